use super::shared::{adam, watch};
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

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
        let slope = f64::from(call.paper.noise_span) * sigmoid * (1.0 - sigmoid);
        let gradient = of_sum / f64::from(call.scene.render_scale) * slope;
        // Counted from the start of the solve.
        let (rate, steps) = (f64::from(call.paper.learning_rate), call.push.iteration + 1);
        adam(&call.paper, rate, steps, gradient, [weight, first, second]);
        watch(counts, *weight, FAULT_NOISE);
    }
}
