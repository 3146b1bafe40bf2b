//! The compact form of an exhaustive capture: two lists of points, and a histogram for every combination.

use glam::DVec3;

use super::super::lattice::Lattice;
use crate::{Capture, PairKind};

/// One side of an exhaustive capture as it is stored.
pub struct StoredSide {
    /// Points along x and along y; [n, 1] for points that form no lattice.
    pub shape: [usize; 2],
    /// `[ix * Y + iy]`, metres.
    pub points: Vec<DVec3>,
    pub normals: Option<Vec<DVec3>>,
}

/// The laser's and the sensor's side of an exhaustive capture whose pairs are ordered laser point by laser point, each
/// with all sensor points in the same order. `None` for any other capture, which is stored pair by pair.
pub fn sides(capture: &Capture) -> Option<[StoredSide; 2]> {
    let PairKind::Exhaustive { lasers, sensors } = capture.pair_kind() else { return None };
    if capture.scan != [lasers, sensors] {
        return None;
    }
    // Pair l * S + s has the laser point of pair l * S and the sensor point of pair s.
    let laser = (&capture.laser, &capture.laser_normal);
    let laser = side(laser, lasers, |l| l * sensors, |pair| pair / sensors)?;
    let sensor = (&capture.sensor, &capture.sensor_normal);
    let sensor = side(sensor, sensors, |s| s, |pair| pair % sensors)?;
    Some([laser, sensor])
}

/// The `count` points and normals at the pairs `pair_of`. `None` if a pair has other values than its `place`.
fn side(
    (points, normals): (&Vec<DVec3>, &Option<Vec<DVec3>>),
    count: usize,
    pair_of: impl Fn(usize) -> usize,
    place: impl Fn(usize) -> usize,
) -> Option<StoredSide> {
    let list = |values: &Vec<DVec3>| {
        let picked: Vec<DVec3> = (0..count).map(|k| values[pair_of(k)]).collect();
        values.iter().enumerate().all(|(pair, v)| *v == picked[place(pair)]).then_some(picked)
    };
    let points = list(points)?;
    let normals = match normals {
        Some(normals) => Some(list(normals)?),
        None => None,
    };
    Some(StoredSide { shape: shape_of(&points), points, normals })
}

/// [X, Y] if the points are a lattice, column by column, else [n, 1].
fn shape_of(points: &[DVec3]) -> [usize; 2] {
    let lattice = Lattice::of(points);
    let [x, y] = lattice.counts;
    let in_order =
        |places: &[[usize; 2]]| places.iter().enumerate().all(|(k, p)| *p == [k / y.max(1), k % y.max(1)]);
    if lattice.full().is_some_and(in_order) { [x, y] } else { [points.len(), 1] }
}
