use super::shared::watch;
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

/// As the twin of `residual.comp`, weighted, with the high-pass applied to weighted differences. A partial sum is that of
/// a pair.
pub fn residual_rows(call: &Call, b: &mut [Cells]) {
    bind!(b: counts u, measured f, residual f, histograms f, loss_partials v2, _6 any, spread f);
    let m = call.twin.model;
    let (render, elements) = (f64::from(call.scene.render_scale), m.elements as f64);
    let filter = |row: &mut [f64]| m.high_pass.iter().for_each(|f| f.apply(row, m.bin_width));
    let [seen, spots] = [constant::SEEN, constant::SPOT].map(|c| call.constant(c, 0) != 0);
    let root = |bin: usize| m.bin_weight(bin).sqrt();
    residual[..call.cells()].fill(0.0);
    for pair in 0..call.scene.pairs as usize {
        let row = call.row(pair)..call.row(pair) + m.bins;
        let compared = &mut if seen { &mut *spread } else { &mut *histograms }[row.clone()];
        let data = &measured[pair * m.bins..][..m.bins];
        let plain: Vec<f64> = compared.iter().zip(data).map(|(sum, h)| sum * render - h).collect();
        let magnitude: f64 = compared.iter().map(|sum| (sum * render).abs()).sum();
        let mut values: Vec<f64> = plain.iter().enumerate().map(|(bin, d)| root(bin) * d).collect();
        filter(&mut values);
        let squares = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
        loss_partials[pair] = [squares(&values), squares(&plain)];
        watch(counts, magnitude, FAULT_FORWARD);
        filter(&mut values);
        let scaled = values.iter().enumerate().map(|(bin, v)| 2.0 / elements * render * root(bin) * v);
        residual[row].iter_mut().zip(scaled).for_each(|(out, v)| *out = v);
        // The kernel keeps intermediate values in the row that it compares.
        compared.fill(Cells::ANY);
    }
    if !spots {
        histograms[..call.cells()].fill(0.0);
    }
}
