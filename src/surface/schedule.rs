//! The surface as schedules.

use crate::engine::over_pairs::{compare, forward, gather, groups, size_passes, turns_of_finish};
use crate::engine::passes::{FINISH, FORWARD, objective};
use crate::engine::{Level, Pass, Plan, stage_values};
use crate::gpu::Schedule;
use crate::surface::passes::*;
use crate::surface::weights;
use crate::transport::kernels::*;

/// Turns of a kernel for a pixel: its eight neighbours and its four points.
const NEAR: u64 = 8 + 4;

/// Depth of a column without a pixel for the bonds, metres: none is left over such a step.
const FAR: f32 = 1e6;

/// Share of the iterations after which a pixel uses its own gradient only, as in `heights.glsl`.
const NARROWED: f64 = 0.6;

/// Iterations between two comparisons of the objective; bonds and prior weights are renewed with them.
pub(super) const CHECK: usize = 10;

fn push(count: usize) -> Push {
    Push { last: count as u32, ..Default::default() }
}

/// Puts Adam at rest, with `points` samples for each of `count` pixels, and finds the bonds at the current depths. Sizes the
/// passes of iterations.
pub fn start(s: &mut Schedule, plan: &Plan, level: &Level, count: usize, points: usize) {
    s.fill(buffer::HEIGHT_MOMENTS, count as u64 * 16, 0);
    // Columns without a pixel: no depth, no gradient.
    let [depths, pulls] = [buffer::BOND_DEPTHS, buffer::HEIGHT_PULL].map(|buffer| plan.bytes_of(buffer));
    s.fill(buffer::BOND_DEPTHS, depths, FAR.to_bits());
    s.fill(buffer::HEIGHT_PULL, pulls, 0);
    s.set(buffer::COUNTS, COUNT_ACTIVE, (points * count) as u32);
    s.set(buffer::COUNTS, COUNT_ARRIVED, 0);
    size_passes(s, &plan.batch(0).unwrap_or(level).rendered);
    bonds(s, level, count);
}

/// Finds the bonds of every pixel.
pub fn bonds(s: &mut Schedule, level: &Level, count: usize) {
    s.dispatch(&SURFACE_BONDS, groups(count, WORKGROUP), 16 * count as u64)
        .bind(buffer::SCENE, level.scene)
        .with(push(count));
}

/// Computes slopes and samples of the current surface.
pub fn points(s: &mut Schedule, level: &Level, count: usize) {
    s.dispatch(&SURFACE_POINTS, groups(count, WORKGROUP), NEAR * count as u64)
        .bind(buffer::SCENE, level.scene)
        .with(push(count));
}

/// Renders the current surface for all pairs of `level` and compares it by the pass `residual`. Passes of iterations keep
/// their sizes.
pub fn render(s: &mut Schedule, plan: &Plan, level: &Level, count: usize, residual: &Pass) {
    points(s, level, count);
    size_passes(s, &level.rendered);
    rendered(s, plan, level, residual);
    if let Some(batch) = plan.batch(0) {
        size_passes(s, &batch.rendered);
    }
}

/// Renders the samples of the surface for the pairs of `level`, and compares it.
fn rendered(s: &mut Schedule, plan: &Plan, level: &Level, residual: &Pass) {
    forward(s, plan, level, &FORWARD);
    compare(s, plan, level, residual, Push::default());
}

/// Iteration `i` of the whole solve (from 0), `at` of this fit's schedule, which has `all`: points, forward, weighted residual,
/// gather, combine, pull while gradients are spread, step, for the next batch of pairs if there are batches.
pub fn iteration(s: &mut Schedule, plan: &Plan, level: &Level, count: usize, [i, at, all]: [usize; 3]) {
    let scene = level.scene;
    points(s, level, count);
    let push = Push { iteration: i as u32, step: at as u32 + 1, ..push(count) };
    let seen = plan.batch(i).unwrap_or(level);
    rendered(s, plan, seen, objective(plan));
    gather(s, plan, seen, &SURFACE_GATHER);
    let (own, pixels, around) = (groups(count, WORKGROUP), count as u64, weights::around(level));
    s.dispatch(&SURFACE_COMBINE, own, NEAR * pixels).bind(buffer::SCENE, scene).with(push);
    if (at as f64) < NARROWED * all as f64 {
        s.dispatch(&SURFACE_PULL, own, around * pixels).bind(buffer::SCENE, scene).with(push);
    }
    // The step closes the iteration.
    s.dispatch(&SURFACE_STEP, own, around * pixels + turns_of_finish(plan))
        .bind(buffer::SCENE, seen.scene)
        .with(push);
}

/// Finds the scale of the albedos of `count` pixels by two renderings of the pairs of `of`, and keeps the state. Overwrites two rows
/// of the trace, from row `row` on. `is_guess`: it is found once more from there.
pub fn place(
    s: &mut Schedule,
    plan: &Plan,
    [level, of]: [&Level; 2],
    count: usize,
    row: usize,
    is_guess: bool,
) {
    compared(s, plan, of, count, row);
    act(s, level, count, KEEP_TWICE);
    compared(s, plan, of, count, row + 1);
    let flags = JUDGE_SCALE | if is_guess { JUDGE_GUESS } else { 0 };
    judge(s, plan, level, Push { first: row as u32, flags, ..Default::default() });
    act(s, level, count, 0);
}

/// Keeps the state of `count` pixels whose albedos have the scale of the data.
pub fn place_known(s: &mut Schedule, plan: &Plan, level: &Level, count: usize) {
    judge(s, plan, level, Push::default());
    act(s, level, count, 0);
}

/// Iterations of a fit that are judged together.
#[derive(Debug, Clone, Copy)]
pub struct Judged {
    /// The first one, and the number of those that are done after the last one, in the whole solve.
    pub iterations: [usize; 2],
    /// Iterations of the fit's schedule that are done after the last one.
    pub at: usize,
    /// [`JUDGE_FIRST`], [`JUDGE_LAST`].
    pub flags: u32,
}

/// Compares the objective of some iterations with the best one, and keeps the state of `count` pixels, or puts the best one back.
/// Then finds the bonds, unless these are the last ones.
pub fn check(s: &mut Schedule, plan: &Plan, level: &Level, count: usize, of: Judged) {
    let Judged { iterations: [first, done], at, flags } = of;
    let push =
        Push { iteration: done as u32, first: first as u32, step: at as u32, flags, ..Default::default() };
    judge(s, plan, level, push);
    act(s, level, count, 0);
    if flags & JUDGE_LAST == 0 {
        bonds(s, level, count);
    }
}

fn judge(s: &mut Schedule, plan: &Plan, level: &Level, push: Push) {
    let batches = plan.levels.batches.len().max(1);
    s.dispatch(&SURFACE_JUDGE, [1, 1, 1], batches as u64)
        .bind(buffer::SCENE, level.scene)
        .with(Push { last: batches as u32, ..push });
}

fn act(s: &mut Schedule, level: &Level, count: usize, flags: u32) {
    s.dispatch(&SURFACE_KEEP, groups(count, WORKGROUP), count as u64)
        .bind(buffer::SCENE, level.scene)
        .with(Push { flags, ..push(count) });
}

/// Renders `pixels` pixels and writes the objective to row `row` of the trace.
fn compared(s: &mut Schedule, plan: &Plan, level: &Level, pixels: usize, row: usize) {
    s.stage("surface", &stage_values(level, row));
    render(s, plan, level, pixels, objective(plan));
    s.dispatch(&FINISH, [1, 1, 1], turns_of_finish(plan))
        .bind(buffer::SCENE, level.scene)
        .with(Push { iteration: row as u32, ..Default::default() });
}

/// Divides the measured histograms among the batches of pairs.
pub fn divide(s: &mut Schedule, plan: &Plan) {
    for batch in plan.stretches() {
        let [first, count] =
            [batch.first, plan.measured(batch).count].map(|n| (n * plan.scene.bins * 4) as u64);
        s.copy_from([buffer::MEASURED, batch.measured], first, count);
    }
}

/// Puts the maps with a layer of the surface in them into `columns`. `of_layers`: how many pixels each has.
pub fn extract(s: &mut Schedule, level: &Level, of_layers: [usize; 2], layer: usize) {
    points(s, level, of_layers.iter().sum());
    let begin: usize = of_layers[..layer].iter().sum();
    let pixels = of_layers[layer];
    s.dispatch(&SURFACE_EXTRACT, groups(pixels, WORKGROUP), pixels as u64)
        .bind(buffer::SCENE, level.scene)
        .with(Push { first: begin as u32, ..push(begin + pixels) });
}
