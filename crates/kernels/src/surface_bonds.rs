use rayon::prelude::*;

use super::pixels::{AROUND, NOWHERE, PixelField};
use super::shared::*;
use super::{Call, Cells, Real, V2};

/// Weight of zero slope; each neighbour weighs up to one.
const LEVEL: f64 = 1e-3;

/// Slopes of every pixel as coefficients of its neighbours' depths: those of the plane that fits the pixel (with a weight
/// of one) and its neighbours best.
pub fn surface_bonds<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: pixels u, pixel_of u, heights v2, stencils v2, bond_depths f);
    let count = call.push.last as usize;
    for (pixel, column) in pixels[..count].iter().enumerate() {
        bond_depths[*column as usize] = heights[pixel][0];
    }
    let field = PixelField::<F>::new(call, pixels, pixel_of);
    let stencils = stencils[..8 * count].as_chunks_mut::<8>().0;
    stencils.par_iter_mut().with_min_len(WORKGROUP as usize).enumerate().for_each(|(pixel, stencil)| {
        let neighbours = field.neighbours(pixel);
        let bond = |k: usize| match neighbours[k] {
            NOWHERE => F::zero(),
            other => field.bond(k, heights[other as usize][0] - heights[pixel][0]),
        };
        let weights: [F; 8] = std::array::from_fn(bond);
        *stencil = plane(&weights, &field);
    });
}

/// Coefficients of the slopes of the plane through a pixel and neighbours of these weights.
fn plane<F: Real>(weights: &[F; 8], field: &PixelField<'_, F>) -> [[F; 2]; 8] {
    let offset = |k: usize| V2::of(AROUND[k].map(|d| F::of(d.into())));
    // The pixel itself has a weight of one, at zero.
    let all = weights.iter().fold(F::one(), |sum, weight| sum + *weight);
    let mean = (0..8).fold(V2::default(), |sum, k| sum + offset(k) * weights[k]) * (F::one() / all);
    // Level in directions that no neighbour determines.
    let (mut xx, mut xy, mut yy) = (F::of(LEVEL), F::zero(), F::of(LEVEL));
    xx = xx - all * mean.x * mean.x;
    xy = xy - all * mean.x * mean.y;
    yy = yy - all * mean.y * mean.y;
    for (k, weight) in weights.iter().enumerate() {
        let d = offset(k);
        xx = xx + *weight * d.x * d.x;
        xy = xy + *weight * d.x * d.y;
        yy = yy + *weight * d.y * d.y;
    }
    let area = xx * yy - xy * xy;
    std::array::from_fn(|k| {
        let d = (offset(k) - mean) * weights[k];
        let (x, y) = (yy * d.x - xy * d.y, xx * d.y - xy * d.x);
        [x / area / field.pitch.x, y / area / field.pitch.y]
    })
}
