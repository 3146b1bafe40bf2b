//! From a capture to maps: the one path of library, command, sessions and benchmark.

use std::sync::Arc;
use std::time::Instant;

use crate::Result;
use crate::engine::{OnProgress, Progress, Reconstruction, TracePoint, Watch};
use crate::gpu::Gpu;
use crate::judge::{self, Job, as_result, conclude, grade};

/// Reconstructs the capture of a job. Returns the job with its estimates, and the result. The watch is called during the short fits and
/// the solve; intermediate maps have the mask and the depth errors of a run that ends there.
///
/// # Errors
/// Settings out of range, or that the capture does not allow; memory or device do not allow the solve; the watch cancels
/// ([`crate::Kind::Cancelled`]); a loss is not finite.
pub fn solve<'c>(gpu: &Gpu, job: Job<'c>, watch: &mut Watch<'_>) -> Result<(Job<'c>, Reconstruction)> {
    let clock = Instant::now();
    let job = resolve(gpu, job, watch.hear)?;
    // Times count from the first short fit.
    let spent = clock.elapsed().as_secs_f64();
    let mut hear = |progress: &Progress| {
        let Progress { doing, point, iterations, remaining, maps } = progress;
        let point = TracePoint { seconds: point.seconds + spent, ..*point };
        let maps = maps.as_ref().map(|maps| as_result(&job, maps));
        (watch.hear)(&Progress { doing: *doing, point, iterations: *iterations, remaining: *remaining, maps })
    };
    // Maps on the way take time that is not the solve's.
    let is_undisturbed = watch.maps_every.is_none() && watch.maps_at.is_empty();
    let mut heard = Watch { hear: &mut hear, maps_every: watch.maps_every, maps_at: watch.maps_at };
    let mut result = job.solver.solve_from(gpu, &job.problem()?, job.estimates.begun.as_ref(), &mut heard)?;
    result.solve_seconds += spent;
    result.trace.iter_mut().for_each(|point| point.seconds += spent);
    conclude(&job.capture, job.mask_fraction(), &mut result); // mask, depth errors, what looks wrong with the maps
    grade(&job, &mut result); // the verdict
    if is_undisturbed {
        result.solve_seconds = clock.elapsed().as_secs_f64();
    }
    Ok((job, result))
}

/// Settles what the settings leave open, by short fits where an estimate is needed and the capture has light; corrects the counts by
/// what held-out pairs prove wrong with them; and grades what was found. The capture is then in the bins of the solver, with its
/// impulse response.
///
/// # Errors
/// Settings out of range, or that the capture does not allow; the device fails; `hear` cancels.
pub fn resolve<'c>(gpu: &Gpu, job: Job<'c>, hear: &mut OnProgress<'_>) -> Result<Job<'c>> {
    // A volume that the capture does not allow is an error before any fit.
    job.check()?;
    let job = judge::given(job, gpu, hear)?; // undone: the empty room, a calibration, the gain of a device near the wall
    let job = judge::estimate(job, gpu, hear)?; // what the network sees, high-pass, reflectance, impulse response
    let job = judge::widened(job, gpu, hear)?; // a wider box where objects reach beyond the scanned part of the wall
    let mut job = judge::corrected(job, gpu, hear)?; // undone: what a search finds and held-out pairs confirm
    job.verdict = Arc::new(judge::verdict(&job.estimates));
    job.settle()?.summed()
}
