//! The passes that only the surface has. It is rendered and compared by those that solvers share.

use crate::advice::advice;
use crate::engine::plan::whole::passes;
use crate::engine::{Fault, Pass, Voxels};
use crate::transport::kernels::*;

passes! {
    /// All passes that only the surface has.
    pub static ALL;

    /// Finds the neighbours that a pixel's plane goes through.
    SURFACE_BONDS = Pass::of("surface_bonds", |_| &kernel::SURFACE_BONDS);

    /// Computes the slopes and the points of every pixel.
    SURFACE_POINTS = Pass {
        faults: &[Fault { bit: FAULT_SAMPLE, what: "the surface", hint: &advice!["check the counts (" [Capture] ")"] }],
        ..Pass::of("surface_points", |_| &kernel::SURFACE_POINTS)
    };

    /// Gathers the gradient of every point.
    SURFACE_GATHER = Pass {
        report: "backward_surface",
        pairs: Some(Voxels::Active),
        faults: &[Fault {
            bit: FAULT_BACKWARD,
            what: "the surface's gradient",
            hint: &advice!["use a larger " MinDepth " where it touches the wall, and check the counts (" [Capture] ")"],
        }],
        ..Pass::of("surface_gather", |_| &kernel::SURFACE_GATHER)
    };

    /// Sums the gradients of the points of every pixel.
    SURFACE_COMBINE = Pass::of("surface_combine", |_| &kernel::SURFACE_COMBINE);

    /// Adds the gradients of the prior and of the neighbours' slopes.
    SURFACE_PULL = Pass::of("surface_pull", |_| &kernel::SURFACE_PULL);

    /// Updates depths and albedos by Adam, and closes the iteration.
    SURFACE_STEP = Pass {
        faults: &[Fault { bit: FAULT_UPDATE, what: "the next surface", hint: &advice!["check the counts (" [Capture] ")"] }],
        ..Pass::of("surface_step", |_| &kernel::SURFACE_STEP)
    };

    /// Finds the scale of the albedos, and compares the objective with the best one on the way.
    SURFACE_JUDGE = Pass::of("surface_judge", |_| &kernel::SURFACE_JUDGE);

    /// Scales the albedos, keeps the state, or puts the best one back.
    SURFACE_KEEP = Pass::of("surface_keep", |_| &kernel::SURFACE_KEEP);

    /// Puts a layer of the surface into the maps.
    SURFACE_EXTRACT = Pass::of("surface_extract", |_| &kernel::SURFACE_EXTRACT);
}
