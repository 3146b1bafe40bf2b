//! Subtracts the light of the empty room, if held-out pairs do not speak against it: quick trials of the first model, with and without
//! it, are judged on the same held-out pairs.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::time::Instant;

use super::estimate::held;
use super::job::Job;
use super::room::FoundEmpty;
use crate::Result;
use crate::capture::{Capture, RoomGain};
use crate::engine::{Progress, room_light, without_room};
use crate::gpu::Gpu;
use crate::methods::SolverOptions;
use crate::surface::mean_and_error;

/// The subtraction is left out if it leaves more by this share: chance alone, of few photons, may hide harm.
const HARMS: f64 = 0.01;

/// Decides on the subtraction of the empty room that the capture holds.
///
/// # Errors
/// The device fails, or `hear` cancels.
pub fn subtract<'c>(
    mut job: Job<'c>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Job<'c>> {
    let clock = Instant::now();
    if !job.has_light() {
        return Ok(job);
    }
    let Some(light) = room_light(&job.capture) else { return Ok(job) };
    let without = job.capture.outline().with(|c| c.histograms = job.capture.histograms.clone());
    let with = without_room(&job.capture, &light);
    // Shadows are negative; the capture is what it was.
    job.settings.preset = Some(job.preset);
    let (found, kept) = decided(&job, without, with, gpu, hear)?;
    let why = job.why;
    let mut job = job.again(Cow::Owned(kept));
    job.why = why;
    job.estimates.empty = Some(found);
    job.estimates.seconds += clock.elapsed().as_secs_f64();
    Ok(job)
}

/// The finding, and the capture that it keeps.
fn decided(
    job: &Job<'_>,
    without: Capture,
    with: Option<(RoomGain, Capture)>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<(FoundEmpty, Capture)> {
    let mut found = FoundEmpty {
        gain: with.as_ref().map(|(gain, _)| range(gain)),
        share: with.as_ref().map_or(0.0, |(gain, _)| gain.share),
        left: None,
        is_used: false,
        untried: None,
    };
    let Some((_, with)) = with else {
        found.untried = Some("no gain makes its light a part of the capture's".into());
        return Ok((found, without));
    };
    if !matches!(job.solver, SolverOptions::Surface(_)) {
        found.untried = Some("only the solver surface compares held-out pairs".into());
        found.is_used = true;
        return Ok((found, with));
    }
    let mut trial = |capture: &Capture| {
        let held = held(job, capture, gpu, hear)?;
        Ok::<_, crate::Error>(held.map(|held| (held.squared_counts(), held.pairs)))
    };
    let squares = [trial(&without)?, trial(&with)?];
    found.is_used = match &squares {
        [Some((none, pairs)), Some((some, of_some))] if pairs == of_some => {
            let left = compared(none, some);
            found.left = Some(left);
            left[1] <= 1.0 + HARMS
        }
        // What is left of the room without the object shows no surface.
        [Some(_), None] => false,
        _ => true,
    };
    let kept = if found.is_used { with } else { without };
    Ok((found, kept))
}

/// Least, mean and largest gain.
fn range(gain: &RoomGain) -> [f64; 3] {
    let all = || gain.of_pair.iter().copied();
    [
        all().fold(f64::INFINITY, f64::min),
        all().sum::<f64>() / gain.of_pair.len().max(1) as f64,
        all().fold(0.0, f64::max),
    ]
}

/// Both sums in units of the first, and the standard error of their difference by the scatter of pairs.
fn compared(none: &[f64], some: &[f64]) -> [f64; 3] {
    let sum: f64 = none.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let [_, error] = mean_and_error(none.iter().zip(some).map(|(none, some)| some - none));
    [1.0, some.iter().sum::<f64>() / sum, error * none.len() as f64 / sum]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_compared_pair_by_pair() {
        let none: Vec<f64> = (0..64).map(|i| 10.0 + f64::from(i % 3)).collect();
        let some: Vec<f64> = none.iter().enumerate().map(|(i, v)| v - 1.0 + (i % 2) as f64).collect();
        let [one, left, error] = compared(&none, &some);
        assert_eq!(one, 1.0);
        // Half of the pairs leave 1 of 11 less: differences have the deviation ½.
        assert!((left - (1.0 - 0.5 / 11.0)).abs() < 1e-2, "{left}");
        assert!((error - 0.5 * 8.0 / (64.0 * 11.0)).abs() < 1e-3, "{error}");
    }
}
