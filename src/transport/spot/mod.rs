//! The instrument's spot: laser and sensor see areas of the wall, not points.
//!
//! Light is rendered for sharp points that cover the spots of all measured pairs, beyond the scan's edge too, and a
//! measured histogram is the weighted sum of the rendered ones in its spot ([`SpotTaps`]). The points lie on a lattice:
//! the scan's own, continued on every side, or a wider one where spot and pulse hide the difference. Where a lattice would
//! have far more points than the scan, as for one fixed point, every point of the scan has a few of its own.
//!
//! A confocal pair with the laser at p + x and the sensor at p + y is, to first order in x and y, the confocal pair at
//! p + (x + y) / 2: one spot with a quarter of the sum of both variances. To second order its path is longer than that of
//! the one point by (x - y)² / 4 over the distance, mean over the spot: the points are moved behind the wall by it.

use glam::DVec3;

use super::{Geometry, Wall};
use crate::capture::Capture;

mod cover;
mod each;
mod side;
mod taps;

use side::sides;
pub use taps::SpotTaps;

/// Full width at half maximum of a Gaussian over its standard deviation.
const WIDTH: f64 = 2.354_820_045_030_949_3;

/// A spot whose standard deviation is below this many bins is a point.
const LEAST: f64 = 0.1;

/// The spots of an instrument on a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Standard deviations along x and y, metres: of the scanned points' spot, and of the other points'. In a confocal
    /// scan the first is that of pairs, and the second is 0.
    pub sigma: [f64; 2],
    /// Rendered points may be so far apart even where measured ones are nearer, metres: the pulse or a bin hides the
    /// difference of their paths.
    pub coarsest: f64,
    /// Mean path of the light, metres.
    pub path: f64,
}

impl Spot {
    /// The spots of a capture whose pairs are made so; `None` if they are points. `laser_scans`: whether the scanned side
    /// is the laser's.
    pub fn of(capture: &Capture, geometry: Geometry, laser_scans: bool) -> Option<Spot> {
        let sigma = |width: Option<f64>| width.unwrap_or(0.0) / WIDTH;
        let (laser, sensor) = (sigma(capture.laser_spot), sigma(capture.sensor_spot));
        let sides = match (geometry, laser_scans) {
            (Geometry::Confocal, _) => [0.5 * laser.hypot(sensor), 0.0],
            (_, true) => [laser, sensor],
            (_, false) => [sensor, laser],
        };
        let seen = |sigma: f64| if sigma < LEAST * capture.bin_width { 0.0 } else { sigma };
        let pulse = capture.pulse.as_ref().map_or(0.0, |p| p.moments()[1]);
        let spot = Spot {
            sigma: sides.map(seen),
            coarsest: (2.0 * pulse).max(capture.bin_width),
            path: mean_path(capture),
        };
        (spot.sigma != [0.0; 2]).then_some(spot)
    }
}

/// Mean path of a capture's light, metres; of its bins, if there are no counts.
fn mean_path(capture: &Capture) -> f64 {
    let middle = capture.t_start + 0.5 * capture.bins as f64 * capture.bin_width;
    let at = |bin: usize| capture.t_start + (bin as f64 + 0.5) * capture.bin_width;
    let of_bins = capture.histograms.chunks_exact(capture.bins.max(1)).flat_map(|h| h.iter().enumerate());
    let [light, path] =
        of_bins.fold([0.0; 2], |[l, p], (bin, c)| [l + f64::from(*c), p + f64::from(*c) * at(bin)]);
    let mean = if light > 0.0 { path / light } else { middle };
    mean.max(capture.bin_width)
}

/// The pairs that light is rendered for, and how their histograms make up those of measured pairs.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendered {
    /// The spots.
    pub spot: Spot,
    /// The wall's points, combined as those of the measured pairs.
    pub wall: Wall,
    /// What is summed, in order; at least one stage.
    pub stages: Vec<SpotTaps>,
}

impl Rendered {
    /// The pairs that cover the spots of a wall's pairs.
    pub fn of(wall: &Wall, spot: Spot) -> Rendered {
        let (scanned, others) = sides(wall);
        let rendered = match wall.geometry {
            Geometry::Confocal => {
                let side = scanned.covered(spot.sigma[0], spot.coarsest);
                let longer = spot.sigma[0].powi(2) / (0.5 * spot.path);
                let normals = side.normals.as_deref();
                let behind = |i: usize| normals.map_or(DVec3::Z, |n| n[i]) * longer;
                let points = side.points.iter().enumerate().map(|(i, p)| *p - behind(i)).collect();
                (Wall { normals: side.normals, ..Wall::confocal(points) }, side.stages)
            }
            Geometry::TwoPoints => each::around_pairs(wall, spot.sigma),
            Geometry::Product => {
                let [a, b] = [(scanned, spot.sigma[0]), (others, spot.sigma[1])]
                    .map(|(side, sigma)| side.covered(sigma, spot.coarsest));
                let (others, scanned) = (b.points.len(), wall.scanned.len());
                let of_scanned = a.stages.into_iter().map(|s| SpotTaps { outer: others * s.outer, ..s });
                let of_others = b.stages.into_iter().map(|s| SpotTaps { inner: scanned * s.inner, ..s });
                let normals = a.normals.zip(b.normals).map(|(a, b)| [a, b].concat());
                let wall = Wall { geometry: wall.geometry, scanned: a.points, others: b.points, normals };
                (wall, of_scanned.chain(of_others).collect())
            }
        };
        Rendered { spot, wall: rendered.0, stages: rendered.1 }
    }

    /// The stages of the adjoint, in order.
    pub fn back(&self) -> Vec<SpotTaps> {
        self.stages.iter().rev().map(SpotTaps::back).collect()
    }

    /// The stages and those of the adjoint.
    pub fn all(&self) -> Vec<SpotTaps> {
        [self.stages.clone(), self.back()].concat()
    }
}

#[cfg(test)]
mod tests;
