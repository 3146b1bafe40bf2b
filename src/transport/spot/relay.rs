//! The wall between and beyond its points.

use glam::{DVec2, DVec3};

use super::side::Side;
use crate::capture::nearest::Tree;

/// The wall between and beyond the points of a side.
pub(super) struct Relay<'a> {
    side: &'a Side,
    /// `None` if all points have one height and no normals: the wall is flat.
    tree: Option<Tree<'a>>,
}

impl Relay<'_> {
    pub fn of(side: &Side) -> Relay<'_> {
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
