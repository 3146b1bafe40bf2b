//! Weights of bins (`glsl/include/weight.glsl`).

use super::{Call, Real};

const RETROREFLECTIVE: u32 = 2;

/// Roots of the weights of all bins: the inverse root of the confocal falloff at a bin's centre.
pub fn root_weights<F: Real>(call: &Call<'_>) -> Vec<F> {
    let scene = &call.scene;
    let [start, per_metre, reference] = [scene.t_start, scene.bins_per_metre, scene.reference].map(f64::from);
    let is_retro = call.constant("REFLECTANCE", 0) == RETROREFLECTIVE;
    let of = |bin: usize| {
        // No light at negative paths.
        let scaled = ((start + (bin as f64 + 0.5) / per_metre) * (0.5 / reference)).max(0.0);
        F::of(if is_retro { scaled } else { scaled * scaled })
    };
    (0..call.bins()).map(of).collect()
}
