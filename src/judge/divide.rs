//! Divides a capture by the gain law of devices near the wall, if held-out pairs say so. Quick trials of the first model, with and
//! without the division by a law, are judged on the same held-out pairs.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::time::Instant;

use super::device::{FoundDevice, LEAST_RATIO, best, divided, is_clear};
use super::estimate::held;
use super::job::Job;
use crate::Result;
use crate::capture::{Capture, GainLaw};
use crate::engine::Progress;
use crate::gpu::Gpu;
use crate::methods::SolverOptions;
use crate::settings::DevicePosition;
use crate::surface::Left;

/// Decides on the law of the devices that are set, else of those that the capture names, and divides the capture by it.
///
/// # Errors
/// A position that is set and not in front of the wall; the device fails, or `hear` cancels.
pub fn divide<'c>(
    job: Job<'c>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Job<'c>> {
    let clock = Instant::now();
    let found = if job.has_light() { law(&job, gpu, hear)? } else { None };
    let Some((found, divided)) = found else { return Ok(job) };
    let mut job = match divided {
        Some(divided) => job.again(Cow::Owned(divided)),
        None => job,
    };
    job.estimates.device = Some(found);
    job.estimates.seconds += clock.elapsed().as_secs_f64();
    Ok(job)
}

/// The law, and the capture that is divided by it, if it is to be. `None` if no device is known.
fn law(
    job: &Job<'_>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Option<(FoundDevice, Option<Capture>)>> {
    let (capture, set) = (&*job.capture, job.settings.device_at);
    let named = match set {
        Some(DevicePosition::None) => return Ok(None),
        Some(DevicePosition::At(at)) => capture.clone().with(|c| c.devices = [Some(at); 2]),
        None if capture.devices == [None; 2] => return Ok(None),
        None => capture.clone(),
    };
    let is_set = set.is_some();
    if is_set && named.gains(GainLaw::Laser).is_none() {
        return Err(named.behind(GainLaw::Laser));
    }
    let mut laws = divided(&named);
    let mut found = FoundDevice {
        at: named.devices.map(|at| at.map(|at| at.to_array())),
        is_set,
        law: None,
        left: vec![],
        untried: None,
        is_doubtful: false,
    };
    if laws.is_empty() {
        let is_even = GainLaw::ALL.into_iter().any(|law| named.gains(law).is_some());
        found.untried = Some(if is_even {
            format!("its gains differ by less than {:.0} %", 100.0 * (LEAST_RATIO - 1.0))
        } else {
            "it is not in front of every wall point".into()
        });
        return Ok(Some((found, None)));
    }
    let is_judged = matches!(job.solver, SolverOptions::Surface(_));
    let chosen = if is_judged {
        let mut trial = |capture: &Capture| {
            let held = held(job, capture, gpu, hear)?;
            Ok::<_, crate::Error>(held.map(|held| (held.left(), held.pairs)))
        };
        let none = trial(capture)?;
        let left = laws.iter().map(|(_, divided)| trial(divided)).collect::<Result<Vec<_>>>()?;
        let pairs = none.as_ref().map_or(vec![], |(_, pairs)| pairs.clone());
        let [none, left] = [vec![none], left].map(|trials| {
            trials.into_iter().map(|trial| trial.map(|(left, _)| left)).collect::<Vec<Option<Left>>>()
        });
        let names = std::iter::once("none").chain(laws.iter().map(|(law, _)| law.name()));
        let figures = |left: &Left| [left.excess(), left.standard_error()];
        let all = none.iter().chain(&left).map(|left| left.as_ref().map(figures));
        found.left = names.map(String::from).zip(all).collect();
        let at = best(&left);
        // A surface is better than none.
        let is_better = at.is_some_and(|at| {
            let gains = named.gains(laws[at].0).unwrap_or_default();
            let gains: Vec<f64> = pairs.iter().map(|pair| gains[*pair]).collect();
            let both = none[0].as_ref().zip(left[at].as_ref());
            both.is_none_or(|(none, left)| is_clear(left, none, &gains))
        });
        found.is_doubtful = is_set
            && none[0].as_ref().is_some_and(|none| {
                at.and_then(|at| left[at].as_ref()).is_none_or(|left| none.is_less(left))
            });
        if is_set { Some(at.unwrap_or(0)) } else { at.filter(|_| is_better) }
    } else {
        found.untried = Some("only the solver surface compares held-out pairs".into());
        is_set.then_some(0)
    };
    let kept = chosen.map(|at| laws.swap_remove(at));
    found.law = kept.as_ref().map(|(law, _)| law.name().into());
    Ok(Some((found, kept.map(|(_, divided)| divided))))
}
