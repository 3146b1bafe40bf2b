//! Smaller captures that keep every count: neighbouring bins, or neighbouring histograms, are summed.

use glam::DVec3;

use crate::data::{Capture, PairKind};
use crate::error::{Error, Result};

#[doc(hidden)]
impl Capture {
    /// Sums every `n` neighbouring bins into one, from bin 0 on. Bins missing at the end count as zero, so every count
    /// is kept.
    ///
    /// # Errors
    /// `Kind::Options` if `n` is 0 or more than there are bins.
    pub fn binned(&self, n: usize) -> Result<Capture> {
        if n == 0 || n > self.bins {
            return Err(Error::options(
                format!("bins cannot be summed by {n}: a histogram has {} bins", self.bins),
                format!("give a number of bins to sum, from 1 to {}", self.bins),
            ));
        }
        let bins = self.bins.div_ceil(n);
        let sums = |counts: &[f32]| {
            let mut sums = vec![0.0; counts.len() / self.bins * bins];
            sum_rows(&mut sums, bins, counts, self.bins, n);
            sums
        };
        let mut binned =
            self.with_bins(bins, self.bin_width * n as f64, self.t_start, sums(&self.histograms));
        binned.empty = self.empty.as_deref().map(sums);
        binned.noise = self.noise.map(|[per_count, floor]| [per_count, floor * n as f64]);
        Ok(binned)
    }

    /// Takes the counts of `narrow`, of which this is a [`Capture::binned`] one. Nothing is allocated if it had counts before.
    pub fn take_sums(&mut self, narrow: &Capture) {
        let n = (self.bin_width / narrow.bin_width).round() as usize;
        self.noise = narrow.noise.map(|[per_count, floor]| [per_count, floor * n as f64]);
        self.histograms.resize(self.pair_count() * self.bins, 0.0);
        sum_rows(&mut self.histograms, self.bins, &narrow.histograms, narrow.bins, n);
    }

    /// Sums every `n` x `n` neighbouring histograms of the scan into one, at the mean of their points and with the mean
    /// of their normals. Every count is kept.
    ///
    /// # Errors
    /// `Kind::Options` if `n` does not divide the scan along x and y, or if neighbours in the scan are not neighbours
    /// on the wall (lists, exhaustive captures).
    pub fn summed(&self, n: usize) -> Result<Capture> {
        let [nx, ny] = self.scan;
        if n == 1 {
            return Ok(self.clone());
        }
        if n == 0 || nx % n != 0 || ny % n != 0 {
            return Err(Error::options(
                format!("histograms cannot be summed by {n} x {n}: the scan has {nx} x {ny} points"),
                "give a number that divides both sides, so that every count is kept",
            ));
        }
        let kind = self.pair_kind();
        if !matches!(kind, PairKind::Confocal | PairKind::OneLaser | PairKind::OneSensor) {
            return Err(Error::options(
                format!(
                    "histograms cannot be summed: neighbours in the scan are not neighbours on the wall \
                     (the pairs are {kind})"
                ),
                "thin the scan by a stride or a random subset instead",
            ));
        }
        let (to_x, to_y) = (nx / n, ny / n);
        let block = |at: usize| {
            let (x, y) = (at / to_y * n, at % to_y * n);
            (0..n * n).map(move |k| (x + k / n) * ny + y + k % n)
        };
        let middle = |points: &[DVec3]| -> Vec<DVec3> {
            (0..to_x * to_y).map(|at| block(at).map(|p| points[p]).sum::<DVec3>() / (n * n) as f64).collect()
        };
        let facing = |normals: &[DVec3]| -> Vec<DVec3> {
            middle(normals).into_iter().map(|m| m.try_normalize().unwrap_or(DVec3::Z)).collect()
        };
        let sums = |counts: &[f32]| {
            let mut sums = vec![0.0f32; to_x * to_y * self.bins];
            for (at, to) in sums.chunks_exact_mut(self.bins).enumerate() {
                for pair in block(at) {
                    let from = &counts[pair * self.bins..(pair + 1) * self.bins];
                    to.iter_mut().zip(from).for_each(|(sum, count)| *sum += count);
                }
            }
            sums
        };
        Ok(Capture {
            scan: [to_x, to_y],
            laser: middle(&self.laser),
            sensor: middle(&self.sensor),
            laser_normal: self.laser_normal.as_deref().map(facing),
            sensor_normal: self.sensor_normal.as_deref().map(facing),
            histograms: sums(&self.histograms),
            empty: self.empty.as_deref().map(sums),
            noise: self.noise.map(|[per_count, floor]| [per_count, floor * (n * n) as f64]),
            name: self.name.clone(),
            pulse: self.pulse.clone(),
            cycles: self.cycles.map(|cycles| cycles * (n * n) as f64),
            given: None,
            ..*self
        })
    }
}

/// Sums every `n` neighbouring counts of the rows of `from` into one of the rows of `to`, as many as these have.
fn sum_rows(to: &mut [f32], bins: usize, from: &[f32], narrow_bins: usize, n: usize) {
    for (to, from) in to.chunks_exact_mut(bins).zip(from.chunks_exact(narrow_bins)) {
        // Runs of a length that the compiler knows are summed several at a time.
        match n {
            2 => sum_runs::<2>(to, from),
            3 => sum_runs::<3>(to, from),
            4 => sum_runs::<4>(to, from),
            8 => sum_runs::<8>(to, from),
            _ => to.iter_mut().zip(from.chunks(n)).for_each(|(sum, bins)| *sum = bins.iter().sum()),
        }
    }
}

fn sum_runs<const N: usize>(to: &mut [f32], from: &[f32]) {
    let (runs, rest) = from.as_chunks::<N>();
    to.iter_mut().zip(runs).for_each(|(sum, bins)| *sum = bins.iter().sum());
    if let Some(last) = to.get_mut(runs.len()) {
        *last = rest.iter().sum();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_every_length_are_summed_in_order() {
        let from: Vec<f32> = (0..46).map(|v| (v as f32 * 0.7).sin() * 1e3).collect();
        for n in 1..=23 {
            for bins in [23 / n, 23usize.div_ceil(n)] {
                let mut to = vec![0.0; 2 * bins];
                sum_rows(&mut to, bins, &from, 23, n);
                for (to, from) in to.chunks_exact(bins).zip(from.chunks_exact(23)) {
                    let wanted: Vec<f32> = from.chunks(n).map(|run| run.iter().sum()).take(bins).collect();
                    assert_eq!(to, wanted, "{n}");
                }
            }
        }
    }
}
