use super::{Call, Cells, random3};
use thirdbounce::transport::kernels::*;

/// The first volume: albedo uniform in [0, span), normals zero.
pub fn initialise_raw(call: &Call, b: &mut [Cells]) {
    bind!(b: counts u, active_voxels u, raw v4);
    let span = f64::from(f32::from_bits(call.constant(constant::ALBEDO_SPAN, 1f32.to_bits())));
    for slot in 0..counts[COUNT_TOUCHED as usize] as usize {
        raw[slot] = [span * random3(active_voxels[slot], 0, 0, call.paper.seed)[0], 0.0, 0.0, 0.0];
    }
}
