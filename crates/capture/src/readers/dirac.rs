//! NLOS-Dirac HDF5, which y-tal reads but calls deprecated: a confocal scan of a flat wall.
//!
//! `data_t` [T, X, Y]; `xg`, `yg` [X, Y] wall points in metres; `da` \[T\] paths in metres (only their step is used);
//! `offset_laser`: not 0 if the outer legs were removed. No publication of the format was found. It is read as y-tal
//! (format.py) does, with bin 0 at path 0. Files for which y-tal guesses the positions of the devices are refused.
//!
//! Axes: the coordinates in the file are kept, as y-tal keeps them. Nothing in a file says whether they are right-handed.

use glam::DVec3;

use super::frame;
use super::unread::Unread;
use super::variables::Variables;
use crate::Capture;
use crate::error::{Error, Result};

/// Finds a capture without reading its counts; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays, shapes that do not agree, or paths that include the outer legs.
pub(super) fn read<'f>(file: &'f Variables, notes: &mut Vec<String>) -> Result<Unread<'f>> {
    let numbers = |name: &str| file.numbers(name)?.ok_or_else(|| file.missing(name));
    let counts = file.counts_shape("data_t")?;
    let ((x_shape, x), (y_shape, y)) = (numbers("xg")?, numbers("yg")?);
    let &[bins, nx, ny] = &counts[..] else {
        return Err(Error::input(
            format!("data_t has {} axes, not three", counts.len()),
            "data_t is [T, X, Y]",
        ));
    };
    if x_shape != [nx, ny] || y_shape != [nx, ny] {
        return Err(Error::input(
            format!("data_t has shape {:?}, xg {x_shape:?} and yg {y_shape:?}", counts),
            "xg and yg hold a number for every scan point of data_t, [X, Y]",
        ));
    }
    let (_, paths) = numbers("da")?;
    let &[first, second, ..] = &paths[..] else {
        return Err(Error::input(
            "da holds fewer than two paths, so the bin width is unknown",
            "da holds the paths of all bins, in metres",
        ));
    };
    if numbers("offset_laser")?.1.iter().all(|v| *v == 0.0) {
        return Err(Error::input(
            "offset_laser is 0: the paths of this NLOS-Dirac file include the legs between devices and wall, \
             but the file does not hold the positions of the devices",
            "convert it to y-tal HDF5, with the positions of the devices as laser_xyz and sensor_xyz",
        ));
    }
    notes.push("NLOS-Dirac HDF5 is read as in y-tal: confocal, a flat wall, bin 0 at path 0".into());
    let points: Vec<DVec3> = x.iter().zip(&y).map(|(x, y)| DVec3::new(*x, *y, 0.0)).collect();
    let outline = Capture::new([nx, ny], points.clone(), points, bins, second - first, vec![]);
    let order = frame::order_of(&outline);
    let unread = Unread::in_order(outline, file, "data_t");
    Ok(match order {
        Some(order) => {
            Unread { outline: unread.outline.keep(&order.pairs, order.scan), from: order.pairs, ..unread }
        }
        None => unread,
    })
}
