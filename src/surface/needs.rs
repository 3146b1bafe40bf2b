//! What a fit of a surface needs of a plan.

use super::options::SurfaceOptions;
use crate::Result;
use crate::engine::{Demand, LeftOut, Level, Plan};
use crate::gpu::{Abilities, Buffer};
use crate::surface::passes;
use crate::transport::kernels::{SURFACE_WEIGHTS, WORKGROUP, buffer, constant};
use crate::transport::{Grid, Model};

/// A pixel no wider than this many bins of path is rendered as one point: paths over it differ by about as many bins
/// (benches/NOTES.md).
pub const SMALL_PIXEL: f64 = 2.2;

/// So is a pixel no wider than this many standard deviations of the impulse response: its paths then add less than a tenth to
/// that deviation.
const BLURRED_PIXEL: f64 = 1.5;

/// Bytes of every pixel of the surface, by buffer.
const OF_PIXEL: [(Buffer, u64); 6] = [
    (buffer::PIXELS, 4),
    (buffer::HEIGHTS, 8),
    (buffer::SLOPES, 8),
    (buffer::STENCILS, 64),
    (buffer::HEIGHT_GRADIENT, 16),
    (buffer::HEIGHT_MOMENTS, 16),
];

/// The plan of a fit of at most `iterations[1]` iterations, after `iterations[0]` of other fits. It has room for `least` samples at
/// least.
///
/// # Errors
/// As [`Plan::open`] and [`Plan::finish`].
pub fn plan(
    model: &Model,
    grid: Grid,
    scan: [usize; 2],
    options: &SurfaceOptions,
    iterations: [usize; 2],
    least: usize,
    device: &Abilities,
) -> Result<Plan> {
    let SurfaceOptions { accumulation, general, .. } = *options;
    let demand = Demand { accumulation, general, iterations, ..Demand::default() };
    // Points of all pixels of both layers.
    let room = |levels: &[Level]| {
        let pixels = levels.last().map_or(0, |l| l.grid.n[0] * l.grid.n[1]);
        [((pixels + pixels / BEHIND) * options.points.unwrap_or(4)).max(least); 2]
    };
    let mut plan = Plan::open(model, grid, scan, demand, room, device)?;
    let points = points_per_pixel(options, &plan) as u32;
    // A workgroup of `surface_combine` leaves one partial sum of its pixels' points.
    let constants =
        [(constant::WEIGHTED, 1), (constant::POINTS, points), (constant::SUMMED, points * WORKGROUP)];
    plan.constants.extend(constants);
    plan.add_passes(crate::engine::passes::ALL);
    plan.add_passes(passes::ALL);
    let own = buffers(&plan);
    let mut plan = plan.finish(model, own, false)?;
    plan.leave_out(left_out);
    Ok(plan)
}

/// Its device buffers with their bytes.
fn buffers(plan: &Plan) -> Vec<(Buffer, u64)> {
    let pixels = pixels(plan) as u64;
    // Of two layers.
    let columns = 2 * (plan.levels.maps.n[0] * plan.levels.maps.n[1]) as u64;
    let mut all = vec![
        (buffer::PIXEL_OF, columns * 4),
        (buffer::BOND_DEPTHS, columns * 4),
        (buffer::HEIGHT_PULL, columns * 16),
        (buffer::SURFACE_WEIGHTS, u64::from(SURFACE_WEIGHTS) * 4),
        (buffer::HEIGHTS_KEPT, pixels * 8),
        (buffer::SURFACE_ENERGIES, plan.levels.batches.len().max(1) as u64 * 4),
    ];
    all.extend(OF_PIXEL.map(|(buffer, bytes)| (buffer, pixels * bytes)));
    all
}

fn left_out(plan: &Plan, out: &mut LeftOut) {
    if points_of(plan) == 1 {
        let why = if is_small(plan) {
            "bins of path or the impulse response are wider than it"
        } else {
            "one was requested"
        };
        out.add(format!("three of a surface pixel's four points: {why}"), "three of four of its pairs");
    }
}

/// Points that a pixel is rendered as: four, or one if it is small.
fn points_per_pixel(options: &SurfaceOptions, plan: &Plan) -> usize {
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

/// Bytes that a run of a fit uploads: its pixels, the weights, and maps on the way.
pub fn uploaded(plan: &Plan) -> u64 {
    let [x, y, _] = plan.levels.maps.n;
    let [pixels, columns] = [pixels(plan), x * y].map(|n| n as u64);
    pixels * 12
        + columns * (8 + 32)
        + u64::from(SURFACE_WEIGHTS) * 4
        + 4 * plan.levels.batches.len().max(1) as u64
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
