//! The relay wall's points as kernels see them: which points there are, and which of them make pairs.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::Reflectance;
use crate::capture::Capture;

/// How wall points make pairs: what a kernel computes for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Geometry {
    /// Laser and sensor point are one: one distance.
    Confocal,
    /// Every pair has two points of its own: two distances.
    TwoPoints,
    /// Every scanned point with every other one: distances are found per point, not per pair.
    Product,
}

impl Geometry {
    /// Points of the scanned side, and of the other, that the first `pairs` have on a wall of so many: of a product whole
    /// rows, each of all scanned points with another one, and so all scanned points unless there is one row only.
    pub fn counts(self, pairs: usize, scanned: usize, others: usize) -> [usize; 2] {
        match (self, others) {
            (Geometry::Confocal, _) => [pairs, 0],
            (Geometry::TwoPoints, _) => [pairs, pairs],
            (Geometry::Product, 1) => [pairs, 1],
            (Geometry::Product, _) => [scanned, pairs / scanned],
        }
    }
}

/// Wall points, in metres. Light is symmetric, so it does not matter which side is the laser's: the scanned side is
/// the one with more distinct points.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// How the points pair.
    pub geometry: Geometry,
    /// Points of the scanned side: one per pair, or the distinct ones of a product.
    pub scanned: Vec<DVec3>,
    /// Points of the other side likewise; none in a confocal scan.
    pub others: Vec<DVec3>,
    /// Unit normals of the scanned points, then of the others. `None` where all are (0, 0, 1) or nobody asks.
    pub normals: Option<Vec<DVec3>>,
}

impl Wall {
    /// A confocal scan on a flat wall.
    pub fn confocal(points: Vec<DVec3>) -> Wall {
        Wall { geometry: Geometry::Confocal, scanned: points, others: vec![], normals: None }
    }

    /// The wall of a capture for surfaces of such reflectance, and the capture's pair behind each pair of the wall.
    /// Normals are taken where the model asks for them and the wall is curved; unknown ones count as (0, 0, 1).
    /// `general` leaves nothing out: two points per pair, normals of all.
    pub fn of(capture: &Capture, reflectance: Reflectance, general: bool) -> (Wall, Vec<usize>) {
        let curved = general || (reflectance == Reflectance::Lambertian && !capture.is_planar());
        let filled =
            |normals: &Option<Vec<DVec3>>, count| normals.clone().unwrap_or_else(|| vec![DVec3::Z; count]);
        let in_order = (0..capture.pair_count()).collect();
        let pairs = capture.pair_count();
        if !general && capture.is_confocal() {
            let normals = curved.then(|| filled(&capture.sensor_normal, pairs));
            return (Wall { normals, ..Wall::confocal(capture.sensor.clone()) }, in_order);
        }
        if let Some(product) = (!general).then(|| capture.product()).flatten() {
            let mut normals = filled(&product.scanned_normal, product.scanned.len());
            normals.extend(filled(&product.other_normal, product.other.len()));
            let wall = Wall {
                geometry: Geometry::Product,
                scanned: product.scanned,
                others: product.other,
                normals: curved.then_some(normals),
            };
            return (wall, product.pair_of);
        }
        let laser = (&capture.laser, &capture.laser_normal);
        let sensor = (&capture.sensor, &capture.sensor_normal);
        let (scanned, others) = if capture.laser_scans() { (laser, sensor) } else { (sensor, laser) };
        let mut normals = filled(scanned.1, pairs);
        normals.extend(filled(others.1, pairs));
        let wall = Wall {
            geometry: Geometry::TwoPoints,
            scanned: scanned.0.clone(),
            others: others.0.clone(),
            normals: curved.then_some(normals),
        };
        (wall, in_order)
    }

    /// Number of pairs.
    pub fn pairs(&self) -> usize {
        match self.geometry {
            Geometry::Product => self.scanned.len() * self.others.len(),
            _ => self.scanned.len(),
        }
    }

    /// The scanned and the other point of a pair, counted through both lists.
    pub fn points_of(&self, pair: usize) -> [usize; 2] {
        let scanned = self.scanned.len();
        match self.geometry {
            Geometry::Confocal => [pair, pair],
            Geometry::TwoPoints => [pair, scanned + pair],
            Geometry::Product => [pair % scanned, scanned + pair / scanned],
        }
    }

    /// Point and unit normal by a number of [`Wall::points_of`].
    pub fn point(&self, number: usize) -> [DVec3; 2] {
        let scanned = self.scanned.len();
        let point = if number < scanned { self.scanned[number] } else { self.others[number - scanned] };
        [point, self.normals.as_ref().map_or(DVec3::Z, |n| n[number])]
    }

    /// Optical path in metres of a pair over a hidden point.
    pub fn path(&self, pair: usize, x: DVec3) -> f64 {
        self.points_of(pair).map(|p| self.point(p)[0].distance(x)).iter().sum()
    }

    /// The scanned points, then the others.
    pub fn all_points(&self) -> impl Iterator<Item = &DVec3> {
        self.scanned.iter().chain(&self.others)
    }

    /// As the kernels read it: points, other points, normals where there are any; (x, y, z, 0) each.
    pub fn words(&self) -> Vec<[f32; 4]> {
        let all = self.all_points().chain(self.normals.iter().flatten());
        all.map(|p| [p.x as f32, p.y as f32, p.z as f32, 0.0]).collect()
    }
}
