//! The wall points of a scan, in the order in which they were measured.

use std::io::Read;
use std::path::Path;

use glam::{DVec3, dvec3};

use super::text::{Plain, real};
use crate::capture::lattice::Lattice;
use crate::capture::{Capture, Turn};
use crate::error::{Error, Result};

/// Longest file of points, bytes.
const LONGEST: u64 = 1 << 30;
/// Whole metres beyond which points of laser and sensor are unlikely.
const FARTHEST: f64 = 8.0;
/// Most points: a sane limit for a grid that is only asked for.
const MOST: usize = 1 << 22;

/// Laser and sensor point of each point of a scan, in the order in which they were measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Laser points, metres.
    pub laser: Vec<DVec3>,
    /// Sensor points, metres.
    pub sensor: Vec<DVec3>,
    /// Points of a line, if there are lines.
    pub per_line: Option<usize>,
    /// Whether every second line runs backwards.
    pub both_ways: bool,
}

impl Scan {
    /// A confocal scan of `columns` x `rows` points of the flat wall z = 0 around the origin. The outermost points along
    /// the longer side are `wall` metres apart. It is measured row by row from the lowest, each from -x to +x; `snake`:
    /// every other row from +x to -x.
    ///
    /// # Errors
    /// `Kind::Options` for a wall that is no positive length, no points, or far too many.
    pub fn grid([columns, rows]: [usize; 2], wall: f64, snake: bool) -> Result<Scan> {
        let points = columns.checked_mul(rows).filter(|n| *n <= MOST).unwrap_or(0);
        let longer = columns.max(rows);
        if points == 0 || longer < 2 {
            return Err(Error::options(
                format!("a scan of {columns} x {rows} points is not possible"),
                "give columns x rows, such as 64x64, or a file of points",
            ));
        }
        if !(wall.is_finite() && wall > 0.0) {
            return Err(Error::options(
                format!("the scan is {wall} m wide"),
                "give the distance of its outermost points in metres",
            ));
        }
        let step = wall / (longer - 1) as f64;
        let at = |i: usize, n: usize| (i as f64 - (n - 1) as f64 / 2.0) * step;
        let point = |p: usize| {
            let (row, k) = (p / columns, p % columns);
            let column = if snake && row % 2 == 1 { columns - 1 - k } else { k };
            dvec3(at(column, columns), at(row, rows), 0.0)
        };
        let all: Vec<_> = (0..points).map(point).collect();
        Ok(Scan { laser: all.clone(), sensor: all, per_line: Some(columns), both_ways: snake })
    }

    /// The scan of [`Scan::grid`], measured column by column from -x, each from the lowest; `snake`: every other column from the top.
    ///
    /// # Errors
    /// Those of [`Scan::grid`].
    pub fn by_columns([columns, rows]: [usize; 2], wall: f64, snake: bool) -> Result<Scan> {
        let mut scan = Scan::grid([rows, columns], wall, snake)?;
        scan.laser.iter_mut().chain(&mut scan.sensor).for_each(|p| *p = dvec3(p.y, p.x, p.z));
        Ok(scan)
    }

    /// Reads the points of a scan from text, a line for each in the order in which they were measured: `x, y`, or `x, y, z`
    /// for laser and sensor at one point, or `x, y, z` of the laser point and `x, y, z` of the sensor point; metres. A
    /// first line of words, empty lines and those that begin with `#` are not read.
    ///
    /// # Errors
    /// `Kind::Input`, beginning with the path: no such file, no points, or a line that is not one.
    pub fn read(path: &Path) -> Result<Scan> {
        let read = || {
            let mut text = vec![];
            Plain::new(super::open(path)?)?
                .take(LONGEST)
                .read_to_end(&mut text)
                .map_err(super::unreadable)?;
            Self::of_text(&String::from_utf8_lossy(&text))
        };
        read().map_err(|e: Error| e.at(path.display()))
    }

    fn of_text(text: &str) -> Result<Scan> {
        let mut scan = Scan { laser: vec![], sensor: vec![], per_line: None, both_ways: false };
        let mut is_whole = true;
        for (number, line) in text.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            // A comma is decimal where something else separates the numbers.
            let decimal = line.contains([';', '\t']) || (line.contains(' ') && !line.contains(", "));
            let parts = line.split(if decimal { &[';', '\t', ' '][..] } else { &[',', ' '] });
            let parts = parts.map(|part| part.trim_matches('"')).filter(|part| !part.is_empty());
            let values: Option<Vec<f64>> = parts.map(|part| real(part.as_bytes())).collect();
            is_whole &= values.iter().flatten().all(|v| v.fract() == 0.0) && !line.contains('.');
            let (laser, sensor) = match values.as_deref() {
                Some(&[x, y]) => (dvec3(x, y, 0.0), dvec3(x, y, 0.0)),
                Some(&[x, y, z]) => (dvec3(x, y, z), dvec3(x, y, z)),
                Some(&[a, b, c, x, y, z]) => (dvec3(a, b, c), dvec3(x, y, z)),
                None if scan.laser.is_empty() && line.starts_with(|c: char| c.is_alphabetic()) => continue,
                _ => {
                    return Err(Error::input(
                        format!("line {} is {line:?}", number + 1),
                        "write x, y, z of each point in metres, or those of its laser point and of its sensor point",
                    ));
                }
            };
            scan.laser.push(laser);
            scan.sensor.push(sensor);
        }
        if is_whole && scan.sensor != scan.laser && scan.reach() > FARTHEST {
            return Err(Error::input(
                "lines hold six whole numbers: three numbers with decimal commas, or points many metres apart",
                "write decimal points, or semicolons between the numbers",
            ));
        }
        if scan.laser.is_empty() {
            return Err(Error::input("holds no point", "write a line for each: x, y, z in metres"));
        }
        Ok(scan)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.laser.len()
    }

    /// Whether laser and sensor see the same point, everywhere.
    pub fn is_confocal(&self) -> bool {
        let reach = self.reach();
        self.laser.iter().zip(&self.sensor).all(|(l, s)| l.distance(*s) <= 1e-3 * reach)
    }

    /// The diagonal of the box around all points, metres.
    pub(super) fn reach(&self) -> f64 {
        let all = || self.laser.iter().chain(&self.sensor);
        let low = all().copied().reduce(DVec3::min).unwrap_or_default();
        let high = all().copied().reduce(DVec3::max).unwrap_or_default();
        low.distance(high)
    }

    /// The pairs of a capture without counts, turned and, if they form a lattice, by columns and rows; and the pair of each
    /// point. Laser and sensor see `points`, if these are given: the scan then says their order only.
    pub(super) fn pairs(&self, turn: Turn, points: Option<&[DVec3]>) -> (Capture, Vec<usize>) {
        let count = self.points();
        // The side that is scanned, if the other stands still; both if they move together.
        let moves = |side: &[DVec3]| side.iter().any(|p| *p != side[0]);
        let side = if moves(&self.laser) && !moves(&self.sensor) { &self.laser } else { &self.sensor };
        let moved_apart = moves(&self.laser) && moves(&self.sensor) && !self.is_confocal();
        let lattice = Lattice::of(side);
        let (scan, order) = match lattice.full().filter(|_| !moved_apart) {
            Some(places) => {
                let [_, rows] = lattice.counts;
                let mut order = vec![0; count]; // bounded: the points of the scan
                places.iter().enumerate().for_each(|(point, [x, y])| order[x * rows + y] = point);
                (lattice.counts, order)
            }
            None => ([count, 1], (0..count).collect()),
        };
        let pick = |side: &[DVec3]| order.iter().map(|p| side[*p]).collect::<Vec<_>>();
        // A pair carries the number of its point as its count through the turn. There are fewer than 2^24.
        let numbers = order.iter().map(|p| *p as f32).collect();
        let [laser, sensor] = [&self.laser[..], &self.sensor].map(|side| pick(points.unwrap_or(side)));
        let capture = Capture::new(scan, laser, sensor, 1, 1.0, numbers).turned(turn);
        let mut pair_of = vec![0; count]; // bounded: the points of the scan
        capture.histograms.iter().enumerate().for_each(|(pair, point)| pair_of[*point as usize] = pair);
        (capture.outline(), pair_of)
    }
}
