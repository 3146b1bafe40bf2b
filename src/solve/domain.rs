//! The active domain as schedules: the first one, its reduction, its doubling, its compacted lists.
//!
//! State lies by slot: active voxels first, in storage order, and behind them, for the paper's random sampling, the rim,
//! their neighbours that are not active. A change of the domain keeps the old masks and their slots beside the new ones
//! until state has been moved. Between iterations nothing lives in `gradient` and `sample_points`: where they are large
//! enough, the volumes of a reduction cost no memory ([`Plan::volumes`]).

use super::schedule::groups;
use super::{Level, PaperOptions, Plan};
use crate::gpu::Schedule;
use crate::transport::BRICK_VOXELS;
use crate::transport::kernels::*;

/// The first volume, the domain of all voxels that are not too near, optimiser at rest, sums at zero.
pub fn initialise(plan: &Plan, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let bytes = |name: &str| plan.buffers.iter().find(|b| b.name == name).map_or(0, |b| b.bytes);
    s.fill("counts", bytes("counts"), 0);
    s.fill("histograms", bytes("histograms"), 0);
    s.fill("noise_state", bytes("noise_state"), 0);
    s.dispatch("initialise", groups(level.grid.storage() / 32, WORKGROUP))
        .bind("scene", level.scene)
        .bind("reachable", level.reachable);
    s.extend(compact(plan, level));
    s.indirect("initialise_raw", "arguments", TOUCHED).bind("scene", level.scene);
    s.extend(restart(plan));
    s
}

/// Arguments of a kernel with an invocation for every touched voxel.
const TOUCHED: u64 = 12 * ARGUMENTS_UPDATE as u64;

/// List, slots, counts and dispatch arguments from the mask.
pub fn compact(plan: &Plan, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let scene = level.scene;
    let words = level.grid.storage() / 32;
    let bricks = level.grid.storage() / BRICK_VOXELS;
    s.dispatch("compact_count", groups(bricks, WORKGROUP)).bind("scene", scene);
    s.dispatch("compact_scan_active", [1, 1, 1]).bind("scene", scene);
    s.dispatch("compact_scatter_active", groups(words, WORKGROUP)).bind("scene", scene);
    if plan.continuous {
        s.dispatch("rim", groups(words, WORKGROUP)).bind("scene", scene);
        s.dispatch("compact_count", groups(bricks, WORKGROUP)).bind("scene", scene).bind("mask", "rim_mask");
        s.dispatch("compact_scan_rim", [1, 1, 1]).bind("scene", scene);
        s.dispatch("compact_scatter_rim", groups(words, WORKGROUP))
            .bind("scene", scene)
            .bind("mask", "rim_mask")
            .bind("ranks", "rim_ranks");
    }
    s.dispatch("arguments", [1, 1, 1]).bind("scene", scene);
    s
}

/// Domain reduction: smooth the active albedo, keep what is above the threshold (paper, section 3.3).
pub fn reduce(plan: &Plan, level: &Level, keep_above: f64) -> Schedule {
    let mut s = prune(plan, level, keep_above, plan.capacity);
    s.extend(compact(plan, level));
    for buffer in ["raw", "moment_first", "moment_second"] {
        s.extend(carry(plan, level, "carry", buffer));
    }
    s
}

/// The mask of a reduction to `room` voxels at most; the old one stays beside it with its slots.
pub(super) fn prune(plan: &Plan, level: &Level, keep_above: f64, room: usize) -> Schedule {
    let mut s = smooth(plan, level, "gaussian_x");
    s.extend(remember(plan, level));
    s.extend(keep(plan, level, keep_above, room));
    s
}

/// Keeps the masks and what their slots follow from.
fn remember(plan: &Plan, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let bytes = level.grid.storage() as u64 / 8;
    s.copy("mask", "mask_before", bytes);
    s.copy("ranks", "ranks_before", bytes);
    if plan.continuous {
        s.copy("rim_mask", "rim_before", bytes);
        s.copy("rim_ranks", "rim_ranks_before", bytes);
    }
    s
}

/// Takes a part of the state to its new slots by the kernel `how`.
fn carry(plan: &Plan, level: &Level, how: &'static str, buffer: &'static str) -> Schedule {
    let mut s = Schedule::default();
    let [target, _] = plan.volumes();
    s.indirect(how, "arguments", TOUCHED)
        .bind("scene", level.scene)
        .bind("source", buffer)
        .bind("target", target);
    s.copy(target, buffer, plan.touched_capacity as u64 * 16);
    s
}

/// Smooths what the kernel `first` reads into the first of [`Plan::volumes`], and its maximum into `counts`.
pub(super) fn smooth(plan: &Plan, level: &Level, first: &'static str) -> Schedule {
    let mut s = Schedule::default();
    let scene = level.scene;
    let [a, b] = plan.volumes();
    s.set("counts", COUNT_PEAK_SMOOTH, 0);
    s.set("counts", COUNT_LEAST_SMOOTH, 0);
    let all = groups(level.grid.storage(), WORKGROUP);
    s.dispatch(first, all).bind("scene", scene).bind("source", b).bind("target", a);
    s.dispatch("gaussian_y", all).bind("scene", scene).bind("source", a).bind("target", b);
    s.dispatch("gaussian_z", all).bind("scene", scene).bind("source", b).bind("target", a);
    s
}

/// The mask of what is smoothed above a share of its maximum and, where that may be more than `room` voxels, among the
/// brightest.
pub(super) fn keep(plan: &Plan, level: &Level, above: f64, room: usize) -> Schedule {
    let mut s = Schedule::default();
    let [smooth, _] = plan.volumes();
    if level.grid.storage() > room {
        s.fill("levels", u64::from(LEVELS) * 4, 0);
        s.dispatch("levels", groups(level.grid.storage(), LEVELS))
            .bind("scene", level.scene)
            .bind("source", smooth)
            .bind("reachable", level.reachable);
        s.dispatch("room", [1, 1, 1]).bind("scene", level.scene).with(Push {
            first: room as u32,
            flags: (above as f32).to_bits(),
            ..Default::default()
        });
    }
    s.dispatch("threshold", groups(level.grid.storage() / 32, WORKGROUP))
        .bind("scene", level.scene)
        .bind("source", smooth)
        .bind("reachable", level.reachable)
        .with(Push { flags: (above as f32).to_bits(), ..Default::default() });
    s
}

/// Puts the optimiser at rest.
pub fn restart(plan: &Plan) -> Schedule {
    let mut s = Schedule::default();
    let bytes = plan.touched_capacity as u64 * 16;
    s.fill("moment_first", bytes, 0);
    s.fill("moment_second", bytes, 0);
    s
}

/// From `coarse` to `fine`, which has twice its lateral resolution; the optimiser is at rest after it.
pub fn double(plan: &Plan, coarse: &Level, fine: &Level) -> Schedule {
    let mut s = remember(plan, coarse);
    s.extend(split(plan, coarse, fine));
    s
}

/// The same from a mask that has been pruned: what it has lost still counts where its neighbours are interpolated.
fn split(plan: &Plan, coarse: &Level, fine: &Level) -> Schedule {
    let mut s = double_mask(coarse, fine);
    s.extend(compact(plan, fine));
    s.extend(carry(plan, fine, "carry_doubled", "raw"));
    s.extend(restart(plan));
    s
}

/// The mask of `fine` from that of `coarse`, by way of `ranks`, which are made anew from it.
pub(super) fn double_mask(coarse: &Level, fine: &Level) -> Schedule {
    let mut s = Schedule::default();
    s.copy("mask", "ranks", coarse.grid.storage() as u64 / 8);
    s.dispatch("double_domain", groups(fine.grid.storage() / 32, WORKGROUP))
        .bind("scene", fine.scene)
        .bind("coarse_mask", "ranks");
    s
}

/// What is due after `done` iterations, in the paper's order: reduction, then doubling (`level` moves on) or
/// restart. Empty if nothing is.
pub fn due(plan: &Plan, options: &PaperOptions, level: &mut usize, done: usize) -> Schedule {
    let mut s = Schedule::default();
    let here = &plan.levels[*level];
    let next = plan.levels.get(*level + 1).filter(|_| done.is_multiple_of(options.double_every));
    let reduces = options.reduce && done.is_multiple_of(options.reduce_every);
    if let Some(fine) = next {
        // A voxel becomes four: there must be room for them.
        if reduces || fine.grid.storage() > plan.capacity {
            s.extend(prune(plan, here, options.keep_above, plan.capacity / 4));
            s.extend(split(plan, here, fine));
        } else {
            s.extend(double(plan, here, fine));
        }
        *level += 1;
        return s;
    }
    if reduces {
        s.extend(reduce(plan, here, options.keep_above));
    }
    if done.is_multiple_of(options.restart_every) {
        s.extend(restart(plan));
    }
    s
}

/// The maps of `level`, in `columns_host`.
pub fn extract(level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let columns = level.grid.n[0] * level.grid.n[1];
    s.dispatch("extract", groups(columns, WORKGROUP)).bind("scene", level.scene);
    s.copy("columns", "columns_host", columns as u64 * 32);
    s
}
