use glam::DVec3;

use super::shared::{gather, may_be_active};
use super::{Call, Cells, Sample, Twin};
use thirdbounce::transport::Model;
use thirdbounce::transport::kernels::BACKWARD_CONTINUE;

/// Back-projects filtered histograms into every voxel that is not too near, with the cosine of a surface that faces the
/// wall and no falloff. Spots count as points.
pub fn backproject(call: &Call, b: &mut [Cells]) {
    bind!(b: _1 any, _2 any, projected f; _wall any, residual f);
    let sharp = Model { rendered: None, ..call.twin.model.clone() };
    let call = &Call { twin: Twin { model: &sharp, ..call.twin }, ..call.clone() };
    let directed = sharp.reflectance.has_normals();
    for (index, projected) in projected.iter_mut().enumerate().take(call.twin.grid.storage()) {
        let c = call.twin.grid.voxel(index).map(|c| c as f64);
        let point = call.twin.grid.position(DVec3::from_array(c));
        let sample = Sample { point, albedo: 1.0, normal: DVec3::ZERO, length: 0.0 };
        let mut sum = if call.push.flags & BACKWARD_CONTINUE == 0 { 0.0 } else { *projected };
        if may_be_active(&call.twin, index) {
            let cosine = |toward: DVec3| if directed { (-toward.z).max(0.0) } else { 1.0 };
            gather(call, &sample, residual, |k, r, _| sum += r * cosine(k.arms[0].toward));
        }
        *projected = sum;
    }
}
