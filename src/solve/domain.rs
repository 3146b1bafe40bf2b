//! The active domain as schedules: the first one, its reduction, its doubling, its compacted lists.
//!
//! The paper's solver may have every voxel active, and has its reduction's volumes in `gradient` and `sample_points`, and
//! the coarse volume of a doubling in `moment_first`: between iterations nothing lives there, so they cost no memory.

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
    s.dispatch("initialise", groups(level.grid.storage(), WORKGROUP))
        .bind("scene", level.scene)
        .bind("reachable", level.reachable);
    s.extend(compact(plan, level));
    s
}

/// Lists, slots, counts and dispatch arguments from the mask.
pub fn compact(plan: &Plan, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let scene = level.scene;
    let words = level.grid.storage() / 32;
    let bricks = level.grid.storage() / BRICK_VOXELS;
    s.dispatch("compact_count", groups(bricks, WORKGROUP)).bind("scene", scene);
    s.dispatch("compact_scan_active", [1, 1, 1]).bind("scene", scene);
    s.dispatch("compact_scatter_active", groups(words, WORKGROUP))
        .bind("scene", scene)
        .bind("list", "active_voxels");
    if plan.continuous {
        s.dispatch("dilate", groups(words, WORKGROUP)).bind("scene", scene);
        s.dispatch("compact_count", groups(bricks, WORKGROUP))
            .bind("scene", scene)
            .bind("mask", "touched_mask");
        s.dispatch("compact_scan_touched", [1, 1, 1]).bind("scene", scene);
        s.dispatch("compact_scatter_touched", groups(words, WORKGROUP))
            .bind("scene", scene)
            .bind("mask", "touched_mask")
            .bind("list", "touched_voxels");
    } else {
        // Touched is active: only the count is wanted again.
        s.dispatch("compact_count", groups(bricks, WORKGROUP)).bind("scene", scene);
        s.dispatch("compact_scan_touched", [1, 1, 1]).bind("scene", scene);
    }
    s.dispatch("arguments", [1, 1, 1]).bind("scene", scene);
    s
}

/// Domain reduction: smooth the active albedo, keep what is above the threshold (paper, section 3.3).
pub fn reduce(plan: &Plan, level: &Level, keep_above: f64) -> Schedule {
    let mut s = smooth(plan, level, "gaussian_x");
    s.extend(keep(plan, level, keep_above));
    s.extend(compact(plan, level));
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

/// The mask of what is smoothed above a share of its maximum.
pub(super) fn keep(plan: &Plan, level: &Level, above: f64) -> Schedule {
    let mut s = Schedule::default();
    s.dispatch("threshold", groups(level.grid.storage() / 32, WORKGROUP))
        .bind("scene", level.scene)
        .bind("source", plan.volumes()[0])
        .bind("reachable", level.reachable)
        .with(Push { flags: (above as f32).to_bits(), ..Default::default() });
    s
}

/// Puts the optimiser at rest.
pub fn restart(level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let bytes = level.grid.storage() as u64 * 16;
    s.fill("moment_first", bytes, 0);
    s.fill("moment_second", bytes, 0);
    s
}

/// From `coarse` to `fine`, which has twice its lateral resolution; the optimiser is at rest after it.
pub fn double(plan: &Plan, coarse: &Level, fine: &Level) -> Schedule {
    let mut s = Schedule::default();
    s.copy("raw", "moment_first", coarse.grid.storage() as u64 * 16);
    s.dispatch("double_raw", groups(fine.grid.storage(), WORKGROUP))
        .bind("scene", fine.scene)
        .bind("coarse", "moment_first");
    s.extend(double_mask(coarse, fine));
    s.extend(restart(fine));
    s.extend(compact(plan, fine));
    s
}

/// The mask of `fine` from that of `coarse`.
pub(super) fn double_mask(coarse: &Level, fine: &Level) -> Schedule {
    let mut s = Schedule::default();
    s.copy("mask", "touched_mask", coarse.grid.storage() as u64 / 8);
    s.dispatch("double_domain", groups(fine.grid.storage() / 32, WORKGROUP))
        .bind("scene", fine.scene)
        .bind("coarse_mask", "touched_mask");
    s
}

/// What is due after `done` iterations, in the paper's order: reduction, then doubling (`level` moves on) or
/// restart. Empty if nothing is.
pub fn due(plan: &Plan, options: &PaperOptions, level: &mut usize, done: usize) -> Schedule {
    let mut s = Schedule::default();
    if options.reduce && done.is_multiple_of(options.reduce_every) {
        s.extend(reduce(plan, &plan.levels[*level], options.keep_above));
    }
    if done.is_multiple_of(options.double_every) && *level + 1 < plan.levels.len() {
        s.extend(double(plan, &plan.levels[*level], &plan.levels[*level + 1]));
        *level += 1;
    } else if done.is_multiple_of(options.restart_every) {
        s.extend(restart(&plan.levels[*level]));
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
