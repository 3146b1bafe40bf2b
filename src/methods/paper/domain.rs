//! The active domain as schedules: the first one, its reduction, its doubling, its compacted lists.
//!
//! State lies by slot: active voxels first, in storage order. For the random sampling of the paper the rim follows:
//! the neighbours of active voxels that are not active. When the domain changes, the old masks and their slots stay
//! beside the new ones until state has been moved.

use super::needs::{block_of, volumes};
use crate::engine::over_pairs::groups;
use crate::engine::{COLUMNS_HOST, Level, Plan};
use crate::gpu::Schedule;
use crate::methods::paper::passes::*;
use crate::transport::BRICK_VOXELS;
use crate::transport::kernels::*;

/// Turns for a word of the rim's mask, a block of 4 x 4 x 2 voxels: the voxels in it and around, and each of its own from 27.
const TURNS_OF_RIM: u64 = 6 * 6 * 4 + 32 * 27;

/// Makes list, slots, counts and dispatch arguments from the mask.
pub fn compact(s: &mut Schedule, plan: &Plan, level: &Level) {
    count(s, level);
    list(s, plan, level);
}

/// Counts the voxels of each brick of the mask, which [`prune`] does for its own.
fn count(s: &mut Schedule, level: &Level) {
    let words = level.grid.storage() / 32;
    s.dispatch(&COMPACT_COUNT, groups(level.grid.storage() / BRICK_VOXELS, WORKGROUP), words as u64)
        .bind(buffer::SCENE, level.scene);
}

/// Makes list, slots, counts and dispatch arguments from the mask and the counts of its bricks.
pub(super) fn list(s: &mut Schedule, plan: &Plan, level: &Level) {
    let (scene, rendered) = (level.scene, level.rendered.scene);
    let words = level.grid.storage() / 32;
    let bricks = level.grid.storage() / BRICK_VOXELS;
    let voxels = level.grid.storage() as u64;
    s.dispatch(&COMPACT_SCAN_ACTIVE, [1, 1, 1], 2 * bricks as u64).bind(buffer::SCENE, rendered);
    s.dispatch(&COMPACT_SCATTER_ACTIVE, groups(words, WORKGROUP), voxels).bind(buffer::SCENE, scene);
    if plan.demand.has_rim {
        s.dispatch(&RIM, groups(words, WORKGROUP), TURNS_OF_RIM * words as u64).bind(buffer::SCENE, scene);
        s.dispatch(&COMPACT_COUNT, groups(bricks, WORKGROUP), words as u64)
            .bind(buffer::SCENE, scene)
            .bind(buffer::MASK, buffer::RIM_MASK);
        s.dispatch(&COMPACT_SCAN_RIM, [1, 1, 1], 2 * bricks as u64).bind(buffer::SCENE, rendered);
        s.dispatch(&COMPACT_SCATTER_RIM, groups(words, WORKGROUP), voxels)
            .bind(buffer::SCENE, scene)
            .bind(buffer::MASK, buffer::RIM_MASK)
            .bind(buffer::RANKS, buffer::RIM_RANKS);
    }
}

/// Reduces the mask to voxels whose smoothed albedo is above the share `above` of the largest; if there may be more than
/// `room`, to the brightest. Where no smoothed albedo is above zero, the mask stays unchanged if there is room for it, else it
/// becomes empty. The old mask stays beside the new one with its slots.
pub(super) fn prune(s: &mut Schedule, plan: &Plan, level: &Level, above: f64, room: usize) {
    smooth(s, plan, level);
    let [smooth, _] = volumes(plan);
    let (voxels, flags) = (level.grid.storage(), (above as f32).to_bits());
    let push = Push { first: room as u32, flags, ..Default::default() };
    if voxels > room {
        s.dispatch(&LEVELS_OF, groups(voxels, LEVELS), voxels as u64)
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::SOURCE, smooth)
            .bind(buffer::REACHABLE, level.reachable);
        s.dispatch(&ROOM, [1, 1, 1], LEVELS.into()).bind(buffer::SCENE, level.scene).with(push);
    }
    s.dispatch(&THRESHOLD, groups(voxels / 32, WORKGROUP), voxels as u64)
        .bind(buffer::SCENE, level.scene)
        .bind(buffer::SOURCE, smooth)
        .bind(buffer::REACHABLE, level.reachable)
        .with(push);
    remember_rim(s, plan, level);
}

/// Copies the masks, and the ranks that give their slots.
pub(super) fn remember(s: &mut Schedule, plan: &Plan, level: &Level) {
    let bytes = level.grid.storage() as u64 / 8;
    s.copy(buffer::MASK, buffer::MASK_BEFORE, bytes);
    s.copy(buffer::RANKS, buffer::RANKS_BEFORE, bytes);
    remember_rim(s, plan, level);
}

fn remember_rim(s: &mut Schedule, plan: &Plan, level: &Level) {
    if plan.demand.has_rim {
        let bytes = level.grid.storage() as u64 / 8;
        s.copy(buffer::RIM_MASK, buffer::RIM_BEFORE, bytes);
        s.copy(buffer::RIM_RANKS, buffer::RIM_RANKS_BEFORE, bytes);
    }
}

/// Smooths the active albedo into the first of the [`volumes`], and writes its maximum to `counts`.
fn smooth(s: &mut Schedule, plan: &Plan, level: &Level) {
    let ([a, b], own) = (volumes(plan), block_of(plan, level));
    let voxels = level.grid.storage();
    // Each voxel and its neighbours on both sides.
    let turns = (voxels * (2 * plan.domain.taps.len()).saturating_sub(1)) as u64;
    for (pass, [source, target]) in [(&GAUSSIAN_X, [b, a]), (&GAUSSIAN_Y, [a, b]), (&GAUSSIAN_Z, [b, a])] {
        s.dispatch(pass, groups(voxels, WORKGROUP), turns)
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::PAPER, own)
            .bind(buffer::SOURCE, source)
            .bind(buffer::TARGET, target);
    }
}

/// Makes the mask of `fine` from that of `coarse`. Overwrites `ranks`, which the new mask gives again.
pub(super) fn double_mask(s: &mut Schedule, coarse: &Level, fine: &Level) {
    s.copy(buffer::MASK, buffer::RANKS, coarse.grid.storage() as u64 / 8);
    let voxels = fine.grid.storage();
    s.dispatch(&DOUBLE_DOMAIN, groups(voxels / 32, WORKGROUP), voxels as u64)
        .bind(buffer::SCENE, fine.scene)
        .bind(buffer::COARSE_MASK, buffer::RANKS);
}

/// Puts the maps of `level` into `columns_host`.
pub fn extract(s: &mut Schedule, level: &Level) {
    let columns = level.grid.n[0] * level.grid.n[1];
    s.dispatch(&EXTRACT, groups(columns, WORKGROUP), (3 * columns * level.grid.n[2]) as u64)
        .bind(buffer::SCENE, level.scene);
    s.copy(buffer::COLUMNS, COLUMNS_HOST, columns as u64 * 32);
}
