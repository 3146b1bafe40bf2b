use super::shared::{corners, elu, larger, sample_point, slot_of, toward_wall, watch};
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

/// The samples of the active voxels: raw variables interpolated at a random point, or those at the centre.
pub fn sample(call: &Call, b: &mut [Cells]) {
    bind!(
        b: counts u, active_voxels u, raw v4, points v4, normals v4, l1_partials f, mask u, ranks u, rim u, rim_ranks u
    );
    let twin = &call.twin;
    let continuous = call.constant(constant::CONTINUOUS, 1) != 0;
    let state = |index: usize| {
        let of_rim = || slot_of(rim, rim_ranks, index, call.scene.touched_capacity);
        slot_of(mask, ranks, index, call.scene.capacity).or_else(of_rim).map_or([0.0; 4], |slot| raw[slot])
    };
    for slot in 0..counts[COUNT_ACTIVE as usize] as usize {
        let index = active_voxels[slot];
        let g = sample_point(call, index);
        let mut v = if continuous { [0.0; 4] } else { raw[slot] };
        for (corner, weight) in corners(twin.grid, g).filter(|_| continuous) {
            let near = state(corner);
            (0..4).for_each(|k| v[k] += weight * near[k]);
        }
        let (u, albedo, point) = (toward_wall(v), elu(v[0]), twin.grid.position(g));
        let length = u.length().max(1e-12);
        points[slot] = [point.x, point.y, point.z, albedo];
        if twin.model.reflectance.has_normals() {
            normals[slot] = [u.x / length, u.y / length, u.z / length, length];
        }
        let before = if slot.is_multiple_of(WORKGROUP as usize) { 0.0 } else { l1_partials[slot / WORKGROUP as usize] };
        l1_partials[slot / WORKGROUP as usize] = before + albedo.abs();
        let peak = &mut counts[COUNT_PEAK_ALBEDO as usize];
        *peak = larger(*peak, albedo.abs());
        watch(counts, v.iter().sum(), FAULT_SAMPLE);
    }
}
