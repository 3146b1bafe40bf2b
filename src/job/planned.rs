//! What a run needs memory for, before trials have found the pulse.

use std::borrow::Cow;

use crate::Result;
use crate::capture::Pulse;
use crate::judge::{FindPulse, Job};

/// Whether a run finds the pulse first, whatever the trials of the model show.
pub fn finds_pulse(job: &Job<'_>) -> bool {
    job.find_pulse() == FindPulse::Always
}

/// What to plan for: the job without its counts, which a plan does not need and which may be large, in the bins of the solver. A pulse
/// that is still to be found gets any width: all widths take the same memory.
///
/// # Errors
/// A bin width that makes no pulse, and those of [`Job::summed`].
pub fn to_plan(job: &Job<'_>) -> Result<Job<'static>> {
    planned(job, finds_pulse(job))
}

/// What needs the most memory, whatever trials find; see [`to_plan`].
///
/// # Errors
/// Those of [`to_plan`].
pub fn at_most(job: &Job<'_>) -> Result<Job<'static>> {
    planned(job, job.find_pulse() != FindPulse::Never)
}

fn planned(job: &Job<'_>, with_pulse: bool) -> Result<Job<'static>> {
    let capture = &*job.capture;
    let pulse = match with_pulse {
        true => Some(Pulse::gaussian(4.0 * capture.bin_width)?),
        false => capture.pulse.clone(),
    };
    let sum = job.settings.sum(&job.solver, &capture.outline().with(|c| c.pulse = pulse.clone()));
    let summed = if sum == 1 { Cow::Borrowed(capture) } else { Cow::Owned(capture.binned(sum)?) };
    // The box ends where the light does.
    let volume = job.settings.volume.map_or_else(|| job.solver.default_volume(&summed), Ok)?;
    let mut planned = job.with_capture(Cow::Owned(summed.outline().with(|c| c.pulse = pulse)));
    (planned.settings.volume, planned.sum) = (Some(volume), sum);
    Ok(planned)
}
