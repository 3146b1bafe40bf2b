//! The passes that only the vector solver has.

use crate::advice::advice;
use crate::solve::passes;
use crate::solve::plan::pass::{ConstantValue, Fault, Pass, Voxels, passes, twin};
use crate::transport::kernels::*;

const BOUND_FAULT: &[Fault] = &[Fault {
    bit: FAULT_BOUND,
    what: "the bounds of the steps",
    mend: &advice!["use a smaller " Peak " or " NoiseFactor ", and check the wall's points and the bins (" [Capture] ")"],
}];

passes! {
    /// All passes that only the vector solver has.
    pub static ALL;

    /// Filters the measurement along time.
    FILTER = Pass { twin: twin!(filter), ..Pass::of("filter", |_| &kernel::FILTER) };

    /// Gathers the filtered measurement in every voxel.
    BACKPROJECT = Pass {
        report: "backward_project",
        pairs: Some(Voxels::Grid),
        twin: twin!(backproject),
        ..Pass::of("backproject", |p| p.variant(&kernel::BACKPROJECT, &kernel::BACKPROJECT_TEXELS))
    };

    /// Smooths the back-projection along x.
    GAUSSIAN_X_VOLUME = Pass {
        constants: &[(constant::AXIS, ConstantValue::Is(0)), (constant::FIRST, ConstantValue::Is(0)), (constant::LAST, ConstantValue::Is(0))],
        twin: twin!(smooth),
        ..Pass::of("gaussian_x_volume", |_| &kernel::GAUSSIAN)
    };

    /// Smooths the length of vectors along x.
    GAUSSIAN_X = Pass {
        constants: &[(constant::AXIS, ConstantValue::Is(0)), (constant::FIRST, ConstantValue::Is(2)), (constant::LAST, ConstantValue::Is(0))],
        twin: twin!(smooth),
        ..Pass::of("gaussian_x", |_| &kernel::GAUSSIAN)
    };

    /// Moves vectors and bounds to their new slots.
    SETTLE = Pass {
        constants: &[(constant::DOUBLED, ConstantValue::Is(0))],
        twin: twin!(settle),
        ..Pass::of("settle", |_| &kernel::SETTLE)
    };

    /// Moves them to twice the lateral resolution.
    SETTLE_DOUBLED = Pass {
        constants: &[(constant::DOUBLED, ConstantValue::Is(1))],
        twin: twin!(settle),
        ..Pass::of("settle_doubled", |_| &kernel::SETTLE)
    };

    /// Puts the points of the active voxels at their centres.
    POINTS = Pass { twin: twin!(points), ..Pass::of("points", |_| &kernel::POINTS) };

    /// Estimates the expected brightness of voxels.
    EXPECT = Pass {
        constants: &[(constant::DOUBLED, ConstantValue::Is(0))],
        twin: twin!(expect),
        ..Pass::of("expect", |_| &kernel::EXPECT)
    };

    /// Estimates it at twice the lateral resolution.
    EXPECT_DOUBLED = Pass {
        constants: &[(constant::DOUBLED, ConstantValue::Is(1))],
        twin: twin!(expect),
        ..Pass::of("expect_doubled", |_| &kernel::EXPECT)
    };

    /// Renders unit albedo without cosines: a bound of the operator.
    FORWARD_BOUND = Pass {
        constants: &[(constant::BOUND, ConstantValue::Is(1))],
        pairs: Some(Voxels::Active),
        twin: twin!(forward_bound),
        ..Pass::of("forward_bound", passes::forward)
    };

    /// Gathers the bound D of every step.
    BOUND_STEP = Pass {
        report: "backward_bound_step",
        constants: &[(constant::WHAT, ConstantValue::Is(0))],
        pairs: Some(Voxels::Active),
        faults: BOUND_FAULT,
        twin: twin!(bound),
        ..Pass::of("bound_step", |p| p.variant(&kernel::BOUND, &kernel::BOUND_TEXELS))
    };

    /// Computes the photon variance of every bin.
    VARIANCE = Pass { twin: twin!(variance), ..Pass::of("variance", |_| &kernel::VARIANCE) };

    /// Takes variances back through the squared pulse.
    PULSE_NOISE = Pass {
        when: |p| p.scene.pulse > 0,
        constants: &[(constant::BACK, ConstantValue::Is(1)), (constant::SQUARED, ConstantValue::Is(1))],
        twin: twin!(pulse),
        ..Pass::of("pulse_noise", |_| &kernel::PULSE)
    };

    /// Takes variances back to the rendered pairs, by squared weights.
    SPOT_NOISE = Pass {
        when: crate::solve::Plan::has_spots,
        constants: &[(constant::SQUARED, ConstantValue::Is(1))],
        twin: twin!(spot),
        ..Pass::of("spot_noise", |_| &kernel::SPOT)
    };

    /// Gathers the weight lambda of every voxel's group term.
    BOUND_NOISE = Pass {
        report: "backward_bound_noise",
        constants: &[(constant::WHAT, ConstantValue::Is(1))],
        pairs: Some(Voxels::Active),
        faults: BOUND_FAULT,
        twin: twin!(bound),
        ..Pass::of("bound_noise", |p| p.variant(&kernel::BOUND, &kernel::BOUND_TEXELS))
    };

    /// Extrapolates the iterate, and computes its roughness there.
    EXTRAPOLATE = Pass {
        faults: &[Fault {
            bit: FAULT_SAMPLE,
            what: "the volume",
            mend: &advice!["use a smaller " LearningRate ", " InitialAlbedo " or " Roughness],
        }],
        twin: twin!(extrapolate),
        ..Pass::of("extrapolate", |_| &kernel::EXTRAPOLATE)
    };

    /// Gathers the gradient and takes the proximal step.
    STEP = Pass {
        report: "backward_step",
        pairs: Some(Voxels::Active),
        faults: &[
            Fault {
                bit: FAULT_BACKWARD,
                what: "the gradient",
                mend: &advice!["use a smaller " Peak ", or a larger " MinDepth " where voxels touch the wall"],
            },
            Fault {
                bit: FAULT_UPDATE,
                what: "the next volume",
                mend: &advice!["use a smaller " LearningRate " or " Peak ", or " StepShare " 1"],
            },
        ],
        twin: twin!(step),
        ..Pass::of("step", |p| p.variant(&kernel::STEP, &kernel::STEP_TEXELS))
    };
}
