//! Scans that Fourier methods take: a regular lattice of points on a flat wall.

use glam::DVec3;

use crate::capture::lattice::Lattice;
use crate::capture::{Capture, PairKind};
use crate::transport::Grid;
use crate::{Error, Result};

/// A point may be this share of the spacing away from its place.
const OFF_PLACE: f64 = 0.1;

/// What a method that needs a regular scan of a flat wall can do instead.
const OTHERS: &str = "choose a method that takes any pairs and any wall: fbp, bp or vector";

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
        let points = capture.scanned_points();
        let Lattice { range, counts, spacing, places } = Lattice::of(points);
        let (Some(places), [Some(dx), Some(dy)]) = (places, spacing) else {
            return refuse(
                "a regular scan of at least 2 × 2 points, and the points of this one form no full lattice",
            );
        };
        let first = [range[0][0], range[1][0]];
        let step = [dx, dy];
        let off = |(p, at): (&DVec3, &[usize; 2])| {
            (0..2).any(|a| (p[a] - first[a] - at[a] as f64 * step[a]).abs() > OFF_PLACE * step[a])
        };
        if points.iter().zip(&places).any(off) {
            return refuse("a regular scan, and the points of this one are not equally spaced");
        }
        let mut pair_of = vec![0; places.len()];
        for (pair, [x, y]) in places.iter().enumerate() {
            pair_of[x * counts[1] + y] = pair;
        }
        let z = points.iter().map(|p| p.z).sum::<f64>() / points.len() as f64;
        Ok(RegularScan { n: counts, first, step, measured: step, z, pair_of, spot })
    }

    /// The columns of a grid as a lattice, for interpolation between them. No pair belongs to a place.
    pub fn of_columns(grid: &Grid) -> RegularScan {
        let of = |v: glam::DVec3| [v.x, v.y];
        let (n, step) = ([grid.n[0], grid.n[1]], of(grid.pitch));
        let first = of(grid.origin);
        RegularScan { n, first, step, measured: step, z: 0.0, pair_of: vec![], spot: None }
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
