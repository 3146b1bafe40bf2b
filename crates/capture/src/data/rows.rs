//! Passes over all histograms.

use rayon::prelude::*;

use super::Capture;

/// Counts that one thread goes over before another one has woken up. On a busy machine that other one may come late by
/// milliseconds.
const SMALL: usize = 1 << 20;

/// Counts that are compared side by side: one after the other would wait for each comparison.
const LANES: usize = 16;

/// Whether it does not pay to divide work on `counts` between threads.
pub fn is_small(counts: &[f32]) -> bool {
    counts.len() <= SMALL
}

impl Capture {
    /// `of` each histogram, in the order of the pairs; on all threads if there are many counts.
    #[doc(hidden)]
    pub fn of_rows<T: Send>(&self, of: impl Fn(&[f32]) -> T + Sync + Send) -> Vec<T> {
        match is_small(&self.histograms) {
            true => self.histograms.chunks_exact(self.bins).map(of).collect(),
            false => self.histograms.par_chunks_exact(self.bins).map(of).collect(),
        }
    }

    /// The histograms of these pairs, one behind the other, in exactly the room that they take.
    pub(crate) fn histograms_of(&self, pairs: &[usize]) -> Vec<f32> {
        pairs.iter().map(|pair| self.histogram(*pair)).collect::<Vec<_>>().concat()
    }

    /// Whether any histogram is so.
    pub(crate) fn any_row(&self, is: impl Fn(&[f32]) -> bool + Sync + Send) -> bool {
        match is_small(&self.histograms) {
            true => self.histograms.chunks_exact(self.bins).any(is),
            false => self.histograms.par_chunks_exact(self.bins).any(is),
        }
    }

    /// The least and the largest count; 0 if that is less or more. NaN does not count.
    pub(crate) fn range(&self) -> [f32; 2] {
        let both = |[a, b]: [f32; 2], [c, d]: [f32; 2]| [a.min(c), b.max(d)];
        self.of_rows(|row| range_from([0.0; 2], row)).into_iter().fold([0.0; 2], both)
    }
}

/// The least and the largest count, and of these two. NaN does not count.
pub(crate) fn range_from([low, high]: [f32; 2], counts: &[f32]) -> [f32; 2] {
    let (runs, rest) = counts.as_chunks::<LANES>();
    let (mut lows, mut highs) = ([low; LANES], [high; LANES]);
    for run in runs {
        for ((low, high), count) in lows.iter_mut().zip(&mut highs).zip(run) {
            *low = if *count < *low { *count } else { *low };
            *high = if *count > *high { *count } else { *high };
        }
    }
    let all = lows.iter().chain(rest).copied().fold(low, f32::min);
    (all, highs.iter().chain(rest).copied().fold(high, f32::max)).into()
}

/// The largest sum of three neighbouring counts, those beyond the ends being zero; 0 if that is more.
pub(crate) fn largest_of_three(counts: &[f32]) -> f32 {
    let at = |bin: usize| counts.get(bin).copied().unwrap_or(0.0);
    let last = counts.len().saturating_sub(1);
    let ends = [at(0) + at(1), at(last.wrapping_sub(1)) + at(last)];
    let mut most = [0.0f32; LANES];
    let (mut first, inner) = (0, counts.len().saturating_sub(2));
    while let Some(run) = counts.get(first..).and_then(<[f32]>::first_chunk::<{ LANES + 2 }>) {
        for (lane, most) in most.iter_mut().enumerate() {
            let sum = run[lane] + run[lane + 1] + run[lane + 2];
            *most = if sum > *most { sum } else { *most };
        }
        first += LANES;
    }
    let rest = (first..inner).map(|bin| at(bin) + at(bin + 1) + at(bin + 2));
    most.into_iter().chain(rest).chain(ends).fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_find_what_single_counts_show() {
        for bins in [0, 1, 2, 3, 15, 16, 17, 18, 19, 34, 100] {
            let counts: Vec<f32> = (0..bins).map(|b| (b as f32 * 1.7).sin() * 9.0).collect();
            for turned in 0..bins.max(1) {
                let mut counts = counts.clone();
                counts.rotate_left(turned.min(bins));
                let low = counts.iter().copied().fold(0.0f32, f32::min);
                let high = counts.iter().copied().fold(0.0f32, f32::max);
                assert_eq!(range_from([0.0; 2], &counts), [low, high], "{bins} {turned}");
                let at = |bin: usize| counts.get(bin).copied().unwrap_or(0.0);
                let sums = (0..bins).map(|b| at(b.wrapping_sub(1)) + at(b) + at(b + 1));
                assert_eq!(largest_of_three(&counts), sums.fold(0.0f32, f32::max), "{bins} {turned}");
            }
        }
        let counts = [f32::NAN, 2.0, -1.0, f32::NAN].repeat(9);
        assert_eq!(range_from([f32::INFINITY, f32::NEG_INFINITY], &counts), [-1.0, 2.0]);
    }
}
