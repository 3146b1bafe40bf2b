//! Weights of bins (`glsl/include/weight.glsl`).

use super::light::RETROREFLECTIVE;
use super::{Call, Real};

/// Roots of the weights of all bins: the inverse root of the confocal falloff at a bin's centre.
pub fn root_weights<F: Real>(call: &Call<'_>) -> Vec<F> {
    roots(call).map(F::of).collect()
}

/// The weights of all bins.
pub fn bin_weights<F: Real>(call: &Call<'_>) -> Vec<F> {
    roots(call).map(|root| F::of(root * root)).collect()
}

fn roots(call: &Call<'_>) -> impl Iterator<Item = f64> {
    let scene = &call.scene;
    let [start, per_metre, reference] = [scene.t_start, scene.bins_per_metre, scene.reference].map(f64::from);
    let is_retro = call.constant("REFLECTANCE", 0) == RETROREFLECTIVE;
    (0..call.bins()).map(move |bin| {
        // No light at negative paths.
        let scaled = ((start + (bin as f64 + 0.5) / per_metre) * (0.5 / reference)).max(0.0);
        if is_retro { scaled } else { scaled * scaled }
    })
}
