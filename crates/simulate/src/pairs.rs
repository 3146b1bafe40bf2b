//! Pairs of wall points to render.

use super::WallShape;
use crate::capture::Capture;
use crate::{Error, Result};
use glam::{DVec2, DVec3, dvec2};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Pairing of laser and sensor in a scan of n × n wall points.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Layout {
    /// Laser and sensor together at every scan point: n² pairs.
    #[default]
    Confocal,
    /// The laser at one point, the sensor at every scan point: n² pairs.
    OneLaser {
        /// The laser point (x, y), metres.
        point: DVec2,
    },
    /// The sensor at one point, the laser at every scan point: n² pairs.
    OneSensor {
        /// The sensor point (x, y), metres.
        point: DVec2,
    },
    /// Each of `lasers` × `lasers` laser points with every scan point: lasers² · n² pairs.
    Exhaustive {
        /// Laser points per side, at the centres of cells of the wall.
        lasers: usize,
    },
    /// Random laser and sensor points on the wall for each pair: n² pairs.
    Irregular {
        /// Seed of the points.
        seed: u64,
    },
}

impl Layout {
    /// Number of pairs of a scan of n × n points.
    pub fn pair_count(self, scan: usize) -> f64 {
        let lasers = match self {
            Layout::Exhaustive { lasers } => lasers as f64,
            _ => 1.0,
        };
        (lasers * scan as f64).powi(2)
    }

    /// The fixed laser or sensor point (x, y), metres, if the layout has one.
    pub fn point(self) -> Option<DVec2> {
        match self {
            Layout::OneLaser { point } | Layout::OneSensor { point } => Some(point),
            _ => None,
        }
    }
}

/// Laser and sensor points of a scan, as in [`Capture`].
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
    /// The pairs of a scan of n × n points, at the centres of the cells of a square wall (side in metres), with
    /// normals if the wall is not flat. Exhaustive pairs are ordered by laser point: the scan is [laser points, sensor
    /// points].
    pub fn new(layout: Layout, n: usize, wall: f64, shape: WallShape) -> Pairs {
        let grid = cell_centres(n, wall);
        let ([nx, ny], laser, sensor) = match layout {
            Layout::Confocal => ([n, n], grid.clone(), grid),
            Layout::OneLaser { point } => ([n, n], vec![point; n * n], grid),
            Layout::OneSensor { point } => ([n, n], grid.clone(), vec![point; n * n]),
            Layout::Exhaustive { lasers } => {
                let each = cell_centres(lasers, wall);
                let laser = each.iter().flat_map(|&l| std::iter::repeat_n(l, grid.len())).collect();
                ([each.len(), grid.len()], laser, grid.repeat(each.len()))
            }
            Layout::Irregular { seed } => {
                let mut rng = Pcg64::seed_from_u64(seed);
                let mut point = || dvec2(rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5) * wall;
                let (laser, sensor) = (0..n * n).map(|_| (point(), point())).unzip();
                ([n * n, 1], laser, sensor)
            }
        };
        let on_wall = |points: &[DVec2]| points.iter().map(|p| shape.point(p.x, p.y, wall)).collect();
        let normals =
            |points: &[DVec2]| points.iter().map(|p| shape.normal(p.x, p.y, wall)).collect::<Option<_>>();
        Pairs {
            scan: [nx, ny],
            laser_normal: normals(&laser),
            sensor_normal: normals(&sensor),
            laser: on_wall(&laser),
            sensor: on_wall(&sensor),
        }
    }

    /// A confocal scan of n × n points of a flat wall.
    pub fn confocal(n: usize, wall: f64) -> Pairs {
        Pairs::new(Layout::Confocal, n, wall, WallShape::Flat)
    }

    /// A scan of n × n laser points of a flat wall with one fixed sensor point.
    pub fn one_sensor(n: usize, wall: f64, sensor: DVec3) -> Pairs {
        let laser = Pairs::confocal(n, wall).laser;
        let sensor = vec![sensor; n * n];
        Pairs { scan: [n, n], laser, sensor, laser_normal: None, sensor_normal: None }
    }

    /// True if laser and sensor point are the same in every pair.
    pub fn is_confocal(&self) -> bool {
        self.laser == self.sensor
    }

    /// True if the sensor is the scanned side, as in [`Capture::scanned_points`].
    pub fn sensor_scans(&self) -> bool {
        !self.capture(0, 1.0, vec![]).laser_scans()
    }

    /// A capture of these pairs with `histograms` `[pair * bins + bin]`; `bin_width` is in metres of path.
    pub(super) fn capture(&self, bins: usize, bin_width: f64, histograms: Vec<f32>) -> Capture {
        let (laser, sensor) = (self.laser.clone(), self.sensor.clone());
        Capture::new(self.scan, laser, sensor, bins, bin_width, histograms).with(|c| {
            c.laser_normal = self.laser_normal.clone();
            c.sensor_normal = self.sensor_normal.clone();
        })
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

fn cell_centres(n: usize, wall: f64) -> Vec<DVec2> {
    let at = |i: usize| ((i as f64 + 0.5) / n as f64 - 0.5) * wall;
    (0..n * n).map(|k| dvec2(at(k / n), at(k % n))).collect()
}
