use super::arguments::chunks;
use super::{Call, Cells, Sample, rendered_pair};
use thirdbounce::transport::kernels::COUNT_ACTIVE;

/// Renders the samples of a dispatch into the histograms.
pub fn forward(call: &Call, b: &mut [Cells]) {
    bind!(b: counts u, points v4, normals v4, histograms f, _wall any);
    let active = counts[COUNT_ACTIVE as usize];
    let [_, chunk, of_set] = chunks(call, active);
    let at = |chunks: u32| chunks.saturating_mul(chunk).min(active) as usize;
    let slots = at(call.push.first)..at(call.push.first + of_set);
    let samples: Vec<Sample> = slots.map(|slot| Sample::at(&call.twin, points, normals, slot)).collect();
    for pair in 0..call.scene.pairs as usize {
        let bins = &mut histograms[call.row(pair)..];
        bins.iter_mut().zip(rendered_pair(&call.twin, pair, &samples)).for_each(|(sum, v)| *sum += v);
    }
}
