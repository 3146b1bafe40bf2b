//! The relay wall's points as kernels see them: the points, and which of them make pairs.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::Reflectance;
use crate::capture::Capture;

/// How wall points make pairs: what a kernel computes for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Geometry {
    /// Laser and sensor point are the same: one distance.
    Confocal,
    /// Every pair has its own two points: two distances.
    TwoPoints,
    /// Every scanned point with every other point: distances are computed per point, not per pair.
    Product,
}

impl Geometry {
    /// Number of scanned points and of other points that the first `pairs` use, on a wall with `scanned` and `others`.
    /// In a product, `pairs` covers whole other points, each with all scanned points, unless there is one other point.
    pub fn counts(self, pairs: usize, scanned: usize, others: usize) -> [usize; 2] {
        match (self, others) {
            (Geometry::Confocal, _) => [pairs, 0],
            (Geometry::TwoPoints, _) => [pairs, pairs],
            (Geometry::Product, 1) => [pairs, 1],
            (Geometry::Product, _) => [scanned, pairs / scanned],
        }
    }
}

/// Points of the relay wall, in metres. Light is symmetric, so either side may be the laser's: the scanned side is the
/// one with more distinct points.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// How the points make pairs.
    pub geometry: Geometry,
    /// Scanned points: one per pair, or the distinct ones of a product.
    pub scanned: Vec<DVec3>,
    /// Other points: one per pair, or the distinct ones of a product; none in a confocal scan.
    pub others: Vec<DVec3>,
    /// Unit normals of the scanned points, then of the others. `None` if all are (0, 0, 1) or the model uses none.
    pub normals: Option<Vec<DVec3>>,
}

impl Wall {
    /// A confocal scan on a flat wall.
    pub fn confocal(points: Vec<DVec3>) -> Wall {
        Wall { geometry: Geometry::Confocal, scanned: points, others: vec![], normals: None }
    }

    /// The wall of a capture for surfaces with this reflectance, and the capture's pair for each pair of the wall.
    /// Normals are kept if the reflectance needs them and the wall is curved; unknown ones count as (0, 0, 1).
    /// `general` leaves nothing out: two points per pair, and all normals.
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

    /// Numbers of a pair's scanned and other point, counted through both lists.
    pub fn points_of(&self, pair: usize) -> [usize; 2] {
        let scanned = self.scanned.len();
        match self.geometry {
            Geometry::Confocal => [pair, pair],
            Geometry::TwoPoints => [pair, scanned + pair],
            Geometry::Product => [pair % scanned, scanned + pair / scanned],
        }
    }

    /// Point, metres, and unit normal of a number from [`Wall::points_of`].
    pub fn point(&self, number: usize) -> [DVec3; 2] {
        let scanned = self.scanned.len();
        let point = if number < scanned { self.scanned[number] } else { self.others[number - scanned] };
        [point, self.normals.as_ref().map_or(DVec3::Z, |n| n[number])]
    }

    /// Path of a pair over a hidden point, metres.
    pub fn path(&self, pair: usize, x: DVec3) -> f64 {
        self.points_of(pair).map(|p| self.point(p)[0].distance(x)).iter().sum()
    }

    /// The scanned points, then the others.
    pub fn all_points(&self) -> impl Iterator<Item = &DVec3> {
        self.scanned.iter().chain(&self.others)
    }

    /// The wall as kernels read it: scanned points, other points, both from `centre` on, then normals if there are any; (x, y, z, 0) each.
    pub fn words(&self, centre: DVec3) -> Vec<[f32; 4]> {
        let points = self.all_points().map(|p| *p - centre);
        let all = points.chain(self.normals.iter().flatten().copied());
        all.map(|p| [p.x as f32, p.y as f32, p.z as f32, 0.0]).collect()
    }
}
