//! Summary of a capture, for the command line and reports.

use serde::{Deserialize, Serialize};

use super::check::place_in;
use super::scan::decimals;
use super::{Capture, METRES_PER_PICOSECOND, PairKind, Pulse};

/// A capture in figures. Lengths are metres of path unless said otherwise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Summary {
    /// The capture's name.
    pub name: String,
    /// Scan points along x and y.
    pub scan: [usize; 2],
    /// Number of pairs.
    pub pairs: usize,
    /// Bins of a histogram.
    pub bins: usize,
    /// Bin width in metres of path.
    pub bin_width_m: f64,
    /// Bin width as time of flight in picoseconds.
    pub bin_width_ps: f64,
    /// Full width at half maximum, in metres of path, of a Gaussian as wide as the instrument's pulse; `None` if the
    /// pulse is not known.
    pub pulse_fwhm_m: Option<f64>,
    /// Full widths at half maximum on the wall, in metres, of what laser and sensor see; `None` for a point.
    pub spots_m: [Option<f64>; 2],
    /// Leading edge of the first bin, metres of path.
    pub t_start_m: f64,
    /// Trailing edge of the last bin, metres of path.
    pub t_end_m: f64,
    /// How laser and sensor points are combined.
    pub pair_kind: PairKind,
    /// Pairs of the file that were left out because they were not measured.
    pub dropped_pairs: usize,
    /// Points of the scanned side along x and y: [`Capture::resolution`].
    pub resolution: [usize; 2],
    /// Whether laser and sensor point coincide in every pair.
    pub confocal: bool,
    /// Whether the wall is a plane that faces +z.
    pub planar: bool,
    /// (xmin, xmax, ymin, ymax) of the scanned part of the wall in metres, outer cell edges.
    pub wall_extent_m: [f64; 4],
    /// Distance of the outermost scan points along the longer side in metres: what a wall size scales.
    pub wall_points_m: f64,
    /// Least and largest z of the wall points in metres.
    pub wall_depth_m: [f64; 2],
    /// First and last bin with signal in any pair, `None` without signal.
    pub signal_bins: Option<[usize; 2]>,
    /// Largest count.
    pub peak: f64,
    /// Bin of the largest count.
    pub peak_bin: usize,
    /// Pair of the largest count.
    pub peak_pair: usize,
    /// Sum of all counts.
    pub total: f64,
    /// Pairs with any signal.
    pub pairs_with_signal: usize,
    /// Whether all counts are whole numbers.
    pub integer_counts: bool,
    /// Whether the normals at the laser points are known.
    pub laser_normals: bool,
    /// Whether the normals at the sensor points are known.
    pub sensor_normals: bool,
    /// Whether the normals were estimated from neighbouring points.
    pub normals_estimated: bool,
}

impl Summary {
    /// The summary of a capture whose array lengths agree.
    pub fn of(capture: &Capture) -> Summary {
        let mut first = usize::MAX;
        let (mut last, mut total, mut lit) = (0, 0.0, 0);
        let (mut peak, mut peak_bin, mut peak_pair) = (0.0f32, 0, 0);
        for (pair, histogram) in capture.histograms.chunks_exact(capture.bins.max(1)).enumerate() {
            let before = total;
            for (bin, &count) in histogram.iter().enumerate().filter(|(_, c)| **c > 0.0) {
                first = first.min(bin);
                last = last.max(bin);
                total += f64::from(count);
                if count > peak {
                    (peak, peak_bin, peak_pair) = (count, bin, pair);
                }
            }
            lit += usize::from(total > before);
        }
        let pair_kind = capture.pair_kind();
        let depths = capture.laser.iter().chain(&capture.sensor).map(|p| p.z);
        let (low, high) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| (a.min(z), b.max(z)));
        Summary {
            name: capture.name.clone(),
            scan: capture.scan,
            pairs: capture.pair_count(),
            bins: capture.bins,
            bin_width_m: capture.bin_width,
            bin_width_ps: capture.bin_width / METRES_PER_PICOSECOND,
            pulse_fwhm_m: capture.pulse.as_ref().map(Pulse::fwhm),
            spots_m: [capture.laser_spot, capture.sensor_spot].map(|spot| spot.filter(|width| *width > 0.0)),
            t_start_m: capture.t_start,
            t_end_m: capture.t_end(),
            pair_kind,
            dropped_pairs: 0,
            resolution: capture.resolution(),
            confocal: pair_kind == PairKind::Confocal,
            planar: capture.is_planar(),
            wall_extent_m: capture.wall_extent(),
            wall_points_m: capture.outermost(),
            wall_depth_m: [low, high],
            signal_bins: (lit > 0).then_some([first, last]),
            peak: f64::from(peak),
            peak_bin,
            peak_pair,
            total,
            pairs_with_signal: lit,
            integer_counts: capture.integer_counts,
            laser_normals: capture.laser_normal.is_some(),
            sensor_normals: capture.sensor_normal.is_some(),
            normals_estimated: false,
        }
    }
}

impl Capture {
    /// The summary of the capture.
    pub fn summary(&self) -> Summary {
        Summary::of(self)
    }
}

impl std::fmt::Display for Summary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x0, x1, y0, y1] = self.wall_extent_m;
        // Decimals of lengths, of widths of bins, and of those in picoseconds.
        let d = decimals(4, (x1 - x0).max(y1 - y0));
        let (b, p) = (d + 2, d - 2);
        let path = |bin: f64| self.t_start_m + bin * self.bin_width_m;
        writeln!(f, "capture   {}", self.name)?;
        let [nx, ny] = self.scan;
        writeln!(f, "scan      {nx} x {ny} = {} pairs, {}", self.pairs, self.pair_kind)?;
        if self.dropped_pairs > 0 {
            writeln!(f, "dropped   {} pairs that were not measured", self.dropped_pairs)?;
        }
        if self.resolution != self.scan {
            writeln!(
                f,
                "points    as dense as a lattice of {} x {} points",
                self.resolution[0], self.resolution[1]
            )?;
        }
        let [low, high] = self.wall_depth_m;
        let wall = match (self.planar, high - low) {
            (true, _) => "flat".to_string(),
            (false, 0.0) => "flat, but not all of its normals are (0, 0, 1)".to_string(),
            (false, _) => format!("curved or tilted, z {low:.d$} to {high:.d$} m"),
        };
        writeln!(f, "wall      x {x0:.d$} to {x1:.d$} m, y {y0:.d$} to {y1:.d$} m, {wall}")?;
        writeln!(f, "          outermost points {:.d$} m apart: the wall size to give", self.wall_points_m)?;
        let normals = match (self.laser_normals, self.sensor_normals) {
            _ if self.normals_estimated => "estimated from neighbouring points",
            (true, true) => "known",
            (true, false) => "known for the laser points only",
            (false, true) => "known for the sensor points only",
            (false, false) => "not known, taken as (0, 0, 1)",
        };
        writeln!(f, "normals   {normals}")?;
        writeln!(f, "bins      {} of {:.b$} m ({:.p$} ps)", self.bins, self.bin_width_m, self.bin_width_ps)?;
        if let Some(fwhm) = self.pulse_fwhm_m {
            let ps = fwhm / METRES_PER_PICOSECOND;
            writeln!(f, "pulse     {fwhm:.b$} m ({ps:.p$} ps) full width at half maximum")?;
        }
        if self.spots_m != [None; 2] {
            let [laser, sensor] =
                self.spots_m.map(|spot| spot.map_or("a point".into(), |w| format!("{w:.d$} m wide")));
            writeln!(f, "spots     laser {laser}, sensor {sensor}")?;
        }
        writeln!(f, "path      {:.d$} to {:.d$} m", self.t_start_m, self.t_end_m)?;
        match self.signal_bins {
            Some([a, b]) => writeln!(
                f,
                "signal    bins {a} to {b}, path {:.d$} to {:.d$} m, in {} pairs",
                path(a as f64),
                path(b as f64 + 1.0),
                self.pairs_with_signal
            )?,
            None => writeln!(f, "signal    none")?,
        }
        // Whole counts are exact, others have three significant digits.
        let count = |v: f64| if self.integer_counts { v } else { format!("{v:.2e}").parse().unwrap_or(v) };
        writeln!(
            f,
            "peak      {} in bin {} ({:.d$} m), {}",
            count(self.peak),
            self.peak_bin,
            path(self.peak_bin as f64 + 0.5),
            place_in(self.scan, self.peak_pair)
        )?;
        let counts = if self.integer_counts { "whole counts" } else { "real numbers" };
        write!(f, "total     {} ({counts})", count(self.total))
    }
}
