use super::shared::{PixelBuffers, covered, sigma_at};
use super::{Call, Cells};

/// The gradient of every pixel over the sum of the weights with which it is spread over the pixels around.
pub fn surface_pull(call: &Call, b: &mut [Cells]) {
    bind!(b: pixels u4, pixel_of u, stencils v2, height_gradient v4, weights f, height_pull v2);
    let field = PixelBuffers { grid: call.twin.grid, pixels, pixel_of };
    let Some(sigma) = sigma_at(weights, call.push.step) else { return };
    for pixel in 0..call.push.last as usize {
        let weight = |d: [i32; 2]| {
            field.beside(pixel, d).map_or(0.0, |other| field.bond(d, sigma, field.step(pixel, other)))
        };
        let whole: f64 = covered(sigma).map(weight).sum();
        height_pull[pixel] = field.pulled(pixel, stencils, height_gradient).map(|g| g / whole);
    }
}
