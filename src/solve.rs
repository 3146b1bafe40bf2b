//! A capture to maps: the one way of library, command, sessions and benchmark.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::Arc;

use crate::engine::{Progress, Reconstruction, TracePoint, Watch};
use crate::gpu::Gpu;
use crate::judge::{self, EXPECTED_IOU, Job, conclude};
use crate::{Grade, Result, Verdict};

/// Reconstructs the capture of a job. Returns the job with its estimates, and the result. The watch is called during the trials and the
/// solve; maps on the way have the mask and depth errors of a run that ends there.
///
/// # Errors
/// Settings out of range, or that the capture does not allow; memory or device do not allow the solve; the watch cancels
/// ([`crate::Kind::Cancelled`]); a loss is not finite.
pub fn solve<'c>(gpu: &Gpu, job: Job<'c>, watch: &mut Watch<'_>) -> Result<(Job<'c>, Reconstruction)> {
    let job = resolve(gpu, job, watch.hear)?;
    let before = job.estimates.seconds;
    let mut hear = |progress: &Progress| {
        let Progress { doing, point, iterations, remaining, maps } = progress;
        let point = TracePoint { seconds: point.seconds + before, ..*point };
        let maps = maps.as_ref().map(|maps| job.as_result(maps));
        (watch.hear)(&Progress { doing: *doing, point, iterations: *iterations, remaining: *remaining, maps })
    };
    let mut heard = Watch { hear: &mut hear, maps_every: watch.maps_every, maps_at: watch.maps_at };
    let mut result = job.solver.solve_from(gpu, &job.problem()?, job.estimates.begun.as_ref(), &mut heard)?;
    result.solve_seconds += before;
    result.trace.iter_mut().for_each(|point| point.seconds += before);
    conclude(&job.capture, job.mask_fraction(), &mut result);
    judge(&job, &mut result);
    Ok((job, result))
}

/// Fills in what the settings leave open: by short fits where an estimate is needed and the capture has light. The capture is then in
/// the bins of the solver, with its impulse response.
///
/// # Errors
/// Settings out of range, or that the capture does not allow; the device fails; `hear` cancels.
pub fn resolve<'c>(
    gpu: &Gpu,
    job: Job<'c>,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Job<'c>> {
    // Errors of the box come before any fit.
    job.check()?;
    let job = judge::divide(job, gpu, hear)?; // by the gain law of a device near the wall
    let mut job = judge::estimate(job, gpu, hear)?; // what the network sees, high-pass, reflectance, impulse response
    let mut found = judge::diagnose(&job, gpu, hear)?; // delays of lines, laws of few numbers, doubts about the scale
    if let Some(calibrated) = found.calibrated.take() {
        job = judge::estimate(job.again(Cow::Owned(calibrated)), gpu, hear)?;
        let second = judge::diagnose(&job, gpu, hear)?;
        if let Some(calibrated) = found.add(second) {
            job = judge::estimate(job.again(Cow::Owned(calibrated)), gpu, hear)?;
        }
    }
    job.verdict = Arc::new(judge::verdict(&job.estimates, &found));
    job.settle()?.summed()
}

/// Gives the result the verdict of its job, with what the maps say and what is known of the capture: faults that are certain make it
/// poor, what looks wrong fair.
fn judge(job: &Job<'_>, result: &mut Reconstruction) {
    let mut verdict = with_warnings(&job.verdict, &result.warnings);
    with_capture(Arc::make_mut(&mut verdict), &job.warnings, &job.faults);
    result.warnings.splice(0..0, job.warnings.iter().cloned());
    // A poor result is never without a warning.
    let first = verdict.reasons.first().filter(|_| verdict.grade == Grade::Poor);
    result.warnings.extend(first.filter(|reason| !result.warnings.contains(reason)).cloned());
    result.verdict = Some(verdict);
}

/// The verdict with what the maps say: it is poor if they have warnings, and fair if the network sees the scene well all the same, as
/// before a wall that sends most of the light.
pub fn with_warnings(verdict: &Arc<Verdict>, warnings: &[String]) -> Arc<Verdict> {
    let mut verdict = verdict.clone();
    let is_seen = verdict.expected_iou.is_some_and(|iou| iou >= EXPECTED_IOU);
    for warning in warnings {
        Arc::make_mut(&mut verdict).add(if is_seen { Grade::Fair } else { Grade::Poor }, warning);
    }
    verdict
}

/// Adds what is known of the capture.
fn with_capture(verdict: &mut Verdict, warnings: &[String], faults: &[String]) {
    warnings.iter().for_each(|warning| verdict.add(Grade::Fair, warning));
    faults.iter().for_each(|fault| verdict.add(Grade::Poor, fault));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suspicious_capture_is_fair_and_a_certain_fault_poor() {
        let [odd, broken] = ["odd", "broken"].map(|text| vec![text.to_owned()]);
        let graded = |warnings: &[String], faults: &[String]| {
            let mut verdict = Verdict::GOOD;
            with_capture(&mut verdict, warnings, faults);
            (verdict.grade, verdict.reasons)
        };
        assert_eq!(graded(&odd, &[]), (Grade::Fair, odd.clone()));
        let (grade, reasons) = graded(&odd, &broken);
        assert_eq!(grade, Grade::Poor);
        assert!(reasons.contains(&broken[0]));
    }
}
