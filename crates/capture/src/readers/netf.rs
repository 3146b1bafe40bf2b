//! Captures that NeTF (Shen and others 2021) prepared: MATLAB v5 with the names of Z-NLOS.
//!
//! `data` (t, i, j) with the outer legs removed, `cameraGridPositions` 3×(I·J), j fastest, optional
//! `laserGridPositions` of one or as many points, `deltaT` (metres, or seconds if it is below 1e-6),
//! `hiddenVolumePosition`. The bins of a confocal file are **one-way** distances: bin b is at the distance b · deltaT,
//! a path of twice that. Here all lengths are paths.
//!
//! Axes: the coordinates in the file are kept, except for the rotation of the wall to +z. Pair (i, j) has the point
//! `i * J + j`, as in the loop of the script that prepares their files. Nothing in a file says
//! whether the coordinates are right-handed.

use glam::DVec3;

use super::points::per_pair;
use super::variables::Variables;
use super::{frame, znlos};
use crate::error::{Error, Result};
use crate::{Capture, METRES_PER_PICOSECOND, host};

/// A bin width below this is in seconds: no bin is so short in metres, and none is so long in seconds.
const LONGEST_SECONDS: f64 = 1e-6;

/// Reads a capture without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for missing arrays or shapes that do not agree.
pub fn read(file: &Variables, notes: &mut Vec<String>) -> Result<Capture> {
    let sensors =
        znlos::SidePoints::read(file, "camera")?.ok_or_else(|| file.missing("cameraGridPositions"))?;
    let lasers = znlos::SidePoints::read(file, "laser")?;
    let shape = file.counts_shape("data")?;
    // MATLAB's (t, i, j) is read as [j, i, t].
    let [nj, ni, bins] = shape[..] else {
        return Err(Error::input(
            format!("data has {} axes, not three", shape.len()),
            "data is (t, i, j) in MATLAB",
        ));
    };
    let pairs = ni * nj;
    let points = in_rows("cameraGridPositions", &sensors.points, sensors.shape, [ni, nj])?;
    let confocal = lasers.is_none();
    let laser = match &lasers {
        None => points.clone(),
        Some(grid) if grid.points.len() == 1 => per_pair("laserGridPositions", grid.points.clone(), pairs)?,
        Some(grid) => in_rows("laserGridPositions", &grid.points, grid.shape, [ni, nj])?,
    };
    let width = file.number("deltaT")?.ok_or_else(|| file.missing("deltaT"))?;
    let metres = if width < LONGEST_SECONDS { width * 1e12 * METRES_PER_PICOSECOND } else { width };
    if confocal {
        notes.push(format!(
            "deltaT is one-way, as in NeTF: a bin is {:.6} m of path; the outer legs are already removed",
            2.0 * metres
        ));
    }
    let bin_width = if confocal { 2.0 * metres } else { metres };
    let place = |p: usize| (p % nj * ni + p / nj) * bins;
    let counts = file.counts("data")?;
    let integer_counts = counts.whole();
    let all = (0..pairs).flat_map(|p| &counts.values[place(p)..place(p) + bins]).copied();
    let histograms = host::collected("the counts", counts.values.len(), all)?;
    let capture =
        Capture { integer_counts, ..Capture::new([ni, nj], laser, points, bins, bin_width, histograms) };
    let towards = file.point("hiddenVolumePosition")?;
    Ok(frame::in_order(frame::facing_z(capture, towards, notes)))
}

/// Points `[i * J + j]`, stored in a list of that order or as MATLAB's (3, I, J) or (I, J, 3).
fn in_rows(name: &str, points: &[DVec3], shape: [usize; 2], [ni, nj]: [usize; 2]) -> Result<Vec<DVec3>> {
    // A list has one axis. A grid is read with its axes reversed, i fastest.
    let list = shape[1] == 1 || shape[0] == 1;
    if points.len() != ni * nj || !(list || shape == [nj, ni]) {
        return Err(Error::input(
            format!(
                "{name} holds {} x {} points (MATLAB order reversed) for {ni} x {nj} histograms",
                shape[0], shape[1]
            ),
            "give one point per histogram, in the axes of data",
        ));
    }
    Ok((0..ni * nj).map(|p| if list { points[p] } else { points[p % nj * ni + p / nj] }).collect())
}
