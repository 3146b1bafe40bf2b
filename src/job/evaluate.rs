//! Compares maps with truth.

use crate::maps::{Maps, Truth};
use crate::measure::{Metrics, metrics};
use crate::{Error, Result};

/// Compares maps with truth, by their own mask, or by that of a share of the brightest albedo, which they then have.
///
/// # Errors
/// A truth of another part of the wall, a mask fraction out of range.
pub fn evaluate_maps(maps: &mut Maps, truth: &Truth, mask_fraction: Option<f64>) -> Result<Metrics> {
    check_extent(maps.extent, truth.extent)?;
    if mask_fraction.is_some() {
        maps.set_mask(mask_fraction);
    }
    // The maps' own mask is that of the run, which a share of the albedo may not give.
    metrics(maps, truth, mask_fraction)
}

/// Least overlap of the extents of maps and truth as a share of the larger one: maps are up to 1.5 walls wide.
const OVERLAP: f64 = 0.4;

/// Refuses a truth of another part of the wall.
fn check_extent(maps: [f64; 4], truth: [f64; 4]) -> Result<()> {
    let area = |[x0, x1, y0, y1]: [f64; 4]| (x1 - x0).max(0.0) * (y1 - y0).max(0.0);
    let [a, b] = [maps, truth];
    let both = area([a[0].max(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].min(b[3])]);
    if both >= OVERLAP * area(a).max(area(b)) {
        return Ok(());
    }
    let text = |[x0, x1, y0, y1]: [f64; 4]| format!("x {x0:.3} to {x1:.3} m, y {y0:.3} to {y1:.3} m");
    Err(Error::input(
        format!("the result covers {}, the truth {}", text(maps), text(truth)),
        "give the truth of this scene, with the same wall",
    ))
}
