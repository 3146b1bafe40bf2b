//! The passes that only the paper's solver has.

use crate::advice::advice;
use crate::engine::plan::whole::passes;
use crate::engine::{Fault, Pass, Voxels};
use crate::transport::kernels::*;

passes! {
    /// All passes that only the paper's solver has.
    pub static ALL;

    /// Finds the first active voxels: all that are not too near and can reach a bin.
    INITIALISE = Pass::of("initialise", |_| &kernel::INITIALISE);

    /// Draws the first raw variables.
    INITIALISE_RAW = Pass::of("initialise_raw", |_| &kernel::INITIALISE_RAW);

    /// Draws a point in every active voxel.
    SAMPLE = Pass {
        faults: &[Fault {
            bit: FAULT_SAMPLE,
            what: "the volume",
            hint: &advice!["use a smaller " LearningRate " or " InitialAlbedo],
        }],
        ..Pass::of("sample", |_| &kernel::SAMPLE)
    };

    /// Learns the weights of the noise term.
    NOISE = Pass {
        when: |p| p.constant(constant::NOISE).is_some_and(|term| term != 0),
        faults: &[Fault {
            bit: FAULT_NOISE,
            what: "the noise term",
            hint: &advice!["use a smaller " NoiseSpan " or " LearningRate],
        }],
        ..Pass::of("noise", |_| &kernel::NOISE)
    };

    /// Gathers the gradient of every active voxel.
    BACKWARD = Pass {
        pairs: Some(Voxels::Active),
        faults: &[Fault {
            bit: FAULT_BACKWARD,
            what: "the gradient",
            hint: &advice!["use a smaller " Peak ", or a larger " MinDepth " where voxels touch the wall"],
        }],
        ..Pass::of("backward", |_| &kernel::BACKWARD)
    };

    /// Updates the raw variables by Adam.
    UPDATE = Pass {
        faults: &[Fault {
            bit: FAULT_UPDATE,
            what: "the next volume",
            hint: &advice!["use a smaller " LearningRate " or " Peak],
        }],
        ..Pass::of("update", |_| &kernel::UPDATE)
    };

    /// Moves state to its new slots.
    CARRY = Pass {
        constants: &[(constant::DOUBLED, 0)],
        ..Pass::of("carry", |_| &kernel::CARRY)
    };

    /// Moves state to twice the lateral resolution, interpolated.
    CARRY_DOUBLED = Pass {
        constants: &[(constant::DOUBLED, 1)],
        ..Pass::of("carry_doubled", |_| &kernel::CARRY)
    };

    /// Smooths the albedo along x: raw, or after ELU with a noise term.
    GAUSSIAN_X = Pass {
        constants: &[(constant::AXIS, 0)],
        ..Pass::of("gaussian_x", |_| &kernel::GAUSSIAN)
    };

    /// Smooths along y.
    GAUSSIAN_Y = Pass {
        constants: &[(constant::AXIS, 1)],
        ..Pass::of("gaussian_y", |_| &kernel::GAUSSIAN)
    };

    /// Smooths along z and finds the maximum.
    GAUSSIAN_Z = Pass {
        constants: &[(constant::AXIS, 2)],
        ..Pass::of("gaussian_z", |_| &kernel::GAUSSIAN)
    };

    /// Counts smoothed voxels by brightness.
    LEVELS_OF = Pass::of("levels", |_| &kernel::LEVELS);

    /// Finds the brightness above which voxels fit into the room.
    ROOM = Pass::of("room", |_| &kernel::ROOM);

    /// The mask of the voxels that are bright enough.
    THRESHOLD = Pass::of("threshold", |_| &kernel::THRESHOLD);

    /// Counts the voxels of each brick in a mask.
    COMPACT_COUNT = Pass::of("compact_count", |_| &kernel::COMPACT_COUNT);

    /// Sums these counts over the bricks before.
    COMPACT_SCAN_ACTIVE = Pass {
        constants: &[(constant::RIM, 0)],
        ..Pass::of("compact_scan_active", |_| &kernel::COMPACT_SCAN)
    };

    /// Lists the active voxels.
    COMPACT_SCATTER_ACTIVE = Pass {
        constants: &[(constant::RIM, 0)],
        ..Pass::of("compact_scatter_active", |_| &kernel::COMPACT_SCATTER)
    };

    /// The mask of the active voxels' neighbours.
    RIM = Pass { when: |p| p.demand.has_rim, ..Pass::of("rim", |_| &kernel::RIM) };

    /// Sums the rim's voxels over the bricks before.
    COMPACT_SCAN_RIM = Pass {
        when: |p| p.demand.has_rim,
        constants: &[(constant::RIM, 1)],
        ..Pass::of("compact_scan_rim", |_| &kernel::COMPACT_SCAN)
    };

    /// Lists the rim behind the active voxels.
    COMPACT_SCATTER_RIM = Pass {
        when: |p| p.demand.has_rim,
        constants: &[(constant::RIM, 1)],
        ..Pass::of("compact_scatter_rim", |_| &kernel::COMPACT_SCATTER)
    };

    /// The mask at twice the lateral resolution.
    DOUBLE_DOMAIN = Pass::of("double_domain", |_| &kernel::DOUBLE_DOMAIN);

    /// The maps: the brightest voxel of each column.
    EXTRACT = Pass::of("extract", |_| &kernel::EXTRACT);
}
