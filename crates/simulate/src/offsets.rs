//! Sample positions inside the laser and sensor spots.

use glam::{DVec2, dvec2};
use std::f64::consts::TAU;

/// Full width at half maximum of a Gaussian over its standard deviation.
const WIDTH: f64 = 2.354_820_045_030_949_3;

/// Length of the sequence, in which every pair starts at a different position. A power of two.
const COUNT: usize = 1 << 16;

/// Positions in both spots, low-discrepancy jointly over both Gaussians, also in short runs.
pub(super) struct Offsets(Vec<[DVec2; 2]>);

impl Offsets {
    /// For spots of these full widths at half maximum, metres; `None` for two points.
    pub fn of(spots: [f64; 2]) -> Option<Offsets> {
        if spots == [0.0; 2] {
            return None;
        }
        let one = |i: usize| {
            let u = evenly(i);
            [gaussian(u[0], u[1]) * (spots[0] / WIDTH), gaussian(u[2], u[3]) * (spots[1] / WIDTH)]
        };
        Some(Offsets((0..COUNT).map(one).collect()))
    }

    /// Offsets of laser and sensor at which a pair sees element `i`, metres.
    pub fn at(&self, pair: usize, i: usize) -> [DVec2; 2] {
        // A large odd step, so that pairs start far apart.
        self.0[pair.wrapping_mul(40_503).wrapping_add(i) % COUNT]
    }
}

/// Element `i` of an additive recurrence in four dimensions, in [0, 1): multiples of powers of the root of g⁵ = g +
/// 1.
fn evenly(i: usize) -> [f64; 4] {
    const ROOT: f64 = 1.167_303_978_261_418_7;
    std::array::from_fn(|d| (0.5 + (i as f64 + 1.0) * ROOT.powi(-(d as i32) - 1)).fract())
}

/// Normally distributed point from two numbers in [0, 1) (Box & Muller 1958).
fn gaussian(u: f64, v: f64) -> DVec2 {
    let (sin, cos) = (TAU * v).sin_cos();
    dvec2(cos, sin) * (-2.0 * (1.0 - u).ln()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_hundred_in_a_row_have_the_moments_of_the_spots() {
        assert!(Offsets::of([0.0, 0.0]).is_none());
        let offsets = Offsets::of([0.1, 0.05]).unwrap();
        for pair in [0, 1, 777] {
            for (side, width) in [(0, 0.1), (1, 0.05)] {
                let all: Vec<DVec2> = (0..500).map(|i| offsets.at(pair, i)[side]).collect();
                let mean = all.iter().sum::<DVec2>() / 500.0;
                let square = all.iter().map(|o| *o * *o).sum::<DVec2>() / 500.0;
                let sigma = width / WIDTH;
                assert!(mean.length() < 0.03 * sigma, "{mean}");
                assert!((square / (sigma * sigma) - 1.0).abs().max_element() < 0.05, "{square}");
            }
        }
    }
}
