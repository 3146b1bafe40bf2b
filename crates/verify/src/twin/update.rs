use super::shared::{adam, corners, sample_point, watch};
use super::{Call, Cells, Raw};
use thirdbounce::transport::kernels::*;

/// One step of Adam on the touched voxels, with the gradient gathered from the samples around each: the adjoint of the
/// interpolation. Its rate is constant, or falls as half a cosine over the solve.
pub fn update(call: &Call, b: &mut [Cells]) {
    bind!(b: counts u, active_voxels u, _ranks any, gradient v4, raw v4, first v4, second v4, _mask any);
    let (twin, paper) = (&call.twin, &call.paper);
    let mut sums: Vec<Raw> = vec![[0.0; 4]; twin.grid.storage()];
    for slot in 0..counts[COUNT_ACTIVE as usize] as usize {
        for (to, weight) in corners(twin.grid, sample_point(call, active_voxels[slot])) {
            (0..4).for_each(|k| sums[to][k] += weight * gradient[slot][k]);
        }
    }
    let over = f64::from(paper.decay_over);
    let done = if over > 0.0 { (f64::from(call.push.iteration) / over).min(1.0) } else { 0.0 };
    let rate = f64::from(paper.learning_rate) * (0.5 + 0.5 * (std::f64::consts::PI * done).cos());
    for slot in 0..counts[COUNT_TOUCHED as usize] as usize {
        let g = sums[active_voxels[slot] as usize];
        for k in 0..4 {
            let state = [&mut raw[slot][k], &mut first[slot][k], &mut second[slot][k]];
            adam(paper, rate, call.push.step, g[k], state);
        }
        watch(counts, raw[slot].iter().sum(), FAULT_UPDATE);
    }
}
