//! The passes that solvers share: rendering, comparing.

use super::tuning::Accumulation;
use super::whole::{Fault, Pass, Plan, Voxels, passes};
use crate::advice::advice;
use crate::gpu::KernelCode;
use crate::transport::Geometry;
use crate::transport::kernels::*;

passes! {
    /// All shared passes, in the order in which plans list them.
    pub static ALL;

    /// Renders the sampled points into the histograms.
    FORWARD = Pass {
        pairs: Some(Voxels::Active),
        faults: &[Fault {
            bit: FAULT_FORWARD,
            what: "the rendered histograms",
            hint: &advice![
                "use a larger " MinDepth " where voxels touch the wall, or a smaller " LearningRate " of the paper solver, and \
                 check the capture (" [Capture] ")"
            ],
        }],
        ..Pass::of("forward", forward)
    };

    /// Spreads the rendered histograms as the instrument does.
    PULSE = Pass { when: |p| p.scene.pulse > 0, ..Pass::of("pulse", pulse) };

    /// Sums the rendered histograms over the instrument's spots.
    SPOT = Pass { when: Plan::has_spots, ..Pass::of("spot", spot) };

    /// Sums them further, where the first pass read fixed point.
    SPOT_MORE = Pass {
        when: |p| p.has_spots() && p.fixed_point(),
        ..Pass::of("spot_more", |_| &kernel::SPOT)
    };

    /// Compares the rendered histograms with the measurement.
    RESIDUAL = Pass {
        faults: &[Fault {
            bit: FAULT_RESIDUAL,
            what: "the difference from the measurement",
            hint: &advice!["check the counts (" [Capture] "), or use a smaller " Peak " of the paper solver"],
        }],
        ..Pass::of("residual", residual)
    };

    /// Compares as [`RESIDUAL`] does, and takes down what changes slowly along time.
    RESIDUAL_ROWS = Pass {
        when: |p| p.scene.high_pass,
        faults: RESIDUAL.faults,
        ..Pass::of("residual_rows", residual_rows)
    };

    /// Takes residuals back through the pulse.
    PULSE_BACK = Pass {
        when: |p| p.scene.pulse > 0,
        constants: &[(constant::BACK, 1)],
        // Residuals are fp32 on every accumulation path.
        ..Pass::of("pulse_back", |_| &kernel::PULSE)
    };

    /// Takes residuals back to the rendered pairs.
    SPOT_BACK = Pass {
        when: Plan::has_spots,
        ..Pass::of("spot_back", |_| &kernel::SPOT)
    };

    /// Closes an iteration: sums the losses and writes the row of the trace.
    FINISH = Pass::of("finish", |_| &kernel::FINISH);

    /// The sizes of the indirect dispatches, from the counts.
    ARGUMENTS = Pass::of("arguments", |_| &kernel::ARGUMENTS);
}

/// The module that renders, by the kind of pairs and by how contributions are added up.
pub fn forward(plan: &Plan) -> &'static KernelCode {
    let product = plan.scene.geometry == Geometry::Product;
    match (plan.division.accumulation, product) {
        (Accumulation::Float, false) => &kernel::FORWARD_FLOAT,
        (Accumulation::Float, true) => &kernel::FORWARD_PRODUCT_FLOAT,
        (Accumulation::Fixed, false) => &kernel::FORWARD_FIXED,
        (Accumulation::Fixed, true) => &kernel::FORWARD_PRODUCT_FIXED,
        (Accumulation::Owned | Accumulation::Auto | Accumulation::Repeatable, _) => &kernel::FORWARD_OWNED,
    }
}

/// The module that compares.
pub fn residual(plan: &Plan) -> &'static KernelCode {
    if plan.fixed_point() { &kernel::RESIDUAL_FIXED } else { &kernel::RESIDUAL }
}

fn residual_rows(plan: &Plan) -> &'static KernelCode {
    match (plan.division.tuning.row_lanes > 0, plan.fixed_point()) {
        (true, true) => &kernel::RESIDUAL_SCAN_FIXED,
        (true, false) => &kernel::RESIDUAL_SCAN,
        (false, true) => &kernel::RESIDUAL_ROWS_FIXED,
        (false, false) => &kernel::RESIDUAL_ROWS,
    }
}

/// The pass that makes a plan's objective of the difference from the measurement.
pub fn objective(plan: &Plan) -> &'static Pass {
    if plan.scene.high_pass { &RESIDUAL_ROWS } else { &RESIDUAL }
}

/// The module that applies the pulse to what was accumulated.
fn pulse(plan: &Plan) -> &'static KernelCode {
    match plan.fixed_point() && !plan.has_spots() {
        true => &kernel::PULSE_FIXED,
        false => &kernel::PULSE,
    }
}

/// The module that sums what was accumulated over spots.
fn spot(plan: &Plan) -> &'static KernelCode {
    if plan.fixed_point() { &kernel::SPOT_FIXED } else { &kernel::SPOT }
}
