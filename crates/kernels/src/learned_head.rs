use super::{Call, Cells, Real};

/// Means of features over the distribution of depths, their maxima, the largest logit, the logarithm of the sum of exponentials;
/// and the most probable voxel with its fraction.
pub fn learned_head<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: features f, logits f, out f, depth f);
    let (layer, cells) = (call.learned(), call.learned_cells());
    let (count, deep) = (layer.inputs as usize, layer.n_z as usize);
    let columns = cells / deep;
    let wide = |all: &[F]| all.iter().map(|v| v.wide()).collect::<Vec<f64>>();
    for column in 0..columns {
        let logits = wide(&logits[column * deep..][..deep]);
        let top = (0..deep).max_by(|a, b| logits[*a].total_cmp(&logits[*b])).unwrap_or(0);
        let p: Vec<f64> = logits.iter().map(|l| (l - logits[top]).exp()).collect();
        let all: f64 = p.iter().sum();
        let mut put = |row: usize, value: f64| out[row * columns + column] = F::of(value);
        for f in 0..count {
            let values = wide(&features[f * cells + column * deep..][..deep]);
            put(f, p.iter().zip(&values).map(|(p, v)| p * v).sum::<f64>() / all);
            put(count + f, values.into_iter().fold(f64::NEG_INFINITY, f64::max));
        }
        put(2 * count, logits[top]);
        put(2 * count + 1, logits[top] + all.ln());
        let near = top.saturating_sub(2)..(top + 3).min(deep);
        let sum: f64 = near.clone().map(|z| p[z] * z as f64).sum();
        depth[column] = F::of(sum / near.map(|z| p[z]).sum::<f64>());
    }
}
