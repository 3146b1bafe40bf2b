use rayon::prelude::*;

use super::shared::PADDING;
use super::weight::bin_weights;
use super::{Call, Cells, Real};

/// Weighted histograms, filtered along time. `hat_taps`: the radius, then the weights at 0, 1, 2, ... bins to either side;
/// a radius below zero: those of earlier bins are the negatives of those of later ones. A pair is one task.
pub fn filter<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: measured f, hat_taps f, residual f);
    let (weights, bins) = (bin_weights::<F>(call), call.bins());
    let (radius, hat) = (hat_taps[0].wide().abs() as usize, &hat_taps[1..]);
    let earlier = if hat_taps[0] < F::zero() { -F::one() } else { F::one() };
    // Weights of the bins from `radius` before a bin to `radius` after it; beyond the row they are of no bin.
    let reach = radius.min(bins);
    let taps: Vec<F> = (0..2 * reach + 1)
        .map(|k| if k < reach { earlier * hat[reach - k] } else { hat[k - reach] })
        .collect();
    let (before, rows) = residual[..call.cells()].split_at_mut(PADDING as usize);
    before.fill(F::zero());
    let scratch = || vec![F::zero(); bins + 2 * reach];
    let rows = rows.par_chunks_mut(call.stride()).zip(measured.par_chunks(bins));
    rows.for_each_init(scratch, |weighted, (row, measured)| {
        row.fill(F::zero());
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || {
                let own = weighted[reach..].iter_mut().zip(measured).zip(&weights);
                own.for_each(|((to, value), weight)| *to = *weight * *value);
                for (k, tap) in taps.iter().enumerate() {
                    row[..bins].iter_mut().zip(&weighted[k..]).for_each(|(sum, v)| *sum = *sum + *tap * *v);
                }
            },
        );
    });
}
