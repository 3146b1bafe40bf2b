use glam::{DVec2, dvec3};

use super::shared::{PixelBuffers, depth_limits, facing, larger, stretch, watch};
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

/// Slopes of every pixel, and its samples: 1 or 4 points of its tilted square, with depths limited to the grid's.
pub fn surface_points(call: &Call, b: &mut [Cells]) {
    bind!(b: pixels u, pixel_of u, heights v2, stencils v2, slopes v2, points v4, normals v4, counts u);
    let twin = &call.twin;
    let field = PixelBuffers { grid: twin.grid, pixels, pixel_of };
    let each = call.constant(constant::POINTS, 4) as usize;
    let [near, far] = depth_limits(twin);
    for pixel in 0..call.push.last as usize {
        let [depth, light] = heights[pixel];
        let risen =
            |(k, other): (usize, usize)| DVec2::from_array(stencils[8 * pixel + k]) * (heights[other][0] - depth);
        let slope: DVec2 = field.neighbours(pixel).map(risen).sum();
        slopes[pixel] = slope.to_array();
        let albedo = light * stretch(twin, slope) / each as f64;
        let (_, [x, y]) = field.place(pixel);
        let centre = twin.grid.position(dvec3(x.into(), y.into(), 0.0)).truncate();
        for k in 0..each {
            let (d, normal) = (field.part(k, each), facing(slope));
            let z = (depth + slope.dot(d)).clamp(near, far);
            points[each * pixel + k] = [centre.x + d.x, centre.y + d.y, z, albedo];
            if twin.model.reflectance.has_normals() {
                normals[each * pixel + k] = [normal.x, normal.y, normal.z, 0.0];
            }
        }
        watch(counts, slope.x + slope.y + albedo, FAULT_SAMPLE);
        let peak = &mut counts[COUNT_PEAK_ALBEDO as usize];
        *peak = larger(*peak, albedo);
    }
}
