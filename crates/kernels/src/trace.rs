//! The end of an iteration: sums of partial losses, and the row of the trace.

use rayon::prelude::*;

use super::shared::*;
use super::{Call, Real};

/// Sum of the partial sums of a dispatch, and the row of the trace that closes an iteration.
pub fn close<F: Real>(
    call: &Call<'_>,
    counts: &mut [u32],
    losses: &[[F; 2]],
    magnitudes: &[F],
    trace: &mut [u32],
) {
    let of = |constant, usual| call.constant(constant, usual);
    let tile = (WORKGROUP * RESIDUAL_BINS) as usize;
    let partials = if of("ROWS", 0) == 0 { call.cells().div_ceil(tile) } else { call.scene.pairs as usize };
    let of_chunk =
        |all: &[[F; 2]]| all.iter().fold([0.0; 2], |s, l| [s[0] + l[0].wide(), s[1] + l[1].wide()]);
    // There may be millions.
    let chunks: Vec<[f64; 2]> = losses[..partials].par_chunks(4096).map(of_chunk).collect();
    let mean = |k: usize| chunks.iter().map(|sum| sum[k]).sum::<f64>() * f64::from(call.scene.loss_scale);
    let active = counts[COUNT_ACTIVE as usize];
    let summed = active.div_ceil(of("SUMMED", WORKGROUP)) as usize;
    let row = &mut trace[(call.push.iteration * TRACE_ROW) as usize..][..TRACE_ROW as usize];
    let mut put = |at: u32, value: f64| row[at as usize] = (value as f32).to_bits();
    put(TRACE_DATA, mean(1));
    put(TRACE_OBJECTIVE, mean(0));
    put(TRACE_L1, magnitudes[..summed].iter().map(|v| v.wide()).sum());
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
