//! The residual of a calibration over the shift of time zero.

use std::path::Path;

use super::axis::{self, Axis, INK, Labels};
use super::drawing::{Anchor, Drawing};
use super::png;
use crate::capture::calibrate::Calibration;
use crate::error::Result;

const CURVE: [u8; 3] = [0, 114, 178];
const BEST: [u8; 3] = [213, 94, 0];
const PLOT: [f64; 4] = [90.0, 60.0, 760.0, 360.0];

/// Writes the curve as PNG, with the best shift as a disc; millimetres of path on both axes.
///
/// # Errors
/// `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, found: &Calibration) -> Result<()> {
    let [x, y, w, h] = PLOT;
    let mut drawing = Drawing::new((x + w + 40.0) as usize, (y + h + 70.0) as usize);
    let mm = |v: f64| 1000.0 * v;
    let shown = || found.curve.iter().filter(|p| p[1].is_finite());
    let along = Axis::new(shown().map(|p| mm(p[0])), false);
    let up = Axis::new(shown().map(|p| mm(p[1])).chain([0.0]), false);
    let title = "residual of one point (mm of path) over the shift of time zero (mm of path)";
    drawing.title(title, [x, y - 20.0], 12.0, Anchor::Start, INK);
    let place = |p: [f64; 2]| [x + w * along.share(mm(p[0])), y + h * (1.0 - up.share(mm(p[1])))];
    let labels = Labels { size: 10.0, below: 22.0, beside: 8.0, stroke: 0.0 };
    axis::grid(&mut drawing, PLOT, [&along, &up], &labels);
    drawing.line(&shown().map(|p| place(*p)).collect::<Vec<_>>(), 2.0, CURVE);
    drawing.disc(place([found.shift, found.residual]), 6.0, BEST);
    let best = format!("{:.2} mm", mm(found.shift));
    let [bx, by] = place([found.shift, found.residual]);
    drawing.text(&best, [bx + 12.0, by - 10.0], 11.0, Anchor::Start, BEST);
    png::write(path, &drawing.picture())
}
