//! Wall points and normals as formats store them.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::host;

/// One vector per pair. `given` holds one for each, or a single one for all.
pub(super) fn per_pair(what: &str, given: Vec<DVec3>, pairs: usize) -> Result<Vec<DVec3>> {
    match given.len() {
        n if n == pairs => Ok(given),
        1 => host::filled(what, pairs, given[0]),
        n => Err(Error::input(
            format!("{what} holds {n} points for {pairs} scan positions"),
            "give one point per scan position, in the order of H, or a single one",
        )),
    }
}

/// The axes longer than 1.
pub(super) fn squeezed(axes: &[usize]) -> Vec<usize> {
    axes.iter().copied().filter(|n| *n > 1).collect()
}

/// Refuses points or normals of shape `shape`, [..., 3], that do not stand in the axes `scan` of the counts of shape `counts`,
/// although there may be as many. A single one is that of every pair.
pub(super) fn check_places(what: &str, shape: &[usize], scan: &[usize], counts: &[usize]) -> Result<()> {
    let places = squeezed(&shape[..shape.len().saturating_sub(1)]);
    if places.is_empty() || places == squeezed(scan) {
        return Ok(());
    }
    Err(Error::input(
        format!("H has shape {counts:?} and {what} {shape:?}, which do not agree"),
        format!(
            "store H as [T, X, Y] with {what} [X, Y, 3] of the same X and Y, or both as lists, [T, P] with [P, 3], or a single \
             {what} as [1, 3]; every laser point with every sensor point is [T, Lx, Ly, Sx, Sy]"
        ),
    ))
}

/// Vectors from consecutive triples; the last dimension must be 3.
pub(super) fn triples(what: &str, shape: &[usize], values: &[f64]) -> Result<Vec<DVec3>> {
    if shape.last() != Some(&3) {
        return Err(Error::input(
            format!("{what} has shape {shape:?}, not x, y, z along its last axis"),
            format!("store {what} as [X, Y, 3], or as [1, 3] for a single point"),
        ));
    }
    Ok(values.chunks_exact(3).map(|v| DVec3::new(v[0], v[1], v[2])).collect())
}

/// Brings a normal that was rounded to float32 back to unit length. A wrong normal is left for the check; a unit normal
/// does not change by a bit.
pub(super) fn unit(n: DVec3) -> DVec3 {
    let off = (n.length() - 1.0).abs();
    if (1e-12..1e-4).contains(&off) { n.normalize() } else { n }
}

/// Shape and flat values of the points: a single point, of shape `single`, if all are equal, else all of them.
pub(super) fn compact(points: &[DVec3], scan: [usize; 2], single: &[usize]) -> (Vec<usize>, Vec<f64>) {
    let all_equal = points.windows(2).all(|w| w[0] == w[1]);
    let (shape, points) = if all_equal && points.len() > 1 {
        (single.to_vec(), &points[..1])
    } else {
        (vec![scan[0], scan[1], 3], points)
    };
    (shape, points.iter().flat_map(|p| p.to_array()).collect())
}
