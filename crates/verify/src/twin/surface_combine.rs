use glam::{DVec2, DVec3, dvec2, dvec3};

use super::shared::{AROUND, PixelBuffers, facing, stretch};
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

/// Gradients by every pixel's own slopes, depth and albedo, from those of its points and of the prior: for each pair of
/// neighbours
///   bond * (bend (off / size)² + jump (a_i - a_j)²) / 2
/// where `off` is the distance along z of one pixel from the plane through the other with the mean slopes of both; and
/// for every pixel the term that keeps few of them lit. Keeps the largest gradients, and sums the prior by workgroups.
pub fn surface_combine(call: &Call, b: &mut [Cells]) {
    bind!(
        b: pixels u, pixel_of u, heights v2, slopes v2, gradient v4, height_gradient v4, weights f, l1_partials f,
        bond_depths f
    );
    let (twin, count) = (&call.twin, call.push.last as usize);
    let field = PixelBuffers { grid: twin.grid, pixels, pixel_of };
    let points = call.constant(constant::POINTS, 4) as usize;
    let of = |i: u32, w: &[f64]| w[i as usize];
    let [bend, jump] = [SURFACE_BEND, SURFACE_JUMP].map(|i| of(i, weights));
    let [sparse, faint] = [SURFACE_SPARSE, SURFACE_FAINT].map(|i| of(i, weights));
    l1_partials[..count.div_ceil(WORKGROUP as usize)].fill(0.0);
    for pixel in 0..count {
        let ([depth, albedo], slope) = (heights[pixel], DVec2::from_array(slopes[pixel]));
        let (mut deeper, mut brighter, mut tilts, mut energy) = (0.0, 0.0, DVec2::ZERO, 0.0);
        for (k, g) in gradient[points * pixel..][..points].iter().enumerate() {
            let (share, stretched) = (1.0 / points as f64, stretch(twin, slope));
            let by_depth = if twin.model.reflectance.has_normals() {
                // The normal is (slope, -1) over its length; a steeper pixel has more surface.
                let (vector, n) = (dvec3(g[0], g[1], g[2]), facing(slope));
                let across: DVec3 = (vector - n * n.dot(vector)) / slope.extend(-1.0).length();
                tilts += share * albedo * (stretched * across.truncate() + n.dot(vector) * slope / stretched);
                brighter += share * stretched * n.dot(vector);
                g[3]
            } else {
                brighter += share * g[0];
                g[1]
            };
            deeper += by_depth;
            tilts += by_depth * field.part(k, points);
        }
        for (k, other) in field.neighbours(pixel) {
            let weight = field.bond(AROUND[k], 1.0, field.step(bond_depths, pixel, other));
            let d = dvec2(AROUND[k][0].into(), AROUND[k][1].into()) * field.pitch();
            let plane = 0.5 * (slope + DVec2::from_array(slopes[other])).dot(d);
            let off = (heights[other][0] - depth - plane) / field.size();
            let differs = albedo - heights[other][1];
            deeper -= bend * weight * off / field.size();
            tilts -= 0.5 * bend * weight * off / field.size() * d;
            brighter += jump * weight * differs;
            energy += 0.25 * weight * (bend * off * off + jump * differs * differs);
        }
        if sparse > 0.0 {
            brighter += sparse / (1.0 + albedo / faint);
            energy += sparse * faint * (albedo / faint).ln_1p();
        }
        height_gradient[pixel] = [tilts.x, tilts.y, deeper, brighter];
        l1_partials[pixel / WORKGROUP as usize] += energy;
        for (i, value) in [(SURFACE_LARGEST, deeper), (SURFACE_LARGEST + 1, brighter)] {
            weights[i as usize] = of(i, weights).max(value.abs());
        }
    }
}
