//! Checks of a capture: the error names the first thing that is wrong.

use glam::DVec3;
use rayon::prelude::*;

use super::histogram_figures::HistogramFigures;
use super::rows::is_small;
use super::{Capture, Pulse};
use crate::error::{Error, Result};

/// Bins that a thread adds up at least: a few lines of the cache.
const LEAST_RUN: usize = 128;

/// Least ratio of the least value to the largest one, both from zero, of a signal that is upside down. Noise around a baseline has a
/// ratio of about one.
const UPSIDE_DOWN: f32 = 4.0;
pub(crate) const NEGATIVE_PULSES: &str = "as the voltage of a photomultiplier, whose pulses are negative";
pub(crate) const UPRIGHT: &str =
    "store it with the opposite sign, without its baseline: H = np.median(H) - H";

/// Whether values from the least to the largest are those of negative pulses.
pub(crate) fn is_upside_down([low, high]: [f32; 2]) -> bool {
    -low > UPSIDE_DOWN * high.max(0.0)
}

impl Capture {
    /// Checks everything that the solvers rely on: array lengths, bin width, points, unit normals, finite counts, and
    /// that there is any signal at all. Single counts may be negative; their sum may not.
    ///
    /// # Errors
    /// `Kind::Input`, naming the first wrong field with its pair, bin and value.
    pub fn check(&self) -> Result<()> {
        self.check_scan()?;
        if let Some(empty) = self.empty.as_ref().filter(|empty| empty.len() != self.histograms.len()) {
            return Err(Error::input(
                format!("{} counts of the empty room for {} counts", empty.len(), self.histograms.len()),
                "give the empty room the pairs and bins of the capture",
            ));
        }
        self.check_counts(&self.histograms)
    }

    /// Checks counts for the pairs and bins of this capture: how many there are, that all are finite, and that there is
    /// any signal at all.
    ///
    /// # Errors
    /// As [`Capture::check`].
    pub fn check_counts(&self, histograms: &[f32]) -> Result<()> {
        let pairs = self.pair_count();
        if !self.is_whole(histograms) {
            return Err(Error::input(
                format!("{} counts for {pairs} pairs of {} bins", histograms.len(), self.bins),
                "give pairs x bins counts, bin by bin within a pair",
            ));
        }
        if is_small(histograms) {
            return self.check_seen(histograms.chunks_exact(self.bins).map(HistogramFigures::of));
        }
        let seen: Vec<HistogramFigures> =
            histograms.par_chunks_exact(self.bins).map(HistogramFigures::of).collect();
        self.check_seen(seen.into_iter())
    }

    /// As [`Capture::check_counts`], and copies the counts behind those of `to`, all or a part of them if they are wrong.
    #[doc(hidden)]
    pub fn copy_checked(&self, histograms: &[f32], to: &mut Vec<f32>) -> Result<()> {
        if !(self.is_whole(histograms) && is_small(histograms)) {
            self.check_counts(histograms)?;
            to.extend_from_slice(histograms);
            return Ok(());
        }
        // A row that was just checked is near.
        self.check_seen(histograms.chunks_exact(self.bins).map(|row| {
            to.extend_from_slice(row);
            HistogramFigures::of(row)
        }))
    }

    /// Checks how many counts there are, and that all are finite.
    ///
    /// # Errors
    /// As [`Capture::check`].
    #[doc(hidden)]
    pub fn check_finite(&self, histograms: &[f32]) -> Result<()> {
        match self.check_counts(histograms) {
            // Only the signal is missing.
            Err(_) if self.is_whole(histograms) && histograms.iter().all(|v| v.is_finite()) => Ok(()),
            checked => checked,
        }
    }

    fn is_whole(&self, histograms: &[f32]) -> bool {
        self.pair_count().checked_mul(self.bins) == Some(histograms.len())
    }

    /// Checks everything but the counts.
    ///
    /// # Errors
    /// As [`Capture::check`].
    pub fn check_scan(&self) -> Result<()> {
        self.check_lengths()?;
        if !(self.bin_width.is_finite() && self.bin_width > 0.0) {
            return Err(Error::input(
                format!("the bin width is {} m", self.bin_width),
                "give a positive bin width in metres of path (seconds times 299792458)",
            ));
        }
        if !self.t_start.is_finite() {
            return Err(Error::input(
                format!("the start of bin 0 is {} m", self.t_start),
                "give the leading edge of bin 0 in metres of path, 0 if unknown",
            ));
        }
        if self.t_end() <= 0.0 {
            return Err(Error::input(
                format!("all bins lie before path 0: they end at {} m", self.t_end()),
                "check t_start and whether the outer legs were removed twice",
            ));
        }
        if let Some(pulse) = &self.pulse {
            pulse.check()?;
            pulse.taps(self.bin_width)?;
        }
        for (side, spot) in [("laser", self.laser_spot), ("sensor", self.sensor_spot)] {
            if let Some(width) = spot.filter(|s| !(s.is_finite() && *s >= 0.0)) {
                return Err(Error::input(
                    format!("the {side} spot is {width} m wide"),
                    "give its full width at half maximum on the wall in metres, 0 for a point",
                ));
            }
        }
        if let Some(cycles) = self.cycles.filter(|n| !(n.is_finite() && *n > 0.0)) {
            return Err(Error::input(
                format!("there were {cycles} laser pulses (cycles)"),
                "give the number of laser pulses of a pair, or leave it out",
            ));
        }
        for (name, device) in ["laser", "sensor"].into_iter().zip(self.devices) {
            if let Some(at) = device.filter(|at| !at.is_finite()) {
                return Err(Error::input(
                    format!("the device of the {name} is at {at} m"),
                    "give its position x, y, z in metres, or leave it out",
                ));
            }
        }
        if let Some(path) = self.direct.filter(|path| !path.is_finite()) {
            return Err(Error::input(
                format!("direct light is at {path} m of path (direct)"),
                "give the path in metres, or leave it out",
            ));
        }
        check_points("laser", &self.laser)?;
        check_points("sensor", &self.sensor)?;
        check_normals("laser", self.laser_normal.as_deref())?;
        check_normals("sensor", self.sensor_normal.as_deref())
    }

    /// Refuses pairs that are all the same: they tell how far the light went, not from where it came.
    ///
    /// # Errors
    /// `Kind::Input`.
    #[doc(hidden)]
    pub fn check_aperture(&self) -> Result<()> {
        let is_one = |points: &[DVec3]| points.iter().all(|p| *p == points[0]);
        if self.pair_count() == 1 || !(is_one(&self.laser) && is_one(&self.sensor)) {
            return Ok(());
        }
        Err(Error::input(
            format!("the scan has no aperture: all {} pairs are at {}", self.pair_count(), self.laser[0]),
            "give the wall points of each pair (laser and sensor, in metres), or the size of the wall",
        ))
    }

    /// Trailing edge of the last bin, in metres of path.
    pub fn t_end(&self) -> f64 {
        self.t_start + self.bins as f64 * self.bin_width
    }

    /// Mean histogram over the pairs, `[bin]`.
    pub fn mean_histogram(&self) -> Vec<f64> {
        // Long runs of a histogram are read faster, and each thread needs one.
        let run = match is_small(&self.histograms) {
            true => self.bins,
            false => self.bins.div_ceil(rayon::current_num_threads()).next_multiple_of(LEAST_RUN),
        };
        let mut mean = vec![0.0f64; self.bins];
        // Every bin adds the pairs in their order.
        let add_up = |(part, mean): (usize, &mut [f64])| {
            let first = part * run;
            for histogram in self.histograms.chunks_exact(self.bins) {
                mean.iter_mut().zip(&histogram[first..]).for_each(|(m, v)| *m += f64::from(*v));
            }
            mean.iter_mut().for_each(|m| *m /= self.pair_count() as f64);
        };
        match is_small(&self.histograms) {
            true => mean.chunks_mut(run).enumerate().for_each(add_up),
            false => mean.par_chunks_mut(run).enumerate().for_each(add_up),
        }
        mean
    }

    /// Whether an instrument measured the counts: photons, or photons less a background.
    #[doc(hidden)]
    pub fn is_measured(&self) -> bool {
        self.integer_counts || self.any_row(|row| row.iter().fold(false, |any, v| any | (*v < 0.0)))
    }

    /// Sets the impulse response.
    ///
    /// # Errors
    /// One that the bins cannot hold.
    pub fn set_pulse(&mut self, pulse: Option<Pulse>) -> Result<()> {
        pulse.as_ref().map(|pulse| pulse.taps(self.bin_width)).transpose()?;
        self.pulse = pulse;
        Ok(())
    }

    /// Number of pairs P.
    pub fn pair_count(&self) -> usize {
        self.laser.len()
    }

    /// Names a pair and its place in the scan, for error messages.
    fn pair_place(&self, pair: usize) -> String {
        place_in(self.scan, pair)
    }

    fn check_lengths(&self) -> Result<()> {
        let pairs = self.laser.len();
        if pairs == 0 {
            return Err(Error::input("the capture has no pair", "give at least one laser and sensor point"));
        }
        if self.bins == 0 {
            return Err(Error::input("the capture has no bin", "give histograms of at least one bin"));
        }
        if self.scan[0].checked_mul(self.scan[1]) != Some(pairs) {
            return Err(Error::input(
                format!("the scan is {} x {} but there are {pairs} pairs", self.scan[0], self.scan[1]),
                "give one laser and one sensor point per scan position",
            ));
        }
        let lengths = [
            ("sensor points", Some(self.sensor.len())),
            ("laser normals", self.laser_normal.as_ref().map(Vec::len)),
            ("sensor normals", self.sensor_normal.as_ref().map(Vec::len)),
        ];
        for (what, length) in lengths {
            if let Some(length) = length.filter(|&l| l != pairs) {
                return Err(Error::input(
                    format!("{length} {what} for {pairs} laser points"),
                    "all arrays of a capture hold one entry per pair",
                ));
            }
        }
        Ok(())
    }

    /// Checks the counts by what each pair's histogram holds.
    pub(crate) fn check_seen(&self, seen: impl Iterator<Item = HistogramFigures>) -> Result<()> {
        let (mut total, mut dark, mut range) = (0.0, true, [f32::INFINITY, f32::NEG_INFINITY]);
        let (mut pairs, mut upside_down) = (0, 0);
        for (pair, seen) in seen.enumerate() {
            if let Some((bin, value)) = seen.wrong {
                return Err(Error::input(
                    format!("{}, bin {bin}: the count is {value}", self.pair_place(pair)),
                    "counts must be finite: set unknown bins to 0 or drop the pair",
                ));
            }
            total += seen.total;
            dark &= seen.filled == 0;
            pairs += 1;
            upside_down += usize::from(is_upside_down(seen.range));
            range = [range[0].min(seen.range[0]), range[1].max(seen.range[1])];
        }
        if dark {
            return Err(Error::input(
                format!(
                    "there is no signal: all {} counts between {:.4} m and {:.4} m of path are zero",
                    self.pair_count() * self.bins,
                    self.t_start,
                    self.t_end()
                ),
                "check the gate, or that the right file was given",
            ));
        }
        let [low, high] = range;
        if high <= 0.0 || total < 0.0 && 2 * upside_down > pairs {
            return Err(Error::input(
                format!(
                    "there is no signal: it is upside down, values reach from {low} to {high}, {NEGATIVE_PULSES}"
                ),
                UPRIGHT,
            ));
        }
        // NaN must fail too: the sum of numbers beyond fp64.
        if total.is_nan() || total <= 0.0 {
            return Err(Error::input(
                format!("there is no signal: negative counts outweigh the others, the sum of all is {total}"),
                "subtract less background, or none: it is estimated from the counts",
            ));
        }
        Ok(())
    }
}

/// Names a pair and its place in the scan.
pub(crate) fn place_in(scan: [usize; 2], pair: usize) -> String {
    match scan[1] {
        0 | 1 => format!("pair {pair}"),
        ny => format!("pair {pair} (ix {}, iy {})", pair / ny, pair % ny),
    }
}

fn check_points(side: &str, points: &[DVec3]) -> Result<()> {
    match points.iter().position(|p| !p.is_finite()) {
        None => Ok(()),
        Some(pair) => Err(Error::input(
            format!("pair {pair}: the {side} point is {}", points[pair]),
            "wall points must be finite, in metres; drop pairs without a known point",
        )),
    }
}

fn check_normals(side: &str, normals: Option<&[DVec3]>) -> Result<()> {
    let normals = normals.unwrap_or(&[]);
    // NaN must fail too.
    let bad = normals.iter().position(|n| {
        let off = (n.length() - 1.0).abs();
        off.is_nan() || off > 1e-3
    });
    match bad {
        None => Ok(()),
        Some(pair) => Err(Error::input(
            format!(
                "pair {pair}: the {side} normal is {} of length {}",
                normals[pair],
                normals[pair].length()
            ),
            "wall normals must be of unit length; leave them out if they are unknown",
        )),
    }
}
