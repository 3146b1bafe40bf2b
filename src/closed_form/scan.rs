//! Scans that Fourier methods take: a regular lattice of points on a flat wall.

use std::borrow::Cow;

use glam::DVec3;
use rayon::prelude::*;

use super::resample::add;
use crate::capture::lattice::Lattice;
use crate::capture::{Background, Capture, PairKind};
use crate::transport::Grid;
use crate::{Error, Result};

/// A point may be this share of the spacing away from its place.
const OFF_PLACE: f64 = 0.1;

/// Places of a lattice without a pair may be this share of those with one: few enough that most of them lie between such.
const GAPS: f64 = 0.05;

/// What a method that needs a regular scan of a flat wall can do instead.
const OTHERS: &str = "choose a method that takes any pairs and any wall: surface, fbp or bp";

/// A regular scan: which pair is where.
#[derive(Debug, Clone, PartialEq)]
pub struct RegularScan {
    /// Points along x and y.
    pub n: [usize; 2],
    /// x and y of the first point, metres.
    pub first: [f64; 2],
    /// Distances of neighbours along x and y, metres.
    pub step: [f64; 2],
    /// The same of measured points: more than `step` where points were added between them.
    pub measured: [f64; 2],
    /// z of the wall, metres.
    pub z: f64,
    /// The pair of each place, `[ix * n[1] + iy]`.
    pub pair_of: Vec<usize>,
    /// For each place without a pair the pairs around it. Places without a pair count as pairs that follow the others
    /// ([`RegularScan::light`] adds them).
    pub(super) gaps: Vec<Vec<usize>>,
    /// The one point of the other side; `None` in a confocal scan.
    pub spot: Option<DVec3>,
}

impl RegularScan {
    /// The confocal scan of `capture` for a method of this name.
    ///
    /// # Errors
    /// `Kind::Input` if the capture is not confocal, the wall not flat or the lattice not regular.
    pub fn confocal(capture: &Capture, method: &str) -> Result<RegularScan> {
        match capture.pair_kind() {
            PairKind::Confocal => RegularScan::of(capture, None, method),
            _ if capture.offset().is_some() => RegularScan::of(capture, None, method),
            other => Err(Error::input(
                format!("{method} needs a confocal scan, and these pairs are not: {other}"),
                OTHERS,
            )),
        }
    }

    /// The confocal scan of `capture`, or the scan with one laser or one sensor point.
    ///
    /// # Errors
    /// As [`RegularScan::confocal`].
    pub fn with_one_spot(capture: &Capture, method: &str) -> Result<RegularScan> {
        let spot = match capture.pair_kind() {
            PairKind::Confocal => None,
            PairKind::OneLaser => capture.laser.first().copied(),
            PairKind::OneSensor => capture.sensor.first().copied(),
            _ if capture.offset().is_some() => None,
            other => {
                return Err(Error::input(
                    format!(
                        "{method} needs a confocal scan or one laser or sensor point, and these pairs are \
                         not: {other}"
                    ),
                    OTHERS,
                ));
            }
        };
        RegularScan::of(capture, spot, method)
    }

    fn of(capture: &Capture, spot: Option<DVec3>, method: &str) -> Result<RegularScan> {
        let refuse = |what: &str| Err(Error::input(format!("{method} needs {what}"), OTHERS));
        if !capture.is_planar() {
            return refuse("a flat wall, and the wall of this capture is curved");
        }
        // A sensor beside the laser sees nearly what both would see in the middle.
        let middle =
            || capture.laser.iter().zip(&capture.sensor).map(|(l, s)| l.midpoint(*s)).collect::<Vec<_>>();
        let points = &spot.map_or_else(middle, |_| capture.scanned_points().to_vec());
        let lattice = Lattice::of(points);
        let (Some(places), [Some(dx), Some(dy)]) = (lattice.holed(), lattice.spacing) else {
            return refuse(
                "a regular scan of at least 2 × 2 points, and the points of this one form no lattice",
            );
        };
        let Lattice { range, counts, .. } = lattice;
        let missing = counts[0] * counts[1] - places.len();
        let may_miss = (GAPS * places.len() as f64) as usize;
        if missing > may_miss {
            let [nx, ny] = counts;
            return refuse(&format!(
                "a full lattice of points, and {missing} places of {nx} × {ny} have none (at most {may_miss} may)"
            ));
        }
        let first = [range[0][0], range[1][0]];
        let step = [dx, dy];
        let off = |(p, at): (&DVec3, &[usize; 2])| {
            (0..2).any(|a| (p[a] - first[a] - at[a] as f64 * step[a]).abs() > OFF_PLACE * step[a])
        };
        if points.iter().zip(places).any(off) {
            return refuse("a regular scan, and the points of this one are not equally spaced");
        }
        let (pair_of, gaps) = pairs_of(counts, places);
        let z = points.iter().map(|p| p.z).sum::<f64>() / points.len() as f64;
        Ok(RegularScan { n: counts, first, step, measured: step, z, pair_of, gaps, spot })
    }

    /// The columns of a grid as a lattice, for interpolation between them. No pair belongs to a place.
    pub fn of_columns(grid: &Grid) -> RegularScan {
        let of = |v: glam::DVec3| [v.x, v.y];
        let (n, step) = ([grid.n[0], grid.n[1]], of(grid.pitch));
        let first = of(grid.origin);
        RegularScan { n, first, step, measured: step, z: 0.0, pair_of: vec![], gaps: vec![], spot: None }
    }

    /// The light of `capture`, whose scan this is: its counts less the background of each pair, if `with_background`. Places
    /// without a pair are added to it with the mean of the pairs around them.
    pub(super) fn light(&self, capture: Cow<'_, Capture>, with_background: bool) -> Capture {
        let background = Background::of(&capture, with_background);
        let mut light = capture.into_owned();
        let bins = light.bins;
        if background != Background::NONE {
            light.histograms.par_chunks_exact_mut(bins).enumerate().for_each(|(pair, counts)| {
                let below = background.of_pair(pair) as f32;
                counts.iter_mut().for_each(|v| *v -= below);
            });
        }
        if self.gaps.is_empty() {
            return light;
        }
        let (measured, places, kind) = (light.pair_count(), self.places(), light.pair_kind());
        let [laser, sensor] = [light.laser[0], light.sensor[0]];
        light.histograms.reserve_exact(self.gaps.len() * bins);
        // Gaps are in the order of their places.
        let missing = self.pair_of.iter().zip(places).filter(|(pair, _)| **pair >= measured);
        for (around, (_, place)) in self.gaps.iter().zip(missing) {
            let mut mean = vec![0.0f32; bins];
            around.iter().for_each(|pair| add(&mut mean, light.histogram(*pair), 1.0 / around.len() as f32));
            light.histograms.extend(mean);
            // The other side of a scan with one spot stays.
            light.laser.push(if kind == PairKind::OneLaser { laser } else { place });
            light.sensor.push(if kind == PairKind::OneSensor { sensor } else { place });
        }
        light.scan = [light.laser.len(), 1];
        // Scans that this is made of are flat: their normals say nothing.
        (light.laser_normal, light.sensor_normal) = (None, None);
        light
    }

    /// The points, `[ix * n[1] + iy]`.
    pub(super) fn places(&self) -> Vec<DVec3> {
        let at = |axis: usize, i: usize| self.first[axis] + i as f64 * self.step[axis];
        let of = |i: usize| DVec3::new(at(0, i / self.n[1]), at(1, i % self.n[1]), self.z);
        (0..self.points()).map(of).collect()
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.n[0] * self.n[1]
    }

    /// Points of the lattice with as many empty places again along each axis: transforms are periodic, and light from
    /// one side of the scan must not come back at the other.
    pub fn padded(&self) -> [usize; 2] {
        self.n.map(|n| super::fourier::fast_length(2 * n))
    }

    /// Distance across the scan along each axis, metres.
    pub fn size(&self) -> [f64; 2] {
        [0, 1].map(|a| self.n[a] as f64 * self.step[a])
    }
}

/// The pair of each place of a lattice, and the pairs around each place that has none: the nearest square of places around it
/// that has any. Those places follow the pairs in number.
fn pairs_of([nx, ny]: [usize; 2], places: &[[usize; 2]]) -> (Vec<usize>, Vec<Vec<usize>>) {
    let mut taken = vec![None; nx * ny];
    places.iter().enumerate().for_each(|(pair, [x, y])| taken[x * ny + y] = Some(pair));
    let around = |place: usize| {
        let [x, y] = [place / ny, place % ny];
        let within = |reach: usize| {
            let xs = x.saturating_sub(reach)..=(x + reach).min(nx - 1);
            let ys = move || y.saturating_sub(reach)..=(y + reach).min(ny - 1);
            xs.flat_map(move |x| ys().map(move |y| x * ny + y))
        };
        let found = |reach: usize| within(reach).filter_map(|p| taken[p]).collect::<Vec<usize>>();
        (1..nx.max(ny)).map(found).find(|pairs| !pairs.is_empty()).unwrap_or_default()
    };
    let mut gaps = vec![];
    let pair_of = (0..nx * ny).map(|place| {
        taken[place].unwrap_or_else(|| {
            gaps.push(around(place));
            places.len() + gaps.len() - 1
        })
    });
    (pair_of.collect(), gaps)
}

#[cfg(test)]
mod tests {
    use super::super::reference::random_capture;
    use super::*;

    /// The scan of all but these pairs, and its light.
    fn without(gone: &[usize], spot: Option<DVec3>) -> (Capture, RegularScan, Capture) {
        let whole = random_capture(spot);
        let kept: Vec<usize> = (0..whole.pair_count()).filter(|p| !gone.contains(p)).collect();
        let capture = whole.keep(&kept, [kept.len(), 1]);
        let places: Vec<[usize; 2]> = kept.iter().map(|p| [p / 3, p % 3]).collect();
        let (pair_of, gaps) = pairs_of([4, 3], &places);
        let scan = RegularScan { pair_of, gaps, ..RegularScan::with_one_spot(&whole, "it").unwrap() };
        let light = scan.light(Cow::Borrowed(&capture), false);
        light.check().unwrap();
        (whole, scan, light)
    }

    #[test]
    fn places_without_a_pair_have_the_mean_of_those_around() {
        for spot in [None, Some(DVec3::new(0.03, 0.2, 0.05))] {
            // A corner, and one in the middle beside it.
            let (whole, scan, light) = without(&[0, 4], spot);
            for place in 0..12 {
                let pair = scan.pair_of[place];
                assert!((light.sensor[pair] - whole.sensor[place]).length() < 1e-12);
                assert!((light.laser[pair] - whole.laser[place]).length() < 1e-12);
                let around: &[usize] = match place {
                    0 => &[1, 3],
                    4 => &[1, 2, 3, 5, 6, 7, 8],
                    _ => &[place],
                };
                for bin in 0..whole.bins {
                    let sum: f32 = around.iter().map(|p| whole.histogram(*p)[bin]).sum();
                    let found = light.histogram(pair)[bin];
                    assert!((found - sum / around.len() as f32).abs() < 1e-6, "{place} {bin}");
                }
            }
            assert_eq!(light.pair_kind(), whole.pair_kind());
        }
    }

    #[test]
    fn a_scan_with_many_gaps_is_refused() {
        let at = |i: usize| DVec3::new((i / 20) as f64, (i % 20) as f64, 0.0) * 0.05;
        let of = |gone: usize| {
            let points: Vec<DVec3> = (0..400).filter(|i| i * gone % 400 >= gone).map(at).collect();
            let n = points.len();
            let counts = vec![1.0; n * 2];
            RegularScan::confocal(&Capture::new([n, 1], points.clone(), points, 2, 0.01, counts), "it")
        };
        assert_eq!(of(19).unwrap().gaps.len(), 19);
        let refused = of(25).unwrap_err().to_string();
        assert!(refused.contains("25 places of 20 × 20"), "{refused}");
    }
}
