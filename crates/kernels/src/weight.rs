use super::light::RETROREFLECTIVE;
use super::{Call, Real};

/// Weight of squared differences by bin: the inverse of the confocal falloff at the bin's centre, none at negative paths.
pub fn bin_weights<F: Real>(call: &Call<'_>) -> Vec<F> {
    let s = &call.scene;
    let [start, per_metre, reference] = [s.t_start, s.bins_per_metre, s.reference].map(f64::from);
    let power = if call.constant("REFLECTANCE", 0) == RETROREFLECTIVE { 2 } else { 4 };
    let of = |bin: usize| ((start + (bin as f64 + 0.5) / per_metre) * 0.5 / reference).max(0.0).powi(power);
    (0..call.bins()).map(|bin| F::of(of(bin))).collect()
}
