//! The passes that only the surface has. It is rendered and compared by those that solvers share.

use crate::advice::advice;
use crate::gpu::Constant;
use crate::solve::Plan;
use crate::solve::passes::{FORWARD, forward};
use crate::solve::plan::pass::{ConstantValue, Fault, Pass, Voxels, passes, twin};
use crate::transport::kernels::*;

/// The surface's own model of reflectance. All other constants are the volume's.
const REFLECTS: (Constant, ConstantValue) =
    (constant::REFLECTANCE, ConstantValue::Of(|p| p.scene.reflectance.number()));

/// Samples of one partial sum of [`SURFACE_COMBINE`].
const SUMMED: (Constant, ConstantValue) =
    (constant::SUMMED, ConstantValue::Of(|p| p.constant(constant::POINTS).unwrap_or(1) * WORKGROUP));

/// The pass that renders the surface: the volume's, if both reflect alike.
pub(super) fn forward_of(plan: &Plan) -> &'static Pass {
    if plan.scene.reflectance == plan.scene.volume_reflectance { &FORWARD } else { &SURFACE_FORWARD }
}

passes! {
    /// All passes that only the surface has.
    pub static ALL;

    /// The second surface of every column of the volume.
    EXTRACT_BEHIND = Pass {
        constants: &[(constant::BEHIND, ConstantValue::Is(1))],
        twin: twin!(extract_behind),
        ..Pass::of("extract_behind", |_| &kernel::EXTRACT)
    };

    /// Finds the neighbours that a pixel's plane goes through.
    SURFACE_BONDS = Pass {
        twin: twin!(surface_bonds),
        ..Pass::of("surface_bonds", |_| &kernel::SURFACE_BONDS)
    };

    /// Computes the slopes and the points of every pixel.
    SURFACE_POINTS = Pass {
        faults: &[Fault { bit: FAULT_SAMPLE, what: "the surface", mend: &advice!["use a smaller " Peak] }],
        twin: twin!(surface_points),
        ..Pass::of("surface_points", |_| &kernel::SURFACE_POINTS)
    };

    /// Renders the points of a surface that does not reflect as the volume does.
    SURFACE_FORWARD = Pass {
        report: "forward_surface",
        when: |p| p.scene.reflectance != p.scene.volume_reflectance,
        constants: &[REFLECTS],
        pairs: FORWARD.pairs,
        faults: FORWARD.faults,
        twin: FORWARD.twin,
        ..Pass::of("surface_forward", forward)
    };

    /// Gathers the gradient of every point.
    SURFACE_GATHER = Pass {
        report: "backward_surface",
        constants: &[REFLECTS],
        pairs: Some(Voxels::Active),
        faults: &[Fault {
            bit: FAULT_BACKWARD,
            what: "the surface's gradient",
            mend: &advice!["use a smaller " Peak ", or a larger " MinDepth " where it touches the wall"],
        }],
        twin: twin!(surface_gather),
        ..Pass::of("surface_gather", |p| p.variant(&kernel::SURFACE_GATHER, &kernel::SURFACE_GATHER_TEXELS))
    };

    /// Sums the gradients of the points of every pixel.
    SURFACE_COMBINE = Pass {
        twin: twin!(surface_combine),
        ..Pass::of("surface_combine", |_| &kernel::SURFACE_COMBINE)
    };

    /// Adds the gradients of the prior and of the neighbours' slopes.
    SURFACE_PULL = Pass {
        twin: twin!(surface_pull),
        ..Pass::of("surface_pull", |_| &kernel::SURFACE_PULL)
    };

    /// Updates depths and albedos by Adam, and closes the iteration.
    SURFACE_STEP = Pass {
        constants: &[SUMMED],
        faults: &[Fault { bit: FAULT_UPDATE, what: "the next surface", mend: &advice!["use a smaller " Peak] }],
        twin: twin!(surface_step),
        ..Pass::of("surface_step", |_| &kernel::SURFACE_STEP)
    };

    /// Closes a comparison without a step.
    SURFACE_FINISH = Pass {
        constants: &[
            (constant::ACCELERATED, ConstantValue::Is(0)),
            SUMMED,
        ],
        twin: twin!(finish),
        ..Pass::of("surface_finish", |_| &kernel::FINISH)
    };

    /// Puts a layer of the surface into the maps.
    SURFACE_EXTRACT = Pass {
        twin: twin!(surface_extract),
        ..Pass::of("surface_extract", |_| &kernel::SURFACE_EXTRACT)
    };
}
