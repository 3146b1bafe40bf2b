use rayon::prelude::*;

use super::shared::*;
use super::{Call, Real};

/// Sums the partial sums of an iteration, writes its row of the trace and resets the maximum.
pub fn close<F: Real>(
    call: &Call<'_>,
    counts: &mut [u32],
    losses: &[[F; 2]],
    magnitudes: &[F],
    trace: &mut [u32],
) {
    let tile = (WORKGROUP * RESIDUAL_BINS) as usize;
    let each = if call.is("GROUPED") { 1 } else { WORKGROUP as usize };
    let partials =
        if call.is("ROWS") { call.scene.pairs as usize } else { call.cells().div_ceil(tile) * each };
    let of_chunk =
        |all: &[[F; 2]]| all.iter().fold([0.0; 2], |s, l| [s[0] + l[0].wide(), s[1] + l[1].wide()]);
    // In order, and in float64: there may be millions.
    let chunks: Vec<[f64; 2]> = losses[..partials].par_chunks(4096).map(of_chunk).collect();
    let mean = |k: usize| chunks.iter().map(|sum| sum[k]).sum::<f64>() * f64::from(call.scene.loss_scale);
    let summed = counts[COUNT_ACTIVE as usize].div_ceil(call.constant("SUMMED", WORKGROUP)) as usize;
    let row = &mut trace[(call.push.iteration * TRACE_ROW) as usize..][..TRACE_ROW as usize];
    let mut put = |at: u32, value: f64| row[at as usize] = (value as f32).to_bits();
    put(TRACE_DATA, mean(1));
    put(TRACE_OBJECTIVE, mean(0));
    put(TRACE_L1, magnitudes[..summed].iter().map(|m| m.wide()).sum());
    for (at, count) in [
        (TRACE_ACTIVE, COUNT_ACTIVE),
        (TRACE_PEAK, COUNT_PEAK_ALBEDO),
        (TRACE_FAULTS, COUNT_FAULTS),
        (TRACE_LEAST, COUNT_LEAST_SMOOTH),
    ] {
        row[at as usize] = counts[count as usize];
    }
    counts[COUNT_PEAK_ALBEDO as usize] = 0;
}
