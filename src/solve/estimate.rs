//! Estimates that the vector solver makes from the data.

use crate::capture::Capture;
use crate::transport::Model;

/// The weighted data term of photon noise alone. Below it a solver fits noise (discrepancy principle, Morozov 1966).
pub fn expected_noise(model: &Model) -> f64 {
    let [per_value, floor] = model.variance;
    // A count is its own unbiased variance; `measured` is the count less the background.
    let noise =
        |(i, m): (usize, &f32)| model.bin_weight(i % model.bins) * (per_value * f64::from(*m) + floor);
    model.measured.iter().enumerate().map(noise).sum::<f64>() / model.elements as f64
}

/// Counts per bin without light: the lowest mean, over all pairs, of any sixteenth of the bins behind the strongest
/// one; 0 if there are fewer bins behind it.
pub fn background(capture: &Capture) -> f64 {
    let bins = capture.bins;
    let mean = capture.mean_histogram();
    let peak = (0..bins).max_by(|a, b| mean[*a].total_cmp(&mean[*b])).unwrap_or(0);
    let window = (bins / 16).max(1);
    let behind = mean[peak + 1..].windows(window).map(|w| w.iter().sum::<f64>() / window as f64);
    behind.reduce(f64::min).unwrap_or(0.0)
}

/// Variance of a bin over its mean count; 1 for photons. Estimated from second differences along time, whose square is
/// 1.5 variances on average where the signal is smooth. The median over bins ignores edges.
pub fn variance_per_count(capture: &Capture) -> f64 {
    // Median of a squared standard normal.
    const MEDIAN: f64 = 0.4549;
    if capture.integer_counts {
        return 1.0;
    }
    let mut ratios: Vec<f64> = capture
        .histograms
        .chunks_exact(capture.bins)
        .flat_map(|h| h.windows(3))
        .filter(|w| w.iter().all(|v| *v > 0.0))
        .map(|w| {
            let [a, b, c] = [w[0], w[1], w[2]].map(f64::from);
            (b - 0.5 * (a + c)).powi(2) / (0.25 * a + b + 0.25 * c)
        })
        .collect();
    if ratios.is_empty() {
        return 0.0;
    }
    let middle = ratios.len() / 2;
    *ratios.select_nth_unstable_by(middle, f64::total_cmp).1 / MEDIAN
}
