//! The paper's solver as schedules.

use super::PaperOptions;
use super::passes::*;
use crate::gpu::{Buffer, Schedule};
use crate::solve::adam::unbiased;
use crate::solve::over_pairs::{arguments, compare, forward, gather, groups, over_parts, scene_of_sums};
use crate::solve::passes::*;
use crate::solve::plan::pass::Pass;
use crate::solve::{Level, Plan, domain};
use crate::transport::kernels::*;

/// Sample, forward, residual, (noise,) backward, update, finish: iteration `iteration` of the solve (from 0),
/// `step` of the optimiser since its restart (from 1).
pub fn iteration(plan: &Plan, level: &Level, iteration: u32, step: u32) -> Schedule {
    let mut s = Schedule::default();
    let push = Push { iteration, step, ..Default::default() };
    s.indirect(&SAMPLE, buffer::ARGUMENTS, arguments(ARGUMENTS_SAMPLE))
        .bind(buffer::SCENE, level.scene)
        .with(push);
    s.extend(over_parts(plan, level, |part| {
        let mut s = forward(plan, level, part, &FORWARD);
        s.extend(compare(plan, level, part, &RESIDUAL, push, None));
        if plan.passes.contains(&&NOISE) {
            let push = unbiased(push, plan.betas, iteration + 1);
            s.dispatch(&NOISE, groups(part.own.count, 1))
                .bind(buffer::SCENE, part.own.scene)
                .bind(buffer::NOISE_STATE, part.noise)
                .with(push);
        }
        s.extend(gather(plan, level, part, &BACKWARD, 0, plan.residual()));
        s
    }));
    s.indirect(&UPDATE, buffer::ARGUMENTS, arguments(ARGUMENTS_UPDATE))
        .bind(buffer::SCENE, level.scene)
        .with(unbiased(push, plan.betas, step));
    s.dispatch(&FINISH, [1, 1, 1]).bind(buffer::SCENE, scene_of_sums(plan, level)).with(push);
    s
}

/// Makes the first volume and the domain of all voxels that are not too near. Puts the optimiser at rest and sums to
/// zero.
pub fn initialise(plan: &Plan, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    s.fill(buffer::COUNTS, plan.bytes_of(buffer::COUNTS), 0);
    s.fill(buffer::HISTOGRAMS, plan.bytes_of(buffer::HISTOGRAMS), 0);
    s.fill(buffer::NOISE_STATE, plan.bytes_of(buffer::NOISE_STATE), 0);
    for stored in plan.parts(level).iter().flat_map(|part| &part.stored).filter(|stored| stored.changes) {
        s.fill(stored.host, plan.bytes_of(stored.host), 0);
    }
    s.dispatch(&INITIALISE, groups(level.grid.storage() / 32, WORKGROUP))
        .bind(buffer::SCENE, level.scene)
        .bind(buffer::REACHABLE, level.reachable);
    s.extend(domain::compact(plan, level));
    s.indirect(&INITIALISE_RAW, buffer::ARGUMENTS, TOUCHED).bind(buffer::SCENE, level.scene);
    s.extend(restart(plan));
    s
}

/// Arguments of a kernel with an invocation for every touched voxel.
const TOUCHED: u64 = 12 * ARGUMENTS_UPDATE as u64;

/// Domain reduction: smooth the active albedo, keep what is above the threshold (paper, section 3.3).
pub fn reduce(plan: &Plan, level: &Level, keep_above: f64) -> Schedule {
    let mut s = domain::prune(plan, level, &GAUSSIAN_X, keep_above, plan.capacity);
    s.extend(domain::compact(plan, level));
    for state in [buffer::RAW, buffer::MOMENT_FIRST, buffer::MOMENT_SECOND] {
        s.extend(carry(plan, level, &CARRY, state));
    }
    s
}

/// Moves a part of the state to its new slots by the pass `how`.
fn carry(plan: &Plan, level: &Level, how: &Pass, state: Buffer) -> Schedule {
    let mut s = Schedule::default();
    let [target, _] = plan.volumes;
    s.indirect(how, buffer::ARGUMENTS, TOUCHED)
        .bind(buffer::SCENE, level.scene)
        .bind(buffer::SOURCE, state)
        .bind(buffer::TARGET, target);
    s.copy(target, state, plan.touched_capacity as u64 * 16);
    s
}

/// Puts the optimiser at rest.
pub fn restart(plan: &Plan) -> Schedule {
    let mut s = Schedule::default();
    let bytes = plan.touched_capacity as u64 * 16;
    s.fill(buffer::MOMENT_FIRST, bytes, 0);
    s.fill(buffer::MOMENT_SECOND, bytes, 0);
    s
}

/// From `coarse` to `fine`, which has twice its lateral resolution; the optimiser is at rest after it.
pub fn double(plan: &Plan, coarse: &Level, fine: &Level) -> Schedule {
    let mut s = domain::remember(plan, coarse);
    s.extend(split(plan, coarse, fine));
    s
}

/// As [`double`], from a pruned mask: removed voxels still count where their neighbours are interpolated.
fn split(plan: &Plan, coarse: &Level, fine: &Level) -> Schedule {
    let mut s = domain::double_mask(coarse, fine);
    s.extend(domain::compact(plan, fine));
    s.extend(carry(plan, fine, &CARRY_DOUBLED, buffer::RAW));
    s.extend(restart(plan));
    s
}

/// The schedule that is due after `done` iterations, in the paper's order: reduction, then doubling (`level` moves on)
/// or restart. Empty if nothing is due.
pub fn due(plan: &Plan, options: &PaperOptions, level: &mut usize, done: usize) -> Schedule {
    let mut s = Schedule::default();
    let here = &plan.levels[*level];
    let next = plan.levels.get(*level + 1).filter(|_| done.is_multiple_of(options.domain.double_every));
    let reduces = options.domain.reduce && done.is_multiple_of(options.domain.reduce_every);
    if let Some(fine) = next {
        // A voxel becomes four: there must be room for them.
        if reduces || fine.grid.storage() > plan.capacity {
            s.extend(domain::prune(plan, here, &GAUSSIAN_X, options.domain.keep_above, plan.capacity / 4));
            s.extend(split(plan, here, fine));
        } else {
            s.extend(double(plan, here, fine));
        }
        *level += 1;
        return s;
    }
    if reduces {
        s.extend(reduce(plan, here, options.domain.keep_above));
    }
    if done.is_multiple_of(options.restart_every) {
        s.extend(restart(plan));
    }
    s
}
