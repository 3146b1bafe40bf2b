//! A capture in one picture: its mean histogram, and over the scan the path of each histogram's peak and its sum.

use std::path::Path;

use super::axis::{self, Axis, INK, Labels, plain, rounded};
use super::drawing::{Anchor, Drawing};
use super::picture::{BACKGROUND, Picture, colour};
use super::png;
use crate::capture::Capture;
use crate::error::Result;
use crate::maps::percentile;

const CURVE: [u8; 3] = [0, 114, 178];
const WIDTH: f64 = 1120.0;
const LEFT: f64 = 90.0;
const PLOT: [f64; 4] = [LEFT, 80.0, 980.0, 250.0];
/// Upper edge and side of the maps.
const MAPS: [f64; 2] = [430.0, 380.0];
const BAR: f64 = 16.0;

/// Writes the picture as PNG. Maps show +x to the right and +y up, one square per place of the scan; a scan that
/// is a list is a column.
///
/// # Errors
/// `Kind::Input` if the capture fails its check, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, capture: &Capture) -> Result<()> {
    capture.check()?;
    png::write(path, &picture(capture))
}

fn picture(capture: &Capture) -> Picture {
    let mut drawing = Drawing::new(WIDTH as usize, (MAPS[0] + MAPS[1] + 60.0) as usize);
    let [nx, ny] = capture.scan;
    let title = format!("{}: {nx} x {ny} histograms of {} bins", capture.name, capture.bins);
    drawing.title(&title, [LEFT, 34.0], 15.0, Anchor::Start, INK);
    mean_histogram(&mut drawing, capture);
    let path = |bin: usize| capture.t_start + (bin as f64 + 0.5) * capture.bin_width;
    let histograms = || capture.histograms.chunks_exact(capture.bins);
    let totals: Vec<f32> = histograms().map(|h| h.iter().sum()).collect();
    let peaks: Vec<f32> = histograms()
        .map(|h| {
            let peak = (0..h.len()).max_by(|a, b| h[*a].total_cmp(&h[*b]).then(b.cmp(a)));
            peak.filter(|b| h[*b] > 0.0).map_or(f32::NAN, |b| path(b) as f32)
        })
        .collect();
    let maps = [("path of the peak (m)", peaks), ("sum of the counts", totals)];
    let mut panels = Vec::new();
    for (at, (label, values)) in maps.iter().enumerate() {
        let x = LEFT + at as f64 * (MAPS[1] + 160.0);
        drawing.title(label, [x, MAPS[0] - 12.0], 12.0, Anchor::Start, INK);
        let range = percentile(values, 1.0).zip(percentile(values, 99.0));
        let (low, high) = range.map_or((0.0, 1.0), |(a, b)| (f64::from(a), f64::from(b)));
        let side = MAPS[1];
        for (value, y) in [(high, MAPS[0] + 12.0), (low, MAPS[0] + side)] {
            let at = [x + side + BAR + 20.0, y];
            drawing.text(&plain(rounded(value)), at, 10.0, Anchor::Start, INK);
        }
        panels.push((x as usize, map(values, capture.scan, low, high)));
    }
    let mut picture = drawing.picture();
    let (top, side) = (MAPS[0] as usize, MAPS[1] as usize);
    for (x, panel) in &panels {
        picture.paste(panel, *x, top);
        for row in 0..side {
            let share = row as f64 / (side - 1) as f64;
            picture.fill(x + side + 12, top + row, BAR as usize, 1, colour(share));
        }
    }
    picture
}

fn mean_histogram(drawing: &mut Drawing, capture: &Capture) {
    let mean = capture.mean_histogram();
    let [x, y, w, h] = PLOT;
    let (along, up) = (
        Axis::new([capture.t_start, capture.t_end()].into_iter(), false),
        Axis::new(mean.iter().copied().chain([0.0]), false),
    );
    drawing.title("mean histogram", [x, y - 12.0], 12.0, Anchor::Start, INK);
    let labels = Labels { size: 10.0, below: 20.0, beside: 8.0, stroke: 0.0 };
    axis::grid(drawing, PLOT, [&along, &up], &labels);
    let place = |bin: usize, v: f64| {
        let t = capture.t_start + bin as f64 * capture.bin_width;
        [x + w * along.share(t), y + h * (1.0 - up.share(v))]
    };
    // A step per bin; many bins fall into one column of pixels, which keeps its largest.
    let per_point = mean.len().div_ceil(2 * w as usize).max(1);
    let mut curve = vec![place(0, 0.0)];
    for (at, bins) in mean.chunks(per_point).enumerate() {
        let value = bins.iter().copied().fold(0.0, f64::max);
        curve.push(place(at * per_point, value));
        curve.push(place(at * per_point + bins.len(), value));
    }
    curve.push(place(mean.len(), 0.0));
    drawing.line(&curve, 1.6, CURVE);
    axis::frame(drawing, PLOT);
    drawing.text("path (m)", [x + w, y + h + 42.0], 10.0, Anchor::End, INK);
}

/// Values over the scan as a square, +x to the right and +y up: bright is large, dark is small.
fn map(values: &[f32], [nx, ny]: [usize; 2], low: f64, high: f64) -> Picture {
    let side = MAPS[1] as usize;
    let mut picture = Picture::new(side, side);
    let longest = nx.max(ny);
    // Squares stay squares: the shorter side leaves a margin.
    let (w, h) = ((side * nx / longest).max(1), (side * ny / longest).max(1));
    for row in 0..h {
        for column in 0..w {
            let value = f64::from(values[column * nx / w * ny + (h - 1 - row) * ny / h]);
            let share = if high > low { (high - value) / (high - low) } else { 0.0 };
            let ink = if value.is_nan() { BACKGROUND } else { colour(share) };
            picture.fill((side - w) / 2 + column, (side - h) / 2 + row, 1, 1, ink);
        }
    }
    picture
}
