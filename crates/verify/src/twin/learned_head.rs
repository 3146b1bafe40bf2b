use super::{Call, Cells};

/// Means of features over the distribution of depths, their maxima, the largest logit, the logarithm of the sum of exponentials;
/// and the most probable voxel with its fraction.
pub fn learned_head(call: &Call, b: &mut [Cells]) {
    bind!(b: features f, logits f, out f, depth f);
    let (layer, cells) = (call.learned(), call.learned_cells());
    let (count, deep) = (layer.inputs as usize, layer.n_z as usize);
    let columns = cells / deep;
    for column in 0..columns {
        let logits = &logits[column * deep..][..deep];
        let top = (0..deep).max_by(|a, b| logits[*a].total_cmp(&logits[*b])).unwrap_or(0);
        let p: Vec<f64> = logits.iter().map(|l| (l - logits[top]).exp()).collect();
        let all: f64 = p.iter().sum();
        for f in 0..count {
            let values = &features[f * cells + column * deep..][..deep];
            out[f * columns + column] = p.iter().zip(values).map(|(p, v)| p * v).sum::<f64>() / all;
            out[(count + f) * columns + column] = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        }
        out[2 * count * columns + column] = logits[top];
        out[(2 * count + 1) * columns + column] = logits[top] + all.ln();
        let near = top.saturating_sub(2)..(top + 3).min(deep);
        let sum: f64 = near.clone().map(|z| p[z] * z as f64).sum();
        depth[column] = sum / near.map(|z| p[z]).sum::<f64>();
    }
}
