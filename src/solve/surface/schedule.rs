//! The surface as schedules.

use super::passes::*;
use crate::gpu::Schedule;
use crate::solve::adam::unbiased;
use crate::solve::over_pairs::{compare, forward, gather, gathered, groups, over_parts, scene_of_sums};
use crate::solve::passes::{ARGUMENTS, RESIDUAL};
use crate::solve::plan::pass::Pass;
use crate::solve::plan::{COLUMNS_HOST, PairPart};
use crate::solve::{Level, Plan, together};
use crate::transport::kernels::*;

/// Decays of Adam's moments, as in `surface_step.comp`.
const BETAS: [f64; 2] = [0.9, 0.99];

fn push(count: usize) -> Push {
    Push { last: count as u32, ..Default::default() }
}

/// Puts Adam at rest, with `points` samples for each of `count` pixels, and finds the bonds at the current depths.
pub fn start(level: &Level, count: usize, points: usize) -> Schedule {
    let mut s = Schedule::default();
    s.fill(buffer::HEIGHT_MOMENTS, count as u64 * 16, 0);
    s.set(buffer::COUNTS, COUNT_ACTIVE, (points * count) as u32);
    s.dispatch(&ARGUMENTS, [1, 1, 1]).bind(buffer::SCENE, level.rendered.scene);
    s.extend(bonds(level, count));
    s
}

/// Finds the bonds of every pixel.
pub fn bonds(level: &Level, count: usize) -> Schedule {
    let mut s = Schedule::default();
    s.dispatch(&SURFACE_BONDS, groups(count, WORKGROUP)).bind(buffer::SCENE, level.scene).with(push(count));
    s
}

/// Computes slopes and samples of the current surface.
pub fn points(level: &Level, count: usize) -> Schedule {
    let mut s = Schedule::default();
    s.dispatch(&SURFACE_POINTS, groups(count, WORKGROUP)).bind(buffer::SCENE, level.scene).with(push(count));
    s
}

/// Renders the current surface and compares it by the pass `residual`.
pub fn render(plan: &Plan, level: &Level, count: usize, residual: &Pass, through: Option<u32>) -> Schedule {
    let mut s = points(level, count);
    s.extend(over_parts(plan, level, |part| rendered(plan, level, part, residual, through)));
    s
}

/// Renders the samples of the surface for a part of the pairs, and compares it.
fn rendered(plan: &Plan, level: &Level, part: &PairPart, residual: &Pass, through: Option<u32>) -> Schedule {
    let mut s = forward(plan, level, part, forward_of(plan));
    s.extend(compare(plan, level, part, residual, Push::default(), through));
    s
}

/// Iteration `i` of the whole solve (from 0), `at` of this surface, as if `skipped` had been before it: points, forward, weighted residual, gather,
/// combine, pull, step, finish. Residuals go back through the taps that begin at word `through` of `pulse_taps`, or
/// through the pulse's own if there is one.
pub fn iteration(
    plan: &Plan,
    level: &Level,
    count: usize,
    [i, at, skipped]: [usize; 3],
    through: Option<u32>,
) -> Schedule {
    let scene = level.scene;
    let mut s = points(level, count);
    let push = Push { iteration: i as u32, step: (at + skipped) as u32 + 1, ..push(count) };
    let from = gathered(plan, through);
    s.extend(over_parts(plan, level, |part| {
        let mut s = rendered(plan, level, part, &RESIDUAL, through);
        s.extend(gather(plan, level, part, &SURFACE_GATHER, 0, from));
        s
    }));
    s.extend(together::add_up_losses(plan, level, &SURFACE_FINISH, &[plan.gradients()]));
    s.dispatch(&SURFACE_COMBINE, groups(count, WORKGROUP)).bind(buffer::SCENE, scene).with(push);
    s.dispatch(&SURFACE_PULL, groups(count, WORKGROUP)).bind(buffer::SCENE, scene).with(push);
    s.dispatch(&SURFACE_STEP, groups(count, WORKGROUP)).bind(buffer::SCENE, scene).with(unbiased(
        push,
        BETAS,
        at as u32 + 1,
    ));
    let push = Push { flags: together::finish_flags(plan), ..push };
    s.dispatch(&SURFACE_FINISH, [1, 1, 1]).bind(buffer::SCENE, scene_of_sums(plan, level)).with(push);
    s
}

/// Puts the maps with a layer of the surface in them into `columns_host`. `of_layers`: how many pixels each has.
pub fn extract(level: &Level, of_layers: [usize; 2], layer: usize) -> Schedule {
    let mut s = points(level, of_layers.iter().sum());
    let begin: usize = of_layers[..layer].iter().sum();
    s.dispatch(&SURFACE_EXTRACT, groups(of_layers[layer], WORKGROUP))
        .bind(buffer::SCENE, level.scene)
        .with(Push { first: begin as u32, ..push(begin + of_layers[layer]) });
    s.extend(columns(level));
    s
}

/// Puts the second surface of every column of the volume into `columns_host`.
pub fn extract_behind(level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let all = level.grid.n[0] * level.grid.n[1];
    s.dispatch(&EXTRACT_BEHIND, groups(all, WORKGROUP)).bind(buffer::SCENE, level.scene);
    s.extend(columns(level));
    s
}

fn columns(level: &Level) -> Schedule {
    let mut s = Schedule::default();
    s.copy(buffer::COLUMNS, COLUMNS_HOST, (level.grid.n[0] * level.grid.n[1]) as u64 * 32);
    s
}

/// Continues with more pairs: new weights and dispatch sizes.
pub fn widen(level: &Level, weights: &[f32; SURFACE_WEIGHTS as usize]) -> Schedule {
    let mut s = Schedule::default();
    for index in [SURFACE_BEND, SURFACE_JUMP] {
        s.set(buffer::SURFACE_WEIGHTS, index, weights[index as usize].to_bits());
    }
    s.dispatch(&ARGUMENTS, [1, 1, 1]).bind(buffer::SCENE, level.rendered.scene);
    s
}
