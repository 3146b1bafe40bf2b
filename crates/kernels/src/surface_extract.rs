use super::pixels::facing;
use super::{Call, Cells, Real, V2};

/// The maps' columns of the pixels of a layer: albedo, depth, 0, 1, then the normal and 0.
pub fn surface_extract<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: pixels u, heights v2, slopes v2, columns v4);
    let (zero, one) = (F::zero(), F::one());
    for pixel in call.push.first as usize..call.push.last as usize {
        let column = pixels[pixel] as usize % (call.scene.grid_x * call.scene.grid_y) as usize;
        columns[2 * column] = [heights[pixel][1], heights[pixel][0], zero, one];
        columns[2 * column + 1] = facing(V2::of(slopes[pixel])).with(zero);
    }
}
