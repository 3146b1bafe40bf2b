//! What the methods' tests against float64 references share.

use glam::{DVec3, dvec3};

use super::scan::RegularScan;
use crate::capture::Capture;
use crate::transport::{Grid, Volume as Box};

pub use thirdbounce_fourier::Wide;

pub fn wide_turn(angle: f64) -> Wide {
    Wide::new(angle.cos(), angle.sin())
}

/// Random counts of a scan of 4 × 3 points whose bins begin late. `spot`: the one point of the laser.
pub fn random_capture(spot: Option<DVec3>) -> Capture {
    let points: Vec<DVec3> =
        (0..12).map(|i| dvec3(-0.2 + 0.15 * f64::from(i / 3), 0.1 + 0.12 * f64::from(i % 3), 0.05)).collect();
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1u32 << 24) as f32
    };
    let counts = (0..12 * 16).map(|_| random()).collect();
    let laser = spot.map_or(points.clone(), |spot| vec![spot; 12]);
    let mut capture = Capture::new([4, 3], laser, points, 16, 0.05, counts);
    capture.t_start = 0.7;
    capture
}

/// A grid whose columns are the points of [`random_capture`].
pub fn random_grid(scan: &RegularScan) -> Grid {
    let volume = Box { min: dvec3(-0.275, 0.04, 0.45), max: dvec3(0.325, 0.4, 0.8) };
    let grid = Grid::new(volume, 12, 0.03).unwrap();
    // Not square: the values at the points are compared, not those between them.
    assert_eq!(scan.n, [4, 3]);
    grid
}

/// The largest difference, over the largest value.
pub fn error(found: &[f32], wanted: &[f64]) -> f64 {
    let largest = wanted.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    assert!(largest > 0.0 && found.len() == wanted.len());
    found.iter().zip(wanted).map(|(f, w)| (f64::from(*f) - w).abs()).fold(0.0, f64::max) / largest
}
