use super::shared::{PixelBuffers, covered, sigma_at};
use super::{Call, Cells};

/// The gradient of every pixel over the sum of the weights with which it is spread over the pixels around.
pub fn surface_pull(call: &Call, b: &mut [Cells]) {
    bind!(b: pixels u, pixel_of u, stencils v2, height_gradient v4, weights f, height_pull v4, bond_depths f);
    let field = PixelBuffers { grid: call.twin.grid, pixels, pixel_of };
    let Some(sigma) = sigma_at(weights, call.push.step) else { return };
    for pixel in 0..call.push.last as usize {
        let weight = |d: [i32; 2]| {
            field.beside(pixel, d).map_or(0.0, |other| field.bond(d, sigma, field.step(bond_depths, pixel, other)))
        };
        let whole: f64 = covered(sigma).map(weight).sum();
        let [depth, albedo] = field.pulled(pixel, stencils, height_gradient).map(|g| g / whole);
        let column = pixels[pixel] as usize;
        height_pull[column] = [depth, albedo, bond_depths[column], 1.0];
    }
}
