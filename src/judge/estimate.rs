//! Short fits of parts of a capture.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::time::Instant;

use super::constants::{FAR, FINE, LATERAL};
use super::found::{EstimateSeconds, Estimates, FindPulse, Shown};
use super::job::Job;
use super::model::FoundModel;
use super::probe::{Ask, shown_of};
use super::pulse::{FoundPulse, Shape};
use super::search::Search;
use super::trial::From;
use crate::capture::Capture;
use crate::engine::Progress;
use crate::gpu::Gpu;
use crate::methods::SolverOptions;
use crate::surface::{Begun, Candidate, HeldOut, Starts};
use crate::{Kind, Result};

/// Estimates what the job leaves open, by short fits of parts of its capture, if that has light.
///
/// # Errors
/// The device fails or has too little memory, or `hear` cancels ([`Kind::Cancelled`]). If a fit fails otherwise, the usual model
/// and sharp paths stay, and the solve itself reports the cause.
pub fn estimate<'c>(
    mut job: Job<'c>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Job<'c>> {
    if job.has_light() {
        let Estimates { calibration, device, empty, seconds, .. } = std::mem::take(&mut job.estimates);
        let ask = if job.calibrates() { Ask::Causes } else { Ask::Nothing };
        let found = found(&job, ask, gpu, hear)?;
        job.estimates = Estimates { calibration, device, empty, seconds: seconds + found.seconds, ..found };
    }
    Ok(job)
}

/// The estimates by fits of more pixels, without what causes they suggest.
///
/// # Errors
/// As [`estimate`].
pub fn finely(
    job: &Job<'_>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Estimates> {
    found(job, Ask::Fine, gpu, hear)
}

fn found(
    job: &Job<'_>,
    ask: Ask,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Estimates> {
    let _span = gpu.span("trials");
    let start = Instant::now();
    let finds_model = job.models.len() > 1;
    let find_pulse = job.find_pulse();
    let finds_high_pass = job.finds_high_pass();
    // The solve begins with the surface of the fits where its support may leave that of the start.
    let finds_start = matches!(&job.solver, SolverOptions::Surface(options) if options.grow);
    if !finds_model && find_pulse == FindPulse::Never && !finds_high_pass && !finds_start {
        return Ok(Estimates::default());
    }
    let usual = job.solver.common().reflectance;
    let mut tried = vec![];
    let (mut high_pass, mut begun, mut candidates, mut expected_iou) = (None, None, vec![], None);
    let (mut shown, mut finds_none, mut is_union) = (None, false, false);
    let (mut samples, mut is_by_chance) = (None, false);
    let mut stages = EstimateSeconds::default();
    let searched = Search::new(job, pixels_of(job, ask), gpu, hear).and_then(|mut search| {
        stages.start = start.elapsed().as_secs_f64();
        search.tell_start()?;
        expected_iou = search.starts.seen.as_ref().map(|seen| seen.expected_iou());
        if finds_high_pass {
            high_pass = Some(search.find_high_pass(&job.capture)?);
        }
        stages.high_pass = start.elapsed().as_secs_f64() - stages.start;
        let found = search.run(usual, finds_model);
        stages.pulse = search.pulse_seconds;
        stages.model = start.elapsed().as_secs_f64() - stages.start - stages.high_pass - stages.pulse;
        (samples, is_by_chance) = (search.samples.take(), search.is_by_chance);
        tried = std::mem::take(&mut search.tried);
        candidates = std::mem::take(&mut search.candidates);
        (finds_none, is_union) = (search.sharp.is_empty(), search.is_union);
        if let Some((reflectance, _)) = found.as_ref().ok().filter(|_| search.finds_start)
            && let Some(best) =
                std::mem::take(&mut search.sharp).into_iter().find(|s| s.reflectance == *reflectance)
        {
            candidates[best.candidate].kept = true;
            let is_far = !best.fitted.surface.is_coherent(FAR);
            // What suggests causes renders sharp paths.
            let ask = if samples.is_none() { ask } else { Ask::Nothing };
            shown = Some(shown_of(&mut search, *reflectance, best.fitted.clone(), ask)?);
            let Candidate { layers, step, .. } = best.fitted.surface;
            let Starts { layers: closed, light, seen, .. } = Starts::clone(&search.starts);
            begun = Some(Begun { layers, closed, is_far: is_far && seen.is_some(), seen, light, step });
        } else if search.finds_start && search.starts.seen.is_some() {
            // No trial found a surface: what the network sees may still explain light at full resolution.
            let Starts { layers, light, seen, .. } = Starts::clone(&search.starts);
            begun = Some(Begun { light, is_far: true, ..Begun::of(layers, seen) });
        }
        found
    });
    let ((reflectance, pulse), failed) = match searched {
        Ok(answer) => (answer, None),
        Err(e) if matches!(e.kind, Kind::Device | Kind::Cancelled) => return Err(e),
        // A fit needs less than the solve.
        Err(e) if e.kind == Kind::Memory => return Err(e),
        Err(e) => ((usual, (find_pulse == FindPulse::Always).then_some(Shape::SHARP)), Some(e.what)),
    };
    let seconds = start.elapsed().as_secs_f64();
    let model = finds_model.then(|| FoundModel::of(reflectance, &tried, is_by_chance, failed.clone()));
    let pulse = pulse.map(|shape| {
        let found = FoundPulse::of(shape, reflectance, &tried, stages.pulse, failed);
        match samples {
            Some(samples) => found.with(samples),
            None => found,
        }
    });
    Ok(Estimates {
        model,
        high_pass,
        pulse,
        expected_iou,
        candidates,
        seconds,
        stages,
        shown,
        finds_none,
        is_union,
        begun,
        calibration: None,
        device: None,
        empty: None,
    })
}

/// Lateral pixels of a fit.
fn pixels_of(job: &Job<'_>, ask: Ask) -> usize {
    if ask == Ask::Fine { FINE } else { job.solver.common().lateral.min(LATERAL) }
}

/// The held-out pairs of a short fit of another version of the job's capture, by the usual model. `None` if it finds no surface.
///
/// # Errors
/// The device fails, or the caller cancels.
pub fn held(
    job: &Job<'_>,
    capture: &Capture,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Option<HeldOut>> {
    let tried = job.with_capture(Cow::Borrowed(capture));
    Ok(shown(&tried, &Estimates::default(), Ask::Nothing, gpu, hear)?.map(|shown| shown.held))
}

/// What a short fit of the job's capture shows, with sharp paths, by the model and the high-pass that were `found` for another version
/// of it. `None` if it finds no surface.
///
/// # Errors
/// The device fails, or `hear` cancels.
pub fn shown(
    job: &Job<'_>,
    found: &Estimates,
    ask: Ask,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Option<Shown>> {
    let (solver, _) = found.settle(&job.solver, &job.models)?;
    let job = Job { models: vec![], find_pulse: FindPulse::Never, ..job.with_solver(solver) };
    let searched = Search::new(&job, pixels_of(&job, ask), gpu, hear).and_then(|mut search| {
        if found.is_union {
            search.begin_with_union();
        }
        let model = search.trials[0].reflectance();
        let fitted = search.fit(model, Shape::SHARP, From::Start)?;
        fitted.map(|fitted| shown_of(&mut search, model, fitted, ask)).transpose()
    });
    match searched {
        Err(e) if matches!(e.kind, Kind::Device | Kind::Cancelled) => Err(e),
        searched => Ok(searched.unwrap_or(None)),
    }
}
