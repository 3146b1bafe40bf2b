//! Mirrors and rotates captures, for files that do not say how the scan lies on the wall.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::choose::PairOrder;
use crate::data::{Capture, PairKind};
use crate::error::{Error, Result};

/// How a scan is mirrored, as seen in the pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Flip {
    /// Left and right swap.
    X,
    /// Top and bottom swap.
    Y,
    /// Both.
    Xy,
}

/// How a capture is mirrored and then rotated. The default changes nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Turn {
    /// Whether x changes its sign: left and right swap.
    flip_x: bool,
    /// Whether y changes its sign: up and down swap.
    flip_y: bool,
    /// Quarter turns after the mirroring, 0 to 3, clockwise in the pictures (+x to the left, +y up): +x becomes +y.
    quarters: u8,
}

impl Turn {
    /// A mirroring, then a rotation by an angle in degrees: 90, 180 or 270.
    ///
    /// # Errors
    /// `Kind::Options`: another angle.
    pub fn of(flip: Option<Flip>, degrees: Option<usize>) -> Result<Turn> {
        let flip_x = matches!(flip, Some(Flip::X | Flip::Xy));
        let flip_y = matches!(flip, Some(Flip::Y | Flip::Xy));
        let quarters = match degrees {
            None => 0,
            Some(degrees @ (90 | 180 | 270)) => (degrees / 90) as u8,
            Some(degrees) => {
                return Err(Error::options(
                    format!("a rotation by {degrees} degrees is not supported"),
                    "give 90, 180 or 270 degrees, clockwise in the pictures",
                ));
            }
        };
        Ok(Turn { flip_x, flip_y, quarters })
    }

    /// A sentence that says what is done; `None` if nothing is.
    pub fn note(&self) -> Option<String> {
        let flipped = match (self.flip_x, self.flip_y) {
            (false, false) => None,
            (true, false) => Some("mirrored left to right".to_string()),
            (false, true) => Some("mirrored top to bottom".to_string()),
            (true, true) => Some("mirrored left to right and top to bottom".to_string()),
        };
        let turned = (self.quarters > 0).then(|| {
            let degrees = 90 * u32::from(self.quarters);
            format!("rotated by {degrees} degrees clockwise")
        });
        let done: Vec<String> = flipped.into_iter().chain(turned).collect();
        (!done.is_empty()).then(|| format!("the scan is {}", done.join(", then ")))
    }

    /// Mirrors a point or a direction, then rotates it about the z axis.
    fn apply(&self, mut v: DVec3) -> DVec3 {
        if self.flip_x {
            v.x = -v.x;
        }
        if self.flip_y {
            v.y = -v.y;
        }
        for _ in 0..self.quarters {
            v = DVec3::new(-v.y, v.x, v.z);
        }
        v
    }

    /// The shape of the new scan, and the old pair of every new one.
    fn order(&self, [nx, ny]: [usize; 2]) -> ([usize; 2], Vec<usize>) {
        let mut shape = [nx, ny];
        let flip = |flip: bool, i: usize, n: usize| if flip { n - 1 - i } else { i };
        let mut from: Vec<usize> = (0..nx * ny)
            .map(|p| flip(self.flip_x, p / ny, nx) * ny + flip(self.flip_y, p % ny, ny))
            .collect();
        for _ in 0..self.quarters {
            let [nx, ny] = shape;
            // (x, y) goes to (-y, x): the new column counts the old rows from the top.
            from = (0..nx * ny).map(|p| from[p % nx * ny + (ny - 1 - p / nx)]).collect();
            shape = [ny, nx];
        }
        (shape, from)
    }
}

#[doc(hidden)]
impl Capture {
    /// Mirrors and rotates the capture: laser points, sensor points and normals are mirrored at x = 0 and y = 0, then
    /// rotated about the z axis. Pairs in columns and rows are put in the new order, ix along +x and iy along +y. Lists
    /// and exhaustive captures keep the order of their pairs. The histograms stay with their pairs.
    pub fn turned(mut self, turn: Turn) -> Capture {
        self.turn_points(turn);
        match self.turned_order(turn) {
            Some(PairOrder { pairs, scan }) => self.keep(&pairs, scan),
            None => self,
        }
    }

    /// Mirrors and rotates points and normals, and leaves the order of the pairs.
    pub(crate) fn turn_points(&mut self, turn: Turn) {
        if turn == Turn::default() {
            return;
        }
        let normals = self.laser_normal.iter_mut().chain(&mut self.sensor_normal).flatten();
        let devices = self.devices.iter_mut().flatten();
        for v in self.laser.iter_mut().chain(&mut self.sensor).chain(devices).chain(normals) {
            *v = turn.apply(*v);
        }
    }

    /// The order that pairs take after their points were turned; `None` if it stays.
    pub(crate) fn turned_order(&self, turn: Turn) -> Option<PairOrder> {
        let [nx, ny] = self.scan;
        let list = || ny == 1 && nx > 1 && !self.resolution().contains(&1);
        if turn == Turn::default() || list() || matches!(self.pair_kind(), PairKind::Exhaustive { .. }) {
            return None;
        }
        let (scan, pairs) = turn.order(self.scan);
        Some(PairOrder { pairs, scan })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    /// A capture of these pairs, on a wall with a bump, whose histograms are all different.
    fn capture(scan: [usize; 2], pairs: &[(DVec3, DVec3)]) -> Capture {
        let lean = |p: DVec3| dvec3(0.3 * p.x - 0.1, 0.2 * p.y, 1.0).normalize();
        let (laser, sensor): (Vec<_>, Vec<_>) = pairs.iter().copied().unzip();
        let histograms = (0..2 * pairs.len()).map(|v| v as f32).collect();
        let facing = |points: &[DVec3]| Some(points.iter().map(|p| lean(*p)).collect());
        Capture {
            laser_normal: facing(&laser),
            sensor_normal: facing(&sensor),
            ..Capture::new(scan, laser, sensor, 2, 0.01, histograms)
        }
    }

    fn grid(nx: usize, ny: usize) -> Vec<DVec3> {
        (0..nx * ny).map(|p| dvec3(0.1 * (p / ny) as f64 - 0.3, 0.2 * (p % ny) as f64 + 0.1, 0.02)).collect()
    }

    /// A confocal scan of 4 x 3 points, one laser point, every laser with every sensor point, a list, and a row.
    fn every_kind() -> Vec<Capture> {
        let points = grid(4, 3);
        let confocal: Vec<_> = points.iter().map(|&p| (p, p)).collect();
        let one: Vec<_> = points.iter().map(|&p| (dvec3(0.07, -0.2, 0.0), p)).collect();
        let all: Vec<_> = grid(2, 3).iter().flat_map(|&l| points.iter().map(move |&s| (l, s))).collect();
        let list: Vec<_> = (0..7)
            .map(|k| dvec3(0.1 * k as f64, 0.03 * (k * k) as f64, 0.0))
            .map(|p| (p, p + 0.01 * DVec3::X))
            .collect();
        let row: Vec<_> = grid(4, 1).iter().map(|&p| (p, p)).collect();
        vec![
            capture([4, 3], &confocal),
            capture([4, 3], &one),
            capture([6, 12], &all),
            capture([7, 1], &list),
            capture([4, 1], &row),
        ]
    }

    fn turn(flip: &str, degrees: usize) -> Turn {
        let flip = [("x", Flip::X), ("y", Flip::Y), ("xy", Flip::Xy)].into_iter().find(|row| row.0 == flip);
        Turn::of(flip.map(|row| row.1), (degrees > 0).then_some(degrees)).unwrap()
    }

    #[test]
    fn two_flips_and_four_quarters_change_nothing() {
        for c in every_kind() {
            for flip in ["x", "y", "xy"] {
                let once = c.clone().turned(turn(flip, 0));
                assert_ne!(once, c, "{:?}, {flip}", c.scan);
                assert_eq!(once.clone().turned(turn(flip, 0)), c, "{:?}, {flip}", c.scan);
            }
            let [quarter, half, three] = [90, 180, 270].map(|degrees| c.clone().turned(turn("", degrees)));
            assert_ne!(quarter, c);
            assert_eq!(quarter.clone().turned(turn("", 90)), half);
            assert_eq!(half.clone().turned(turn("", 90)), three);
            assert_eq!(three.turned(turn("", 90)), c);
            assert_eq!(c.clone().turned(turn("xy", 0)), half);
            assert_eq!(c.clone().turned(turn("x", 90)), c.clone().turned(turn("x", 0)).turned(turn("", 90)));
        }
    }

    #[test]
    fn every_histogram_stays_with_its_turned_pair() {
        for c in every_kind() {
            for (flip, degrees, to) in [
                ("x", 0, [[-1.0, 0.0], [0.0, 1.0]]),
                ("y", 0, [[1.0, 0.0], [0.0, -1.0]]),
                ("", 90, [[0.0, -1.0], [1.0, 0.0]]),
                ("", 270, [[0.0, 1.0], [-1.0, 0.0]]),
                ("x", 90, [[0.0, -1.0], [-1.0, 0.0]]),
            ] {
                let moved = c.clone().turned(turn(flip, degrees));
                let at =
                    |v: DVec3| dvec3(to[0][0] * v.x + to[0][1] * v.y, to[1][0] * v.x + to[1][1] * v.y, v.z);
                for (p, laser) in moved.laser.iter().enumerate() {
                    let from = moved.histograms[2 * p] as usize / 2;
                    assert_eq!(moved.histograms[2 * p + 1] as usize, 2 * from + 1);
                    assert_eq!((*laser, moved.sensor[p]), (at(c.laser[from]), at(c.sensor[from])));
                    let normals = [&moved.laser_normal, &moved.sensor_normal].map(|n| n.as_ref().unwrap()[p]);
                    let were = [&c.laser_normal, &c.sensor_normal].map(|n| at(n.as_ref().unwrap()[from]));
                    assert_eq!(normals, were);
                }
            }
        }
    }

    #[test]
    fn scans_run_along_x_and_y_after_it() {
        for c in every_kind().into_iter().filter(|c| [[4, 3], [4, 1]].contains(&c.scan)) {
            for (flip, degrees) in [("x", 0), ("y", 0), ("xy", 90), ("", 90), ("", 270)] {
                let moved = c.clone().turned(turn(flip, degrees));
                let [nx, ny] = moved.scan;
                let turned = degrees == 90 || degrees == 270;
                assert_eq!(moved.scan, if turned { [c.scan[1], c.scan[0]] } else { c.scan });
                for (ix, iy) in (0..nx).flat_map(|ix| (0..ny).map(move |iy| (ix, iy))) {
                    let (here, p) = (moved.sensor[ix * ny + iy], &moved.sensor);
                    assert!(ix + 1 == nx || p[(ix + 1) * ny + iy].x > here.x);
                    assert!(iy + 1 == ny || p[ix * ny + iy + 1].y > here.y);
                }
            }
        }
    }

    #[test]
    fn what_is_done_is_said_and_what_is_no_turn_is_refused() {
        assert_eq!(turn("", 0).note(), None);
        let note = turn("y", 270).note().unwrap();
        assert!(note.contains("top to bottom") && note.contains("rotated by 270"), "{note}");
        for degrees in [0, 45] {
            let error = Turn::of(None, Some(degrees)).unwrap_err();
            assert_eq!(error.kind, crate::error::Kind::Options);
        }
    }
}
