//! The passes of back-projections, and their schedule.

use crate::engine::over_pairs::{groups, light, pair_chunks, work_of};
use crate::engine::plan::whole::passes;
use crate::engine::{Level, Pass, Plan, Voxels};
use crate::gpu::{Buffer, Schedule};
use crate::transport::cells;
use crate::transport::kernels::*;

passes! {
    /// All passes that only back-projections have.
    pub static ALL;

    /// Filters the measurement along time.
    FILTER = Pass::of("filter", |_| &kernel::FILTER);

    /// Gathers the filtered measurement in every voxel.
    BACKPROJECT = Pass {
        report: "backward_project",
        pairs: Some(Voxels::Grid),
        ..Pass::of("backproject", |_| &kernel::BACKPROJECT)
    };
}

/// A number per voxel.
pub const PROJECTED: Buffer = Buffer::named("projected");

/// Back-projects the filtered measurement into [`PROJECTED`]; the filter has `taps` taps, its two
/// sides counted once.
pub fn gather_filtered(s: &mut Schedule, plan: &Plan, level: &Level, taps: usize) {
    let voxels = level.grid.storage();
    let own = plan.measured(level);
    let cells = cells(own.count, plan.scene.bins);
    s.dispatch(&FILTER, groups(cells, WORKGROUP), light(cells * 2 * taps))
        .bind(buffer::SCENE, own.scene)
        .bind(buffer::MEASURED, level.measured);
    for push in pair_chunks(plan, &own, voxels) {
        let all = groups(voxels, plan.division.tuning.samples_of_group(voxels));
        s.dispatch(&BACKPROJECT, all, work_of(&push, voxels))
            .with(push)
            .bind(buffer::SCENE, own.scene)
            .bind(buffer::WALL, own.wall)
            .bind(buffer::TARGET, PROJECTED);
    }
}
