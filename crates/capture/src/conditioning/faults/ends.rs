//! The ends of a record: counts beyond it that were added to the last bin, and light that comes again at its beginning.

use crate::conditioning::Gate;
use crate::data::Capture;
use crate::data::scan::decimals;
use crate::error::Result;

/// The last bin holds this many times the counts of any of the bins before it, in the mean and in nearly all pairs.
const OVERFLOW: f64 = 8.0;
const BEFORE: usize = 16;
const NEARLY_ALL: f64 = 0.9;
/// Counts of the last bin at least, in the mean over pairs.
const LEAST_COUNTS: f64 = 4.0;

/// Light at both ends of the record is at least this share of the strongest light, and differs at most by this factor.
const LIT: f64 = 0.05;
const ALIKE: f64 = 2.0;
/// Bins of an end.
const END: usize = 4;
/// Bins without light between the ends are at least this share of the record, with at most this share of the strongest light.
const GAP: f64 = 0.15;
const DARK: f64 = 0.02;

impl Capture {
    /// Leaves the last bin out if it holds what came after it. Light of a scene does not rise so from one bin to the next in all pairs.
    pub(super) fn without_overflow(&mut self, mean: &[f64]) -> Result<Option<String>> {
        let last = self.bins - 1;
        let most = |row: &[f64]| row.iter().copied().fold(0.0, f64::max);
        let before = last - BEFORE.min(last)..last;
        let scene = most(&mean[..last]);
        if mean[last] < LEAST_COUNTS || mean[last] < OVERFLOW * most(&mean[before.clone()]) || scene <= 0.0 {
            return Ok(None);
        }
        let stands_out = |row: &&[f32]| {
            let beside = row[before.clone()].iter().copied().fold(0.0f32, f32::max);
            f64::from(row[last]) > 0.5 * OVERFLOW * f64::from(beside)
        };
        let count = self.histograms.chunks_exact(self.bins).filter(stands_out).count();
        if (count as f64) < NEARLY_ALL * self.pair_count() as f64 {
            return Ok(None);
        }
        self.set_gate(Gate { from: f64::NEG_INFINITY, to: self.edge(last) })?;
        Ok(Some(format!(
            "the last bin is left out: it holds {:.0} counts in the mean of all pairs, the bin before {:.1}, as a counter that adds \
             everything later to its last bin",
            mean[last],
            mean[last - 1]
        )))
    }

    /// Moves the beginning of a record behind its end where the light of both is the same: the counts of paths longer than the laser's
    /// period are recorded from 0 on.
    pub(super) fn undo_roll(&mut self, mean: &[f64]) -> Option<String> {
        let most = mean.iter().copied().fold(0.0, f64::max);
        let mut sorted = mean.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let background = sorted[self.bins / 20];
        let level = most - background;
        let end = |bins: &[f64]| bins.iter().sum::<f64>() / bins.len() as f64 - background;
        let [first, last] = [end(&mean[..END]), end(&mean[self.bins - END..])];
        let is_lit = first.min(last) > LIT * level && first.max(last) < ALIKE * first.min(last);
        if !is_lit || level <= 0.0 {
            return None;
        }
        // The longest run without light.
        let dark: Vec<bool> = mean.iter().map(|v| v - background < DARK * level).collect();
        let mut runs = dark.chunk_by(|a, b| a == b).scan(0, |at, run| {
            *at += run.len();
            Some((run[0], *at - run.len()..*at))
        });
        let gap =
            runs.by_ref().filter(|(dark, _)| *dark).map(|run| run.1).max_by_key(ExactSizeIterator::len)?;
        if (gap.len() as f64) < GAP * self.bins as f64 || !self.ends_join() {
            return None;
        }
        let cut = (gap.start + gap.end) / 2;
        self.histograms.chunks_exact_mut(self.bins).for_each(|row| row.rotate_left(cut));
        let (d, bound) = (decimals(3, self.unit()), self.edge(gap.start));
        self.t_start = self.edge(cut);
        Some(format!(
            "light goes on from the end of the record to its beginning: paths below {bound:.d$} m are longer by the record, {:.d$} m, as \
             of a laser whose next pulse comes before all light is back",
            self.bins as f64 * self.bin_width
        ))
    }

    /// Whether the pairs that are bright at the end of the record are bright at its beginning.
    fn ends_join(&self) -> bool {
        let rows = || self.histograms.chunks_exact(self.bins);
        let sum = |bins: &[f32]| bins.iter().map(|v| f64::from(*v)).sum::<f64>();
        let ends: Vec<[f64; 2]> =
            rows().map(|row| [sum(&row[self.bins - END..]), sum(&row[..END])]).collect();
        let mean = [0, 1].map(|i| ends.iter().map(|e| e[i]).sum::<f64>() / ends.len() as f64);
        let of = |a: usize, b: usize| ends.iter().map(|e| (e[a] - mean[a]) * (e[b] - mean[b])).sum::<f64>();
        of(0, 1) > 0.5 * (of(0, 0) * of(1, 1)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{BINS, noisy, scan};

    #[test]
    fn what_a_counter_adds_to_its_last_bin_is_left_out() {
        let proper = noisy();
        let mut full = proper.clone();
        full.histograms.iter_mut().skip(BINS - 1).step_by(BINS).for_each(|v| *v = 1500.0);
        assert!(
            full.without_overflow(&full.mean_histogram()).unwrap().is_some_and(|n| n.contains("1500 counts"))
        );
        assert_eq!(
            (full.bins, full.mean_histogram()),
            (BINS - 1, proper.mean_histogram()[..BINS - 1].to_vec())
        );
        let mut capture = proper.clone();
        assert_eq!(capture.without_overflow(&capture.mean_histogram()).unwrap(), None);
        assert_eq!(capture, proper);
        // A scene that begins near the end does so in different bins.
        let mut late = scan(|ix, iy, bin| if bin + (ix + iy) / 6 >= BINS { 90.0 } else { 0.0 });
        assert_eq!(late.without_overflow(&late.mean_histogram()).unwrap(), None);
    }

    #[test]
    fn a_record_that_begins_again_is_put_in_order() {
        // Light of a cosine's hump, which ends for each pair at a path of its own.
        let light = |ix: usize, iy: usize, bin: usize| {
            let far = bin as f64 - 50.0 - (ix + iy) as f64;
            if (0.0..50.0).contains(&far) { (200.0 * (0.063 * far).sin()).round() as f32 } else { 0.0 }
        };
        let whole = |bin: usize| move |ix: usize, iy: usize, b: usize| light(ix, iy, b + bin);
        let mut rolled = scan(|ix, iy, bin| light(ix, iy, bin) + light(ix, iy, bin + BINS));
        assert!(rolled.undo_roll(&rolled.mean_histogram()).is_some_and(|n| n.contains("paths below")));
        let cut = (rolled.t_start / rolled.bin_width).round() as usize;
        assert_eq!(rolled.histograms, scan(whole(cut)).histograms);
        // Direct light at the beginning, and light that the end cuts off.
        let cut_off = |ix: usize, iy: usize, bin: usize| if bin < 3 { 90.0 } else { light(ix, iy, bin) };
        for proper in [noisy(), scan(light), scan(cut_off)] {
            let mut capture = proper.clone();
            assert_eq!(capture.undo_roll(&capture.mean_histogram()), None);
            assert_eq!(capture, proper);
        }
    }
}
