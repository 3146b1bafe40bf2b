use glam::DVec2;

use super::shared::facing;
use super::{Call, Cells};

/// The maps' columns of the pixels of a layer: albedo, depth, 0, 1, then the normal and 0.
pub fn surface_extract(call: &Call, b: &mut [Cells]) {
    bind!(b: pixels u, heights v2, slopes v2, columns v4);
    for pixel in call.push.first as usize..call.push.last as usize {
        let column = pixels[pixel] as usize % (call.twin.grid.n[0] * call.twin.grid.n[1]);
        let normal = facing(DVec2::from_array(slopes[pixel]));
        columns[2 * column] = [heights[pixel][1], heights[pixel][0], 0.0, 1.0];
        columns[2 * column + 1] = [normal.x, normal.y, normal.z, 0.0];
    }
}
