//! What a run needs memory for, before trials have found the pulse.

use std::borrow::Cow;

use crate::Result;
use crate::capture::{Capture, Pulse};
use crate::estimation::{EstimateRequest, FindPulse};
use crate::solve::Ready;

/// Whether a run finds the pulse first, whatever the trials of the model show.
pub fn finds_pulse(request: &EstimateRequest, capture: &Capture) -> bool {
    request.find_pulse(capture) == FindPulse::Always
}

/// What to plan for: the capture without its counts, which a plan does not need and which may be large. A pulse that is
/// still to be found gets any width: all widths take the same memory.
///
/// # Errors
/// A bin width that makes no pulse, and those of [`EstimateRequest::ready`].
pub fn to_plan(request: &EstimateRequest, capture: &Capture) -> Result<Ready<'static>> {
    planned(request, capture, finds_pulse(request, capture))
}

/// What needs the most memory, whatever trials find; see [`to_plan`].
///
/// # Errors
/// Those of [`to_plan`].
pub fn at_most(request: &EstimateRequest, capture: &Capture) -> Result<Ready<'static>> {
    planned(request, capture, request.find_pulse(capture) != FindPulse::Never)
}

fn planned(request: &EstimateRequest, capture: &Capture, with_pulse: bool) -> Result<Ready<'static>> {
    let pulse = match with_pulse {
        true => Some(Pulse::gaussian(4.0 * capture.bin_width)?),
        false => capture.pulse.clone(),
    };
    let sum =
        request.discretisation.sum(&request.solver, &capture.outline().with(|c| c.pulse = pulse.clone()));
    let summed = if sum == 1 { Cow::Borrowed(capture) } else { Cow::Owned(capture.binned(sum)?) };
    let grid = request.grid(&summed)?;
    Ok(Ready { capture: Cow::Owned(summed.outline().with(|c| c.pulse = pulse)), grid, sum })
}
