//! Square roots of histograms, by which points beside each other are compared.

use crate::data::Capture;

/// Fewer lines, or points of a line, prove nothing.
pub(super) const LEAST: usize = 8;
/// Histograms are compared in this many bins at most.
pub(super) const COMPARED_BINS: usize = 64;

/// Square roots of histograms in few bins, 0 behind the last one: of photons, all have the same noise. NaN where a histogram has no counts, as
/// of a point that was not measured.
pub(super) struct RootRows {
    rows: Vec<[f32; COMPARED_BINS]>,
}

impl RootRows {
    /// |before − 2 middle + after|².
    pub(super) fn bend(&self, three: [usize; 3]) -> f64 {
        let [a, b, c] = three.map(|pair| &self.rows[pair]);
        a.iter().zip(b).zip(c).map(|((a, b), c)| f64::from(a - 2.0 * b + c).powi(2)).sum()
    }

    pub(super) fn difference(&self, a: usize, b: usize) -> f64 {
        self.rows[a].iter().zip(&self.rows[b]).map(|(a, b)| f64::from(a - b).powi(2)).sum()
    }
}

impl Capture {
    pub(super) fn few_bins(&self) -> RootRows {
        let width = self.bins.div_ceil(COMPARED_BINS);
        let root =
            |run: &[f32]| (run.iter().map(|v| f64::from(*v)).sum::<f64>().max(0.0) + 0.375).sqrt() as f32;
        let few = |row: &[f32]| {
            if row.iter().all(|v| *v == 0.0) {
                return [f32::NAN; COMPARED_BINS];
            }
            let mut roots = [0.0; COMPARED_BINS];
            roots.iter_mut().zip(row.chunks(width)).for_each(|(to, run)| *to = root(run));
            roots
        };
        RootRows { rows: self.of_rows(few) }
    }
}
