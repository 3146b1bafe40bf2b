use glam::{DMat3, DVec3, dvec3};

use super::shared::{AROUND, PixelBuffers};
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

/// Weight of zero slope; each neighbour weighs up to one.
const LEVEL: f64 = 1e-3;

/// Slopes of every pixel as coefficients of its neighbours' depths: those of the plane that fits the pixel (with a weight
/// of one) and its neighbours best. Renews the weights of the prior by the objective that is left.
pub fn surface_bonds(call: &Call, b: &mut [Cells]) {
    bind!(b: pixels u, pixel_of u, heights v2, stencils v2, weights f, trace u, bond_depths f);
    if call.push.iteration > 0 {
        let left = trace[((call.push.iteration - 1) * TRACE_ROW + TRACE_OBJECTIVE) as usize];
        for (weight, share) in [(SURFACE_BEND, SURFACE_BEND_SHARE), (SURFACE_JUMP, SURFACE_JUMP_SHARE)] {
            weights[weight as usize] = weights[share as usize] * f64::from(f32::from_bits(left));
        }
    }
    let count = call.push.last as usize;
    for pixel in 0..count {
        bond_depths[pixels[pixel] as usize] = heights[pixel][0];
    }
    let field = PixelBuffers { grid: call.twin.grid, pixels, pixel_of };
    for pixel in 0..count {
        // A plane's value at a neighbour, as coefficients of its depth at the pixel and its two slopes.
        let row = |k: usize| dvec3(1.0, AROUND[k][0].into(), AROUND[k][1].into());
        let outer = |r: DVec3| DMat3::from_cols(r * r.x, r * r.y, r * r.z);
        let bond = |k: usize, other: usize| field.bond(AROUND[k], 1.0, heights[other][0] - heights[pixel][0]);
        let own = DMat3::from_diagonal(dvec3(1.0, LEVEL, LEVEL));
        let normal = field.neighbours(pixel).fold(own, |sum, (k, other)| sum + bond(k, other) * outer(row(k)));
        let inverse = normal.inverse();
        for k in 0..8 {
            let plane = field.beside(pixel, AROUND[k]).map(|other| inverse * (bond(k, other) * row(k)));
            let pitch = field.pitch();
            stencils[8 * pixel + k] = plane.map_or([0.0; 2], |p| [p.y / pitch.x, p.z / pitch.y]);
        }
    }
}
