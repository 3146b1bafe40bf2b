use super::learned::half;
use super::{Call, Cells, Real};

/// Scale and offset of each channel, from the moments of its group.
pub fn learned_moments<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: weights u, moments v2, scales v2);
    let layer = call.learned();
    let (each, partials) = (layer.outputs as usize, layer.inputs as usize);
    let count = (call.learned_cells() * each) as f64;
    let weight = |i: usize| half(weights, layer.weights as usize + i);
    for channel in 0..layer.more as usize {
        let of = &moments[channel / each * each * partials..][..each * partials];
        let [mean, square] = [0, 1].map(|k| of.iter().map(|m| m[k].wide()).sum::<f64>() / count);
        let scale = if call.is("OF_BANDS") {
            [1.0 / (3.0 * square.sqrt().max(1e-20)), 0.0]
        } else {
            let scale = weight(channel) / ((square - mean * mean).max(0.0) + 1e-5).sqrt();
            [scale, weight(layer.more as usize + channel) - mean * scale]
        };
        scales[channel] = scale.map(F::of);
    }
}
