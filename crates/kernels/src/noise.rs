use rayon::prelude::*;

use super::adam::Adam;
use super::shared::*;
use super::{Call, Cells, Real};

/// One step of Adam on the noise weights, one per bin or one per histogram: (weight, first moment, second moment).
pub fn noise<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: residual f, noise_state v3, counts u);
    let (bins, per_histogram) = (call.bins(), call.is("PER_HISTOGRAM"));
    let span = F::from32(call.paper.noise_span) / F::from32(call.scene.render_scale);
    // Counted from the start of the solve.
    let adam = Adam::<F>::of(&call.paper, call.paper.learning_rate.into(), call.push.iteration + 1);
    let learn = |[weight, first, second]: &mut [F; 3], of_sum: F| {
        let sigmoid = F::one() / (F::one() + (-*weight).exp());
        adam.step(of_sum * span * sigmoid * (F::one() - sigmoid), [&mut *weight, first, second]);
        weight.is_finite()
    };
    let pairs = noise_state.par_chunks_mut(if per_histogram { 1 } else { bins }).take(call.scene.pairs as usize);
    let all = pairs.enumerate().map(|(pair, state)| {
        let row = &residual[call.row(pair)..][..bins];
        if per_histogram {
            return learn(&mut state[0], row.iter().copied().sum());
        }
        state.iter_mut().zip(row).fold(true, |is_finite, (state, r)| is_finite & learn(state, *r))
    });
    if !all.reduce(|| true, |a, b| a & b) {
        counts[COUNT_FAULTS as usize] |= FAULT_NOISE;
    }
}
