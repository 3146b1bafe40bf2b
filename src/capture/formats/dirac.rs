//! NLOS-Dirac HDF5, which y-tal reads and calls deprecated: a confocal scan of a flat wall.
//!
//! `data_t` [T, X, Y]; `xg`, `yg` [X, Y] wall points in metres; `da` \[T\] paths in metres, of which the step counts;
//! `offset_laser`: not 0 if the legs from laser to wall and back were taken off. No publication of the format was
//! found: this is as y-tal (format.py) reads it, bin 0 at path 0. Where y-tal guesses the devices, it is refused.
//!
//! Axes: the file has the points' coordinates, which are kept.

use glam::DVec3;

use super::frame;
use super::variables::Variables;
use crate::capture::Capture;
use crate::error::{Error, Result};
use crate::files::array::transpose;

/// Reads a capture without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays, shapes that do not agree, or paths that include the outer legs.
pub fn read(file: &Variables, notes: &mut Vec<String>) -> Result<Capture> {
    let numbers = |name: &str| file.numbers(name)?.ok_or_else(|| file.missing(name));
    let counts = file.counts("data_t")?;
    let ((x_shape, x), (y_shape, y)) = (numbers("xg")?, numbers("yg")?);
    let &[bins, nx, ny] = &counts.shape[..] else {
        return Err(Error::input(
            format!("data_t has {} axes, not three", counts.shape.len()),
            "data_t is [T, X, Y]",
        ));
    };
    if x_shape != [nx, ny] || y_shape != [nx, ny] {
        return Err(Error::input(
            format!("data_t has shape {:?}, xg {x_shape:?} and yg {y_shape:?}", counts.shape),
            "xg and yg hold a number for every scan point of data_t, [X, Y]",
        ));
    }
    let (_, paths) = numbers("da")?;
    let &[first, second, ..] = &paths[..] else {
        return Err(Error::input(
            "da holds a single path, which tells no bin width",
            "da holds the paths of all bins, in metres",
        ));
    };
    if numbers("offset_laser")?.1.iter().all(|v| *v == 0.0) {
        return Err(Error::input(
            "offset_laser is 0: the paths of this NLOS-Dirac file include the legs between devices and wall, and \
             where the devices are is not in the file",
            "convert it to y-tal HDF5 with laser_xyz and sensor_xyz as they were",
        ));
    }
    notes.push("NLOS-Dirac HDF5 is read as y-tal does: confocal, a flat wall, bin 0 at path 0".into());
    let points: Vec<DVec3> = x.iter().zip(&y).map(|(x, y)| DVec3::new(*x, *y, 0.0)).collect();
    let histograms = transpose(&counts.values, bins, nx * ny);
    let capture = Capture::new([nx, ny], points.clone(), points, bins, second - first, histograms);
    Ok(frame::in_order(Capture { integer_counts: counts.whole(), ..capture }))
}
