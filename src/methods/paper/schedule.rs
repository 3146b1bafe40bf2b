//! The paper's solver as schedules.

use super::needs::{block_of, volumes};
use super::options::PaperOptions;
use crate::engine::over_pairs::{
    compare, forward, gather, groups, over_active, over_touched, turns_of_finish,
};
use crate::engine::plan::passes::*;
use crate::engine::{Level, Pass, Plan, unbiased};
use crate::gpu::{Buffer, Command, Kernel, Schedule};
use crate::methods::paper::domain;
use crate::methods::paper::passes::*;
use crate::transport::kernels::*;

/// Sample, forward, residual, (noise,) backward, update, finish: iteration `iteration` of the solve (from 0),
/// `step` of the optimiser since its restart (from 1).
pub fn iteration(s: &mut Schedule, plan: &Plan, level: &Level, iteration: u32, step: u32) {
    let begin = s.commands.len();
    let push = Push { iteration, step, ..Default::default() };
    over_active(s, plan, level, &SAMPLE, 8).with(push);
    forward(s, plan, level, &FORWARD);
    compare(s, plan, level, &RESIDUAL, push);
    if plan.passes.contains(&&NOISE) {
        s.dispatch(&NOISE, groups(level.pairs, 1), (level.pairs * plan.scene.bins) as u64)
            .bind(buffer::SCENE, level.scene)
            .with(unbiased(push, plan.demand.betas, iteration + 1));
    }
    gather(s, plan, level, &BACKWARD);
    // A touched voxel adds up what 27 samples may leave to it.
    over_touched(s, plan, level, &UPDATE, 27).with(unbiased(push, plan.demand.betas, step));
    s.dispatch(&FINISH, [1, 1, 1], turns_of_finish(plan)).bind(buffer::SCENE, level.scene).with(push);
    bind_own(s, begin, plan, level);
}

/// Binds the solver's block of a level to the dispatches from number `begin` on that read it.
pub(super) fn bind_own(s: &mut Schedule, begin: usize, plan: &Plan, level: &Level) {
    let own = block_of(plan, level);
    let reads = |kernel: Kernel| {
        let pass = plan.passes.iter().find(|pass| pass.kernel == kernel);
        pass.is_some_and(|pass| (pass.code)(plan).bindings.iter().any(|b| b.block == buffer::PAPER))
    };
    for command in &mut s.commands[begin..] {
        if matches!(command, Command::Dispatch { kernel, .. } if reads(*kernel)) {
            command.bind(buffer::PAPER, own);
        }
    }
}

/// Makes the first volume and the domain of all voxels that are not too near. Puts the optimiser at rest and sums to
/// zero.
pub fn initialise(s: &mut Schedule, plan: &Plan, level: &Level) {
    s.fill(buffer::COUNTS, plan.bytes_of(buffer::COUNTS), 0);
    s.fill(buffer::HISTOGRAMS, plan.bytes_of(buffer::HISTOGRAMS), 0);
    s.fill(buffer::NOISE_STATE, plan.bytes_of(buffer::NOISE_STATE), 0);
    let voxels = level.grid.storage();
    s.dispatch(&INITIALISE, groups(voxels / 32, WORKGROUP), voxels as u64)
        .bind(buffer::SCENE, level.scene)
        .bind(buffer::REACHABLE, level.reachable);
    domain::compact(s, plan, level);
    over_touched(s, plan, level, &INITIALISE_RAW, 1).bind(buffer::PAPER, block_of(plan, level));
    restart(s, plan);
}

/// Domain reduction: smooth the active albedo, keep what is above the threshold (paper, section 3.3).
/// Raw albedo may all be below zero: then the domain stays as it is.
pub fn reduce(s: &mut Schedule, plan: &Plan, level: &Level, keep_above: f64) {
    domain::prune(s, plan, level, keep_above, plan.domain.capacity);
    domain::list(s, plan, level);
    for state in [buffer::RAW, buffer::MOMENT_FIRST, buffer::MOMENT_SECOND] {
        carry(s, plan, level, &CARRY, state);
    }
}

/// Moves a part of the state to its new slots by the pass `how`.
fn carry(s: &mut Schedule, plan: &Plan, level: &Level, how: &Pass, state: Buffer) {
    let [target, _] = volumes(plan);
    // Doubling interpolates between eight.
    over_touched(s, plan, level, how, 8).bind(buffer::SOURCE, state).bind(buffer::TARGET, target);
    s.copy(target, state, plan.domain.touched_capacity as u64 * 16);
}

/// Puts the optimiser at rest.
pub fn restart(s: &mut Schedule, plan: &Plan) {
    let bytes = plan.domain.touched_capacity as u64 * 16;
    s.fill(buffer::MOMENT_FIRST, bytes, 0);
    s.fill(buffer::MOMENT_SECOND, bytes, 0);
}

/// From `coarse` to `fine`, which has twice its lateral resolution; the optimiser is at rest after it.
pub fn double(s: &mut Schedule, plan: &Plan, coarse: &Level, fine: &Level) {
    domain::remember(s, plan, coarse);
    split(s, plan, coarse, fine);
}

/// As [`double`], from a pruned mask: removed voxels still count where their neighbours are interpolated.
fn split(s: &mut Schedule, plan: &Plan, coarse: &Level, fine: &Level) {
    domain::double_mask(s, coarse, fine);
    domain::compact(s, plan, fine);
    carry(s, plan, fine, &CARRY_DOUBLED, buffer::RAW);
    restart(s, plan);
}

/// The schedule that is due after `done` iterations, in the paper's order: reduction, then doubling (`level` moves on)
/// or restart. Empty if nothing is due.
pub fn due(s: &mut Schedule, plan: &Plan, options: &PaperOptions, level: &mut usize, done: usize) {
    let (here, above) = (&plan.levels.volume[*level], options.domain.keep_above);
    let next =
        plan.levels.volume.get(*level + 1).filter(|_| done.is_multiple_of(options.domain.double_every));
    let reduces = options.domain.reduce && done.is_multiple_of(options.domain.reduce_every);
    if let Some(fine) = next {
        // A voxel becomes four: there must be room for them.
        if reduces || fine.grid.storage() > plan.domain.capacity {
            domain::prune(s, plan, here, above, plan.domain.capacity / 4);
            split(s, plan, here, fine);
        } else {
            double(s, plan, here, fine);
        }
        *level += 1;
        return;
    }
    if reduces {
        reduce(s, plan, here, above);
    }
    if done.is_multiple_of(options.restart_every) {
        restart(s, plan);
    }
}
