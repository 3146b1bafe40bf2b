//! A plot of a calibration: the residual over the shift of time zero.

use std::path::Path;

use super::axis::{Axis, Panel};
use super::figure::{self, Area, COLOURS, Canvas, Drawn, Figure};
use super::png;
use crate::capture::calibrate::Calibration;
use crate::error::Result;

const PLOT: [f64; 4] = [90.0, 60.0, 760.0, 360.0];

/// Writes the curve as PNG, with the best shift as a disc; millimetres of path on both axes.
///
/// # Errors
/// `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, found: &Calibration) -> Result<()> {
    png::write(path, &figure::picture(&Curve(found))?)
}

struct Curve<'a>(&'a Calibration);

impl Figure for Curve<'_> {
    fn size(&self) -> [u32; 2] {
        let [x, y, w, h] = PLOT;
        [x + w + 40.0, y + h + 70.0].map(|v| v as u32)
    }

    fn draw<B: Canvas>(&self, area: &Area<B>) -> Drawn<B> {
        let mm = |p: [f64; 2]| p.map(|v| 1000.0 * v);
        let shown: Vec<_> = self.0.curve.iter().filter(|p| p[1].is_finite()).map(|p| mm(*p)).collect();
        let along = Axis::new(shown.iter().map(|p| p[0]), false);
        let up = Axis::new(shown.iter().map(|p| p[1]).chain([0.0]), false);
        let best = mm([self.0.shift, self.0.residual]);
        let title = format!("residual of one point (mm of path), least at a shift of {:.2} mm", best[0]);
        let mut panel = Panel::new(area, PLOT, [&title, "shift of time zero (mm of path)"], [along, up])?;
        panel.curve(&shown, COLOURS[0])?;
        panel.disc(best, 6.0, COLOURS[1])
    }
}
