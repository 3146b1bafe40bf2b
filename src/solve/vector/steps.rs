//! The vector solver as schedules.

use super::VectorOptions;
use crate::gpu::Schedule;
use crate::solve::schedule::{forward, groups, pair_chunks};
use crate::solve::{Level, Plan, domain};
use crate::transport::kernels::*;

/// Sums at zero, the first domain from a filtered back-projection, nothing in it, its bounds.
pub fn start(plan: &Plan, level: &Level, options: &VectorOptions) -> Schedule {
    let mut s = Schedule::default();
    let bytes = |name: &str| plan.buffers.iter().find(|b| b.name == name).map_or(0, |b| b.bytes);
    for buffer in ["counts", "histograms", "momentum"] {
        s.fill(buffer, bytes(buffer), 0);
    }
    s.fill("raw", level.grid.storage() as u64 * 16, 0);
    s.set("momentum", MOMENTUM_SHARE, (options.step_share as f32).to_bits());
    s.dispatch("filter", groups(plan.pairs * plan.bins, WORKGROUP)).bind("scene", level.scene);
    for push in pair_chunks(plan) {
        s.dispatch("backproject", groups(level.grid.storage(), WORKGROUP))
            .bind("scene", level.scene)
            .bind("target", "sample_points")
            .with(push);
    }
    s.extend(domain::smooth(level, "gaussian_x_volume"));
    s.extend(domain::keep(level, options.start_above));
    // The maximum of a back-projection says nothing about albedo: no roughness before there is one.
    s.set("counts", COUNT_PEAK_SMOOTH, f32::INFINITY.to_bits());
    s.extend(settle(plan, level));
    s.extend(bounds(plan, level));
    s
}

/// One iteration: extrapolate (and roughness), forward, weighted residual, step, finish.
pub fn iteration(plan: &Plan, level: &Level, iteration: u32) -> Schedule {
    let mut s = Schedule::default();
    let push = Push { iteration, ..Default::default() };
    s.indirect("extrapolate", "arguments", 12 * u64::from(ARGUMENTS_SAMPLE))
        .bind("scene", level.scene)
        .with(push);
    s.extend(forward(plan, level, "forward"));
    s.dispatch("residual", groups(plan.pairs * plan.bins, WORKGROUP * RESIDUAL_BINS))
        .bind("scene", level.scene)
        .with(push);
    for chunk in pair_chunks(plan) {
        // The sums begin with the roughness.
        let chunk = Push { flags: chunk.flags | BACKWARD_CONTINUE, ..chunk };
        s.indirect("step", "arguments", 12 * u64::from(ARGUMENTS_BACKWARD))
            .bind("scene", level.scene)
            .with(chunk);
    }
    s.dispatch("finish", [1, 1, 1]).bind("scene", level.scene).with(push);
    s
}

/// What is due after `done` iterations: doubling (the level moves on) or reduction.
pub fn due(plan: &Plan, options: &VectorOptions, level: &mut usize, done: usize) -> Schedule {
    let mut s = Schedule::default();
    let here = &plan.levels[*level];
    if done.is_multiple_of(options.coarse_iterations) && *level + 1 < plan.levels.len() {
        s.extend(reduce(here, options));
        let fine = &plan.levels[*level + 1];
        s.extend(domain::double_volume(plan, here, fine));
        s.extend(settle(plan, fine));
        s.extend(bounds(plan, fine));
        *level += 1;
    } else if done.is_multiple_of(options.reduce_every) {
        s.extend(reduce(here, options));
        s.extend(settle(plan, here));
        if done.is_multiple_of(options.bound_every) {
            s.extend(bounds(plan, here));
        }
    }
    s
}

fn reduce(level: &Level, options: &VectorOptions) -> Schedule {
    let mut s = domain::smooth(level, "gaussian_x");
    s.extend(domain::keep(level, options.keep_above));
    s
}

/// After a new mask: what is inactive holds nothing, lists, points.
fn settle(plan: &Plan, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    s.dispatch("settle", groups(level.grid.storage(), WORKGROUP)).bind("scene", level.scene);
    s.extend(domain::compact(plan, level));
    s.indirect("points", "arguments", 12 * u64::from(ARGUMENTS_SAMPLE)).bind("scene", level.scene);
    s
}

/// D and lambda of the active voxels. What becomes active later has no bound, and stays zero until the next time:
/// so the bounds of the others hold in between.
fn bounds(plan: &Plan, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let scene = level.scene;
    let elements = plan.pairs * plan.bins;
    let sample = 12 * u64::from(ARGUMENTS_SAMPLE);
    s.fill("bounds", level.grid.storage() as u64 * 8, 0);
    // The largest albedo of the rendering that bounds: one.
    s.set("counts", COUNT_PEAK_ALBEDO, 1.0f32.to_bits());
    s.extend(forward(plan, level, "forward_bound"));
    s.dispatch("residual_bound", groups(elements, WORKGROUP * RESIDUAL_BINS)).bind("scene", scene);
    s.set("counts", COUNT_PEAK_ALBEDO, 0);
    for chunk in pair_chunks(plan) {
        s.indirect("bound_step", "arguments", sample).bind("scene", scene).with(chunk);
    }
    s.dispatch("variance", groups(elements, WORKGROUP)).bind("scene", scene);
    for chunk in pair_chunks(plan) {
        s.indirect("bound_noise", "arguments", sample).bind("scene", scene).with(chunk);
    }
    s
}
