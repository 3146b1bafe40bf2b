//! A plot of a calibration: the residual over the shift of time zero.

use std::path::Path;

use super::axis::{Axis, Panel};
use super::figure::{COLOURS, Figure};
use super::png;
use crate::capture::calibrate::Calibration;
use crate::error::Result;

const PLOT: [f64; 4] = [90.0, 60.0, 760.0, 360.0];

/// Writes the curve as PNG, with the best shift as a disc; millimetres of path on both axes.
///
/// # Errors
/// `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, found: &Calibration) -> Result<()> {
    let [left, top, width, height] = PLOT;
    let mut figure = Figure::new([left + width + 40.0, top + height + 70.0]);
    let mm = |p: [f64; 2]| p.map(|v| 1000.0 * v);
    let shown: Vec<_> = found.curve.iter().filter(|p| p[1].is_finite()).map(|p| mm(*p)).collect();
    let along = Axis::new(shown.iter().map(|p| p[0]), false);
    let up = Axis::new(shown.iter().map(|p| p[1]).chain([0.0]), false);
    let best = mm([found.shift, found.residual]);
    let title = format!("residual of one point (mm of path), least at a shift of {:.2} mm", best[0]);
    let mut panel = Panel::new(&mut figure, PLOT, [&title, "shift of time zero (mm of path)"], [along, up]);
    panel.curve(&shown, COLOURS[0]);
    panel.disc(best, 6.0, COLOURS[1]);
    png::write(path, &figure.picture())
}
