//! Short fits of parts of a capture.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use super::constants::FAR;
use super::estimates::{AtHand, EstimateSeconds, Estimates, FindPulse};
use super::job::Job;
use super::model::FoundModel;
use super::physics::Physics;
use super::pulse::{FoundPulse, Shape};
use super::trial::{FitBegin, From, for_fits};
use crate::capture::Capture;
use crate::engine::{Problem, Progress, Watch};
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
        let Estimates { findings, seconds, .. } = std::mem::take(&mut job.estimates);
        let found = found(&job, gpu, hear)?;
        let stages = EstimateSeconds { search: seconds, ..found.stages };
        job.estimates = Estimates { findings, seconds: seconds + found.seconds, stages, ..found };
    }
    Ok(job)
}

fn found(job: &Job<'_>, gpu: &Gpu, hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>) -> Result<Estimates> {
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
    let (mut at_hand, mut finds_none, mut is_union) = (None, false, false);
    let (mut samples, mut is_by_chance) = (None, false);
    let mut stages = EstimateSeconds::default();
    let searched = Physics::new(job, gpu, hear).and_then(|mut search| {
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
        if let Some((reflectance, shape)) = found.as_ref().ok().filter(|_| search.finds_start)
            && let Some(best) =
                std::mem::take(&mut search.sharp).into_iter().find(|s| s.reflectance == *reflectance)
        {
            candidates[best.candidate].kept = true;
            let is_far = !best.fitted.surface.is_coherent(FAR);
            let shape = shape.filter(|_| samples.is_none());
            let spread = shape.and_then(|shape| search.spread_by(*reflectance, shape));
            let held = spread.unwrap_or_else(|| best.fitted.held.clone());
            at_hand = Some(AtHand { held, starts: search.starts.clone() });
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
        at_hand,
        finds_none,
        is_union,
        begun,
        findings: vec![],
    })
}

/// What fits of the job's capture begin with.
///
/// # Errors
/// As [`for_fits`]; the device fails, or `hear` cancels.
pub fn begin_of(
    job: &Job<'_>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<FitBegin> {
    let (whole, grid, options) =
        for_fits(&job.settings, job.solver.common().lateral, &job.capture, &job.solver)?;
    let problem = Problem { memory: job.settings.memory, ..Problem::new(&whole, grid) };
    let mut watch = Watch { hear, maps_every: None, maps_at: &[] };
    let starts = Arc::new(Starts::of(gpu, [&job.capture, &whole], &problem, &options, &mut watch)?);
    Ok(FitBegin { grid, starts, delays: vec![] })
}

/// The held-out pairs of a short fit of another version of the job's capture, with sharp paths, by the usual model. `None` if it finds no
/// surface.
///
/// # Errors
/// The device fails, or the caller cancels.
pub fn held(
    job: &Job<'_>,
    capture: &Capture,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Option<HeldOut>> {
    let job = job.with_capture(Cow::Borrowed(capture));
    let job = Job { models: vec![], find_pulse: FindPulse::Never, ..job };
    let searched = Physics::new(&job, gpu, hear).and_then(|mut search| {
        let model = search.trials[0].reflectance();
        Ok(search.fit(model, Shape::SHARP, From::Start)?.map(|fitted| fitted.held))
    });
    match searched {
        Err(e) if matches!(e.kind, Kind::Device | Kind::Cancelled) => Err(e),
        searched => Ok(searched.unwrap_or(None)),
    }
}
