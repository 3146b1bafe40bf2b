//! Weights of bins (`glsl/include/weight.glsl`).

use super::light::RETROREFLECTIVE;
use super::{Call, Real};

/// The weights of all bins: the inverse of the confocal falloff at a bin's centre.
pub fn bin_weights<F: Real>(call: &Call<'_>) -> Vec<F> {
    let scene = &call.scene;
    let [start, per_metre, reference] = [scene.t_start, scene.bins_per_metre, scene.reference].map(f64::from);
    let power = if call.constant("REFLECTANCE", 0) == RETROREFLECTIVE { 2 } else { 4 };
    let of = |bin: usize| {
        // No light at negative paths.
        let scaled = ((start + (bin as f64 + 0.5) / per_metre) * (0.5 / reference)).max(0.0);
        F::of(scaled.powi(power))
    };
    (0..call.bins()).map(of).collect()
}
