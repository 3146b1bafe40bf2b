//! Pairs of wall points to render.

use crate::{Error, Result};
use glam::DVec3;

/// Laser and sensor points of a scan, with the meanings of [`crate::capture::Capture`].
#[derive(Debug, Clone, PartialEq)]
pub struct Pairs {
    /// Scan shape (X, Y): pair `ix * Y + iy`.
    pub scan: [usize; 2],
    /// Laser points in metres, one per pair.
    pub laser: Vec<DVec3>,
    /// Sensor points in metres, one per pair.
    pub sensor: Vec<DVec3>,
    /// Unit wall normals at the laser points; `None`: (0, 0, 1).
    pub laser_normal: Option<Vec<DVec3>>,
    /// Unit wall normals at the sensor points; `None`: (0, 0, 1).
    pub sensor_normal: Option<Vec<DVec3>>,
}

impl Pairs {
    /// A confocal scan of n × n points at the centres of the cells of a square wall (side in metres).
    pub fn confocal(n: usize, wall: f64) -> Pairs {
        let points = cell_centres(n, wall);
        Pairs { scan: [n, n], laser: points.clone(), sensor: points, laser_normal: None, sensor_normal: None }
    }

    /// A scan of n × n laser points at the cells' centres with one fixed sensor point.
    pub fn one_sensor(n: usize, wall: f64, sensor: DVec3) -> Pairs {
        let sensor = vec![sensor; n * n];
        Pairs { scan: [n, n], laser: cell_centres(n, wall), sensor, laser_normal: None, sensor_normal: None }
    }

    /// Whether laser and sensor point are the same in every pair.
    pub fn is_confocal(&self) -> bool {
        self.laser == self.sensor
    }

    /// Whether only the sensor scans: one laser point, several sensor points.
    pub fn sensor_scans(&self) -> bool {
        let one = |points: &[DVec3]| points.windows(2).all(|p| p[0] == p[1]);
        one(&self.laser) && !one(&self.sensor)
    }

    /// Checks lengths and values.
    ///
    /// # Errors
    /// Arrays whose lengths differ from the scan's X · Y, no pairs, or values that are not finite.
    pub fn check(&self) -> Result<()> {
        let count = self.scan[0].saturating_mul(self.scan[1]);
        let normals = [&self.laser_normal, &self.sensor_normal].into_iter().flatten();
        for points in [&self.laser, &self.sensor].into_iter().chain(normals) {
            if points.len() != count || count == 0 {
                return Err(Error::input(
                    format!(
                        "a scan of {:?} with {} points or normals does not fit together",
                        self.scan,
                        points.len()
                    ),
                    "give X * Y laser points, sensor points and normals, at least one of each",
                ));
            }
            if !points.iter().all(|p| p.is_finite()) {
                return Err(Error::input(
                    "a wall point or normal is not finite",
                    "give finite coordinates in metres",
                ));
            }
        }
        Ok(())
    }
}

fn cell_centres(n: usize, wall: f64) -> Vec<DVec3> {
    let at = |i: usize| ((i as f64 + 0.5) / n as f64 - 0.5) * wall;
    (0..n * n).map(|k| DVec3::new(at(k / n), at(k % n), 0.0)).collect()
}
