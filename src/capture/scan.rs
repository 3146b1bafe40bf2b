//! Geometry of the scan: what part of the wall it covers, whether it is confocal and planar, thinning.

use std::collections::HashSet;

use glam::DVec3;

use super::Capture;
use crate::error::{Error, Result};

impl Capture {
    /// Keeps every `n`th scan point in x and in y (`ix % n == 0`, `iy % n == 0`), with their histograms.
    /// Where the scan is (laser points, sensor points), every combination of both, each list is thinned.
    ///
    /// # Errors
    /// `Kind::Options` if `n` is 0.
    pub fn stride(&self, n: usize) -> Result<Capture> {
        if n == 0 {
            return Err(Error::options("a stride of 0 keeps no scan point", "use 1 to keep every point"));
        }
        let [nx, ny] = self.scan;
        let kept: Vec<usize> =
            (0..nx).step_by(n).flat_map(|ix| (0..ny).step_by(n).map(move |iy| ix * ny + iy)).collect();
        let pick = |points: &[DVec3]| kept.iter().map(|&p| points[p]).collect::<Vec<_>>();
        let mut histograms = Vec::with_capacity(kept.len() * self.bins);
        for &p in &kept {
            histograms.extend_from_slice(&self.histograms[p * self.bins..(p + 1) * self.bins]);
        }
        Ok(Capture {
            name: self.name.clone(),
            scan: [nx.div_ceil(n), ny.div_ceil(n)],
            laser: pick(&self.laser),
            sensor: pick(&self.sensor),
            laser_normal: self.laser_normal.as_deref().map(pick),
            sensor_normal: self.sensor_normal.as_deref().map(pick),
            histograms,
            ..*self
        })
    }

    /// The lateral part of the wall that the scan covers: (xmin, xmax, ymin, ymax) in metres, outer edges of
    /// the scan's cells, that is the points of the scanned side plus half the spacing on every side.
    ///
    /// The scanned side is the one (laser or sensor) with more distinct points. A single row or column is
    /// as wide as its own spacing. If there is only one point, the extent is a square around it whose half
    /// side is a quarter of the longest path, the distance over which the histogram says anything at all.
    pub fn wall_extent(&self) -> [f64; 4] {
        let grid = Grid::of(self.scanned_points());
        let (dx, dy) = match (grid.spacing(0), grid.spacing(1)) {
            (Some(dx), Some(dy)) => (dx, dy),
            (Some(d), None) | (None, Some(d)) => (d, d),
            (None, None) => {
                let side = (self.t_end() / 2.0).max(self.bin_width);
                (side, side)
            }
        };
        let ([x0, x1], [y0, y1]) = (grid.range[0], grid.range[1]);
        [x0 - dx / 2.0, x1 + dx / 2.0, y0 - dy / 2.0, y1 + dy / 2.0]
    }

    /// Mean distance in metres of neighbouring points of the scanned side (the smaller of x and y), `None`
    /// if there is only one point.
    pub fn spacing(&self) -> Option<f64> {
        let grid = Grid::of(self.scanned_points());
        [grid.spacing(0), grid.spacing(1)].into_iter().flatten().reduce(f64::min)
    }

    /// Whether the laser and sensor points of every pair coincide, to a thousandth of the spacing.
    pub fn is_confocal(&self) -> bool {
        let tolerance = self.point_tolerance();
        self.laser.iter().zip(&self.sensor).all(|(l, s)| l.distance(*s) <= tolerance)
    }

    /// Whether the wall is a plane facing +z: all points at one z (to a ten-thousandth of the wall's width)
    /// and all normals, where known, (0, 0, 1) to a thousandth.
    pub fn is_planar(&self) -> bool {
        let [x0, x1, y0, y1] = self.wall_extent();
        let tolerance = 1e-4 * (x1 - x0).max(y1 - y0);
        let z = self.sensor.first().map_or(0.0, |p| p.z);
        let flat = self.laser.iter().chain(&self.sensor).all(|p| (p.z - z).abs() <= tolerance);
        let normals = self.laser_normal.iter().chain(&self.sensor_normal).flatten();
        flat && normals.into_iter().all(|n| n.distance(DVec3::Z) <= 1e-3)
    }

    /// Scales the wall about the origin so that its outermost scanned points are `size` metres apart along
    /// the longer side (a file without a scale). Normals, bins and paths are left as they are.
    ///
    /// # Errors
    /// `Kind::Options` if `size` is not positive and finite, or if the scan has a single point.
    pub fn set_wall(&mut self, size: f64) -> Result<()> {
        if !(size.is_finite() && size > 0.0) {
            return Err(Error::options(
                format!("a wall of {size} m"),
                "give the distance in metres between the outermost scan points",
            ));
        }
        let grid = Grid::of(self.scanned_points());
        let span = grid.range.iter().map(|[a, b]| b - a).fold(0.0, f64::max);
        if span <= 0.0 {
            return Err(Error::options(
                "a wall size was given, but the capture has a single scan point",
                "leave the wall size out: there is nothing to scale",
            ));
        }
        let scale = size / span;
        self.laser.iter_mut().chain(&mut self.sensor).for_each(|p| *p *= scale);
        Ok(())
    }

    /// The points of the side (sensor or laser) that was scanned: the one with more distinct points.
    pub fn scanned_points(&self) -> &[DVec3] {
        if distinct(&self.laser) > distinct(&self.sensor) { &self.laser } else { &self.sensor }
    }
}

fn distinct(points: &[DVec3]) -> usize {
    points.iter().map(|p| p.to_array().map(|v| (v + 0.0).to_bits())).collect::<HashSet<_>>().len()
}

/// Lateral range of points and how many of them stand side by side in x and y.
struct Grid {
    range: [[f64; 2]; 2],
    counts: [usize; 2],
}

impl Grid {
    fn of(points: &[DVec3]) -> Grid {
        let range = [0, 1].map(|axis| {
            let values = points.iter().map(|p| p[axis]);
            let (low, high) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            if low <= high { [low, high] } else { [0.0, 0.0] }
        });
        let tolerance = 1e-4 * range.iter().map(|[a, b]| b - a).fold(0.0, f64::max);
        let columns = [clusters(points, 0, tolerance), clusters(points, 1, tolerance)];
        let occupied: HashSet<_> = columns[0].0.iter().zip(&columns[1].0).collect();
        let counts = [columns[0].1, columns[1].1];
        if counts[0].checked_mul(counts[1]) == Some(occupied.len()) {
            return Grid { range, counts };
        }
        // Not a grid aligned with x and y (a warped wall): as many columns as rows would have there.
        let side = (distinct(points) as f64).sqrt().round().max(1.0) as usize;
        Grid { range, counts: [side, side] }
    }

    fn spacing(&self, axis: usize) -> Option<f64> {
        let [low, high] = self.range[axis];
        let spacing = (high - low) / (self.counts[axis].max(2) - 1) as f64;
        (self.counts[axis] > 1 && spacing > 0.0).then_some(spacing)
    }
}

/// Groups the points by one coordinate: the group of each point and the number of groups.
fn clusters(points: &[DVec3], axis: usize, tolerance: f64) -> (Vec<usize>, usize) {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a][axis].total_cmp(&points[b][axis]));
    let mut group = vec![0; points.len()];
    let (mut count, mut first) = (0, f64::NEG_INFINITY);
    for &p in &order {
        if count == 0 || points[p][axis] - first > tolerance {
            count += 1;
            first = points[p][axis];
        }
        group[p] = count - 1;
    }
    (group, count)
}
