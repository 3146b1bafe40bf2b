//! What a histogram holds, in a few figures. They decide whether a pair was measured and whether its counts are valid,
//! also for histograms that are read bin by bin and not kept.

use super::Capture;
use super::rows::range_from;

/// Figures of one histogram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HistogramFigures {
    /// Sum of the counts; NaN if any is.
    pub(crate) total: f64,
    /// The first bin whose count is not finite, and that count.
    pub(crate) wrong: Option<(u32, f32)>,
    /// Whether every count is NaN.
    pub(crate) nothing: bool,
    /// Bins whose count is not zero.
    pub(crate) filled: u32,
    /// The least and the largest count.
    pub(crate) range: [f32; 2],
}

impl HistogramFigures {
    /// A histogram without bins.
    pub(crate) const EMPTY: HistogramFigures = HistogramFigures {
        total: 0.0,
        wrong: None,
        nothing: true,
        filled: 0,
        range: [f32::INFINITY, f32::NEG_INFINITY],
    };

    /// The figures of a histogram.
    pub(crate) fn of(histogram: &[f32]) -> HistogramFigures {
        let mut seen = HistogramFigures::EMPTY;
        seen.add(0, histogram);
        seen
    }

    /// Adds the counts of the bins from `first` on. Bins are added in their order.
    pub(crate) fn add(&mut self, first: usize, counts: &[f32]) {
        // Cheap passes over good data: a bin is searched for only if something is wrong.
        let (valid, filled) =
            counts.iter().fold((true, 0), |(v, n), c| (v & c.is_finite(), n + u32::from(*c != 0.0)));
        self.filled += filled;
        self.range = range_from(self.range, counts);
        if valid {
            self.nothing &= counts.is_empty();
            if filled > 0 {
                self.total += sum(counts);
            }
            return;
        }
        self.nothing &= counts.iter().all(|c| c.is_nan());
        self.total += sum(counts);
        let wrong = || counts.iter().position(|c| !c.is_finite());
        self.wrong = self.wrong.or_else(|| wrong().map(|bin| ((first + bin) as u32, counts[bin])));
    }

    /// Adds the figures of later bins.
    #[cfg(feature = "formats")]
    pub(crate) fn join(&mut self, later: &HistogramFigures) {
        self.total += later.total;
        self.wrong = self.wrong.or(later.wrong);
        self.nothing &= later.nothing;
        self.filled += later.filled;
        self.range = [self.range[0].min(later.range[0]), self.range[1].max(later.range[1])];
    }
}

/// The sum, by eight sums side by side: one after the other would wait for each addition.
pub(crate) fn sum(counts: &[f32]) -> f64 {
    let (runs, rest) = counts.as_chunks::<8>();
    let mut sums = [0.0f64; 8];
    for run in runs {
        sums.iter_mut().zip(run).for_each(|(sum, c)| *sum += f64::from(*c));
    }
    sums.iter().sum::<f64>() + rest.iter().map(|c| f64::from(*c)).sum::<f64>()
}

/// Whether all counts are photon counts: whole and not negative, however they are stored. NaN, an unknown count, is no
/// hindrance.
#[cfg(feature = "formats")]
pub(crate) fn whole(counts: &[f32]) -> bool {
    /// Every float from here on is a whole number.
    const WHOLE_FROM: f32 = 8_388_608.0;
    // Runs short enough to end soon at a fraction. Truncation by way of an integer is one instruction on every CPU.
    let one =
        |c: f32| c.is_nan() | ((c >= 0.0) & ((c as i32 as f32 == c) | ((c >= WHOLE_FROM) & c.is_finite())));
    counts.chunks(256).all(|run| run.iter().fold(true, |all, c| all & one(*c)))
}

impl Capture {
    /// Whether all counts are photon counts, as [`Capture::integer_counts`] of a capture that was read tells.
    #[cfg(feature = "formats")]
    pub fn has_whole_counts(&self) -> bool {
        whole(&self.histograms)
    }
}

#[cfg(all(test, feature = "formats"))]
mod tests {
    use super::*;

    #[test]
    fn parts_join_to_the_whole() {
        let nan = f32::NAN;
        for counts in [
            vec![0.0, 1.5, 2.0, 0.0, 7.0],
            vec![0.0; 4],
            vec![nan; 5],
            vec![nan, 0.0, nan],
            vec![1.0, -1.0, nan, f32::INFINITY],
            vec![3.0, f32::INFINITY, -2.0],
        ] {
            let all = HistogramFigures::of(&counts);
            assert_eq!(all.nothing, counts.iter().all(|c| c.is_nan()), "{counts:?}");
            assert_eq!(all.filled == 0, counts.iter().all(|c| *c == 0.0), "{counts:?}");
            let wrong = counts.iter().position(|c| !c.is_finite());
            assert_eq!(all.wrong.map(|w| w.0 as usize), wrong, "{counts:?}");
            for cut in 0..=counts.len() {
                let mut joined = HistogramFigures::of(&counts[..cut]);
                let mut later = HistogramFigures::EMPTY;
                later.add(cut, &counts[cut..]);
                joined.join(&later);
                assert_eq!(format!("{joined:?}"), format!("{all:?}"), "{counts:?} cut at {cut}");
            }
        }
    }

    #[test]
    fn whole_numbers_of_any_size_are_whole() {
        for good in [0.0, -0.0, 1.0, 65535.0, 8_388_607.0, 8_388_608.0, 3e9, f32::MAX, f32::NAN] {
            assert!(whole(&[1.0, good]), "{good}");
        }
        for bad in [0.5, -1.0, 1e-9, 8_388_607.5, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(!whole(&[1.0, bad]), "{bad}");
            assert_eq!(whole(&[bad]), bad.is_nan() || (bad >= 0.0 && bad.fract() == 0.0), "{bad}");
        }
    }
}
