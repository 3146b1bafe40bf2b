//! The residual of a calibration over the shift of time zero.

use std::path::Path;

use super::axis::Axis;
use super::drawing::{Anchor, Drawing};
use super::png;
use crate::capture::calibrate::Calibration;
use crate::error::Result;

const INK: [u8; 3] = [40, 40, 46];
const GRID: [u8; 3] = [226, 226, 230];
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
    for (value, label) in along.ticks() {
        let at = x + w * along.share(value);
        drawing.line(&[[at, y], [at, y + h]], 1.0, GRID);
        label.iter().for_each(|l| drawing.text(l, [at, y + h + 22.0], 10.0, Anchor::Middle, INK));
    }
    for (value, label) in up.ticks() {
        let at = y + h * (1.0 - up.share(value));
        drawing.line(&[[x, at], [x + w, at]], 1.0, GRID);
        label.iter().for_each(|l| drawing.text(l, [x - 8.0, at + 5.0], 10.0, Anchor::End, INK));
    }
    drawing.line(&shown().map(|p| place(*p)).collect::<Vec<_>>(), 2.0, CURVE);
    drawing.disc(place([found.shift, found.residual]), 6.0, BEST);
    let best = format!("{:.2} mm", mm(found.shift));
    let [bx, by] = place([found.shift, found.residual]);
    drawing.text(&best, [bx + 12.0, by - 10.0], 11.0, Anchor::Start, BEST);
    png::write(path, &drawing.picture())
}
