use glam::{DVec3, dvec3};

use super::shared::{gather, shine, watch};
use super::{Call, Cells, Sample};
use thirdbounce::transport::kernels::*;

/// The gradient of the paper's solver by the raw variables at every sample; before the last pairs, by albedo and by
/// albedo times normal.
pub fn backward(call: &Call, b: &mut [Cells]) {
    bind!(b: counts u, points v4, _3 any, _4 any, gradient v4, normals v4; _wall any, residual f);
    let m = call.twin.model;
    for slot in 0..counts[COUNT_ACTIVE as usize] as usize {
        let s = Sample::at(&call.twin, points, normals, slot);
        let goes_on = call.push.flags & BACKWARD_CONTINUE != 0;
        let [mut albedo, x, y, z] = if goes_on { gradient[slot] } else { [0.0; 4] };
        let mut normal = dvec3(x, y, z);
        gather(call, &s, residual, |k, mut r, _| {
            if call.constant(constant::EXACT, 0) != 0 {
                r *= k.falloff;
            }
            let (value, slope) = shine(m.reflectance, &k.arms, s.normal);
            albedo += r * value;
            normal += r * slope;
        });
        if call.push.flags & BACKWARD_FINISH != 0 {
            let sign = if s.albedo == 0.0 { 0.0 } else { s.albedo.signum() };
            albedo += f64::from(call.paper.l1_scale) * sign;
            // The chain rule through ELU, tanh and the normalization.
            albedo *= if s.albedo > 0.0 { 1.0 } else { s.albedo + 1.0 };
            let tanh = s.normal * s.length + DVec3::Z;
            let across = s.albedo * (normal - s.normal * s.normal.dot(normal)) / s.length;
            normal = across * (1.0 - tanh * tanh).max(DVec3::ZERO);
            watch(counts, albedo + normal.element_sum(), FAULT_BACKWARD);
        }
        gradient[slot] = [albedo, normal.x, normal.y, normal.z];
    }
}
