//! Single bins of single pairs with far more counts than all around: bursts, afterpulses of a marker, crosstalk.

use glam::DVec3;

use crate::conditioning::hot::TIMES;
use crate::data::Capture;
use crate::data::median::median;
use crate::data::nearest::Tree;

/// Pairs around a pair: on a lattice all that surround it.
const AROUND: usize = 8;
/// Counts that a bin may have by chance.
const CHANCE: f32 = 16.0;
/// Bins beside a bin whose counts are compared.
const BESIDE: usize = 2;
/// Pairs with such bins are at most this share of all; if more seem to be, the scene is one of sharp light.
const FEW: f64 = 0.25;

impl Capture {
    /// Gives single bins with more than [`TIMES`] times the counts of the bins beside them, and of those of the pairs around, the mean of
    /// the two beside them. Light of a scene comes to the pairs around within the way between them.
    pub(super) fn mend_single_bins(&mut self) -> Option<String> {
        if !self.integer_counts {
            return None;
        }
        let times = TIMES as f32;
        let stands_out = |row: &[f32], bin: usize| {
            let beside =
                || (bin.saturating_sub(BESIDE)..(bin + BESIDE + 1).min(row.len())).filter(|b| *b != bin);
            row[bin] > CHANCE && beside().all(|b| row[bin] > times * row[b])
        };
        let of_rows =
            self.of_rows(|row| (0..row.len()).filter(|bin| stands_out(row, *bin)).collect::<Vec<_>>());
        let suspects: Vec<(usize, usize)> = (of_rows.iter().enumerate())
            .flat_map(|(pair, bins)| bins.iter().map(move |bin| (pair, *bin)))
            .collect();
        if suspects.is_empty() {
            return None;
        }
        let points: &[DVec3] = self.scanned_points();
        let tree = Tree::new(points);
        let mut hot = vec![];
        for pair in suspects.chunk_by(|a, b| a.0 == b.0) {
            let at = pair[0].0;
            let near = tree.nearest(points[at], AROUND + 1);
            for (_, bin) in pair {
                let around = near.iter().filter(|(_, other)| *other != at).map(|(squared, other)| {
                    // Both legs may be longer.
                    let apart = (2.0 * squared.sqrt() / self.bin_width).ceil() as usize + BESIDE;
                    let bins = bin.saturating_sub(apart)..(bin + apart + 1).min(self.bins);
                    f64::from(self.histogram(*other)[bins].iter().copied().fold(0.0f32, f32::max))
                });
                let beside = median(around).unwrap_or(f64::INFINITY);
                if f64::from(self.histogram(at)[*bin]) > TIMES * beside {
                    hot.push((at, *bin));
                }
            }
        }
        let pairs = hot.chunk_by(|a, b| a.0 == b.0).count();
        if hot.is_empty() || pairs as f64 > FEW * self.pair_count() as f64 {
            return None;
        }
        for (pair, bin) in &hot {
            let row = &mut self.histograms[pair * self.bins..][..self.bins];
            let beside = [bin.checked_sub(1), Some(bin + 1)].into_iter().flatten().filter_map(|b| row.get(b));
            row[*bin] = (beside.sum::<f32>() / 2.0).round();
        }
        Some(format!(
            "{} single bins of {pairs} pairs have more than {TIMES} times the counts of the bins and pairs around them: each gets the \
             mean of the two beside it",
            hot.len()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{BINS, SIDE, noisy, scan};

    #[test]
    fn single_hot_bins_get_the_mean_of_those_beside_them() {
        let proper = noisy();
        let mut hot = proper.clone();
        let at = [(0, 0), (17, 31), (17, 70), (130, 45), (255, BINS - 1)];
        at.iter().for_each(|(pair, bin)| hot.histograms[pair * BINS + bin] = 9000.0);
        assert!(hot.mend_single_bins().is_some_and(|n| n.contains("5 single bins of 4 pairs")));
        let changed: Vec<usize> =
            (0..hot.histograms.len()).filter(|i| hot.histograms[*i] != proper.histograms[*i]).collect();
        assert!(changed.len() <= at.len() && hot.histograms.iter().all(|v| *v < 500.0));
        let mut capture = proper.clone();
        assert_eq!(capture.mend_single_bins(), None);
        assert_eq!(capture, proper);
        // Light of a mirror: one bin of each pair, which moves from pair to pair.
        let sharp = |ix: usize, iy: usize, bin: usize| if bin == 20 + ix * ix / 6 + iy { 900.0 } else { 0.0 };
        assert_eq!(scan(sharp).mend_single_bins(), None);
        assert_eq!(SIDE * SIDE, 256);
    }
}
