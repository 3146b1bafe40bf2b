//! Lengths split into parts that fp32 adds without rounding, for scenes whose paths have very many bins
//! (`glsl/include/place.glsl`).

use glam::DVec3;

use super::{Binning, Grid, Model};

/// Paths of more bins than this are computed in parts: in plain fp32 the shares of a contribution between two bins
/// would have an error above about 1e-4 (docs/devices.md).
const MOST_BINS: f64 = 700.0;

/// Distances in paths of more bins than this are polished on GPUs. Vulkan allows an inverse root to be off by two units of
/// the last place, so a place may be off 1.7 times as far as with the CPU's root that [`MOST_BINS`] was found with: at 700
/// bins by 2.2e-4 of a bin instead of 1.3e-4, at 500 by 1.6e-4. The step costs three of some 45 instructions.
const MOST_BINS_OF_ROOT: f64 = 500.0;

/// The constants of places computed in parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fine {
    /// A power of two, metres: no distance is longer than 2^11 of it.
    pub grain: f64,
    /// Bins per grain: the upper 12 bits, whose multiples are exact up to 2^12 grains, and the rest.
    pub bins_per_grain: [f64; 2],
    /// Bins before the gate, plus half a bin with linear binning: a multiple of the last of those bits, and the rest.
    pub start_bins: [f64; 2],
}

impl Model {
    /// True if places are computed in parts.
    pub fn is_fine(&self, grid: &Grid) -> bool {
        self.path_bins(grid) > MOST_BINS
    }

    /// True if a GPU's distances need a step of Newton. Places in parts correct their root themselves.
    pub fn is_polished(&self, grid: &Grid) -> bool {
        (MOST_BINS_OF_ROOT..=MOST_BINS).contains(&self.path_bins(grid))
    }

    /// Bins of the longest path that counts.
    fn path_bins(&self, grid: &Grid) -> f64 {
        let end = self.t_start + self.bins as f64 * self.bin_width;
        end.min(2.0 * self.longest_distance(grid)) / self.bin_width
    }

    /// Upper bound of the distance from a point of the wall to a point of the grid, metres.
    fn longest_distance(&self, grid: &Grid) -> f64 {
        let low = grid.origin - 0.5 * grid.pitch;
        let high = low + grid.pitch * DVec3::from_array(grid.n.map(|n| n as f64));
        let wall = self.rendered_wall();
        let far = wall.all_points().map(|p| (*p - low).abs().max((*p - high).abs()));
        // Levels with a part of the pairs render for points a little farther beyond the scan's edge.
        let beyond = if self.rendered.is_some() { 1.1 } else { 1.0 };
        beyond * far.reduce(DVec3::max).map_or(0.0, DVec3::length)
    }

    pub(super) fn fine(&self, grid: &Grid) -> Fine {
        let exponent = |v: f64| v.max(1e-30).log2().ceil() as i32;
        let grain = 2f64.powi(exponent(self.longest_distance(grid)) - 11);
        let bins = grain / self.bin_width;
        let unit = 2f64.powi(exponent(bins) - 12);
        let split = |v: f64| {
            let most = (v / unit).round() * unit;
            [most, v - most]
        };
        let mut start_bins = split(self.t_start / self.bin_width);
        if self.binning == Binning::Linear {
            // A contribution shared by two bins is placed relative to the first one's centre.
            start_bins[1] += 0.5;
        }
        Fine { grain, bins_per_grain: split(bins), start_bins }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest error of a place among `bins` bins of path, as `place.glsl` finds it, where the inverse root is off by
    /// up to `units` of the last place.
    fn worst(bins: f64, units: i32, polished: bool) -> f64 {
        const LONGEST: f64 = 1.5;
        let scale = bins / LONGEST;
        let row = (bins + 3.0) as f32;
        let (to_part, from_part) = ((scale / f64::from(row)) as f32, (2.5 / f64::from(row)) as f32);
        let mut state = 1u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let mut worst = 0.0f64;
        for _ in 0..50_000 {
            let way = [draw() - 0.5, draw() - 0.5, 0.3 + draw()].map(|v| v as f32);
            let d2 = way[0].mul_add(way[0], way[1].mul_add(way[1], way[2] * way[2]));
            let off = (draw() * f64::from(2 * units + 1)) as i32 - units;
            let exact = (1.0 / f64::from(d2).sqrt()) as f32;
            let inverse = f32::from_bits(exact.to_bits().wrapping_add_signed(off));
            let mut distance = d2 * inverse;
            if polished {
                distance = (-distance).mul_add(distance, d2).mul_add(0.5 * inverse, distance);
            }
            let part = distance.mul_add(to_part, from_part).clamp(0.0, 1.0);
            let whole = part.mul_add(row, 8_388_607.5);
            let share = part.mul_add(row, 8_388_608.0 - whole);
            let truth = way.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
            if truth < LONGEST {
                let place = f64::from(whole) - 8_388_608.0 + f64::from(share);
                worst = worst.max((place - truth * scale - 2.5).abs());
            }
        }
        worst
    }

    #[test]
    fn a_step_of_newton_takes_off_what_a_gpus_root_adds() {
        let accepted = worst(MOST_BINS, 0, false);
        assert!((0.8e-4..1.5e-4).contains(&accepted), "{accepted}");
        let [root, polished] = [false, true].map(|p| worst(MOST_BINS, 2, p));
        assert!(root > 1.4 * accepted, "two units: {root}, none: {accepted}");
        assert!(polished < accepted, "{polished}");
        let below = worst(MOST_BINS_OF_ROOT, 2, false);
        assert!(below < 1.3 * accepted, "{below}");
    }
}
