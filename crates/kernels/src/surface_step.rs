use rayon::prelude::*;

use super::pixels::{PixelField, sigma_at};
use super::shared::*;
use super::surroundings::Surroundings;
use super::trace::close;
use super::{Call, Cells, Real, unbias, watch};

const BETAS: [f64; 2] = [0.9, 0.99];

/// Share of the first rate that the last step has.
const LAST_RATE: f64 = 0.02;

/// Share of the largest gradient below which a step is no full one, and the least denominator.
const QUIET: f64 = 1e-3;
const LEAST: f64 = 1e-18;

/// A step of Adam, with the gradient that is spread over the pixels around, or the pixel's own. Its rate falls as half a
/// cosine. Closes the iteration.
pub fn surface_step<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(
        b: pixels u, pixel_of u, stencils v2, height_gradient v4, weights f, moments v4, counts u, heights v2,
        height_pull v4, loss_partials v2, l1_partials f, trace u
    );
    let count = call.push.last as usize;
    let field = PixelField::<F>::new(call, &pixels[..count], pixel_of);
    let at = |i: u32| weights[i as usize];
    let done = f64::from(call.push.step - 1) / at(SURFACE_ITERATIONS).wide();
    let rate = 0.5 + 0.5 * (std::f64::consts::PI * done).cos() + LAST_RATE;
    let rates = [SURFACE_DEPTH_RATE, SURFACE_ALBEDO_RATE].map(|i| F::of(rate) * at(i));
    let least = [SURFACE_LARGEST, SURFACE_LARGEST + 1].map(|i| (F::of(QUIET) * at(i)).max(F::of(LEAST)));
    let [near, far] = field.grid.depth_limits();
    let age = call.push.step - at(SURFACE_RESTED).wide() as u32;
    let unbias = BETAS.map(|b| F::of(unbias(b, age)));
    let betas = BETAS.map(|b| F::of(1.0 - b));
    let averaged = sigma_at([SURFACE_SPREAD, SURFACE_ITERATIONS].map(at), call.push.step).map(|sigma| {
        // Columns without a pixel have no gradient, so that their bonds do not count.
        let around = Surroundings::new(&field, sigma, |column| height_pull[column][2]);
        around.averages(|column| [height_pull[column][0], height_pull[column][1]])
    });
    let group = WORKGROUP as usize;
    let states = heights[..count].par_chunks_mut(group).zip(moments[..count].par_chunks_mut(group));
    let finite: Vec<F> = states
        .enumerate()
        .map(|(i, (heights, moments))| {
            let mut sum = F::zero();
            for (k, (height, moments)) in heights.iter_mut().zip(moments).enumerate() {
                let pixel = i * group + k;
                let gradient = match &averaged {
                    Some(averaged) => averaged[pixels[pixel] as usize],
                    None => field.pulled(pixel, stencils, height_gradient),
                };
                for (k, g) in gradient.into_iter().enumerate() {
                    moments[k] = moments[k] + betas[0] * (g - moments[k]);
                    moments[2 + k] = moments[2 + k] + betas[1] * (g * g - moments[2 + k]);
                    let scale = (moments[2 + k] * unbias[1]).sqrt().max(least[k]);
                    height[k] = height[k] - rates[k] * (moments[k] * unbias[0] / scale);
                    sum = sum + height[k] * F::zero();
                }
                *height = [height[0].max(near).min(far), height[1].max(F::zero())];
            }
            sum
        })
        .collect();
    watch(counts, FAULT_UPDATE, &finite);
    close(call, counts, loss_partials, l1_partials, trace);
    counts[COUNT_ARRIVED as usize] = 0;
}
