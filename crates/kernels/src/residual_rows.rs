use rayon::prelude::*;

use super::shared::*;
use super::{Call, Cells, Real};

/// Rows that are filtered together: the lanes of a vector.
const ROWS: usize = 16;

/// As `residual`, weighted, with the high-pass applied to weighted differences: the loss is |F S d|² and the residual S F F S d,
/// F = 1 - share (1 + κ L)⁻¹ with L the second difference with free ends. A partial sum is that of a pair. Leaves the
/// compared rows undefined. Sixteen rows are one task: a solve of their tridiagonal systems is a recurrence along bins,
/// for all of them at once.
pub fn residual_rows<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: counts u, measured f, residual f, histograms f, loss_partials v2, factors v4, spread f);
    let (bins, stride, pairs) = (call.bins(), call.stride(), call.scene.pairs as usize);
    let [seen, spots] = ["SEEN", "SPOT"].map(|name| call.is(name));
    let filter = SharedFilter::of(call, factors);
    let first = PADDING as usize;
    residual[..first].fill(F::zero());
    let compared = if seen { &spread[first..] } else { &histograms[first..] };
    let faults: Vec<u32> = residual[first..call.cells()]
        .par_chunks_mut(ROWS * stride)
        .zip(compared.par_chunks(ROWS * stride))
        .zip(measured[..pairs * bins].par_chunks(ROWS * bins))
        .zip(loss_partials[..pairs].par_chunks_mut(ROWS))
        .map_init(
            || [vec![[F::zero(); ROWS]; bins], vec![[F::zero(); ROWS]; bins]],
            |[values, kept], (((residual, compared), measured), losses)| {
                let rows = FilteredRows { filter: &filter, stride, compared, measured, values, kept, residual, losses };
                pulp::Arch::new().dispatch(rows)
            },
        )
        .collect();
    counts[COUNT_FAULTS as usize] |= faults.into_iter().fold(0, |all, some| all | some);
    if seen && F::IS_REFERENCE {
        spread[..call.cells()].fill(F::of(Cells::<F>::ANY));
    }
    if !spots {
        histograms[..call.cells()].par_chunks_mut(1 << 14).for_each(|part| part.fill(F::zero()));
    }
}

/// What all rows share.
struct SharedFilter<'f, F> {
    render: F,
    /// Residual per weighted and filtered difference.
    scale: F,
    share: F,
    /// By bin, from the first on, for elimination from the first on; for that from the last on the same table backward: root of
    /// its weight, inverse of the pivot, that times κ (`glsl/include/compared.glsl`).
    factors: &'f [[F; 4]],
}

impl<'f, F: Real> SharedFilter<'f, F> {
    fn of(call: &Call<'_>, factors: &'f [[F; 4]]) -> SharedFilter<'f, F> {
        let scene = &call.scene;
        SharedFilter {
            render: F::from32(scene.render_scale),
            scale: F::of(2.0 * f64::from(scene.loss_scale) * f64::from(scene.render_scale)),
            share: F::from32(call.surface.slow_share),
            factors: &factors[..call.bins()],
        }
    }
}

/// A task: up to [`ROWS`] rows, without the padding before the first.
struct FilteredRows<'r, F> {
    filter: &'r SharedFilter<'r, F>,
    stride: usize,
    compared: &'r [F],
    measured: &'r [F],
    /// Right-hand sides and results of eliminations, by bin.
    values: &'r mut [[F; ROWS]],
    kept: &'r mut [[F; ROWS]],
    residual: &'r mut [F],
    losses: &'r mut [[F; 2]],
}

impl<F: Real> pulp::WithSimd for FilteredRows<'_, F> {
    type Output = u32;

    /// Returns the faults.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> u32 {
        let FilteredRows { filter, stride, compared, measured, values, kept, residual, losses } = self;
        let (zero, bins) = (F::zero(), values.len());
        let (mut magnitudes, mut plain, mut filtered) = ([zero; ROWS], [zero; ROWS], [zero; ROWS]);
        for (lane, measured) in measured.chunks_exact(bins).enumerate() {
            let row = &compared[lane * stride..][..bins];
            for (bin, (sum, count)) in row.iter().zip(measured).enumerate() {
                values[bin][lane] = *sum * filter.render;
                kept[bin][lane] = *count;
            }
        }
        // Weighted differences, and their elimination from the first bin on.
        let mut before = [zero; ROWS];
        for (bin, (value, kept)) in values.iter_mut().zip(kept.iter_mut()).enumerate() {
            let [root, inverse, factor, _] = filter.factors[bin];
            for lane in 0..ROWS {
                let difference = value[lane] - kept[lane];
                magnitudes[lane] = magnitudes[lane] + value[lane].abs();
                plain[lane] = plain[lane] + difference * difference;
                value[lane] = root * difference;
                before[lane] = inverse * value[lane] + factor * before[lane];
                kept[lane] = before[lane];
            }
        }
        // Their solution, backward; and at once the elimination of what is left, from the last bin on.
        let mut answer = [zero; ROWS];
        before = [zero; ROWS];
        for (bin, (value, kept)) in values.iter_mut().zip(kept.iter_mut()).enumerate().rev() {
            let along = filter.factors[bin][2];
            let [_, inverse, factor, _] = filter.factors[bins - 1 - bin];
            for lane in 0..ROWS {
                answer[lane] = kept[lane] + along * answer[lane];
                value[lane] = value[lane] - filter.share * answer[lane];
                filtered[lane] = filtered[lane] + value[lane] * value[lane];
                before[lane] = inverse * value[lane] + factor * before[lane];
                kept[lane] = before[lane];
            }
        }
        answer = [zero; ROWS];
        for (bin, (value, kept)) in values.iter_mut().zip(kept.iter()).enumerate() {
            let (along, scale) = (filter.factors[bins - 1 - bin][2], filter.scale * filter.factors[bin][0]);
            for lane in 0..ROWS {
                answer[lane] = kept[lane] + along * answer[lane];
                value[lane] = scale * (value[lane] - filter.share * answer[lane]);
            }
        }
        let mut faults = 0;
        for (lane, row) in residual.chunks_mut(stride).enumerate() {
            let (own, padding) = row.split_at_mut(bins);
            own.iter_mut().zip(values.iter()).for_each(|(to, value)| *to = value[lane]);
            padding.fill(zero);
            losses[lane] = [filtered[lane], plain[lane]];
            if !magnitudes[lane].is_finite() {
                faults |= FAULT_FORWARD;
            } else if !(filtered[lane] + plain[lane]).is_finite() {
                faults |= FAULT_RESIDUAL;
            }
        }
        faults
    }
}
