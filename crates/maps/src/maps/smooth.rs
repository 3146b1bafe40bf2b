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
    let within = |at: usize, k: isize, count: usize| (at as isize + k).clamp(0, count as isize - 1) as usize;
    // Sums of lines, tap by tap: the places of a line do not wait for each other.
    let mut along_y = vec![0.0; values.len()];
    let mut line = Vec::with_capacity(ny + 2 * reach as usize);
    for (to, from) in along_y.chunks_mut(ny).zip(values.chunks(ny)) {
        line.clear();
        line.extend((-reach..ny as isize + reach).map(|y| from[within(0, y, ny)]));
        for (shifted, w) in line.windows(ny).zip(&weights) {
            to.iter_mut().zip(shifted).for_each(|(to, v)| *to += w * v);
        }
        to.iter_mut().for_each(|to| *to /= sum);
    }
    let mut all = vec![0.0; values.len()];
    for (x, to) in all.chunks_mut(ny).enumerate() {
        for (k, w) in (-reach..=reach).zip(&weights) {
            let from = &along_y[within(x, k, nx) * ny..][..ny];
            to.iter_mut().zip(from).for_each(|(to, v)| *to += w * v);
        }
        to.iter_mut().for_each(|to| *to /= sum);
    }
    all
}
