//! How smooth the parts of a surface are. A fit to dim light turns noise into dimples; a strong prior rounds what bright light shows. So
//! every part of the mask becomes smoother step by step, up to a plane, and then of one albedo, while pairs that no fit takes do not
//! contradict.

use super::fit::Fit;
use super::plates::plates;
use super::smooth::{LEAST, scale, scaled_left, smoothed};
use super::support;
use crate::Result;
use crate::maps::Maps;

/// Evidence: benches/NOTES.md, "Smoothness by held-out pairs".
mod constants {
    /// Widths of Gaussian windows as shares of the maps' width; beyond the last one a part is a plane, of one albedo.
    pub const WIDTHS: [f64; 4] = [1.0 / 128.0, 1.0 / 64.0, 1.0 / 32.0, 1.0 / 16.0];
    /// Standard errors of the difference by which a smoother surface may leave more than the best one.
    pub const ERRORS: f64 = 1.0;
    /// Parts that are judged one by one, the largest; smaller ones stay as the fit left them.
    pub const PARTS: usize = 4;
}
use constants::*;

/// Makes the parts of the mask of `maps` smoother while held-out pairs do not contradict: in the `layer` that `fit` has fitted, and in
/// the maps that show it.
///
/// # Errors
/// The device fails.
pub(super) fn settle(fit: &mut Fit, layer: &Maps, maps: &mut Maps) -> Result<()> {
    let mut layer = layer.clone();
    let Some((_, mut best)) = scaled_left(fit, &layer)? else { return Ok(()) };
    let mut parts = support::objects_of(maps);
    parts.retain(|part| part.len() >= LEAST);
    parts.sort_by_key(|part| std::cmp::Reverse(part.len()));
    let side = maps.nx.max(maps.ny) as f64;
    let windows = || WIDTHS.iter().map(|width| Some(width * side)).chain([None]);
    for part in parts.iter().take(PARTS) {
        for of_depths in [true, false] {
            let from = [layer.clone(), maps.clone()];
            for window in windows() {
                // A plane may have several tones.
                let of_albedo = if of_depths { window.or(windows().flatten().last()) } else { window };
                let mut smooth =
                    from.each_ref().map(|of| smoothed(of, part, of_depths.then_some(window), of_albedo));
                let Some((factor, this)) = scaled_left(fit, &smooth[0])? else { break };
                let errors = this.errors_below(&best);
                if errors < -ERRORS {
                    break;
                }
                smooth.iter_mut().for_each(|of| scale(of, factor));
                [layer, *maps] = smooth;
                if errors > 0.0 {
                    best = this;
                }
            }
        }
    }
    if let Some(plates) = plates(fit, &layer, maps, &best)? {
        *maps = plates;
    }
    Ok(())
}
