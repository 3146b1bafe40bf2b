//! Objects that reach beyond the scanned part of the wall: where the network sees surface at its edge, a wider box is tried, and taken if
//! held-out pairs want it.

use std::borrow::Cow;

use super::decide::{EvidenceGate, both};
use super::job::Job;
use super::physics::estimate;
use super::trial::{From, LATERAL, Trial, fit_all};
use crate::Result;
use crate::engine::{OnProgress, Watch};
use crate::gpu::Gpu;
use crate::learned::{LearnedStart, WIDEST};
use crate::methods::SolverOptions;
use crate::surface::Begin;
use crate::transport::Volume;

/// Surface that reaches this share of the half width of the box is at its edge.
const AT_EDGE: f64 = 0.9;
/// Room beside the surface that is seen in the widest box, walls.
const BESIDE: f64 = 0.05;
/// Step of widths, walls.
const STEP: f64 = 0.125;

/// Gives the job a wider box, with estimates anew, where that leaves clearly less of held-out pairs.
///
/// # Errors
/// The device fails, or `hear` cancels.
pub fn widened<'c>(mut job: Job<'c>, gpu: &Gpu, hear: &mut OnProgress<'_>) -> Result<Job<'c>> {
    let Some((walls, volume)) = wider(&job, gpu, hear)? else { return Ok(job) };
    job.settings.volume = Some(volume);
    job.estimates.walls = Some(walls);
    estimate(job, gpu, hear)
}

/// The width, in walls, and the box.
fn wider(job: &Job<'_>, gpu: &Gpu, hear: &mut OnProgress<'_>) -> Result<Option<(f64, Volume)>> {
    let is_free = matches!(&job.solver, SolverOptions::Surface(options) if options.begin == Begin::Auto);
    let Some((held, starts)) =
        job.estimates.at_hand.as_ref().filter(|_| is_free && job.settings.volume.is_none())
    else {
        return Ok(None);
    };
    if starts.seen.as_ref().is_some_and(|seen| seen.reach() < AT_EDGE) {
        return Ok(None);
    }
    let (solver, pulse) = job.estimated()?;
    let usual = solver.default_volume(&job.capture)?;
    let wide = |walls: f64| {
        let more = 0.5 * (walls - 1.0) * (usual.max - usual.min).with_z(0.0);
        Volume { min: usual.min - more, max: usual.max + more }
    };
    let Volume { min, max } = wide(WIDEST);
    let extent = [min.x, max.x, min.y, max.y];
    let Some(seen) = LearnedStart::of(gpu, &job.capture, Some(extent), job.settings.memory)? else {
        return Ok(None);
    };
    // Of widths whose pixels are as wide as those of the wall.
    let walls = (((WIDEST * seen.reach() + 2.0 * BESIDE) / STEP).ceil() * STEP).min(WIDEST);
    if walls <= 1.0 {
        return Ok(None);
    }
    let pixels = (walls * LATERAL as f64) as usize;
    let volume = wide(walls);
    let mut of_wide = job.with_capture(Cow::Borrowed(&job.capture));
    of_wide.settings.volume = Some(volume);
    let trial = Trial::of_models(&of_wide, &[solver], pixels, gpu, &mut Watch::of(hear))?.swap_remove(0);
    let pulse = pulse.as_ref().or(job.capture.pulse.as_ref());
    let fitted = fit_all(&[&trial], pulse, From::Start, 1.0, &mut Watch::of(hear))?.pop().flatten();
    let lefts = fitted.map(|fitted| both(&fitted.held, held, None));
    Ok(lefts.filter(|left| EvidenceGate::WIDER.passes(left)).map(|_| (walls, volume)))
}
