//! Square roots of histograms, by which points beside each other are compared.

use rayon::prelude::*;

use crate::data::Capture;

/// Fewer lines, or points of a line, prove nothing.
pub(super) const LEAST: usize = 8;
/// Histograms are compared in this many bins at most.
pub(super) const COMPARED_BINS: usize = 64;

/// Square roots of histograms in few bins: of photons, all have the same noise. NaN where a histogram has no counts, as of a point
/// that was not measured.
pub(super) struct RootRows {
    columns: usize,
    roots: Vec<f32>,
}

impl RootRows {
    fn row(&self, pair: usize) -> &[f32] {
        &self.roots[pair * self.columns..][..self.columns]
    }

    /// |before − 2 middle + after|².
    pub(super) fn bend(&self, three: [usize; 3]) -> f64 {
        let [a, b, c] = three.map(|pair| self.row(pair));
        a.iter().zip(b).zip(c).map(|((a, b), c)| f64::from(a - 2.0 * b + c).powi(2)).sum()
    }

    pub(super) fn difference(&self, a: usize, b: usize) -> f64 {
        self.row(a).iter().zip(self.row(b)).map(|(a, b)| f64::from(a - b).powi(2)).sum()
    }
}

impl Capture {
    pub(super) fn few_bins(&self) -> RootRows {
        let width = self.bins.div_ceil(COMPARED_BINS);
        let columns = self.bins.div_ceil(width);
        let mut roots = vec![f32::NAN; self.pair_count() * columns];
        let each = roots.par_chunks_exact_mut(columns).zip(self.histograms.par_chunks_exact(self.bins));
        each.filter(|(_, row)| row.iter().any(|v| *v != 0.0)).for_each(|(roots, row)| {
            for (root, run) in roots.iter_mut().zip(row.chunks(width)) {
                let sum: f64 = run.iter().map(|v| f64::from(*v)).sum();
                *root = (sum.max(0.0) + 0.375).sqrt() as f32;
            }
        });
        RootRows { columns, roots }
    }
}
