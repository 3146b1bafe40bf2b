//! The vector solver as schedules.

use super::VectorOptions;
use crate::gpu::Schedule;
use crate::solve::schedule::{compare, forward, gather, groups, pair_chunks, pulse_back};
use crate::solve::{Level, Plan, domain};
use crate::transport::kernels::*;

/// Sums at zero, the first domain from a filtered back-projection, nothing in it, its bounds.
pub fn start(plan: &Plan, level: &Level, options: &VectorOptions) -> Schedule {
    let mut s = Schedule::default();
    let bytes = |name: &str| plan.buffers.iter().find(|b| b.name == name).map_or(0, |b| b.bytes);
    for buffer in ["counts", "histograms", "momentum", "mask_before"] {
        s.fill(buffer, bytes(buffer), 0);
    }
    s.set("momentum", MOMENTUM_SHARE, (options.step_share as f32).to_bits());
    s.dispatch("filter", groups(plan.cells_at(level), WORKGROUP)).bind("scene", level.scene);
    for push in pair_chunks(plan, level) {
        s.dispatch("backproject", groups(level.grid.storage(), WORKGROUP))
            .bind("scene", level.scene)
            .bind("wall", level.wall)
            .bind("target", plan.volumes()[1])
            .with(push);
    }
    s.extend(domain::smooth(plan, level, "gaussian_x_volume"));
    s.extend(domain::keep(plan, level, options.start_above, plan.capacity));
    // The maximum of a back-projection says nothing about albedo: no roughness before there is one.
    s.set("counts", COUNT_PEAK_SMOOTH, f32::INFINITY.to_bits());
    s.extend(settle(plan, level, "settle"));
    s.extend(bounds(plan, level, None));
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
    s.extend(compare(plan, level, "residual", push, None));
    // The sums begin with the roughness.
    s.extend(gather(plan, level, "step", ARGUMENTS_BACKWARD, BACKWARD_CONTINUE, plan.residual()));
    s.dispatch("finish", [1, 1, 1]).bind("scene", level.scene).with(push);
    s
}

/// What is due after `done` iterations: the next level, on a finer grid or with more pairs, or reduction.
pub fn due(plan: &Plan, options: &VectorOptions, level: &mut usize, done: usize) -> Schedule {
    let mut s = Schedule::default();
    let here = &plan.levels[*level];
    let next = plan.levels.get(*level + 1);
    let doubles = next.filter(|l| l.grid != here.grid && done.is_multiple_of(options.coarse_iterations));
    // The first growth begins the last iterations, every further one the last third of what is left.
    let grown = plan.levels[..=*level].iter().rev().take_while(|l| l.grid == here.grid).count() as u32;
    let left = options.growth_iterations / 3usize.pow(grown - 1);
    let growths = plan.levels.len() - 1 - *level;
    let grows_from = options.iterations.saturating_sub(left.max(growths));
    let expected = |kernel| (options.bound_power > 0.0).then_some((kernel, options.bound_power));
    let widens = next.filter(|l| l.grid == here.grid && done >= grows_from);
    if let Some(fine) = doubles {
        // A voxel becomes four.
        s.extend(domain::prune(plan, here, options.keep_above, plan.capacity / 4));
        s.extend(domain::double_mask(here, fine));
        s.extend(settle(plan, fine, "settle_doubled"));
        s.extend(bounds(plan, fine, expected("expect_doubled")));
        *level += 1;
    } else if let Some(wide) = widens {
        s.extend(domain::prune(plan, here, options.keep_above, plan.capacity));
        s.extend(settle(plan, wide, "settle"));
        s.extend(bounds(plan, wide, expected("expect")));
        *level += 1;
    } else if done.is_multiple_of(options.reduce_every) {
        s.extend(domain::prune(plan, here, options.keep_above, plan.capacity));
        s.extend(settle(plan, here, "settle"));
        if done.is_multiple_of(options.bound_every) {
            s.extend(bounds(plan, here, expected("expect")));
        }
    }
    s
}

/// After a new mask: lists, vectors and bounds in their new slots, points, momentum at rest. `how` is the kernel that
/// moves them.
fn settle(plan: &Plan, level: &Level, how: &'static str) -> Schedule {
    let mut s = domain::compact(plan, level);
    let sample = 12 * u64::from(ARGUMENTS_SAMPLE);
    s.indirect(how, "arguments", sample).bind("scene", level.scene);
    let slots = plan.capacity as u64;
    s.copy("before", "raw", slots * 16);
    s.copy("gradient", "bounds", slots * 8);
    for (index, value) in [(MOMENTUM_T, 1.0f32), (MOMENTUM_BETA, 0.0), (MOMENTUM_OBJECTIVE, f32::INFINITY)] {
        s.set("momentum", index, value.to_bits());
    }
    s.indirect("points", "arguments", sample).bind("scene", level.scene);
    s
}

/// D and lambda of the active voxels, D for voxels as bright as `expected` (the kernel that tells, and the power) or
/// all alike. What becomes active later has no bound, and stays zero until the next time:
/// so the bounds of the others hold in between.
fn bounds(plan: &Plan, level: &Level, expected: Option<(&'static str, f64)>) -> Schedule {
    let mut s = Schedule::default();
    let scene = level.scene;
    let sample = 12 * u64::from(ARGUMENTS_SAMPLE);
    if let Some((kernel, power)) = expected {
        s.indirect(kernel, "arguments", sample)
            .bind("scene", scene)
            .bind("source", plan.volumes()[0])
            .with(Push { flags: (power as f32).to_bits(), ..Default::default() });
    }
    // The largest albedo of the rendering that bounds: one.
    s.set("counts", COUNT_PEAK_ALBEDO, 1.0f32.to_bits());
    s.extend(forward(plan, level, "forward_bound"));
    s.extend(compare(plan, level, "residual_bound", Push::default(), None));
    s.set("counts", COUNT_PEAK_ALBEDO, 0);
    s.extend(gather(plan, level, "bound_step", ARGUMENTS_SAMPLE, 0, plan.residual()));
    s.dispatch("variance", groups(plan.cells_at(level), WORKGROUP)).bind("scene", scene);
    s.extend(pulse_back(plan, level, "pulse_noise", None));
    s.extend(gather(plan, level, "bound_noise", ARGUMENTS_SAMPLE, 0, plan.residual()));
    if expected.is_some() {
        s.indirect("points", "arguments", sample).bind("scene", scene);
    }
    s
}
