//! Estimates from the data: noise, energy, and how many pairs are enough.

use std::ops::Range;

use rayon::prelude::*;
use thirdbounce_base::quantile::quantile;

use crate::capture::Capture;
use crate::options::ENOUGH_PAIRS;
use crate::transport::{LANES, Model};

/// The weighted data term of photon noise alone. Below it a solver fits noise (discrepancy principle, Morozov 1966).
pub fn expected_noise(model: &Model) -> f64 {
    let [per_value, floor] = model.variance;
    // A count is its own unbiased variance; `measured` is the count less the background.
    let passed = model.high_pass.map_or(1.0, |f| f.of_noise(model.bins, model.bin_width));
    passed * weighted_sum(model, 0..model.pairs(), [floor, per_value, 0.0]) / model.elements as f64
}

/// The objective of some pairs without any light: weighted squares of the measurement, mean over bins.
pub fn energy(model: &Model, pairs: Range<usize>) -> f64 {
    let sum = match model.high_pass {
        Some(filter) => {
            let roots: Vec<f64> = (0..model.bins).map(|bin| model.bin_weight(bin).sqrt()).collect();
            let filter = filter.rows_of(model.bins, model.bin_width);
            let of_rows = |spare: &mut Vec<_>, rows: &[f32]| {
                let value = |row: usize, bin: usize| roots[bin] * f64::from(rows[row * model.bins + bin]);
                filter.squares(rows.len() / model.bins, value, spare)
            };
            let rows = &model.measured[pairs.start * model.bins..pairs.end * model.bins];
            let sums = rows.par_chunks(LANES * model.bins).map_init(Vec::new, of_rows);
            // In the order of rows, whatever thread sums them.
            sums.collect::<Vec<_>>().into_iter().flatten().sum()
        }
        None => weighted_sum(model, pairs.clone(), [0.0, 0.0, 1.0]),
    };
    sum / model.elements_of(pairs.len()).max(1) as f64
}

/// The sum over the measured values of some pairs of what the polynomial `of` (constant, linear, quadratic) makes
/// of each, with the weights of their bins.
pub fn weighted_sum(model: &Model, pairs: Range<usize>, [constant, linear, quadratic]: [f64; 3]) -> f64 {
    let weights: Vec<f64> = (0..model.bins).map(|bin| model.bin_weight(bin)).collect();
    let of = |m: f64| constant + linear * m + quadratic * (m * m);
    let rows = model.measured[pairs.start * model.bins..pairs.end * model.bins].chunks_exact(model.bins);
    rows.flat_map(|row| row.iter().zip(&weights)).map(|(m, weight)| weight * of(f64::from(*m))).sum()
}

/// Counts per bin without light, in the mean over all pairs ([`Capture::background`]).
pub fn background(capture: &Capture) -> f64 {
    capture.background().level
}

/// Variance of a bin per count of its light, and variance of a bin without light in counts squared. `background` is in
/// counts per bin.
pub fn variances(capture: &Capture, background: f64) -> [f64; 2] {
    if let Some(noise) = capture.noise {
        return noise;
    }
    match capture.negatives() {
        // The background is gone, its noise is still there.
        Some(found) if found.variance > 0.0 => [variance_above(capture, found.variance), found.variance],
        _ => {
            let per_count = variance_per_count(capture);
            [per_count, per_count * background.max(0.0)]
        }
    }
}

/// Photons that pairs need at least.
const LEAST_PHOTONS: f64 = 32_768.0;

/// Most pairs that are needed.
pub const MOST_PAIRS: usize = 1_000_000_000;

/// Pairs of a capture that are enough for a solve: [`ENOUGH_PAIRS`], or more where photons are few. Light of the sum S
/// and variance V counts as S² / V photons: the number of photons with the same signal-to-noise ratio. A capture may have fewer pairs.
pub fn enough_pairs(capture: &Capture) -> usize {
    let Ok(some) = capture.subset(ENOUGH_PAIRS.min(capture.pair_count()), 0) else { return ENOUGH_PAIRS };
    if some.histograms.is_empty() {
        return ENOUGH_PAIRS;
    }
    let background = background(&some);
    let [per_count, empty] = variances(&some, background);
    // Of a pair in the mean. Bins before a gate opens have less than the background.
    let light: f64 = some.mean_histogram().iter().map(|mean| (mean - background).max(0.0)).sum();
    let photons = light * light / (per_count * light + empty * some.bins as f64);
    // Without light it is no number.
    if photons > 0.0 {
        ((LEAST_PHOTONS / photons) as usize).clamp(ENOUGH_PAIRS, MOST_PAIRS)
    } else {
        MOST_PAIRS
    }
}

/// Median and first quartile of a squared standard normal.
const MEDIAN: f64 = 0.4549;
const QUARTILE: f64 = 0.1015;

/// A second difference along time squared, and the counts that its variance comes from: for photons it is 1.5 variances
/// of a bin on average where the signal is smooth.
fn bend(w: &[f32]) -> [f64; 2] {
    let [a, b, c] = [w[0], w[1], w[2]].map(f64::from);
    [(b - 0.5 * (a + c)).powi(2), 0.25 * a + b + 0.25 * c]
}

/// Variance of a bin over its mean count; 1 for photons. Estimated from second differences along time. The median over
/// bins ignores edges.
pub fn variance_per_count(capture: &Capture) -> f64 {
    if capture.integer_counts {
        return 1.0;
    }
    let windows = capture.histograms.par_chunks_exact(capture.bins).flat_map_iter(|h| h.windows(3));
    let lit = windows.filter(|w| w.iter().all(|v| *v > 0.0)).map(bend);
    quantile(&mut lit.map(|[squared, counts]| squared / counts).collect::<Vec<_>>(), 0.5) / MEDIAN
}

/// Bins with so much light, in standard deviations of an empty bin, tell the noise of light: dimmer ones have too little
/// of it, and in brighter ones the bends of the histogram itself outweigh it.
const LIT: Range<f64> = 3.0..6.0;
/// Least number of such bins; with fewer, all brighter ones count, too.
const FEWEST: usize = 256;
/// Most second differences that [`variance_above`] looks at.
const MOST: usize = 1 << 16;

/// Variance of a bin per count of its light, if a bin without light has the variance `empty`: with it, a quarter of the
/// squared second differences is below the quartile of their distribution. Edges are among the other three.
fn variance_above(capture: &Capture, empty: f64) -> f64 {
    let windows = || capture.histograms.chunks_exact(capture.bins).flat_map(|h| h.windows(5));
    // Bins are chosen by those beside them, whose noise is their own.
    let light = |w: &[f32]| 0.5 * (f64::from(w[0]) + f64::from(w[4])) / empty.sqrt();
    let lit = |most: f64| windows().filter(move |w| (LIT.start..most).contains(&light(w)));
    let most = if lit(LIT.end).take(FEWEST).count() < FEWEST { f64::INFINITY } else { LIT.end };
    let every = lit(most).count().div_ceil(MOST).max(1);
    let bends: Vec<[f64; 2]> = lit(most).step_by(every).map(|w| bend(&w[1..4])).collect();
    let ratio = |per_count: f64| {
        let ratios =
            bends.iter().map(|[squared, counts]| squared / (per_count * counts.max(0.0) + 1.5 * empty));
        quantile(&mut ratios.collect::<Vec<_>>(), 0.25)
    };
    let (mut low, mut high) = (0.0, 1.0);
    while ratio(high) > QUARTILE && high < 1e30 {
        (low, high) = (high, 4.0 * high);
    }
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if ratio(middle) > QUARTILE { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
pub(crate) mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::*;

    /// Photon counts of 16 x 16 pairs: a peak of the given size on a level of dark counts.
    pub fn counts(peak: f64, dark: f64, at: f64, seed: u64) -> Capture {
        let mut random = Pcg64::seed_from_u64(seed);
        let bins = 256;
        let wall: Vec<_> =
            (0..256).map(|i| glam::dvec3(f64::from(i / 16), f64::from(i % 16), 0.0) / 16.0).collect();
        let mean = |bin: usize| dark + peak * (-0.5 * ((bin as f64 - at) / 12.0).powi(2)).exp();
        let mut draw = |i: usize| match Poisson::new(mean(i % bins)) {
            Ok(counts) => counts.sample(&mut random) as f32,
            Err(_) => 0.0,
        };
        let histograms = (0..256 * bins).map(&mut draw).collect();
        let mut made = Capture::new([16, 16], wall.clone(), wall, bins, 0.01, histograms);
        made.integer_counts = true;
        made
    }

    /// The same pairs with these values, which are not photon counts.
    fn values(capture: &Capture, histograms: Vec<f32>) -> Capture {
        capture.clone().with(|c| (c.integer_counts, c.histograms) = (false, histograms))
    }

    #[test]
    fn background_is_the_dark_level_behind_the_signal() {
        for (dark, seed) in [(1.0, 1), (5.0, 2), (40.0, 3)] {
            let level = background(&counts(60.0, dark, 90.0, seed));
            assert!((level / dark - 1.0).abs() < 0.05, "{dark} is taken for {level}");
        }
        assert_eq!(background(&counts(60.0, 0.0, 90.0, 4)), 0.0);
    }

    #[test]
    fn there_is_no_background_where_the_signal_ends_the_histogram() {
        // The strongest bin is among the last, so the values there are signal.
        for at in [245.0, 250.0, 255.0] {
            assert_eq!(background(&counts(60.0, 1.0, at, 5)), 0.0, "{at}");
        }
        let one_bin = counts(60.0, 1.0, 90.0, 6).with(|c| (c.bins, c.histograms) = (1, vec![7.0; 256]));
        assert_eq!(background(&one_bin), 0.0);
    }

    #[test]
    fn variance_per_count_is_the_scale_of_scaled_photons() {
        let photons = counts(200.0, 20.0, 120.0, 7);
        assert_eq!(variance_per_count(&photons), 1.0, "photons");
        for factor in [1.0, 0.037, 512.0] {
            let scaled = values(&photons, photons.histograms.iter().map(|h| h * factor).collect());
            let found = variance_per_count(&scaled) / f64::from(factor);
            assert!((found - 1.0).abs() < 0.2, "{factor}: {found}");
        }
        // Without noise the background is almost zero, and nothing is subtracted from zero.
        let smooth = |i: usize| 100.0 + 50.0 * (i as f32 / 40.0).sin();
        let silent = values(&photons, (0..photons.histograms.len()).map(|i| smooth(i % 256)).collect());
        assert!(variance_per_count(&silent) < 1e-3);
        let empty = values(&silent, vec![0.0; photons.histograms.len()]);
        assert_eq!(variance_per_count(&empty), 0.0);
    }
}
