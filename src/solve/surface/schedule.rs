//! The surface as schedules.

use super::passes::*;
use super::weights;
use crate::gpu::{Buffer, Schedule};
use crate::solve::adam::unbiased;
use crate::solve::over_pairs::{compare, forward, gather, groups, size_passes, turns_of_finish};
use crate::solve::passes::{FORWARD, objective};
use crate::solve::plan::COLUMNS_HOST;
use crate::solve::plan::pass::Pass;
use crate::solve::{Level, Plan};
use crate::transport::kernels::*;

/// Turns of a kernel for a pixel: its eight neighbours and its four points.
const NEAR: u64 = 8 + 4;

/// Depth of a column without a pixel for the bonds, metres: none is left over such a step.
const FAR: f32 = 1e6;

/// Share of the iterations after which a pixel uses its own gradient only, as in `heights.glsl`.
const NARROWED: f64 = 0.6;

/// Decays of Adam's moments, as in `surface_step.comp`.
const BETAS: [f64; 2] = [0.9, 0.99];

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
    bonds(s, level, count, 0);
}

/// Finds the bonds of every pixel, and the weights of the prior by the residual after `done` iterations,
/// if any are.
pub fn bonds(s: &mut Schedule, level: &Level, count: usize, done: usize) {
    let push = Push { iteration: done as u32, ..push(count) };
    s.dispatch(&SURFACE_BONDS, groups(count, WORKGROUP), 16 * count as u64)
        .bind(buffer::SCENE, level.scene)
        .with(push);
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

/// Iteration `i` of the whole solve (from 0), `at` of this fit, which has `all`: points, forward, weighted residual, gather,
/// combine, pull while gradients are spread, step, for the next batch of pairs if there are batches.
pub fn iteration(s: &mut Schedule, plan: &Plan, level: &Level, count: usize, times: [usize; 3]) {
    let [iteration, at, all] = times;
    turn(s, plan, level, count, FitIteration { iteration, at, since_rest: at }, all);
}

/// An iteration of a fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct FitIteration {
    /// Its number in the whole solve, from 0.
    pub iteration: usize,
    /// Its place in the schedule of the fit, which sets the length of steps.
    pub at: usize,
    /// Iterations since Adam was at rest.
    pub since_rest: usize,
}

/// [`iteration`] at any place of a fit's schedule.
pub(super) fn turn(
    s: &mut Schedule,
    plan: &Plan,
    level: &Level,
    count: usize,
    FitIteration { iteration: i, at, since_rest }: FitIteration,
    all: usize,
) {
    let scene = level.scene;
    points(s, level, count);
    let push = Push { iteration: i as u32, step: at as u32 + 1, ..push(count) };
    let batch = plan.batch(i);
    let seen = batch.unwrap_or(level);
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
        .with(unbiased(push, BETAS, since_rest as u32 + 1));
}

/// Keeps depths and albedos of `count` pixels, or puts those that are kept back.
pub(super) fn keep(s: &mut Schedule, count: usize, [from, to]: [Buffer; 2]) {
    s.copy(from, to, count as u64 * 8);
}

/// Divides the measured histograms among the batches of pairs.
pub fn divide(s: &mut Schedule, plan: &Plan) {
    for batch in plan.stretches() {
        let [first, count] =
            [batch.first, plan.measured(batch).count].map(|n| (n * plan.scene.bins * 4) as u64);
        s.copy_from([buffer::MEASURED, batch.measured], first, count);
    }
}

/// Puts the maps with a layer of the surface in them into `columns_host`. `of_layers`: how many pixels each has.
pub fn extract(s: &mut Schedule, level: &Level, of_layers: [usize; 2], layer: usize) {
    points(s, level, of_layers.iter().sum());
    let begin: usize = of_layers[..layer].iter().sum();
    let pixels = of_layers[layer];
    s.dispatch(&SURFACE_EXTRACT, groups(pixels, WORKGROUP), pixels as u64)
        .bind(buffer::SCENE, level.scene)
        .with(Push { first: begin as u32, ..push(begin + pixels) });
    s.copy(buffer::COLUMNS, COLUMNS_HOST, (level.grid.n[0] * level.grid.n[1]) as u64 * 32);
}
