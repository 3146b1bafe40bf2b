//! Arrays of counts.

use super::glance::{self, Glance};
use crate::data::histogram_figures;
use crate::error::{Error, Result};
use crate::files::archive::Npz;

/// An array of counts.
#[derive(Debug, Clone, PartialEq)]
pub struct Counts {
    /// Lengths of its axes, the slowest first.
    pub shape: Vec<usize>,
    /// In C order.
    pub values: Vec<f32>,
}

impl Counts {
    /// Whether the values are photon counts: whole and not negative, however they are stored.
    pub fn whole(&self) -> bool {
        histogram_figures::whole(&self.values)
    }
}

/// The shape of an array of counts in an archive, which are not read.
pub(super) fn shape(npz: &mut Npz, name: &str, wanted: &str) -> Result<Vec<usize>> {
    let (head, _) = npz.stream(name)?.ok_or_else(|| npz.missing(name, wanted))?;
    if head.shape.contains(&0) {
        return Err(Error::input(
            format!("{name} has shape {:?}: it holds no bin, or no pair", head.shape),
            "write the capture again: it has to hold at least one bin of one pair",
        ));
    }
    Ok(head.shape)
}

/// The values of an array of counts. What unpacks to far more than the file is looked at first.
pub(super) fn read(npz: &mut Npz, name: &str, wanted: &str) -> Result<Vec<f32>> {
    if npz.sizes(name).is_some_and(|[size, packed]| glance::is_wanted(size, packed))
        && let Some((head, mut elements)) = npz.stream(name)?
    {
        let mut glance = Glance::default();
        let mut left = head.shape.iter().fold(1usize, |n, d| n.saturating_mul(*d));
        while left > 0 {
            let part = left.min(glance::AT_ONCE);
            glance.take(&head.part(&mut elements, part).map_err(|e| e.at(format!("array {name}")))?.to_f32());
            left -= part;
        }
        glance.finish(name)?;
    }
    let array = npz.whole(name)?.ok_or_else(|| npz.missing(name, wanted))?;
    Ok(array.to_f32())
}

/// The largest value, which decides the integer type to store; `None` unless all values are whole and not negative.
pub(super) fn largest_count(values: &[f32]) -> Option<f32> {
    values.iter().try_fold(0.0f32, |largest, &v| (v >= 0.0 && v.fract() == 0.0).then(|| largest.max(v)))
}

/// The error of counts that come alone, with the lines that make a capture of them.
pub(super) fn alone(what: &str) -> Error {
    Error::input(
        what,
        r#"make a capture of it: H [T, X, Y] with the bins first, points [X, Y, 3] on the wall in metres, bins in metres of path:
import numpy as np; H = np.load("FILE"); x, y = [np.linspace(-.5, .5, n) for n in H.shape[1:]]
p = np.stack(np.meshgrid(x, y, [0], indexing="ij"), -1)[:, :, 0]
np.savez("capture.npz", H=H, sensor_xyz=p, laser_xyz=p, delta_t=133e-12 * 299792458)
or, if an instrument wrote its histograms (points, bins) or time tags, use `histogram` with the points of the scan"#,
    )
}
