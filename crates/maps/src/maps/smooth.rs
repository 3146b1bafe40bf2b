//! Slopes and smoothed values of maps.

/// Slope of values along x and y at a pixel, from its neighbours in `shown`; 0 without neighbours.
pub(super) fn slope([nx, ny]: [usize; 2], values: &[f64], shown: &[bool], i: usize) -> [f64; 2] {
    let along = |at: usize, count: usize, stride: usize| {
        let low = at.checked_sub(1).map(|_| i - stride).filter(|j| shown[*j]).unwrap_or(i);
        let high = Some(i + stride).filter(|j| at + 1 < count && shown[*j]).unwrap_or(i);
        let steps = (high - low) / stride;
        if steps == 0 || values[i].is_nan() { 0.0 } else { (values[high] - values[low]) / steps as f64 }
    };
    [along(i / ny, nx, ny), along(i % ny, ny, 1)]
}

/// Gaussian of `sigma` pixels; edge values are repeated beyond the edge.
pub(super) fn smoothed([nx, ny]: [usize; 2], values: &[f64], sigma: f64) -> Vec<f64> {
    let reach = (4.0 * sigma).ceil() as isize;
    let weights: Vec<f64> =
        (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma.max(1e-9)).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    let along = |from: &[f64], count: usize, stride: usize| -> Vec<f64> {
        let of = |i: usize| {
            let at = i / stride % count;
            let mean = (-reach..=reach).zip(&weights).map(|(k, w)| {
                let other = (at as isize + k).clamp(0, count as isize - 1) as usize;
                w * from[i + other * stride - at * stride]
            });
            mean.sum::<f64>() / sum
        };
        (0..from.len()).map(of).collect()
    };
    along(&along(values, ny, 1), nx, ny)
}
