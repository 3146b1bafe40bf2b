use rayon::prelude::*;

use super::pixels::{PixelField, sigma_at};
use super::shared::*;
use super::surroundings::Surroundings;
use super::{Call, Cells, Real};

/// The gradient of every pixel over the sum of the weights with which it is spread over the pixels around.
pub fn surface_pull<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: pixels u, pixel_of u, stencils v2, height_gradient v4, weights f, height_pull v4, bond_depths f);
    let count = call.push.last as usize;
    let field = PixelField::<F>::new(call, &pixels[..count], pixel_of);
    let spread = [SURFACE_SPREAD, SURFACE_ITERATIONS].map(|i| weights[i as usize]);
    let Some(sigma) = sigma_at(spread, call.push.step) else { return };
    let whole = Surroundings::new(&field, sigma, |column| bond_depths[column]).weights();
    let pulls = height_pull[..whole.len()].par_iter_mut().zip(&pixel_of[..whole.len()]).zip(&whole);
    pulls.with_min_len(256).enumerate().for_each(|(column, ((pull, pixel), whole))| {
        if (*pixel as usize) < count {
            let [depth, albedo] = field.pulled(*pixel as usize, stencils, height_gradient);
            *pull = [depth / *whole, albedo / *whole, bond_depths[column], F::one()];
        }
    });
}
