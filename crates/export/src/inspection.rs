//! A capture as a picture: mean histogram, and maps of each histogram's peak and sum over the scan.

use std::path::Path;

use super::axis::{Axis, Panel, plain, rounded};
use super::figure::{COLOURS, Figure, HEADING, INK, TITLE};
use super::picture::{BACKGROUND, Picture, colour};
use super::png;
use crate::capture::Capture;
use crate::error::Result;
use crate::maps::percentile;

const WIDTH: f64 = 1120.0;
const LEFT: f64 = 90.0;
const PLOT: [f64; 4] = [LEFT, 80.0, 980.0, 250.0];
/// Upper edge and side of the maps, and their spacing.
const MAPS: [f64; 2] = [430.0, 380.0];
const STEP: f64 = 540.0;

/// Writes the picture as PNG. Maps show +x to the left and +y up, with one square per scan place. A scan that is a
/// list becomes a column.
///
/// # Errors
/// `Kind::Input` if the capture fails its check, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, capture: &Capture) -> Result<()> {
    capture.check()?;
    let maps = vec![("path of the peak (m)", peaks(capture)), sums(capture)];
    png::write(path, &Overview { capture, maps, logarithmic: false }.picture())
}

/// As [`write()`], for a capture made of time tags. The mean histogram is logarithmic, because it includes direct
/// light. The first map shows `direct`, the path of each pair's direct peak from the laser's trigger in metres
/// (smooth for a flat wall), or without it the path of the peak. If the wall is `shaped` by its own returns, a third
/// map shows its depth.
///
/// # Errors
/// Those of [`write()`].
pub fn write_with_direct(path: &Path, capture: &Capture, direct: Option<&[f64]>, shaped: bool) -> Result<()> {
    capture.check()?;
    let first = match direct {
        Some(all) => ("path to the direct peak (m)", all.iter().map(|v| *v as f32).collect()),
        None => ("path of the peak (m)", peaks(capture)),
    };
    let mut maps = vec![first, sums(capture)];
    if shaped {
        maps.push(("depth of the wall (m)", capture.laser.iter().map(|p| p.z as f32).collect()));
    }
    png::write(path, &Overview { capture, maps, logarithmic: true }.picture())
}

/// The counts of each histogram.
fn sums(capture: &Capture) -> (&'static str, Vec<f32>) {
    ("sum of the counts", capture.histograms.chunks_exact(capture.bins).map(|h| h.iter().sum()).collect())
}

/// Path of each histogram's peak, metres; NaN without signal.
fn peaks(capture: &Capture) -> Vec<f32> {
    let path = |bin: usize| capture.t_start + (bin as f64 + 0.5) * capture.bin_width;
    let peak = |h: &[f32]| {
        let peak = (0..h.len()).max_by(|a, b| h[*a].total_cmp(&h[*b]).then(b.cmp(a)));
        peak.filter(|b| h[*b] > 0.0).map_or(f32::NAN, |b| path(b) as f32)
    };
    capture.histograms.chunks_exact(capture.bins).map(peak).collect()
}

/// Mean histogram, and the maps below it.
struct Overview<'a> {
    capture: &'a Capture,
    /// Titles and values, one per pair.
    maps: Vec<(&'static str, Vec<f32>)>,
    /// Whether the axis of counts is logarithmic.
    logarithmic: bool,
}

impl Overview<'_> {
    fn picture(&self) -> Picture {
        let capture = self.capture;
        let mut picture = self.figure().picture();
        let [top, side] = MAPS.map(|v| v as usize);
        for (at, (_, values)) in self.maps.iter().enumerate() {
            let x = (LEFT + at as f64 * STEP) as usize;
            let range = percentile(values, 1.0).zip(percentile(values, 99.0));
            let (low, high) = range.map_or((0.0, 1.0), |(a, b)| (f64::from(a), f64::from(b)));
            picture.paste(&map(values, capture.scan, low, high), x, top);
            let labels = [high, low].map(|value| plain(rounded(value)));
            picture.colour_bar(x + side + 12, [top, top + side], 0.0, &labels, INK);
        }
        picture
    }

    fn figure(&self) -> Figure {
        let more = self.maps.len().saturating_sub(2) as f64 * STEP;
        let mut figure = Figure::new([WIDTH + more, MAPS[0] + MAPS[1] + 60.0]);
        let capture = self.capture;
        let [nx, ny] = capture.scan;
        let title = format!("{}: {nx} × {ny} histograms of {} bins", capture.name, capture.bins);
        figure.text(&title, HEADING, INK, [LEFT, 28.0]);
        for (at, (title, _)) in self.maps.iter().enumerate() {
            figure.text(title, TITLE, INK, [LEFT + at as f64 * STEP, MAPS[0] - 17.0]);
        }
        let mean = capture.mean_histogram();
        let along = Axis::new([capture.t_start, capture.t_end()].into_iter(), false);
        let up = match self.logarithmic {
            true => Axis::new(mean.iter().copied(), true),
            false => Axis::new(mean.iter().copied().chain([0.0]), false),
        };
        let floor = if self.logarithmic { up.low } else { 0.0 };
        let mut panel = Panel::new(&mut figure, PLOT, ["mean histogram", "path (m)"], [along, up]);
        // If several bins share a pixel column, it shows the largest.
        let per_column = mean.len().div_ceil(PLOT[2] as usize).max(1);
        let path = |bin: usize| capture.t_start + bin as f64 * capture.bin_width;
        for (at, bins) in mean.chunks(per_column).enumerate() {
            let from = at * per_column;
            let value = bins.iter().copied().fold(0.0, f64::max);
            panel.bar([path(from), path(from + bins.len())], [floor, value.max(floor)], COLOURS[0]);
        }
        figure
    }
}

/// Values over the scan as a square, +x to the left and +y up: bright is large, dark is small.
fn map(values: &[f32], [nx, ny]: [usize; 2], low: f64, high: f64) -> Picture {
    let side = MAPS[1] as usize;
    let mut picture = Picture::new(side, side);
    let longest = nx.max(ny);
    // Squares stay square, so the shorter side has a margin.
    let (w, h) = ((side * nx / longest).max(1), (side * ny / longest).max(1));
    for row in 0..h {
        for column in 0..w {
            let value = f64::from(values[(w - 1 - column) * nx / w * ny + (h - 1 - row) * ny / h]);
            let share = if high > low { (high - value) / (high - low) } else { 0.0 };
            let ink = if value.is_nan() { BACKGROUND } else { colour(share) };
            picture.fill((side - w) / 2 + column, (side - h) / 2 + row, 1, 1, ink);
        }
    }
    picture
}
