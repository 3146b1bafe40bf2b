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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hat_has_no_sum_and_fits_its_buffer() {
        for sigma in [0.1, 0.7, 3.0, 20.0, 500.0] {
            for bins in [2, 10, 400] {
                let hat = hat(sigma, bins);
                let radius = hat[0] as usize;
                assert!(hat.len() == radius + 2 && hat.len() <= bins + 1);
                let sum = f64::from(hat[1]) + 2.0 * hat[2..].iter().map(|w| f64::from(*w)).sum::<f64>();
                let size = hat[1..].iter().fold(0.0f32, |a, w| a.max(w.abs()));
                assert!(sum.abs() < 1e-5 * f64::from(size.max(1e-3)), "{sigma} {bins}: {sum}");
                assert!(hat[2..].iter().all(|w| *w <= hat[1]), "highest in its middle");
            }
        }
        // The second derivative of a Gaussian: zero at sigma, lowest at sqrt(3) sigma.
        let hat = hat(30.0, 400);
        assert!(hat[1 + 30].abs() < 0.01 && hat[1 + 20] > 0.0 && hat[1 + 40] < 0.0);
        let lowest = (0..=120).min_by(|a, b| hat[1 + a].total_cmp(&hat[1 + b])).unwrap();
        assert!((50..=54).contains(&lowest), "{lowest}");
    }
}
