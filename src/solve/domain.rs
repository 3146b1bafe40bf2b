//! The active domain as schedules: the first one, its reduction, its doubling, its compacted lists.
//!
//! State lies by slot: active voxels first, in storage order, and behind them, for the paper's random sampling, the rim,
//! their neighbours that are not active. A change of the domain keeps the old masks and their slots beside the new ones
//! until state has been moved. Between iterations nothing lives in `gradient` and `sample_points`: where they are large
//! enough, the volumes of a reduction cost no memory ([`Plan::volumes`]).

use super::Pass;
use super::over_pairs::groups;
use super::passes::*;
use super::plan::COLUMNS_HOST;
use super::{Level, Plan};
use crate::gpu::Schedule;
use crate::transport::BRICK_VOXELS;
use crate::transport::kernels::*;

/// List, slots, counts and dispatch arguments from the mask.
pub fn compact(plan: &Plan, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let scene = level.scene;
    let words = level.grid.storage() / 32;
    let bricks = level.grid.storage() / BRICK_VOXELS;
    s.dispatch(&COMPACT_COUNT, groups(bricks, WORKGROUP)).bind(buffer::SCENE, scene);
    s.dispatch(&COMPACT_SCAN_ACTIVE, [1, 1, 1]).bind(buffer::SCENE, scene);
    s.dispatch(&COMPACT_SCATTER_ACTIVE, groups(words, WORKGROUP)).bind(buffer::SCENE, scene);
    if plan.has_rim {
        s.dispatch(&RIM, groups(words, WORKGROUP)).bind(buffer::SCENE, scene);
        s.dispatch(&COMPACT_COUNT, groups(bricks, WORKGROUP))
            .bind(buffer::SCENE, scene)
            .bind(buffer::MASK, buffer::RIM_MASK);
        s.dispatch(&COMPACT_SCAN_RIM, [1, 1, 1]).bind(buffer::SCENE, scene);
        s.dispatch(&COMPACT_SCATTER_RIM, groups(words, WORKGROUP))
            .bind(buffer::SCENE, scene)
            .bind(buffer::MASK, buffer::RIM_MASK)
            .bind(buffer::RANKS, buffer::RIM_RANKS);
    }
    s.dispatch(&ARGUMENTS, [1, 1, 1]).bind(buffer::SCENE, scene);
    s
}

/// The mask of a reduction to `room` voxels at most, of what the pass `first` smooths along x. The old mask stays beside
/// it with its slots.
pub(super) fn prune(plan: &Plan, level: &Level, first: &Pass, keep_above: f64, room: usize) -> Schedule {
    let mut s = smooth(plan, level, first);
    s.extend(remember(plan, level));
    s.extend(keep(plan, level, keep_above, room));
    s
}

/// Keeps the masks and what their slots follow from.
pub(super) fn remember(plan: &Plan, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let bytes = level.grid.storage() as u64 / 8;
    s.copy(buffer::MASK, buffer::MASK_BEFORE, bytes);
    s.copy(buffer::RANKS, buffer::RANKS_BEFORE, bytes);
    if plan.has_rim {
        s.copy(buffer::RIM_MASK, buffer::RIM_BEFORE, bytes);
        s.copy(buffer::RIM_RANKS, buffer::RIM_RANKS_BEFORE, bytes);
    }
    s
}

/// Smooths what the pass `first` reads into the first of [`Plan::volumes`], and its maximum into `counts`.
pub(super) fn smooth(plan: &Plan, level: &Level, first: &Pass) -> Schedule {
    let mut s = Schedule::default();
    let scene = level.scene;
    let [a, b] = plan.volumes;
    s.set(buffer::COUNTS, COUNT_PEAK_SMOOTH, 0);
    s.set(buffer::COUNTS, COUNT_LEAST_SMOOTH, 0);
    let all = groups(level.grid.storage(), WORKGROUP);
    s.dispatch(first, all).bind(buffer::SCENE, scene).bind(buffer::SOURCE, b).bind(buffer::TARGET, a);
    s.dispatch(&GAUSSIAN_Y, all).bind(buffer::SCENE, scene).bind(buffer::SOURCE, a).bind(buffer::TARGET, b);
    s.dispatch(&GAUSSIAN_Z, all).bind(buffer::SCENE, scene).bind(buffer::SOURCE, b).bind(buffer::TARGET, a);
    s
}

/// The mask of what is smoothed above a share of its maximum and, where that may be more than `room` voxels, among the
/// brightest.
pub(super) fn keep(plan: &Plan, level: &Level, above: f64, room: usize) -> Schedule {
    let mut s = Schedule::default();
    let [smooth, _] = plan.volumes;
    if level.grid.storage() > room {
        s.fill(buffer::LEVELS, u64::from(LEVELS) * 4, 0);
        s.dispatch(&LEVELS_OF, groups(level.grid.storage(), LEVELS))
            .bind(buffer::SCENE, level.scene)
            .bind(buffer::SOURCE, smooth)
            .bind(buffer::REACHABLE, level.reachable);
        s.dispatch(&ROOM, [1, 1, 1]).bind(buffer::SCENE, level.scene).with(Push {
            first: room as u32,
            flags: (above as f32).to_bits(),
            ..Default::default()
        });
    }
    s.dispatch(&THRESHOLD, groups(level.grid.storage() / 32, WORKGROUP))
        .bind(buffer::SCENE, level.scene)
        .bind(buffer::SOURCE, smooth)
        .bind(buffer::REACHABLE, level.reachable)
        .with(Push { flags: (above as f32).to_bits(), ..Default::default() });
    s
}

/// The mask of `fine` from that of `coarse`, by way of `ranks`, which are made anew from it.
pub(super) fn double_mask(coarse: &Level, fine: &Level) -> Schedule {
    let mut s = Schedule::default();
    s.copy(buffer::MASK, buffer::RANKS, coarse.grid.storage() as u64 / 8);
    s.dispatch(&DOUBLE_DOMAIN, groups(fine.grid.storage() / 32, WORKGROUP))
        .bind(buffer::SCENE, fine.scene)
        .bind(buffer::COARSE_MASK, buffer::RANKS);
    s
}

/// The maps of `level`, in `columns_host`.
pub fn extract(level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let columns = level.grid.n[0] * level.grid.n[1];
    s.dispatch(&EXTRACT, groups(columns, WORKGROUP)).bind(buffer::SCENE, level.scene);
    s.copy(buffer::COLUMNS, COLUMNS_HOST, columns as u64 * 32);
    s
}
