//! The passes that only the paper's solver has.

use crate::advice::advice;
use crate::solve::plan::pass::{ConstantValue, Fault, Pass, Voxels, passes, twin};
use crate::transport::kernels::*;

passes! {
    /// All passes that only the paper's solver has.
    pub static ALL;

    /// Finds the first active voxels: all that are not too near and can reach a bin.
    INITIALISE = Pass { twin: twin!(initialise), ..Pass::of("initialise", |_| &kernel::INITIALISE) };

    /// Draws the first raw variables.
    INITIALISE_RAW = Pass {
        twin: twin!(initialise_raw),
        ..Pass::of("initialise_raw", |_| &kernel::INITIALISE_RAW)
    };

    /// Draws a point in every active voxel.
    SAMPLE = Pass {
        faults: &[Fault {
            bit: FAULT_SAMPLE,
            what: "the volume",
            mend: &advice!["use a smaller " LearningRate ", " InitialAlbedo " or " Roughness],
        }],
        twin: twin!(sample),
        ..Pass::of("sample", |_| &kernel::SAMPLE)
    };

    /// Learns the weights of the noise term.
    NOISE = Pass {
        when: |p| p.constant(constant::NOISE).is_some_and(|term| term != 0),
        faults: &[Fault {
            bit: FAULT_NOISE,
            what: "the noise term",
            mend: &advice!["use a smaller " NoiseSpan " or " LearningRate],
        }],
        twin: twin!(noise),
        ..Pass::of("noise", |_| &kernel::NOISE)
    };

    /// Gathers the gradient of every active voxel.
    BACKWARD = Pass {
        pairs: Some(Voxels::Active),
        faults: &[Fault {
            bit: FAULT_BACKWARD,
            what: "the gradient",
            mend: &advice!["use a smaller " Peak ", or a larger " MinDepth " where voxels touch the wall"],
        }],
        twin: twin!(backward),
        ..Pass::of("backward", |p| p.variant(&kernel::BACKWARD, &kernel::BACKWARD_TEXELS))
    };

    /// Updates the raw variables by Adam.
    UPDATE = Pass {
        faults: &[Fault {
            bit: FAULT_UPDATE,
            what: "the next volume",
            mend: &advice!["use a smaller " LearningRate " or " Peak ", or " StepShare " 1"],
        }],
        twin: twin!(update),
        ..Pass::of("update", |_| &kernel::UPDATE)
    };

    /// Moves state to its new slots.
    CARRY = Pass {
        constants: &[(constant::DOUBLED, ConstantValue::Is(0))],
        twin: twin!(carry),
        ..Pass::of("carry", |_| &kernel::CARRY)
    };

    /// Moves state to twice the lateral resolution, interpolated.
    CARRY_DOUBLED = Pass {
        constants: &[(constant::DOUBLED, ConstantValue::Is(1))],
        twin: twin!(carry_doubled),
        ..Pass::of("carry_doubled", |_| &kernel::CARRY)
    };

    /// Smooths the albedo along x: raw, or after ELU with a noise term.
    GAUSSIAN_X = Pass {
        constants: &[(constant::AXIS, ConstantValue::Is(0)), (constant::FIRST, ConstantValue::Is(1)), (constant::LAST, ConstantValue::Is(0))],
        twin: twin!(gaussian),
        ..Pass::of("gaussian_x", |_| &kernel::GAUSSIAN)
    };
}
