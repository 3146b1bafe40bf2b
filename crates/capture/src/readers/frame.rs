//! Points of regular scans of a flat wall, as formats order them.

use glam::DVec3;

pub(super) use crate::conditioning::frame::{facing_z, in_order, order_of};

/// Distances relative to the step of a row below this are taken as rounding.
const STRAIGHT: f64 = 1e-3;

/// Points `[ix * ny + iy]` of a regular scan, centred on the wall at z = 0. The outermost points are `wall` metres
/// apart along the longer side.
pub fn lattice([nx, ny]: [usize; 2], wall: f64) -> Vec<DVec3> {
    let spacing = wall / (nx.max(ny).max(2) - 1) as f64;
    let at = |i: usize, n: usize| (i as f64 - 0.5 * (n as f64 - 1.0)) * spacing;
    (0..nx).flat_map(|ix| (0..ny).map(move |iy| DVec3::new(at(ix, nx), at(iy, ny), 0.0))).collect()
}

/// A direction over the wall, as an eye at the wall sees it and as our pictures show it: +x to the left, +y up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WallDirection {
    Left,
    Right,
    Up,
    Down,
}

/// Directions of the two scan axes of an array that MATLAB stores as (d1, d2, t). One is along x, the other along y.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Axes {
    pub d1: WallDirection,
    pub d2: WallDirection,
}

impl Axes {
    /// The scan shape (X, Y) of `n1` by `n2` stored points.
    pub fn scan(self, [n1, n2]: [usize; 2]) -> [usize; 2] {
        if self.d1_along_x() { [n1, n2] } else { [n2, n1] }
    }

    /// The pair (`ix * Y + iy`) of every stored point, d1 fastest, as HDF5 and MATLAB files have them.
    pub fn pairs(self, [n1, n2]: [usize; 2]) -> Vec<usize> {
        let along =
            |run, i, n| if matches!(run, WallDirection::Left | WallDirection::Up) { i } else { n - 1 - i };
        let pair = |i1, i2| {
            let (a, b) = (along(self.d1, i1, n1), along(self.d2, i2, n2));
            if self.d1_along_x() { a * n2 + b } else { b * n1 + a }
        };
        (0..n2).flat_map(|i2| (0..n1).map(move |i1| (i1, i2))).map(|(i1, i2)| pair(i1, i2)).collect()
    }

    fn d1_along_x(self) -> bool {
        matches!(self.d1, WallDirection::Right | WallDirection::Left)
    }
}

/// The points of an array that is (n, 3) in MATLAB, which is [3, n] in C order; `None` if its shape is another.
pub(super) fn points(shape: &[usize], v: &[f64]) -> Option<Vec<DVec3>> {
    let &[3, n] = shape else { return None };
    Some((0..n).map(|p| DVec3::new(v[p], v[n + p], v[2 * n + p])).collect())
}

/// [rows, points of a row] of points that form a lattice row after row, all in one direction; `None` if they do not, or are a
/// single row.
pub fn rows(points: &[DVec3]) -> Option<[usize; 2]> {
    let step = *points.get(1)? - *points.first()?;
    let tolerance = STRAIGHT * step.length();
    let other = |pair: &[DVec3]| (pair[1] - pair[0] - step).length() > tolerance;
    let row = points.windows(2).position(other).map_or(points.len(), |p| p + 1);
    if row < 2 || row == points.len() || !points.len().is_multiple_of(row) {
        return None;
    }
    let down = points[row] - points[0];
    let place = |p: usize| points[0] + step * (p % row) as f64 + down * (p / row) as f64;
    let near = |(p, at): (usize, &DVec3)| at.distance(place(p)) <= tolerance;
    points.iter().enumerate().all(near).then_some([points.len() / row, row])
}
