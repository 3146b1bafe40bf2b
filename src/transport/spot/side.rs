//! The points of one side of a wall's pairs, and the wall between and beyond them.

use glam::{DVec2, DVec3};

use crate::capture::nearest::Tree;
use crate::transport::Wall;

/// Points of one side of a wall's pairs.
pub(super) struct WallSide {
    pub points: Vec<DVec3>,
    pub normals: Option<Vec<DVec3>>,
}

/// The scanned points of a wall, and the others.
pub(super) fn sides(wall: &Wall) -> (WallSide, WallSide) {
    let count = wall.scanned.len();
    let normals = |range: std::ops::Range<usize>| wall.normals.as_ref().map(|n| n[range].to_vec());
    let all = count + wall.others.len();
    (
        WallSide { points: wall.scanned.clone(), normals: normals(0..count) },
        WallSide { points: wall.others.clone(), normals: normals(count..all) },
    )
}

/// The wall between and beyond the points of a side.
pub(super) struct Relay<'a> {
    side: &'a WallSide,
    /// `None` if all points have one height and no normals: the wall is flat.
    tree: Option<Tree<'a>>,
}

impl Relay<'_> {
    pub fn of(side: &WallSide) -> Relay<'_> {
        let flat = side.normals.is_none() && side.points.iter().all(|p| p.z == side.points[0].z);
        Relay { side, tree: (!flat).then(|| Tree::new(&side.points)) }
    }

    /// The wall's point and unit normal at a place: the mean of the nearest points' planes, weighted by distance.
    pub fn at(&self, place: DVec2) -> (DVec3, DVec3) {
        let points = &self.side.points;
        let flat = place.extend(points.first().map_or(0.0, |p| p.z));
        let Some(tree) = &self.tree else { return (flat, DVec3::Z) };
        let (mut sum, mut height, mut facing) = (0.0, 0.0, DVec3::ZERO);
        for (_, i) in tree.nearest(flat, 4) {
            let normal = self.side.normals.as_ref().map_or(DVec3::Z, |n| n[i]);
            let aside = place - points[i].truncate();
            let weight = 1.0 / (aside.length_squared() + 1e-12);
            let rise = -normal.truncate().dot(aside) / normal.z.max(0.1);
            (sum, height, facing) =
                (sum + weight, height + weight * (points[i].z + rise), facing + weight * normal);
        }
        (place.extend(height / sum), facing.normalize_or(DVec3::Z))
    }
}
