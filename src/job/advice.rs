//! Finds options that make a job fit into memory. Each is tried on a plan of its own.

use std::borrow::Cow;

use super::load::Loaded;
use super::{Request, planned};
use crate::advice::{Advice, Remedy, Setting, advice};
use crate::capture::Gate;
use crate::gpu::Gpu;
use crate::judge::Job;
use crate::{Error, Kind};

/// Replaces the advice of an error: if a job needs too much memory, the advice names options that would fit.
pub fn advise(error: Error, request: &Request, loaded: &Loaded, gpu: &Gpu) -> Error {
    if error.kind != Kind::Memory {
        return error;
    }
    let options = suggestions(request, loaded, gpu);
    if options.is_empty() {
        return error;
    }
    let mut hint = Advice::from("this would fit: ");
    for (i, (setting, value)) in options.into_iter().enumerate() {
        let between = if i == 0 { "" } else { ", or " };
        hint = hint.and(advice![(between) {Remedy::Set(setting)} (format!(" {value}"))]);
    }
    hint = hint.and(advice!["; or a larger " DepthPitch]);
    if request.settings.memory.is_some() {
        hint = hint.and(advice![", or more " Memory]);
    }
    Error { hint, ..error }
}

/// Settings with values. Each of them alone makes the job fit, by the least change that was tried. They are tried on the
/// capture as it was loaded, because a large file takes long to read.
fn suggestions(request: &Request, loaded: &Loaded, gpu: &Gpu) -> Vec<(Setting, String)> {
    let fits = |job: &Job<'_>| fits_on(job, gpu);
    let capture = &loaded.capture;
    let stride = request.settings.stride.unwrap_or(1);
    let job = &request.job(capture);
    let lateral = job.solver.common().lateral;
    let smaller = (1..10).map(|k| lateral >> k).take_while(|n| *n >= 4);
    let smaller = smaller
        .map(|n| job.with_solver(job.solver.with_lateral(n)))
        .find(fits)
        .map(|job| (Setting::Lateral, job.solver.common().lateral.to_string()));
    let thinner = [2, 3, 4, 6, 8, 12, 16].into_iter().find(|times| {
        capture.stride(*times).is_ok_and(|thin| {
            thin.pair_count() < capture.pair_count() && fits(&job.with_capture(Cow::Owned(thin)))
        })
    });
    let thinner = thinner.map(|times| (Setting::Stride, stride.saturating_mul(times).to_string()));
    // Gates that begin with the signal, so that some of it stays.
    let [first, last] = capture.summary().signal_bins.unwrap_or([0, capture.bins]);
    let (from, span) = (capture.edge(first), capture.edge(last + 1) - capture.edge(first));
    let narrower = [1.0, 0.75, 0.5, 0.35, 0.25, 0.18, 0.125].into_iter().find_map(|share| {
        let text = format!("{from:.3}:{:.3}", from + share * span);
        let gated = Gate::parse(&text).and_then(|gate| capture.gated(gate));
        gated.is_ok_and(|gated| fits(&job.with_capture(Cow::Owned(gated)))).then_some((Setting::Gate, text))
    });
    [smaller, thinner, narrower].into_iter().flatten().collect()
}

fn fits_on(job: &Job<'_>, gpu: &Gpu) -> bool {
    let fits = |job: Job<'_>| job.solver.plan_within(gpu, &job.problem()?);
    planned::at_most(job).and_then(fits).is_ok()
}
