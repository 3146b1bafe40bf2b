//! Lengths split into parts that fp32 adds without rounding, for scenes whose paths have very many bins
//! (`glsl/include/place.glsl`).

use glam::DVec3;

use super::{Binning, Grid, Model};

/// Paths of more bins than this are computed in parts: in plain fp32 the shares of a contribution between two bins
/// would have an error above about 1e-4 (docs/stability.md).
const MOST_BINS: f64 = 700.0;

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
        let end = self.t_start + self.bins as f64 * self.bin_width;
        end.min(2.0 * self.longest_distance(grid)) / self.bin_width > MOST_BINS
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
