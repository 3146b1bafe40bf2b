//! How the laser and sensor points of a capture are combined into pairs.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::Capture;

/// Normals of one wall point may differ by this much between pairs and still count as one normal.
const SAME_NORMAL: f64 = 1e-3;

/// How the laser and sensor points of a capture are combined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PairKind {
    /// Laser and sensor point coincide in every pair.
    Confocal,
    /// One laser point; every pair has a sensor point of its own.
    OneLaser,
    /// One sensor point; every pair has a laser point of its own.
    OneSensor,
    /// Every combination of the distinct laser points and the distinct sensor points exactly once, in any order. There
    /// is more than one of each.
    Exhaustive {
        /// Distinct laser points.
        lasers: usize,
        /// Distinct sensor points.
        sensors: usize,
    },
    /// Any other combination.
    Irregular,
}

impl std::fmt::Display for PairKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            PairKind::Confocal => f.write_str("confocal"),
            PairKind::OneLaser => f.write_str("one laser point, many sensor points"),
            PairKind::OneSensor => f.write_str("one sensor point, many laser points"),
            PairKind::Exhaustive { lasers, sensors } => {
                write!(f, "exhaustive: {lasers} laser points x {sensors} sensor points")
            }
            PairKind::Irregular => f.write_str("irregular: each pair has its own laser and sensor point"),
        }
    }
}

/// Pairs that are every combination of two lists of points: S scanned points and O other points, P = S · O.
#[derive(Debug, Clone, PartialEq)]
pub struct Product {
    /// Distinct points of the scanned side (see [`Capture::scanned_points`]), `[S]`, metres.
    pub scanned: Vec<DVec3>,
    /// Distinct points of the other side, `[O]`, metres.
    pub other: Vec<DVec3>,
    /// Unit wall normals at the scanned points, if known, `[S]`.
    pub scanned_normal: Option<Vec<DVec3>>,
    /// Unit wall normals at the other points, if known, `[O]`.
    pub other_normal: Option<Vec<DVec3>>,
    /// The pair of the capture with other point `o` and scanned point `a`, at `o * S + a`.
    pub pair_of: Vec<usize>,
    /// Whether the scanned side is the laser's.
    pub laser_scanned: bool,
}

#[doc(hidden)]
impl Capture {
    /// How laser and sensor points are combined. Points closer than a thousandth of the spacing count as one, those of a confocal pair if
    /// they are closer than a tenth. A single
    /// pair is confocal or has one laser point.
    pub fn pair_kind(&self) -> PairKind {
        if self.is_nearly_confocal() {
            return PairKind::Confocal;
        }
        match self.product() {
            None => PairKind::Irregular,
            Some(product) => {
                let (scanned, other) = (product.scanned.len(), product.other.len());
                let (lasers, sensors) =
                    if product.laser_scanned { (scanned, other) } else { (other, scanned) };
                match (lasers, sensors) {
                    (1, _) => PairKind::OneLaser,
                    (_, 1) => PairKind::OneSensor,
                    _ => PairKind::Exhaustive { lasers, sensors },
                }
            }
        }
    }

    /// The two lists of points whose combinations are the pairs, each exactly once. Points are in the order of first
    /// appearance. `None` for other captures (confocal captures of more than one pair, irregular ones), or if one point
    /// has several normals. A capture with one laser point or one sensor point is a product, too.
    ///
    /// The scanned side is the one with more distinct points; the sensor's on a tie.
    pub fn product(&self) -> Option<Product> {
        let pairs = self.pair_count();
        let tolerance = self.point_tolerance();
        let lasers = Distinct::of(&self.laser, tolerance);
        let sensors = Distinct::of(&self.sensor, tolerance);
        if pairs == 0 || lasers.first.len().checked_mul(sensors.first.len()) != Some(pairs) {
            return None;
        }
        let laser_scanned = lasers.first.len() > sensors.first.len();
        let laser = (lasers, &self.laser, self.laser_normal.as_deref());
        let sensor = (sensors, &self.sensor, self.sensor_normal.as_deref());
        let (scanned, other) = if laser_scanned { (laser, sensor) } else { (sensor, laser) };
        let side = scanned.0.first.len();
        let mut pair_of = vec![usize::MAX; pairs];
        for (pair, (&a, &o)) in scanned.0.index.iter().zip(&other.0.index).enumerate() {
            let place = &mut pair_of[o * side + a];
            if *place != usize::MAX {
                return None;
            }
            *place = pair;
        }
        Some(Product {
            scanned: scanned.0.pick(scanned.1),
            other: other.0.pick(other.1),
            scanned_normal: scanned.2.map(|n| scanned.0.normals(n)).transpose().ok()?,
            other_normal: other.2.map(|n| other.0.normals(n)).transpose().ok()?,
            pair_of,
            laser_scanned,
        })
    }

    /// Wall points at most this far apart, in metres, count as one.
    pub(crate) fn point_tolerance(&self) -> f64 {
        1e-3 * self.spacing().unwrap_or(self.bin_width)
    }
}

/// Lists of numbers by cell. A list may hold numbers of other cells, too.
struct Buckets {
    /// Where the last number of every bucket is.
    last: Vec<u32>,
    /// Every number, and where the one before it in its bucket is.
    before: Vec<[u32; 2]>,
}

impl Buckets {
    const NONE: u32 = u32::MAX;

    /// No numbers yet, for about `count`.
    fn new(count: usize) -> Buckets {
        Buckets {
            last: vec![Self::NONE; count.max(1).next_power_of_two()],
            before: Vec::with_capacity(count),
        }
    }

    fn bucket(&self, cell: [i64; 3]) -> usize {
        let mix = |hash: u64, v: &i64| (hash.rotate_left(23) ^ *v as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (cell.iter().fold(0, mix) >> 32) as usize & (self.last.len() - 1)
    }

    fn add(&mut self, cell: [i64; 3], number: usize) {
        let bucket = self.bucket(cell);
        let before = std::mem::replace(&mut self.last[bucket], self.before.len() as u32);
        self.before.push([number as u32, before]);
    }

    /// The numbers of a cell's bucket.
    fn of(&self, cell: [i64; 3]) -> impl Iterator<Item = usize> {
        let entry = |at: u32| self.before.get(at as usize);
        std::iter::successors(entry(self.last[self.bucket(cell)]), move |[_, before]| entry(*before))
            .map(|[number, _]| *number as usize)
    }
}

/// The distinct points of a list, within a tolerance.
#[derive(Clone)]
pub(crate) struct Distinct {
    /// Index in the list at which each distinct point first appears.
    pub first: Vec<usize>,
    /// The distinct point of each entry of the list.
    pub index: Vec<usize>,
}

impl Distinct {
    /// Distinct points in the order of first appearance. A point joins the first one that is no farther than
    /// `tolerance`; a point that is not finite joins none. O(P) expected, by cells of eight times the tolerance.
    pub fn of(points: &[DVec3], tolerance: f64) -> Distinct {
        let largest =
            points.iter().filter(|p| p.is_finite()).map(|p| p.abs().max_element()).fold(0.0, f64::max);
        // Not below the resolution of double precision, so that cell numbers fit their type.
        let tolerance = if tolerance.is_finite() { tolerance } else { 0.0 };
        let tolerance = tolerance.max(1e-14 * largest).max(f64::MIN_POSITIVE);
        // The tolerance is added in units of cells, because in metres the sum may overflow. The shift keeps round
        // numbers, as most coordinates are, away from the edges of cells.
        let place = |v: f64| v / (8.0 * tolerance) + 0.37;
        let mut cells = Buckets::new(points.len());
        let mut first: Vec<usize> = Vec::new();
        let mut index: Vec<usize> = Vec::with_capacity(points.len());
        for (i, &p) in points.iter().enumerate() {
            if !p.is_finite() {
                index.push(first.len());
                first.push(i);
                continue;
            }
            // Lists of combinations repeat a point many times in a row.
            if i > 0 && points[i - 1] == p {
                index.push(index[i - 1]);
                continue;
            }
            // Near the edge of its cell, a point may belong to one in the next cell.
            let at = p.to_array().map(place);
            let [lo, hi] = [-0.125, 0.125].map(|aside| at.map(|v| (v + aside).floor() as i64));
            let around = |axis: usize| lo[axis]..=hi[axis];
            let known = around(0)
                .flat_map(|x| around(1).flat_map(move |y| around(2).map(move |z| [x, y, z])))
                .flat_map(|at| cells.of(at))
                .filter(|&d| points[first[d]].distance(p) <= tolerance)
                .min();
            index.push(known.unwrap_or(first.len()));
            if known.is_none() {
                cells.add(at.map(|v| v.floor() as i64), first.len());
                first.push(i);
            }
        }
        Distinct { first, index }
    }

    /// The values at the distinct points.
    pub fn pick(&self, values: &[DVec3]) -> Vec<DVec3> {
        self.first.iter().map(|&i| values[i]).collect()
    }

    /// The normals at the distinct points; an error if a point has two different ones.
    fn normals(&self, normals: &[DVec3]) -> Result<Vec<DVec3>, ()> {
        let picked = self.pick(normals);
        let one = self.index.iter().zip(normals).all(|(&d, n)| picked[d].distance(*n) <= SAME_NORMAL);
        if one { Ok(picked) } else { Err(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    fn capture(pairs: &[(DVec3, DVec3)]) -> Capture {
        let (laser, sensor) = pairs.iter().copied().unzip();
        Capture::new([pairs.len(), 1], laser, sensor, 1, 0.01, vec![1.0; pairs.len()])
    }

    fn grid(n: usize, shift: f64) -> Vec<DVec3> {
        (0..n * n).map(|k| dvec3((k / n) as f64 * 0.1 + shift, (k % n) as f64 * 0.1, 0.0)).collect()
    }

    /// Every combination, in an order that is neither laser by laser nor sensor by sensor.
    fn shuffled(lasers: &[DVec3], sensors: &[DVec3]) -> Vec<(DVec3, DVec3)> {
        let all: Vec<_> = lasers.iter().flat_map(|&l| sensors.iter().map(move |&s| (l, s))).collect();
        let step = (7..).find(|s| all.len() % s != 0).unwrap_or(1);
        (0..all.len()).map(|k| all[k * step % all.len()]).collect()
    }

    #[test]
    fn every_kind_is_told() {
        let (spot, points) = (dvec3(0.05, 0.02, 0.0), grid(4, 0.0));
        let kind = |pairs: Vec<(DVec3, DVec3)>| capture(&pairs).pair_kind();
        assert_eq!(kind(points.iter().map(|&p| (p, p)).collect()), PairKind::Confocal);
        assert_eq!(kind(points.iter().map(|&p| (spot, p)).collect()), PairKind::OneLaser);
        assert_eq!(kind(points.iter().map(|&p| (p, spot)).collect()), PairKind::OneSensor);
        let (lasers, sensors) = (grid(3, 0.03), grid(4, 0.0));
        let exhaustive = PairKind::Exhaustive { lasers: 9, sensors: 16 };
        assert_eq!(kind(shuffled(&lasers, &sensors)), exhaustive);
        let mut missing = shuffled(&lasers, &sensors);
        missing.pop();
        assert_eq!(kind(missing), PairKind::Irregular);
        let mut twice = shuffled(&lasers, &sensors);
        twice[5] = twice[6];
        assert_eq!(kind(twice), PairKind::Irregular);
        assert_eq!(kind(vec![(spot, points[3])]), PairKind::OneLaser);
    }

    #[test]
    fn a_product_says_which_pair_each_combination_is() {
        for (lasers, sensors, laser_scanned) in [
            (grid(2, 0.03), grid(4, 0.0), false),
            (grid(4, 0.03), grid(2, 0.0), true),
            (grid(3, 0.0), grid(3, 0.0), false),
        ] {
            let mut pairs = shuffled(&lasers, &sensors);
            // Points as measured: no two are equal bit for bit.
            for (k, (l, s)) in pairs.iter_mut().enumerate() {
                l.x += 1e-9 * (k % 13) as f64;
                s.y -= 1e-9 * (k % 7) as f64;
            }
            let capture = capture(&pairs);
            let product = capture.product().unwrap();
            assert_eq!(product.laser_scanned, laser_scanned);
            assert_eq!(product.scanned.len(), lasers.len().max(sensors.len()));
            let mut met = vec![false; pairs.len()];
            for (o, other) in product.other.iter().enumerate() {
                for (a, scanned) in product.scanned.iter().enumerate() {
                    let pair = product.pair_of[o * product.scanned.len() + a];
                    let (l, s) = pairs[pair];
                    let (scan, rest) = if laser_scanned { (l, s) } else { (s, l) };
                    assert!(scan.distance(*scanned) < 1e-7 && rest.distance(*other) < 1e-7);
                    assert!(!std::mem::replace(&mut met[pair], true));
                }
            }
            assert!(met.into_iter().all(|m| m));
        }
    }

    #[test]
    fn normals_go_with_their_points_and_must_agree() {
        let (lasers, sensors) = (grid(2, 0.03), grid(3, 0.0));
        let lean = |p: DVec3| dvec3(p.x, p.y, 1.0).normalize();
        let mut capture = capture(&shuffled(&lasers, &sensors));
        capture.laser_normal = Some(capture.laser.iter().map(|&p| lean(p)).collect());
        let product = capture.product().unwrap();
        assert_eq!(product.scanned_normal, None);
        let normals = product.other_normal.unwrap();
        assert!(product.other.iter().zip(&normals).all(|(p, n)| lean(*p).distance(*n) < 1e-12));
        capture.laser_normal.as_mut().unwrap()[3] = DVec3::X;
        assert_eq!(capture.product(), None);
        assert_eq!(capture.pair_kind(), PairKind::Irregular);
    }

    #[test]
    fn one_laser_is_a_product_and_confocal_is_none() {
        let points = grid(4, 0.0);
        let one: Vec<_> = points.iter().map(|&p| (DVec3::ZERO, p)).collect();
        let product = capture(&one).product().unwrap();
        assert_eq!((product.scanned.len(), product.other.len()), (16, 1));
        assert_eq!(product.pair_of, (0..16).collect::<Vec<_>>());
        assert_eq!(capture(&points.iter().map(|&p| (p, p)).collect::<Vec<_>>()).product(), None);
    }

    #[test]
    fn kinds_are_written_in_small_letters() {
        let json = |kind| serde_json::to_string(&kind).unwrap();
        assert_eq!(json(PairKind::OneLaser), "\"one-laser\"");
        let exhaustive = PairKind::Exhaustive { lasers: 2, sensors: 3 };
        assert_eq!(json(exhaustive), "{\"exhaustive\":{\"lasers\":2,\"sensors\":3}}");
    }
}
