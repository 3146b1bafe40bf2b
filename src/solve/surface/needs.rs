//! What the surface needs of a plan, for the solver that it follows.

use super::SurfaceOptions;
use super::blur;
use crate::gpu::Buffer;
use crate::solve::Plan;
use crate::solve::plan::{LeftOut, mebibytes};
use crate::transport::kernels::{SURFACE_WEIGHTS, buffer, constant};

/// A pixel no wider than this many bins of path is rendered as one point: paths over it differ by about as many bins
/// (benches/NOTES.md).
pub const SMALL_PIXEL: f64 = 2.2;

/// So is a pixel no wider than this many standard deviations of the pulse: its paths then add less than a tenth to the
/// pulse's deviation.
const BLURRED_PIXEL: f64 = 1.5;

/// Bytes of every pixel of the surface, by buffer.
const OF_PIXEL: [(Buffer, u64); 7] = [
    (buffer::PIXELS, 16),
    (buffer::HEIGHTS, 8),
    (buffer::SLOPES, 8),
    (buffer::STENCILS, 64),
    (buffer::HEIGHT_GRADIENT, 16),
    (buffer::HEIGHT_PULL, 8),
    (buffer::HEIGHT_MOMENTS, 16),
];

/// Sets of taps for residuals, and the bins that the widest adds to the pulse's.
pub fn more_taps(options: &SurfaceOptions) -> [usize; 2] {
    let blurred = options.blur > 0.0 && options.iterations > 0;
    [if blurred { blur::BLURS } else { 0 }, blur::ADDED]
}

/// Points that a pixel is rendered as: four, or one if it is small.
pub fn points_per_pixel(options: &SurfaceOptions, plan: &Plan) -> usize {
    options.points.unwrap_or(if is_small(plan) { 1 } else { 4 })
}

fn is_small(plan: &Plan) -> bool {
    let wide = plan.levels.maps.pitch.truncate().max_element();
    wide <= (SMALL_PIXEL * plan.scene.bin_width).max(BLURRED_PIXEL * plan.scene.pulse_deviation)
}

/// Points of a pixel in a plan that was made for a surface.
pub fn points_of(plan: &Plan) -> usize {
    plan.constant(constant::POINTS).unwrap_or(1) as usize
}

/// Whether a plan has taps for residuals that are averaged along time.
pub fn is_blurred(plan: &Plan) -> bool {
    plan.tap_sets() > 1
}

/// The room for pixels of the second layer is this part of the maps' pixels: a surface seldom fills the maps, so there is
/// more.
const BEHIND: usize = 4;

/// Pixels that the surface may have in both layers: all of the maps' and a quarter more, or as many as there is room
/// for with the points of each.
pub fn pixels(plan: &Plan) -> usize {
    let [x, y, _] = plan.levels.maps.n;
    let most = x * y + x * y / BEHIND;
    plan.levels.pixels.map_or(0, |_| most.min(plan.domain.capacity / points_of(plan)))
}

/// Bytes of a surface with `pixels` pixels, their numbers by column included.
fn bytes(pixels: u64) -> u64 {
    pixels * (OF_PIXEL.iter().map(|(_, bytes)| bytes).sum::<u64>() + 4)
}

/// Its buffers; none without a surface.
pub fn buffers(plan: &Plan) -> Vec<(Buffer, u64)> {
    let pixels = pixels(plan) as u64;
    if pixels == 0 {
        return vec![];
    }
    // Of two layers.
    let columns = 2 * (plan.levels.maps.n[0] * plan.levels.maps.n[1]) as u64;
    let mut all =
        vec![(buffer::PIXEL_OF, columns * 4), (buffer::SURFACE_WEIGHTS, u64::from(SURFACE_WEIGHTS) * 4)];
    all.extend(OF_PIXEL.map(|(buffer, bytes)| (buffer, pixels * bytes)));
    all
}

/// What a plan leaves out of it.
pub fn left_out(plan: &Plan, out: &mut LeftOut) {
    if plan.demand.iterations[1] == 0 {
        let [x, y, _] = plan.levels.maps.n;
        out.add("the surface that the volume's maps begin", mebibytes(bytes((x * y) as u64)));
    } else if points_of(plan) == 1 {
        let why =
            if is_small(plan) { "bins of path or the pulse are wider than it" } else { "one was asked for" };
        out.add(format!("three of a surface pixel's four points: {why}"), "three of four of its pairs");
    }
}
