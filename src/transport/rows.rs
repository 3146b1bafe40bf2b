//! Which counts of a capture a model takes. Found once for a scan; then the counts of many captures of it are taken alike.

use std::ops::Range;

use rayon::prelude::*;

use crate::capture::rows::is_small;
use crate::capture::{Background, Capture};

/// The pairs and bins of captures of one scan that are the rows of a model's measured values.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows {
    /// The capture's pair for each row.
    pairs: Vec<usize>,
    /// The bins of each.
    bins: Range<usize>,
}

impl Rows {
    /// All `bins` bins of the `pairs`, in this order.
    pub(super) fn of(pairs: Vec<usize>, bins: usize) -> Rows {
        Rows { pairs, bins: 0..bins }
    }

    /// The capture's pair for each row.
    pub fn pairs(&self) -> &[usize] {
        &self.pairs
    }

    /// The capture's bins that are kept.
    pub fn bins(&self) -> Range<usize> {
        self.bins.clone()
    }

    /// Puts row `order[i]` in place i, for all i.
    pub fn reorder(&mut self, order: &[usize]) {
        self.pairs = order.iter().map(|row| self.pairs[*row]).collect();
    }

    /// Leaves all but the first `count` rows out.
    pub fn keep_first(&mut self, count: usize) {
        self.pairs.truncate(count);
    }

    /// Leaves all but these of its bins out.
    pub fn crop(&mut self, bins: Range<usize>) {
        self.bins = self.bins.start + bins.start..self.bins.start + bins.end;
    }

    /// The counts of `capture` less `background`, times `scale`: `[row * bins + bin]`.
    pub(super) fn fill(
        &self,
        measured: &mut Vec<f32>,
        capture: &Capture,
        scale: f64,
        background: &Background,
    ) {
        let bins = self.bins.len();
        measured.resize(self.pairs.len() * bins, 0.0);
        let take = |(row, pair): (&mut [f32], &usize)| {
            let counts = &capture.histogram(*pair)[self.bins.clone()];
            let below = (background.of_pair(*pair) * scale) as f32;
            row.iter_mut().zip(counts).for_each(|(m, h)| *m = (f64::from(*h) * scale) as f32 - below);
        };
        match is_small(measured) {
            true => measured.chunks_exact_mut(bins).zip(&self.pairs).for_each(take),
            false => measured.par_chunks_exact_mut(bins).zip(&self.pairs).for_each(take),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn rows_are_the_pairs_and_bins_that_are_left() {
        let points = vec![DVec3::ZERO; 3];
        let counts = (0..12).map(|v| v as f32).collect();
        let capture = Capture::new([3, 1], points.clone(), points, 4, 0.1, counts);
        let mut rows = Rows::of(vec![2, 0, 1], 4);
        rows.reorder(&[1, 2, 0]);
        rows.crop(1..4);
        rows.crop(1..3);
        let mut measured = vec![7.0; 9];
        rows.fill(&mut measured, &capture, 2.0, &Background::even(0.5));
        assert_eq!(measured, [3.0, 5.0, 11.0, 13.0, 19.0, 21.0]);
    }
}
