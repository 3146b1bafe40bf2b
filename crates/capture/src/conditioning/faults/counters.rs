//! Numbers that their type could not hold: unsigned counts read as signed ones, and counters that begin again at zero.

use crate::data::Capture;

/// Minimum number of steps of half the range between neighbouring bins: a wrapped counter makes two for each peak.
const LEAST_STEPS: usize = 16;
/// Share of these steps that may stay once the numbers are right.
const MOST_LEFT: f64 = 0.25;
/// Share of the histograms that may not end where they begin once they are unwrapped.
const MOST_ODD: f64 = 0.03;
/// Bits of counters.
const BITS: [u32; 4] = [8, 10, 12, 16];

impl Capture {
    /// Adds the range of the type to negative numbers of unsigned counts that were read as signed ones. A peak above the largest signed
    /// number falls by the whole range from one bin to the next, which no background and no noise does.
    pub(super) fn undo_sign(&mut self) -> Option<String> {
        let (low, high) = self.histograms.iter().fold((0.0f32, 0.0f32), |(a, b), v| (a.min(*v), b.max(*v)));
        let bits = [8u32, 16].into_iter().find(|bits| {
            let half = (1u32 << (bits - 1)) as f32;
            (-half..=-0.5 * half).contains(&low) && (0.5 * half..half).contains(&high)
        })?;
        let range = (1u32 << bits) as f32;
        let right = |v: f32| if v < 0.0 { v + range } else { v };
        let steps = |of: &dyn Fn(f32) -> f32| {
            let rows = self.histograms.chunks_exact(self.bins);
            let large = |w: &&[f32]| (of(w[1]) - of(w[0])).abs() > 0.5 * range;
            rows.map(|row| row.windows(2).filter(large).count()).sum::<usize>()
        };
        let [before, after] = [steps(&|v| v), steps(&right)];
        if self.histograms.iter().any(|v| v.fract() != 0.0)
            || before < LEAST_STEPS
            || after as f64 > MOST_LEFT * before as f64
        {
            return None;
        }
        let count = self.histograms.iter().filter(|v| **v < 0.0).count();
        self.histograms.iter_mut().for_each(|v| *v = right(*v));
        self.integer_counts = true;
        Some(format!(
            "{count} negative counts get {range} added: unsigned counts of {bits} bits were stored or read as signed ones (write them \
             as unsigned numbers)"
        ))
    }

    /// Undoes counters that begin again at zero, where all steps between bins say how; else says that they do. `None` without a sign of
    /// it.
    pub(super) fn undo_wraps(&mut self) -> Option<Result<String, String>> {
        if !self.integer_counts {
            return None;
        }
        let high = self.histograms.iter().copied().fold(0.0f32, f32::max);
        let bits = BITS.into_iter().find(|bits| high < (1u32 << bits) as f32)?;
        let range = (1u32 << bits) as f32;
        // Bins of a wrapped counter reach up to its last number.
        if high < range - 1.0 - range / 64.0 {
            return None;
        }
        let mut unwrapped = self.histograms.clone();
        let (mut stepped, mut odd, mut steps) = (0usize, 0usize, 0usize);
        for row in unwrapped.chunks_exact_mut(self.bins) {
            let first = row[0];
            let (mut turns, mut least, mut own) = (0.0f32, 0.0f32, 0);
            for bin in 1..row.len() {
                let step = row[bin] + turns * range - row[bin - 1];
                let turn = -(step / range).round();
                own += usize::from(turn != 0.0);
                turns += turn;
                row[bin] += turns * range;
                least = least.min(row[bin]);
            }
            steps += own;
            stepped += usize::from(own > 0);
            odd += usize::from(own > 0 && (turns != 0.0 || least < 0.0 || first > 0.5 * range));
        }
        if steps < LEAST_STEPS || stepped < LEAST_STEPS {
            return None;
        }
        if odd as f64 <= MOST_ODD * stepped as f64 {
            for (row, made) in
                self.histograms.chunks_exact_mut(self.bins).zip(unwrapped.chunks_exact(self.bins))
            {
                let ends_well = made[made.len() - 1] == row[row.len() - 1] && made.iter().all(|v| *v >= 0.0);
                if ends_well {
                    row.copy_from_slice(made);
                }
            }
            return Some(Ok(format!(
                "counters of {bits} bits began again at 0 in {stepped} histograms: steps of the range of {range} are undone (use wider \
                 counters)"
            )));
        }
        self.is_wrapped(range).then(|| {
            Err(format!(
                "counters of {bits} bits began again at 0: counts reach {high} and fall to the lowest ones in the next bin (store counts \
                 in a wider type, or measure for a shorter time)"
            ))
        })
    }

    /// Whether large counts are as frequent as those below them, end at the last number without a pile there, and stand beside small ones.
    fn is_wrapped(&self, range: f32) -> bool {
        let share = |from: f32, to: f32| {
            self.histograms.iter().filter(|v| (from * range..to * range).contains(v)).count()
        };
        let full = self.histograms.iter().filter(|v| **v == range - 1.0).count();
        let [top, below] = [share(0.875, 1.0), share(0.625, 0.75)];
        let beside = |w: &&[f32]| w[0].max(w[1]) > 0.75 * range && w[0].min(w[1]) < 0.25 * range;
        let rows = || self.histograms.chunks_exact(self.bins);
        let crossings: usize = rows().map(|row| row.windows(2).filter(beside).count()).sum();
        top >= 4 * LEAST_STEPS && 3 * top > 2 * below && 8 * full < top && 4 * crossings > top
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::super::tests::scan;
    use super::*;

    /// Photons of a smooth peak of this height.
    fn peak(most: f64, width: f64) -> Capture {
        let mut random = Pcg64::seed_from_u64(7);
        scan(|ix, iy, bin| {
            let middle = 40.0 + 0.5 * ix as f64 + 0.3 * iy as f64;
            let mean = most * (-((bin as f64 - middle) / width).powi(2)).exp() + 0.5;
            Poisson::new(mean).unwrap().sample(&mut random) as f32
        })
    }

    #[test]
    fn unsigned_counts_read_as_signed_are_right_again() {
        for (most, bits) in [(50_000.0, 16), (200.0, 8)] {
            let right = peak(most, 12.0);
            let range = (1u32 << bits) as f32;
            let mut read = right.clone();
            read.integer_counts = false;
            read.histograms.iter_mut().filter(|v| **v >= 0.5 * range).for_each(|v| *v -= range);
            assert!(read.undo_sign().is_some_and(|note| note.contains(&format!("{bits} bits"))));
            assert!(read.histograms == right.histograms);
        }
    }

    #[test]
    fn counters_that_began_again_are_undone_or_named() {
        let right = peak(400.0, 20.0);
        let mut wrapped = right.clone();
        wrapped.histograms.iter_mut().for_each(|v| *v %= 256.0);
        assert!(wrapped.undo_wraps().is_some_and(|found| found.is_ok_and(|n| n.contains("8 bits"))));
        assert!(wrapped.histograms == right.histograms);
        // Steps of more than half the range: which turn they are is not known.
        let mut steep = peak(4000.0, 12.0);
        steep.histograms.iter_mut().for_each(|v| *v %= 256.0);
        let before = steep.clone();
        assert!(steep.undo_wraps().is_some_and(|found| found.is_err_and(|n| n.contains("8 bits"))));
        assert_eq!(steep, before);
    }

    #[test]
    fn proper_counts_stay() {
        for (most, width) in [(235.0, 12.0), (235.0, 0.6), (60_000.0, 12.0), (3.0, 12.0), (4.0e4, 0.4)] {
            let proper = peak(most, width);
            let mut capture = proper.clone();
            assert_eq!((capture.undo_sign(), capture.undo_wraps()), (None, None), "{most} {width}");
            // Others took the background off; a full counter cuts off.
            capture.integer_counts = false;
            capture.histograms.iter_mut().for_each(|v| *v -= 1.0);
            assert_eq!((capture.undo_sign(), capture.undo_wraps()), (None, None));
            let mut full = proper.clone();
            full.histograms.iter_mut().for_each(|v| *v = v.min(255.0));
            assert_eq!(full.undo_wraps(), None, "{most} {width}");
        }
    }
}
