use super::shared::{elu, larger, slot_of};
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

/// One axis of the separable Gaussian, zero outside the grid. The first reads the active voxels' albedo: raw, or after ELU
/// with a noise term. The last keeps the maximum.
pub fn gaussian(call: &Call, b: &mut [Cells]) {
    bind!(b: taps f, raw v4, mask u, source f, smoothed f, counts u, ranks u, levels u);
    let (grid, axis) = (call.twin.grid, call.constant(constant::AXIS, 0) as usize);
    if axis == 0 {
        levels.fill(0);
        counts[COUNT_PEAK_SMOOTH as usize] = 0;
        counts[COUNT_LEAST_SMOOTH as usize] = 0;
    }
    let has_noise = call.paper.noise_base + call.paper.noise_span > 0.0;
    let value = |index: usize| match slot_of(mask, ranks, index, call.scene.capacity) {
        _ if axis > 0 => source[index],
        Some(slot) if has_noise => elu(raw[slot][0]),
        Some(slot) => raw[slot][0],
        None => 0.0,
    };
    for index in 0..grid.storage() {
        let mut c = grid.voxel(index);
        let (here, radius) = (c[axis], taps[0] as usize);
        let mut sum = 0.0;
        if grid.contains(c) {
            for at in here.saturating_sub(radius)..(here + radius + 1).min(grid.n[axis]) {
                c[axis] = at;
                sum += taps[1 + at.abs_diff(here)] * value(grid.index(c));
            }
        }
        smoothed[index] = sum;
        if axis == 2 {
            let peak = &mut counts[COUNT_PEAK_SMOOTH as usize];
            *peak = larger(*peak, sum);
        }
    }
}
