//! What the device's watch for values that are not finite tells (`glsl/include/faults.glsl`), as one error.

use crate::transport::kernels::*;
use crate::{Error, Kind, Result};

/// A kernel by solver (the paper's, the vector solver's), its bit, what it works on, what mends it.
const KERNELS: [(u32, [&str; 2], &str, &str); 7] = [
    (
        FAULT_BOUND,
        ["bound", "bound"],
        "the bounds of the steps",
        "use a smaller --peak or --noise-factor, and check the wall's points and the bins (`thirdbounce info`)",
    ),
    (
        FAULT_SAMPLE,
        ["sample", "extrapolate"],
        "the volume",
        "use a smaller --learning-rate, --initial-albedo or --roughness",
    ),
    (
        FAULT_FORWARD,
        ["forward", "forward"],
        "the rendered histograms",
        "use a smaller --learning-rate, or a larger --min-depth where voxels touch the wall",
    ),
    (
        FAULT_RESIDUAL,
        ["residual", "residual"],
        "the difference from the measurement",
        "use a smaller --peak or --learning-rate, and check the counts (`thirdbounce info`)",
    ),
    (FAULT_NOISE, ["noise", "noise"], "the noise term", "use a smaller --noise-span or --learning-rate"),
    (
        FAULT_BACKWARD,
        ["backward", "step"],
        "the gradient",
        "use a smaller --peak, or a larger --min-depth where voxels touch the wall",
    ),
    (
        FAULT_UPDATE,
        ["update", "step"],
        "the next volume",
        "use a smaller --learning-rate or --peak, or --step-share 1",
    ),
];

/// Errors: a row of the trace with a fault, naming the iteration (from 1), the first kernel in the order of its
/// schedule, what is not finite there, and what may mend it.
pub(super) fn check(row: &[u32; TRACE_ROW as usize], iteration: usize, vectors: bool) -> Result<()> {
    let faults = row[TRACE_FAULTS as usize];
    let Some((_, names, where_, mend)) = KERNELS.iter().find(|k| faults & k.0 != 0) else { return Ok(()) };
    let loss = f32::from_bits(row[TRACE_OBJECTIVE as usize]);
    let name = names[usize::from(vectors)];
    Err(Error::new(
        Kind::Options,
        format!(
            "iteration {iteration}: kernel {name}: {where_} is beyond single precision or no number; the loss is {loss}"
        ),
        *mend,
    ))
}
