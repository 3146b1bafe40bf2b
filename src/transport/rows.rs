//! Which counts of a capture a model takes. Found once for a scan; then the counts of many captures of it are taken alike.

use std::ops::Range;

use rayon::prelude::*;

use super::{Grid, Model};
use crate::capture::Capture;

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

    /// Spreads the pairs of `model` over the wall ([`Model::spread`]).
    pub fn spread(&mut self, model: &mut Model) {
        self.pairs = model.spread().into_iter().map(|row| self.pairs[row]).collect();
    }

    /// Leaves out what no voxel of `grid` reaches ([`Model::trim`]).
    pub fn trim(&mut self, model: &mut Model, grid: &Grid) {
        let Range { start, end } = model.trim(grid);
        self.bins = self.bins.start + start..self.bins.start + end;
    }

    /// Takes the counts of `capture` into `model`: scaled so that the largest count of all becomes the model's peak, less
    /// `background` counts per bin.
    pub fn take(&self, capture: &Capture, background: f64, model: &mut Model) {
        let largest = capture.histograms.par_iter().copied().reduce(|| 0.0f32, f32::max);
        let scale = model.peak / f64::from(largest);
        model.counts_per_unit = 1.0 / scale;
        let below = (background * (1.0 / model.counts_per_unit)) as f32;
        model.measured.resize(self.pairs.len() * self.bins.len(), 0.0);
        let rows = model.measured.par_chunks_exact_mut(self.bins.len()).zip(&self.pairs);
        rows.for_each(|(row, pair)| {
            let counts = &capture.histogram(*pair)[self.bins.clone()];
            row.iter_mut().zip(counts).for_each(|(m, h)| *m = (f64::from(*h) * scale) as f32 - below);
        });
    }
}
