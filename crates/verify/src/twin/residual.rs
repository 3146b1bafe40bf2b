use super::shared::watch;
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

/// Compares rendered histograms with the measurement: dLoss / d(accumulated value) of every bin, and the partial sums of
/// weighted and plain squared differences.
pub fn residual(call: &Call, b: &mut [Cells]) {
    bind!(b: counts u, measured f, residual f, histograms f, loss_partials v2, noise_state v3, spread f);
    let m = call.twin.model;
    let of = |constant| call.constant(constant, 0);
    let (render, elements) = (f64::from(call.scene.render_scale), m.elements as f64);
    let [base, span] = [call.paper.noise_base, call.paper.noise_span].map(f64::from);
    let tile = (WORKGROUP * RESIDUAL_BINS) as usize;
    for first in (0..call.cells()).step_by(tile) {
        for lane in 0..WORKGROUP as usize {
            let mut sums = [0.0; 2];
            let mut magnitude = 0.0;
            for cell in (first + lane..call.cells().min(first + tile)).step_by(WORKGROUP as usize) {
                residual[cell] = 0.0;
                if let Some((pair, bin)) = call.bin_of(cell) {
                    let accumulated = if of(constant::SEEN) != 0 { spread[cell] } else { histograms[cell] };
                    let (mut value, mut open) = (accumulated * render, 1.0);
                    let index = pair * m.bins + bin;
                    if of(constant::NOISE) != 0 {
                        let [w, ..] = noise_state[if of(constant::NOISE) == 1 { index } else { pair }];
                        value += base + span / (1.0 + (-w).exp());
                        open = if value > 0.0 { 1.0 } else { 0.0 };
                        value = value.max(0.0);
                    }
                    let difference = value - measured[index];
                    let weight = if of(constant::WEIGHTED) != 0 { m.bin_weight(bin) } else { 1.0 };
                    residual[cell] = 2.0 / elements * render * open * weight * difference;
                    sums = [sums[0] + weight * difference * difference, sums[1] + difference * difference];
                    magnitude += value.abs();
                }
                if of(constant::SPOT) == 0 {
                    histograms[cell] = 0.0;
                }
            }
            let own = first / tile;
            let before = if lane > 0 { loss_partials[own] } else { [0.0; 2] };
            loss_partials[own] = [before[0] + sums[0], before[1] + sums[1]];
            watch(counts, magnitude, FAULT_FORWARD);
            watch(counts, if magnitude.is_finite() { sums[0] + sums[1] } else { 0.0 }, FAULT_RESIDUAL);
        }
    }
}
