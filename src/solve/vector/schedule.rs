//! The vector solver as schedules.

use super::VectorOptions;
use super::passes::*;
use crate::gpu::{Command, Schedule};
use crate::solve::over_pairs::{
    arguments, compare, forward, gather, groups, instrument_back, over_parts, pair_chunks, scene_of_sums,
    work_of,
};
use crate::solve::passes::{FINISH, FORWARD, RESIDUAL, RESIDUAL_BOUND};
use crate::solve::plan::PairPart;
use crate::solve::plan::pass::Pass;
use crate::solve::{Level, Plan, domain, together};
use crate::transport::cells;
use crate::transport::kernels::*;

/// Back-projects the filtered measurement, and smooths it into the first of [`Plan::volumes`].
pub fn project(plan: &Plan, level: &Level) -> Schedule {
    let mut s = gather_filtered(plan, level, false);
    s.extend(domain::smooth(plan, level, &GAUSSIAN_X_VOLUME, None));
    s
}

/// Back-projects the filtered measurement into the second of [`Plan::volumes`]. Sums below zero stay if `signed`, else
/// they become zero.
pub(in crate::solve) fn gather_filtered(plan: &Plan, level: &Level, signed: bool) -> Schedule {
    let mut s = over_parts(plan, level, |part| {
        let mut s = Schedule::default();
        s.dispatch(&FILTER, groups(cells(part.own.count, level.bins), WORKGROUP))
            .bind(buffer::SCENE, part.own.scene)
            .bind(buffer::MEASURED, part.measured);
        s.extend(backproject(plan, level, part, signed));
        s
    });
    s.extend(together::add_up(plan, &[plan.projection(level)]));
    if !signed {
        let voxels = level.grid.storage();
        let all = groups(voxels, plan.tuning.samples_of_group(voxels));
        s.extend(together::end_of_all(plan, level, &BACKPROJECT, all, |end, part| {
            bind_of_backproject(plan, part, end);
        }));
    }
    s
}

fn bind_of_backproject(plan: &Plan, part: &PairPart, command: &mut Command) {
    command
        .bind(buffer::SCENE, part.own.scene)
        .bind(buffer::WALL, part.own.wall)
        .bind(buffer::TARGET, plan.volumes[1]);
}

/// Back-projects the residuals of a part of the pairs into the second of [`Plan::volumes`]. `signed`: see
/// [`gather_filtered`].
pub(super) fn backproject(plan: &Plan, level: &Level, part: &PairPart, signed: bool) -> Schedule {
    let mut s = Schedule::default();
    let voxels = level.grid.storage();
    for mut push in pair_chunks(plan, part, &part.own, voxels) {
        if signed {
            push.flags &= !BACKWARD_FINISH;
        }
        let all = groups(voxels, plan.tuning.samples_of_group(voxels));
        let command = s.dispatch(&BACKPROJECT, all).with(push).taking(work_of(&push, voxels));
        bind_of_backproject(plan, part, command);
    }
    s
}

/// Sets sums to zero, finds the first domain by a filtered back-projection, and begins with an empty volume and its
/// bounds.
pub fn start(plan: &Plan, level: &Level, options: &VectorOptions) -> Schedule {
    let mut s = Schedule::default();
    for cleared in [buffer::COUNTS, buffer::HISTOGRAMS, buffer::MOMENTUM, buffer::MASK_BEFORE] {
        s.fill(cleared, plan.bytes_of(cleared), 0);
    }
    s.set(buffer::MOMENTUM, MOMENTUM_SHARE, (options.step_share as f32).to_bits());
    s.extend(project(plan, level));
    s.copy_word(buffer::COUNTS, COUNT_PEAK_SMOOTH, COUNT_PEAK_PROJECTED);
    s.extend(domain::keep(plan, level, options.domain.start_above, plan.capacity));
    // The maximum of a back-projection says nothing about albedo: no roughness until there is one.
    s.set(buffer::COUNTS, COUNT_PEAK_SMOOTH, f32::INFINITY.to_bits());
    s.extend(settle(plan, level, &SETTLE));
    s.extend(bounds(plan, level, None));
    s
}

/// One iteration: extrapolate (and roughness), forward, weighted residual, step, finish.
pub fn iteration(plan: &Plan, level: &Level, iteration: u32) -> Schedule {
    let mut s = Schedule::default();
    let push = Push { iteration, ..Default::default() };
    s.indirect(&EXTRAPOLATE, buffer::ARGUMENTS, arguments(ARGUMENTS_SAMPLE))
        .bind(buffer::SCENE, level.scene)
        .with(push);
    s.extend(over_parts(plan, level, |part| {
        let mut s = forward(plan, level, part, &FORWARD);
        s.extend(compare(plan, level, part, &RESIDUAL, push, None));
        // The sums begin with the roughness, once.
        let begun = if plan.begins_sums() { BACKWARD_CONTINUE } else { 0 };
        s.extend(gather(plan, level, part, &STEP, begun, plan.residual()));
        s
    }));
    s.extend(together::add_up_losses(plan, level, &FINISH, &[plan.gradients()]));
    s.extend(together::end(plan, level, &STEP, plan.residual()));
    let push = Push { flags: together::finish_flags(plan), ..push };
    s.dispatch(&FINISH, [1, 1, 1]).bind(buffer::SCENE, scene_of_sums(plan, level)).with(push);
    s
}

/// The schedule that is due after `done` iterations: the next level, on a finer grid or with more pairs, or a
/// reduction.
pub fn due(plan: &Plan, options: &VectorOptions, level: &mut usize, done: usize) -> Schedule {
    let mut s = Schedule::default();
    let here = &plan.levels[*level];
    let next = plan.levels.get(*level + 1);
    let doubles =
        next.filter(|l| l.grid != here.grid && done.is_multiple_of(options.domain.coarse_iterations));
    // The first growth begins the last `growth_iterations`, every further one the last third of what is left.
    let grown = plan.levels[..=*level].iter().rev().take_while(|l| l.grid == here.grid).count() as u32;
    let left = options.growth_iterations / 3usize.pow(grown - 1);
    let growths = plan.levels.len() - 1 - *level;
    let grows_from = options.iterations.saturating_sub(left.max(growths));
    let power = options.bound_power_in(plan);
    let expected = |pass: &'static Pass| (power > 0.0).then_some((pass, power));
    let widens = next.filter(|l| l.grid == here.grid && done >= grows_from);
    if let Some(fine) = doubles {
        // A voxel becomes several: there must be room for them.
        let [wide, deep] = fine.parts;
        let room = plan.capacity / (wide * wide * deep);
        s.extend(domain::prune(plan, here, &GAUSSIAN_X, options.domain.keep_above, room));
        s.extend(domain::double_mask(here, fine));
        s.extend(settle(plan, fine, &SETTLE_DOUBLED));
        s.extend(bounds(plan, fine, expected(&EXPECT_DOUBLED)));
        *level += 1;
    } else if let Some(wide) = widens {
        s.extend(domain::prune(plan, here, &GAUSSIAN_X, options.domain.keep_above, plan.capacity));
        s.extend(settle(plan, wide, &SETTLE));
        s.extend(bounds(plan, wide, expected(&EXPECT)));
        *level += 1;
    } else if done.is_multiple_of(options.domain.reduce_every) {
        s.extend(domain::prune(plan, here, &GAUSSIAN_X, options.domain.keep_above, plan.capacity));
        s.extend(settle(plan, here, &SETTLE));
        if done.is_multiple_of(options.bound_every) {
            s.extend(bounds(plan, here, expected(&EXPECT)));
        }
    }
    s
}

/// Follows a new mask: lists, vectors and bounds in their new slots, points, momentum at rest. The pass `how` moves
/// them.
pub(super) fn settle(plan: &Plan, level: &Level, how: &Pass) -> Schedule {
    let mut s = domain::compact(plan, level);
    let sample = arguments(ARGUMENTS_SAMPLE);
    s.indirect(how, buffer::ARGUMENTS, sample).bind(buffer::SCENE, level.scene);
    let slots = plan.capacity as u64;
    s.copy(buffer::BEFORE, buffer::RAW, slots * 16);
    s.copy(buffer::GRADIENT, buffer::BOUNDS, slots * 8);
    for (index, value) in [(MOMENTUM_T, 1.0f32), (MOMENTUM_BETA, 0.0), (MOMENTUM_OBJECTIVE, f32::INFINITY)] {
        s.set(buffer::MOMENTUM, index, value.to_bits());
    }
    s.indirect(&POINTS, buffer::ARGUMENTS, sample).bind(buffer::SCENE, level.scene);
    s
}

/// D and lambda of the active voxels. `expected` is the pass that estimates brightness, and the power of it that
/// weights D; without it all voxels weigh alike. Voxels that become active later have no bound and stay zero until the
/// next call, so the bounds of the others still hold.
pub(super) fn bounds(plan: &Plan, level: &Level, expected: Option<(&Pass, f64)>) -> Schedule {
    let mut s = Schedule::default();
    let scene = level.scene;
    let sample = arguments(ARGUMENTS_SAMPLE);
    if let Some((pass, power)) = expected {
        s.indirect(pass, buffer::ARGUMENTS, sample)
            .bind(buffer::SCENE, scene)
            .bind(buffer::SOURCE, plan.volumes[0])
            .with(Push { flags: (power as f32).to_bits(), ..Default::default() });
    }
    // The rendering for the bound has albedo one.
    s.set(buffer::COUNTS, COUNT_PEAK_ALBEDO, 1.0f32.to_bits());
    s.extend(over_parts(plan, level, |part| {
        let mut s = forward(plan, level, part, &FORWARD_BOUND);
        s.extend(compare(plan, level, part, &RESIDUAL_BOUND, Push::default(), None));
        s.extend(gather(plan, level, part, &BOUND_STEP, 0, plan.residual()));
        s
    }));
    s.set(buffer::COUNTS, COUNT_PEAK_ALBEDO, 0);
    s.extend(over_parts(plan, level, |part| {
        let mut s = Schedule::default();
        s.dispatch(&VARIANCE, groups(cells(part.own.count, level.bins), WORKGROUP))
            .bind(buffer::SCENE, part.own.scene)
            .bind(buffer::MEASURED, part.measured);
        s.extend(instrument_back(plan, level, part, [&PULSE_NOISE, &SPOT_NOISE], None));
        s.extend(gather(plan, level, part, &BOUND_NOISE, 0, plan.residual()));
        s
    }));
    s.extend(together::add_up(plan, &[plan.bounds()]));
    for pass in [&BOUND_STEP, &BOUND_NOISE] {
        s.extend(together::end(plan, level, pass, plan.residual()));
    }
    if expected.is_some() {
        s.indirect(&POINTS, buffer::ARGUMENTS, sample).bind(buffer::SCENE, scene);
    }
    s
}
