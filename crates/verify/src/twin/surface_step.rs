use super::shared::{PixelBuffers, close, covered, depth_limits, sigma_at, watch};
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

const BETAS: [f64; 2] = [0.9, 0.99];

/// A step of Adam, with the gradient that is spread over the pixels around, or the pixel's own. Its rate falls as half a
/// cosine to a fiftieth of the first; its denominator is at least a thousandth of the largest gradient. Closes the
/// iteration.
pub fn surface_step(call: &Call, b: &mut [Cells]) {
    bind!(
        b: pixels u, pixel_of u, stencils v2, height_gradient v4, weights f, moments v4, counts u, heights v2,
        height_pull v4, loss_partials v2, l1_partials f, trace u
    );
    let field = PixelBuffers { grid: call.twin.grid, pixels, pixel_of };
    let sigma = sigma_at(weights, call.push.step);
    let at = |i: u32| weights[i as usize];
    let done = f64::from(call.push.step - 1) / at(SURFACE_ITERATIONS);
    let rate = 0.5 + 0.5 * (std::f64::consts::PI * done).cos() + 0.02;
    let [near, far] = depth_limits(&call.twin);
    let unbias = [call.push.unbias_first, call.push.unbias_second].map(f64::from);
    for pixel in 0..call.push.last as usize {
        let around = |sigma: f64| {
            let one = |d: [i32; 2]| {
                let other = field.beside(pixel, d)?;
                let [from, to] = [pixel, other].map(|pixel| height_pull[pixels[pixel] as usize]);
                let weight = field.bond(d, sigma, to[2] - from[2]);
                Some([weight * to[0], weight * to[1]])
            };
            covered(sigma).filter_map(one).fold([0.0; 2], |sum, g| [sum[0] + g[0], sum[1] + g[1]])
        };
        let gradient = sigma.map_or_else(|| field.pulled(pixel, stencils, height_gradient), around);
        for (k, g) in gradient.into_iter().enumerate() {
            let (first, second) = (moments[pixel][k], moments[pixel][2 + k]);
            let [first, second] =
                [first + (1.0 - BETAS[0]) * (g - first), second + (1.0 - BETAS[1]) * (g * g - second)];
            (moments[pixel][k], moments[pixel][2 + k]) = (first, second);
            let least = (1e-3 * at(SURFACE_LARGEST + k as u32)).max(1e-18);
            let step = first * unbias[0] / (second * unbias[1]).sqrt().max(least);
            let moved = heights[pixel][k] - rate * at(SURFACE_DEPTH_RATE + k as u32) * step;
            heights[pixel][k] = if k == 0 { moved.clamp(near, far) } else { moved.max(0.0) };
            watch(counts, moved, FAULT_UPDATE);
        }
    }
    close(call, counts, loss_partials, l1_partials, trace);
    counts[COUNT_ARRIVED as usize] = 0;
}
