use glam::DVec3;

use super::shared::{PairGeometry, gather, shine, watch};
use super::{Call, Cells, Sample, Twin};
use thirdbounce::transport::Reflectance;
use thirdbounce::transport::kernels::*;

/// The gradient at points of the surface: by the vector (albedo times normal) and by the depth; without normals by the
/// albedo and by the depth.
pub fn surface_gather(call: &Call, b: &mut [Cells]) {
    bind!(b: counts u, points v4, normals v4, _4 any, _5 any, gradient v4; _wall any, residual f);
    let m = call.twin.model;
    for slot in 0..counts[COUNT_ACTIVE as usize] as usize {
        let s = Sample::at(&call.twin, points, normals, slot);
        let (mut albedo, mut vector, mut depth) = (0.0, DVec3::ZERO, 0.0);
        gather(call, &s, residual, |k, r, rise| {
            if k.falloff == 0.0 {
                return;
            }
            let (value, slope) = shine(m.reflectance, &k.arms, s.normal);
            albedo += r * k.falloff * value;
            vector += r * k.falloff * slope;
            let longer = -(k.arms[0].toward.z + k.arms[1].toward.z) / m.bin_width;
            depth += s.albedo * (rise * longer * k.falloff * value + r * deeper(&call.twin, k, s.normal));
        });
        let sum = match m.reflectance.has_normals() {
            true => [vector.x, vector.y, vector.z, depth],
            false => [albedo, depth, 0.0, 0.0],
        };
        let before = if call.push.flags & BACKWARD_CONTINUE == 0 { [0.0; 4] } else { gradient[slot] };
        gradient[slot] = std::array::from_fn(|k| before[k] + sum[k]);
        watch(counts, gradient[slot].iter().sum(), FAULT_BACKWARD);
    }
}

/// Derivative by depth of a pair's kernel for a sample of unit albedo: the product rule over its factors.
fn deeper(twin: &Twin, k: &PairGeometry, normal: DVec3) -> f64 {
    let model = twin.model;
    let power = f64::from(model.falloff_power()) / 2.0;
    // Derivatives of an arm's direction and falloff as the sample moves along z.
    let turned = k.arms.map(|arm| (arm.toward * arm.toward.z - DVec3::Z) / arm.distance);
    let fallen = k.arms.map(|arm| arm.falloff * power * arm.toward.z / arm.distance);
    let [a, b] = k.arms;
    let of_falloff = fallen[0] * b.falloff + a.falloff * fallen[1];
    let (shown, _) = shine(model.reflectance, &k.arms, normal);
    let of_shine = match model.reflectance {
        Reflectance::Cosine if shown > 0.0 => normal.dot(turned[0]),
        Reflectance::Lambertian if shown > 0.0 => {
            let (cos_a, cos_b) = (normal.dot(a.toward), normal.dot(b.toward));
            let of_surface = normal.dot(turned[0]) * cos_b + cos_a * normal.dot(turned[1]);
            let [wall_a, wall_b] = [0, 1].map(|i| -k.arms[i].wall_normal.dot(turned[i]));
            a.wall * b.wall * of_surface + (wall_a * b.wall + a.wall * wall_b) * cos_a * cos_b
        }
        _ => 0.0,
    };
    of_falloff * shown + k.falloff * of_shine
}
