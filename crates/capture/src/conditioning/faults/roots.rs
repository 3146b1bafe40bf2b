//! Square roots of histograms, by which points beside each other are compared.

use crate::data::Capture;

/// Fewer lines, or points of a line, prove nothing.
pub(super) const LEAST: usize = 8;
/// Histograms are compared in this many bins at most.
pub(super) const COMPARED_BINS: usize = 64;

/// Square roots of histograms in few bins: of photons, all have the same noise.
pub(super) struct RootRows {
    rows: Vec<Vec<f32>>,
}

impl RootRows {
    /// |before − 2 middle + after|²; NaN where one of them has no counts, as of a point that was not measured.
    pub(super) fn bend(&self, [before, middle, after]: [usize; 3]) -> f64 {
        let [a, b, c] = [before, middle, after].map(|pair| &self.rows[pair]);
        if [a, b, c].into_iter().any(Vec::is_empty) {
            return f64::NAN;
        }
        a.iter().zip(b).zip(c).map(|((a, b), c)| f64::from(a - 2.0 * b + c).powi(2)).sum()
    }

    pub(super) fn difference(&self, a: usize, b: usize) -> f64 {
        if self.rows[a].is_empty() || self.rows[b].is_empty() {
            return f64::NAN;
        }
        self.rows[a].iter().zip(&self.rows[b]).map(|(a, b)| f64::from(a - b).powi(2)).sum()
    }
}

impl Capture {
    pub(super) fn few_bins(&self) -> RootRows {
        let width = self.bins.div_ceil(COMPARED_BINS);
        let root =
            |run: &[f32]| (run.iter().map(|v| f64::from(*v)).sum::<f64>().max(0.0) + 0.375).sqrt() as f32;
        let few = |row: &[f32]| match row.iter().all(|v| *v == 0.0) {
            true => vec![],
            false => row.chunks(width).map(root).collect(),
        };
        RootRows { rows: self.of_rows(few) }
    }
}
