use super::shared::{adam, unbiased, watch};
use super::{Call, Cells};
use crate::transport::kernels::*;

/// One step of Adam on the noise weights, one per bin or one per histogram: (weight, first moment, second moment).
pub fn noise(call: &Call, b: &mut [Cells]) {
    bind!(b: residual f, noise_state v3, counts u);
    let m = call.twin.model;
    let per_histogram = call.constant(constant::PER_HISTOGRAM, 0) != 0;
    let size = if per_histogram { m.bins } else { 1 };
    for (i, [weight, first, second]) in noise_state.iter_mut().enumerate() {
        let (pair, bin) = (i * size / m.bins, i * size % m.bins);
        if pair >= call.scene.pairs as usize {
            break;
        }
        let of_sum: f64 = residual[call.row(pair) + bin..][..size].iter().sum();
        let sigmoid = 1.0 / (1.0 + (-*weight).exp());
        let slope = m.noise[1] * m.peak * sigmoid * (1.0 - sigmoid);
        let gradient = of_sum / f64::from(call.scene.render_scale) * slope;
        // Counted from the start of the solve.
        let unbias = unbiased(m, call.push.iteration + 1);
        adam(m, m.learning_rate, unbias, gradient, [weight, first, second]);
        watch(counts, *weight, FAULT_NOISE);
    }
}
