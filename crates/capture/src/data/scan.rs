//! Geometry of the scan: what part of the wall it covers and how densely, whether it is confocal and planar.

use glam::DVec3;

use super::Capture;
use super::lattice::Lattice;
use super::pairs::Distinct;
use crate::error::{Error, Result};

/// Points at most this share of the wall's size apart count as one.
const SAME_POINT: f64 = 1e-6;

/// Share of the spacing or of a spot within which laser and sensor point are one for closed forms.
const NEARLY: f64 = 0.1;
/// Longest constant way from laser to sensor point, as a share of the wall's size, that is an offset.
const SHORT: f64 = 0.05;

/// Walls and volumes of these widths, metres, use the metre as their unit, as the paper's do.
const ORDINARY_WIDTHS: std::ops::RangeInclusive<f64> = 0.25..=8.0;

/// Unit of length, metres, for what the paper gives in metres: one, or the width of the wall or the volume if that is
/// far from one metre.
pub fn unit_of(width: f64) -> f64 {
    if ORDINARY_WIDTHS.contains(&width) { 1.0 } else { width }
}

/// Decimals of displayed lengths, in metres: `usual` for scenes of about a metre and larger ones. A `width` far
/// below that gets more.
pub fn decimals(usual: usize, width: f64) -> usize {
    match unit_of(width) {
        small if small > 0.0 && small < 1.0 => usual + (-small.log10()).ceil() as usize,
        _ => usual,
    }
}

impl Capture {
    /// The part of the wall that the scan covers: (xmin, xmax, ymin, ymax) in metres. These are the outer edges of the
    /// scan's cells: the points plus half the spacing on every side.
    ///
    /// Points of both sides count, unless a side is a single point. A single row or column is as wide as its own
    /// spacing. If both sides are single points, the extent is a square around the sensor point. Its half side is a
    /// quarter of the longest path, which is as far as the histogram can tell.
    pub fn wall_extent(&self) -> [f64; 4] {
        let [scanned, other] = self.sides();
        let lattice = Lattice::of(&scanned);
        let Some(cells) = lattice.cells() else {
            let half = (self.t_end() / 2.0).max(self.bin_width) / 2.0;
            let [[x, _], [y, _]] = lattice.range;
            return [x - half, x + half, y - half, y + half];
        };
        if scanned == other {
            return cells;
        }
        match Lattice::of(&other).cells() {
            None => cells,
            Some(o) => [cells[0].min(o[0]), cells[1].max(o[1]), cells[2].min(o[2]), cells[3].max(o[3])],
        }
    }

    /// Unit of length, metres, for this wall ([`unit_of`]).
    pub fn unit(&self) -> f64 {
        let [x0, x1, y0, y1] = self.wall_extent();
        unit_of((x1 - x0).max(y1 - y0))
    }

    /// Distance of neighbouring points of the scanned side in metres (the smaller of x and y); `None` for a single
    /// point. For points that form no lattice it is the square root of the area of their cells divided by their number.
    pub fn spacing(&self) -> Option<f64> {
        Lattice::of(&self.sides()[0]).spacing.into_iter().flatten().reduce(f64::min)
    }

    /// Points of the scanned side along x and y: of the lattice that they form, holes included, or of a square lattice
    /// of the same density. At least 1.
    pub fn resolution(&self) -> [usize; 2] {
        Lattice::of(&self.sides()[0]).counts.map(|n| n.max(1))
    }

    /// Whether the laser and sensor points of every pair coincide, to a thousandth of the spacing.
    pub fn is_confocal(&self) -> bool {
        if self.is_coaxial() {
            return true;
        }
        let tolerance = self.point_tolerance();
        self.laser.iter().zip(&self.sensor).all(|(l, s)| l.distance(*s) <= tolerance)
    }

    /// Whether the laser and sensor points of every pair are closer than a tenth of the spacing or of a spot: methods for confocal scans
    /// take them as one.
    pub fn is_nearly_confocal(&self) -> bool {
        if self.is_coaxial() {
            return true;
        }
        let spot = self.laser_spot.unwrap_or(0.0).max(self.sensor_spot.unwrap_or(0.0));
        let reach = self.point_tolerance().max(NEARLY * self.spacing().unwrap_or(0.0).max(spot));
        self.laser.iter().zip(&self.sensor).all(|(l, s)| l.distance(*s) <= reach)
    }

    /// Whether laser and sensor points are the same to the last bit, which needs no search for the spacing.
    fn is_coaxial(&self) -> bool {
        self.laser.iter().zip(&self.sensor).all(|(l, s)| l == s && l.is_finite())
    }

    /// The way from the laser to the sensor point, metres, if it is the same in every pair and short beside the scan; `None` for confocal
    /// scans and others.
    pub fn offset(&self) -> Option<DVec3> {
        let first = *self.sensor.first()? - *self.laser.first()?;
        if self.is_nearly_confocal() {
            return None;
        }
        let [x0, x1, y0, y1] = self.wall_extent();
        let same = NEARLY * first.length();
        let constant = self.laser.iter().zip(&self.sensor).all(|(l, s)| (*s - *l).distance(first) <= same);
        let short = first.length() <= SHORT * (x1 - x0).max(y1 - y0);
        (constant && short && self.spacing().is_some()).then_some(first)
    }

    /// Whether the wall is a plane facing +z: all points at one z (to a ten-thousandth of the wall's width)
    /// and all normals, where known, (0, 0, 1) to a thousandth.
    pub fn is_planar(&self) -> bool {
        let z = self.sensor.first().map_or(0.0, |p| p.z);
        let within =
            |tolerance: f64| self.laser.iter().chain(&self.sensor).all(|p| (p.z - z).abs() <= tolerance);
        // Most walls are at one z exactly, and need no search for their extent.
        let flat = within(0.0) || {
            let [x0, x1, y0, y1] = self.wall_extent();
            within(1e-4 * (x1 - x0).max(y1 - y0))
        };
        let normals = self.laser_normal.iter().chain(&self.sensor_normal).flatten();
        flat && normals.into_iter().all(|n| n.distance(DVec3::Z) <= 1e-3)
    }

    /// Scales the wall about the origin so that its outermost scanned points are `size` metres apart along the longer
    /// side, for files without a scale. Spots are scaled, too. Normals, bins and paths do not change.
    ///
    /// # Errors
    /// `Kind::Options` if `size` is not positive and finite, or if the scan has a single point.
    pub fn set_wall(&mut self, size: f64) -> Result<()> {
        if !(size.is_finite() && size > 0.0) {
            return Err(Error::options(
                format!("a wall of {size} m is not possible"),
                "give the distance in metres between the outermost scan points",
            ));
        }
        let span = self.outermost();
        if span <= 0.0 {
            return Err(Error::options(
                "a wall size was given, but the capture has a single scan point",
                "leave the wall size out: there is nothing to scale",
            ));
        }
        let scale = size / span;
        let devices = self.devices.iter_mut().flatten();
        self.laser.iter_mut().chain(&mut self.sensor).chain(devices).for_each(|p| *p *= scale);
        self.laser_spot.iter_mut().chain(&mut self.sensor_spot).for_each(|width| *width *= scale);
        Ok(())
    }

    /// Distance of the outermost scanned points along the longer side, metres.
    pub(crate) fn outermost(&self) -> f64 {
        Lattice::of(&self.sides()[0]).range.iter().map(|[a, b]| b - a).fold(0.0, f64::max)
    }

    /// The points of the scanned side (sensor or laser), pair by pair. It is the side with more distinct points, the
    /// sensor's on a tie.
    pub fn scanned_points(&self) -> &[DVec3] {
        if self.laser_scans() { &self.laser } else { &self.sensor }
    }

    /// Whether the scanned side is the laser's.
    pub fn laser_scans(&self) -> bool {
        // On a tie, the sensor's side is scanned.
        if self.is_coaxial() {
            return false;
        }
        let [lasers, sensors] = self.distinct();
        lasers.first.len() > sensors.first.len()
    }

    /// The distinct points of the scanned side and of the other.
    fn sides(&self) -> [Vec<DVec3>; 2] {
        let [lasers, sensors] = self.distinct();
        let [laser, sensor] = [lasers.pick(&self.laser), sensors.pick(&self.sensor)];
        if laser.len() > sensor.len() { [laser, sensor] } else { [sensor, laser] }
    }

    /// The distinct laser and sensor points.
    fn distinct(&self) -> [Distinct; 2] {
        let all = || self.laser.iter().chain(&self.sensor);
        let (low, high) = all()
            .filter(|p| p.is_finite())
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(*p), b.max(*p)));
        let tolerance = SAME_POINT * (high - low).max_element().max(0.0);
        let lasers = Distinct::of(&self.laser, tolerance);
        let sensors =
            if self.laser == self.sensor { lasers.clone() } else { Distinct::of(&self.sensor, tolerance) };
        [lasers, sensors]
    }
}
