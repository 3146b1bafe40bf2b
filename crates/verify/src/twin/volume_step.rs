use glam::DVec3;

use super::shared::watch;
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

/// As in the kernel.
const CONE: f64 = 3.0;

/// A step of accelerated proximal gradient on the vectors of a coarse volume.
pub fn volume_step(call: &Call, b: &mut [Cells]) {
    bind!(b: counts u, points v4, normals v4, gradient v4, voxels v4);
    let has_normals = call.twin.model.reflectance.has_normals();
    let [momentum, share] = [call.push.unbias_first, call.push.unbias_second].map(f64::from);
    let front = -DVec3::Z;
    let mut most = 0.0f64;
    for slot in 0..counts[COUNT_ACTIVE as usize] as usize {
        let of = |v: &[f64; 4]| DVec3::new(v[0], v[1], v[2]);
        let (before, bound) = (of(&voxels[2 * slot]), share * voxels[2 * slot][3]);
        let y = points[slot][3] * if has_normals { of(&normals[slot]) } else { front };
        let g = if has_normals { of(&gradient[slot]) } else { gradient[slot][0] * front };
        let next = match bound > 0.0 {
            true => shrunk(in_cone(y - g / bound), voxels[2 * slot + 1][0] / bound),
            false => DVec3::ZERO,
        };
        let ahead = next + momentum * (next - before);
        let size = if has_normals { ahead.length() } else { (-ahead.z).max(0.0) };
        watch(counts, next.x + next.y + next.z + size, FAULT_UPDATE);
        voxels[2 * slot] = [next.x, next.y, next.z, voxels[2 * slot][3]];
        points[slot][3] = size;
        if has_normals {
            let way = if size > 0.0 { ahead / size } else { front };
            normals[slot] = [way.x, way.y, way.z, 0.0];
        }
        most = most.max(size);
    }
    let peak = &mut counts[COUNT_PEAK_ALBEDO as usize];
    *peak = (*peak).max((most as f32).to_bits());
}

/// The nearest point with v_z <= 0 and |v_xy| <= [`CONE`] |v_z|.
fn in_cone(v: DVec3) -> DVec3 {
    let across = v.truncate().length();
    if across <= -CONE * v.z {
        return v;
    }
    let at = ((CONE * across - v.z) / (1.0 + CONE * CONE)).max(0.0);
    if at == 0.0 { DVec3::ZERO } else { (v.truncate() * (CONE * at / across)).extend(-at) }
}

fn shrunk(v: DVec3, by: f64) -> DVec3 {
    let size = v.length();
    if size <= by { DVec3::ZERO } else { v * (1.0 - by / size) }
}
