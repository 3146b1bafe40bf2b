//! The vector solver as schedules.

use super::VectorOptions;
use super::hat::taps_of_hat;
use super::passes::*;
use crate::gpu::Schedule;
use crate::solve::domain::{self, Dark};
use crate::solve::over_pairs::{
    compare, forward, gather, groups, instrument_back, light, over_active, over_parts, pair_chunks,
    scene_of_sums, turns_of_finish, work_of,
};
use crate::solve::passes::{FINISH, FORWARD, RESIDUAL_BOUND, objective};
use crate::solve::plan::PairPart;
use crate::solve::plan::pass::Pass;
use crate::solve::{Level, Plan};
use crate::transport::cells;
use crate::transport::kernels::*;

/// Back-projects the filtered measurement, and smooths it into the first volume of [`Plan::domain`].
pub fn project(s: &mut Schedule, plan: &Plan, level: &Level) {
    gather_filtered(s, plan, level, taps_of_hat(level), false);
    domain::smooth(s, plan, level, &GAUSSIAN_X_VOLUME, None);
}

/// Back-projects the filtered measurement into the second volume of [`Plan::domain`]. The filter has so many `taps`, its two
/// sides counted once. Sums below zero stay if `signed`, else they become zero.
pub(in crate::solve) fn gather_filtered(
    s: &mut Schedule,
    plan: &Plan,
    level: &Level,
    taps: usize,
    signed: bool,
) {
    over_parts(s, plan, level, |s, part| {
        let cells = cells(part.own.count, level.bins);
        s.dispatch(&FILTER, groups(cells, WORKGROUP), light(cells * 2 * taps))
            .bind(buffer::SCENE, part.own.scene)
            .bind(buffer::MEASURED, part.measured);
        backproject(s, plan, level, part, signed);
    });
}

/// Back-projects the residuals of a part of the pairs into the second volume of [`Plan::domain`]. `signed`: see
/// [`gather_filtered`].
pub(super) fn backproject(s: &mut Schedule, plan: &Plan, level: &Level, part: &PairPart, signed: bool) {
    let voxels = level.grid.storage();
    for mut push in pair_chunks(plan, part, &part.own, voxels) {
        if signed {
            push.flags &= !BACKWARD_FINISH;
        }
        let all = groups(voxels, plan.division.tuning.samples_of_group(voxels));
        s.dispatch(&BACKPROJECT, all, work_of(&push, voxels))
            .with(push)
            .bind(buffer::SCENE, part.own.scene)
            .bind(buffer::WALL, part.own.wall)
            .bind(buffer::TARGET, plan.domain.volumes[1]);
    }
}

/// Sets sums to zero, finds the first domain by a filtered back-projection, and begins with an empty volume and its
/// bounds.
pub fn start(s: &mut Schedule, plan: &Plan, level: &Level, options: &VectorOptions) {
    for cleared in [buffer::COUNTS, buffer::HISTOGRAMS, buffer::MOMENTUM, buffer::MASK_BEFORE] {
        s.fill(cleared, plan.bytes_of(cleared), 0);
    }
    s.set(buffer::MOMENTUM, MOMENTUM_SHARE, (options.step_share as f32).to_bits());
    project(s, plan, level);
    s.copy_word(buffer::COUNTS, COUNT_PEAK_SMOOTH, COUNT_PEAK_PROJECTED);
    domain::keep(s, plan, level, options.domain.start_above, plan.domain.capacity, None);
    // The maximum of a back-projection says nothing about albedo: no roughness until there is one.
    s.set(buffer::COUNTS, COUNT_PEAK_SMOOTH, f32::INFINITY.to_bits());
    settle(s, plan, level, &SETTLE);
    bounds(s, plan, level, None);
}

/// Samples the active voxels, at the point that the momentum extrapolates to.
pub(super) fn extrapolate(s: &mut Schedule, plan: &Plan, level: &Level, push: Push) {
    // A voxel looks at its six neighbours.
    over_active(s, plan, level, &EXTRAPOLATE, 6).with(push);
}

/// One iteration: extrapolate (and roughness), forward, weighted residual, step, finish.
pub fn iteration(s: &mut Schedule, plan: &Plan, level: &Level, iteration: u32) {
    let push = Push { iteration, ..Default::default() };
    extrapolate(s, plan, level, push);
    over_parts(s, plan, level, |s, part| {
        forward(s, plan, level, part, &FORWARD);
        compare(s, plan, level, part, objective(plan), push, None);
        // The sums begin with the roughness, once.
        gather(s, plan, level, part, &STEP, BACKWARD_CONTINUE, plan.residual());
    });
    s.dispatch(&FINISH, [1, 1, 1], turns_of_finish(plan))
        .bind(buffer::SCENE, scene_of_sums(plan, level))
        .with(push);
}

/// The schedule that is due after `done` iterations: the next level, on a finer grid or with more pairs, or a
/// reduction.
pub fn due(s: &mut Schedule, plan: &Plan, options: &VectorOptions, level: &mut usize, done: usize) {
    let (levels, capacity) = (&plan.levels.volume, plan.domain.capacity);
    let (here, next) = (&levels[*level], levels.get(*level + 1));
    let doubles =
        next.filter(|l| l.grid != here.grid && done.is_multiple_of(options.domain.coarse_iterations));
    // The first growth begins the last `growth_iterations`, every further one the last third of what is left.
    let grown = levels[..=*level].iter().rev().take_while(|l| l.grid == here.grid).count() as u32;
    let left = options.growth_iterations / 3usize.pow(grown - 1);
    let growths = levels.len() - 1 - *level;
    let grows_from = options.iterations.saturating_sub(left.max(growths));
    let power = options.bound_power_in(plan);
    let expected = |pass: &'static Pass| (power > 0.0).then_some((pass, power));
    let widens = next.filter(|l| l.grid == here.grid && done >= grows_from);
    if let Some(fine) = doubles {
        // A voxel becomes several: there must be room for them.
        let [wide, deep] = fine.parts;
        let room = capacity / (wide * wide * deep);
        domain::prune(s, plan, here, &GAUSSIAN_X, options.domain.keep_above, room, Dark::Goes);
        domain::double_mask(s, here, fine);
        domain::count(s, fine);
        settle(s, plan, fine, &SETTLE_DOUBLED);
        bounds(s, plan, fine, expected(&EXPECT_DOUBLED));
        *level += 1;
    } else if let Some(wide) = widens {
        domain::prune(s, plan, here, &GAUSSIAN_X, options.domain.keep_above, capacity, Dark::Goes);
        settle(s, plan, wide, &SETTLE);
        bounds(s, plan, wide, expected(&EXPECT));
        *level += 1;
    } else if done.is_multiple_of(options.domain.reduce_every) {
        domain::prune(s, plan, here, &GAUSSIAN_X, options.domain.keep_above, capacity, Dark::Goes);
        settle(s, plan, here, &SETTLE);
        if done.is_multiple_of(options.bound_every) {
            bounds(s, plan, here, expected(&EXPECT));
        }
    }
}

/// Follows a new mask whose bricks are counted: lists, vectors and bounds in their new slots, points, momentum at rest. The
/// pass `how` moves them.
pub(super) fn settle(s: &mut Schedule, plan: &Plan, level: &Level, how: &Pass) {
    domain::list(s, plan, level);
    // Doubling interpolates between eight.
    over_active(s, plan, level, how, 8);
    over_active(s, plan, level, &POINTS, 1).with(Push { flags: 1, ..Default::default() });
}

/// D and lambda of the active voxels. `expected` is the pass that estimates brightness, and the power of it that
/// weights D; without it all voxels weigh alike. Voxels that become active later have no bound and stay zero until the
/// next call, so the bounds of the others still hold.
pub(super) fn bounds(s: &mut Schedule, plan: &Plan, level: &Level, expected: Option<(&Pass, f64)>) {
    if let Some((pass, power)) = expected {
        over_active(s, plan, level, pass, 8)
            .bind(buffer::SOURCE, plan.domain.volumes[0])
            .with(Push { flags: (power as f32).to_bits(), ..Default::default() });
    }
    // The rendering for the bound has albedo one.
    s.set(buffer::COUNTS, COUNT_PEAK_ALBEDO, 1.0f32.to_bits());
    over_parts(s, plan, level, |s, part| {
        forward(s, plan, level, part, &FORWARD_BOUND);
        compare(s, plan, level, part, &RESIDUAL_BOUND, Push::default(), None);
        gather(s, plan, level, part, &BOUND_STEP, 0, plan.residual());
    });
    s.set(buffer::COUNTS, COUNT_PEAK_ALBEDO, 0);
    over_parts(s, plan, level, |s, part| {
        let cells = cells(part.own.count, level.bins);
        s.dispatch(&VARIANCE, groups(cells, WORKGROUP), cells as u64)
            .bind(buffer::SCENE, part.own.scene)
            .bind(buffer::MEASURED, part.measured);
        instrument_back(s, plan, level, part, [&PULSE_NOISE, &SPOT_NOISE], None);
        gather(s, plan, level, part, &BOUND_NOISE, 0, plan.residual());
    });
    if expected.is_some() {
        over_active(s, plan, level, &POINTS, 1);
    }
}
