//! The Mexican hat that filters histograms along their paths.

/// A narrower hat would fall between bins.
const LEAST_SIGMA: f64 = 0.7;

/// A Mexican hat of `sigma` bins for `filter.comp`: [radius, weights 0..=radius], of zero sum over both sides.
pub fn hat(sigma: f64, bins: usize) -> Vec<f32> {
    let sigma = sigma.max(LEAST_SIGMA);
    let radius = ((4.0 * sigma).ceil() as usize).min(bins - 1);
    let weight = |i: usize| {
        let x = (i as f64 / sigma).powi(2);
        (1.0 - x) * (-0.5 * x).exp()
    };
    let sum = weight(0) + 2.0 * (1..=radius).map(weight).sum::<f64>();
    let mean = sum / (2 * radius + 1) as f64;
    std::iter::once(radius as f32).chain((0..=radius).map(|i| (weight(i) - mean) as f32)).collect()
}
