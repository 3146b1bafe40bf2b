//! Schedules where several devices share the pairs: what stands between their gathers and what reads the sums.
//!
//! Gathers leave the sums of a device's own pairs. These are added up over all devices, and then every device ends the
//! gather with the same sums, by the same pass without pairs. So all of them go on with the same voxels to the bit, and
//! nothing else need be exchanged. On one device all of this is empty.

use super::over_pairs::{arguments, gathering, scene_of_sums, turns_of_finish};
use super::plan::PairPart;
use super::{Level, Pass, Plan};
use crate::gpu::{Buffer, Command, Schedule, Summed};
use crate::transport::kernels::*;

/// Adds `sums` up over all devices.
pub(super) fn add_up(s: &mut Schedule, plan: &Plan, sums: &[Summed]) {
    if plan.division.share.is_some() {
        s.exchange(sums);
    }
}

/// Adds up over all devices the losses that a comparison left, and `sums`. `finish` is the pass that reads the losses; its
/// flags are [`finish_flags`] then.
pub(super) fn add_up_losses(s: &mut Schedule, plan: &Plan, level: &Level, finish: &Pass, sums: &[Summed]) {
    if plan.division.share.is_some() {
        s.dispatch(finish, [1, 1, 1], turns_of_finish(plan))
            .bind(buffer::SCENE, scene_of_sums(plan, level))
            .with(Push { flags: FINISH_ADD, ..Default::default() });
        add_up(s, plan, &[sums, &[plan.losses()]].concat());
    }
}

/// Flags of the pass that closes an iteration.
pub(super) fn finish_flags(plan: &Plan) -> u32 {
    if plan.division.share.is_some() { FINISH_ADDED } else { 0 }
}

/// Ends the gather of `level` by `pass` from the buffer `from`, after its sums were added up.
pub(super) fn end(s: &mut Schedule, plan: &Plan, level: &Level, pass: &Pass, from: Buffer) {
    if let Some(part) = last_of_shared(plan, level) {
        let voxels = plan.voxels_at(level);
        s.indirect(pass, buffer::ARGUMENTS, arguments(ARGUMENTS_BACKWARD), voxels as u64)
            .at_most(gathering(plan, voxels))
            .bind(buffer::SCENE, part.rendered.scene)
            .bind(buffer::WALL, part.rendered.wall)
            .bind(buffer::RESIDUAL, from)
            .with(no_pairs(&part));
    }
}

/// As [`end`], for a pass over all voxels in so many `groups`. `bind` adds what it binds.
pub(super) fn end_of_all(
    s: &mut Schedule,
    plan: &Plan,
    level: &Level,
    pass: &Pass,
    groups: [u32; 3],
    bind: impl FnOnce(&mut Command, &PairPart),
) {
    if let Some(part) = last_of_shared(plan, level) {
        bind(s.dispatch(pass, groups, level.grid.storage() as u64).with(no_pairs(&part)), &part);
    }
}

fn last_of_shared(plan: &Plan, level: &Level) -> Option<PairPart> {
    plan.division.share.and_then(|_| plan.parts(level).last())
}

/// A dispatch that takes the sums of those before and ends the gather: from behind the last pair on there are none.
fn no_pairs(part: &PairPart) -> Push {
    let behind = part.rendered.count as u32;
    Push { first: behind, last: behind, flags: BACKWARD_CONTINUE | BACKWARD_FINISH, ..Default::default() }
}
