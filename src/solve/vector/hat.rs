//! The filter of the back-projection.

use super::HAT_SIGMA;
use crate::solve::Level;

/// A narrower hat would fall between bins.
const LEAST_SIGMA: f64 = 0.7;

/// A Mexican hat of `sigma` bins for `filter.comp`: [radius, weights 0..=radius], of zero sum over both sides.
pub fn hat(sigma: f64, bins: usize) -> Vec<f32> {
    let sigma = sigma.max(LEAST_SIGMA);
    let radius = radius_of(sigma, bins);
    let weight = |i: usize| {
        let x = (i as f64 / sigma).powi(2);
        (1.0 - x) * (-0.5 * x).exp()
    };
    let sum = weight(0) + 2.0 * (1..=radius).map(weight).sum::<f64>();
    let mean = sum / (2 * radius + 1) as f64;
    std::iter::once(radius as f32).chain((0..=radius).map(|i| (weight(i) - mean) as f32)).collect()
}

/// Sigma of the hat at a level, bins.
pub(super) fn sigma_of(level: &Level) -> f64 {
    HAT_SIGMA * level.grid.pitch.x / level.bin_width
}

/// Taps of the hat at a level, its two sides counted once.
pub(super) fn taps_of_hat(level: &Level) -> usize {
    radius_of(sigma_of(level).max(LEAST_SIGMA), level.bins) + 1
}

fn radius_of(sigma: f64, bins: usize) -> usize {
    ((4.0 * sigma).ceil() as usize).min(bins - 1)
}
