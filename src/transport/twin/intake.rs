//! A caller's counts on their way to the measurement.

use crate::transport::Rows;

/// Sum, sum of squares, largest and smallest of counts `[pair * bins + bin]`, for every slice of `of_slice` pairs:
/// `[slice * bins + bin]`.
pub fn tally(counts: &[f64], bins: usize, of_slice: usize) -> Vec<[f64; 4]> {
    let slices = counts.chunks(bins * of_slice);
    slices
        .flat_map(|slice| {
            (0..bins).map(move |bin| {
                let values = || slice.iter().skip(bin).step_by(bins);
                let fold = |with: fn(f64, f64) -> f64, from| values().copied().fold(from, with);
                [
                    values().sum(),
                    values().map(|v| v * v).sum(),
                    fold(f64::max, f64::NEG_INFINITY),
                    fold(f64::min, f64::INFINITY),
                ]
            })
        })
        .collect()
}

/// The measured values that `rows` take of counts `[pair * bins + bin]`, times `factor`, less `below`.
pub fn intake(counts: &[f64], bins: usize, rows: &Rows, [factor, below]: [f64; 2]) -> Vec<f64> {
    let kept = |pair: &usize| &counts[pair * bins..][rows.bins()];
    rows.pairs().iter().flat_map(kept).map(|count| count * factor - below).collect()
}
