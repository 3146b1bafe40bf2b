//! What is wrong with a capture, by the pairs that no fit takes: a cause is right if a surface explains far more of them once it is
//! undone. And the verdict on a result, which the cause, the residual and the network's expectation decide.

use std::borrow::Cow;
use std::ops::ControlFlow;

use super::calibration::Undone;
use super::cause::{self, Cause, JudgedCauses};
use super::found::{Estimates, Shown};
use super::job::Job;
use super::probe::Ask;
use super::scale::{self, Rescaled};
use super::{estimate, lines};
use crate::capture::Capture;
use crate::engine::Progress;
use crate::gpu::Gpu;
use crate::surface::Left;
use crate::{Grade, Result, Verdict};

pub use bands::{EXPECTED_IOU, OF_RESULT};

/// Bands of the verdict. Evidence: benches/NOTES.md, "Verdict".
mod bands {
    /// Least share beyond noise, less two standard errors, of results that are fair. Measured scenes with light that no surface sends
    /// leave up to a half and are right.
    pub const FAIR: f64 = 0.25;
    /// Least share beyond noise, and least standard error of the share, of poor results.
    pub const POOR: f64 = 0.9;
    pub const UNCERTAIN: f64 = 0.2;
    /// Least share beyond noise, less two standard errors, from which other scales are tried: proper captures leave less, but for rooms.
    pub const DOUBTED: f64 = 0.15;
    /// Expected IoU below which results are fair: of the start, and of the result.
    pub const EXPECTED_IOU: f64 = 0.4;
    pub const OF_RESULT: f64 = 0.45;
}

/// Estimated echoes reduce the IoU by up to .18 (benches/NOTES.md, "Causes").
const ECHOES: &str = "the estimated impulse response has echoes, which reduces the accuracy of the surface: measure the impulse response and set it";

/// What was found in a capture.
#[derive(Debug, Clone, Default)]
pub struct Diagnosis {
    /// The causes that held-out pairs prove.
    pub causes: Vec<Cause>,
    /// Others that leave about as little as the last of these.
    pub rivals: Vec<Cause>,
    /// The scale at which closed forms are sharper.
    pub scale: Option<Rescaled>,
    /// Causes that held-out pairs suggest and do not confirm, as sentences.
    pub doubts: Vec<String>,
    /// The capture without the first of these.
    pub undone: Option<Undone>,
}

impl Diagnosis {
    /// Adds what was found once a first cause was undone. The capture without the second one, too, if there is one that is undone.
    pub fn add(&mut self, second: Diagnosis) -> Option<Undone> {
        self.causes.extend(second.causes);
        self.rivals.extend(second.rivals);
        self.scale = second.scale;
        self.doubts.extend(second.doubts);
        second.undone
    }
}

/// Tries delays of lines and other scales on a capture whose estimates leave much of the held-out pairs. Delays are undone if the
/// settings do not forbid it.
///
/// # Errors
/// The device fails, or `hear` cancels.
pub fn diagnose(
    job: &Job<'_>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Diagnosis> {
    let (capture, estimates) = (&*job.capture, &job.estimates);
    let calibrates = job.calibrates();
    let is_doubtful = match &estimates.shown {
        Some(shown) => shown.held.left().certain() > bands::DOUBTED,
        None => estimates.finds_none,
    };
    let sharpness = if is_doubtful { scale::sharpness_of(job, gpu) } else { None };
    let scale = sharpness.and_then(|own| scale::rescaled(job, gpu, own));
    let found = Diagnosis { scale, ..Diagnosis::default() };
    let Some(shown) = &estimates.shown else { return Ok(found) };
    let mut trial = |capture: &Capture| {
        estimate::shown(&job.with_capture(Cow::Borrowed(capture)), estimates, Ask::Nothing, gpu, hear)
    };
    let Some((delays, after)) = lines::calibrate(shown, capture, &mut trial)? else {
        let record = sharpness.filter(|_| calibrates).and_then(|own| scale::restarted(job, gpu, own));
        return with_laws(found, job, record, gpu, hear);
    };
    let cause = Cause {
        what: delays.what(),
        hint: "measure the delay of each line, or correct the times before they are binned".into(),
        left: [shown.held.left().excess(), after.excess()],
        undone: calibrates,
    };
    let undone = || Undone { capture: delays.undone(capture), correction: delays.correction(capture) };
    Ok(Diagnosis { causes: vec![cause], undone: calibrates.then(undone), ..found })
}

/// Adds the law of few numbers that held-out pairs confirm, which is undone, and those between which and it they do not decide. `record`:
/// metres of path by which a later record makes images sharper.
fn with_laws(
    found: Diagnosis,
    job: &Job<'_>,
    record: Option<f64>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Diagnosis> {
    let (mut causes, undone) = match cause::judged(job, record, gpu, hear)? {
        JudgedCauses::Confirmed(found) => (found.causes, found.undone),
        JudgedCauses::Doubts(doubts) => return Ok(Diagnosis { doubts, ..found }),
    };
    let rivals = causes.split_off(1);
    Ok(Diagnosis { causes, rivals, undone: Some(undone), ..found })
}

/// The verdict on estimates: before a solve, without what the maps say.
pub fn verdict(estimates: &Estimates, diagnosis: &Diagnosis) -> Verdict {
    let mut verdict = Verdict { expected_iou: estimates.expected_iou, ..Verdict::GOOD };
    for cause in &diagnosis.causes {
        verdict.add(if cause.undone { Grade::Fair } else { Grade::Poor }, cause.sentence());
    }
    for rival in &diagnosis.rivals {
        verdict.add(Grade::Fair, format!("or, as pairs do not decide: {}", rival.sentence()));
    }
    for doubt in &diagnosis.doubts {
        verdict.add(Grade::Fair, doubt);
    }
    let device = estimates.device.as_ref().and_then(|found| found.doubt());
    let calibration = estimates.calibration.as_ref().and_then(|found| found.doubt());
    for doubt in device.into_iter().chain(calibration) {
        verdict.add(Grade::Fair, doubt);
    }
    if estimates.pulse.as_ref().is_some_and(|pulse| pulse.samples.is_some()) {
        verdict.add(Grade::Fair, ECHOES);
    }
    if let Some(scale) = &diagnosis.scale {
        verdict.add(Grade::Poor, scale.sentence());
    }
    match estimates.shown.as_ref().map(|shown: &Shown| shown.held.left()) {
        None if estimates.finds_none => {
            verdict.add(Grade::Poor, "no fit found a surface that explains the counts");
        }
        None => verdict.add(Grade::Fair, "no pairs were held out to judge it"),
        Some(left) => judge(&mut verdict, &left),
    }
    if let Some(iou) = estimates.expected_iou.filter(|iou| *iou < EXPECTED_IOU) {
        verdict.add(Grade::Fair, format!("the learned start expects an IoU of only {iou:.2}"));
    }
    verdict
}

/// Grades what a surface leaves of held-out pairs.
fn judge(verdict: &mut Verdict, left: &Left) {
    let (share, error) = (left.excess(), left.standard_error());
    verdict.left = Some([share, error]);
    let is_uncertain = error > bands::UNCERTAIN;
    let grade = match () {
        () if is_uncertain || share > bands::POOR => Grade::Poor,
        () if left.certain() > bands::FAIR => Grade::Fair,
        () => return,
    };
    let [share, error] = [share, error].map(|part| 100.0 * part);
    let why = if is_uncertain {
        format!(
            "the share is uncertain by {error:.0} %, so held-out pairs neither confirm nor refute the surface"
        )
    } else {
        "light that is not of the scene, or a fault without a name".into()
    };
    verdict.add(
        grade,
        format!("the surface leaves {share:.0} % of the light of held-out pairs beyond noise: {why}"),
    );
}

#[cfg(test)]
mod tests {
    use super::super::pulse::{FoundPulse, Shape};
    use super::super::samples::ResponseSamples;
    use super::*;
    use crate::transport::Reflectance;

    /// What is left of 100 pairs of equal light: `mean`, and every other one more and less by `scatter`.
    fn left(mean: f64, scatter: f64) -> Left {
        let of = |i: usize| mean + if i.is_multiple_of(2) { scatter } else { -scatter };
        Left { pairs: (0..100).map(|i| [of(i), 1.0]).collect(), noise: 0.0 }
    }

    #[test]
    fn a_surface_that_held_out_pairs_do_not_confirm_is_poor() {
        let graded = |mean: f64, scatter: f64| {
            let mut verdict = Verdict::GOOD;
            judge(&mut verdict, &left(mean, scatter));
            (verdict.grade, verdict.reasons.concat())
        };
        // The standard error is a tenth of the scatter.
        assert_eq!(graded(0.2, 0.3), (Grade::Good, String::new()));
        let (grade, reason) = graded(0.5, 0.3);
        assert!(grade == Grade::Fair && reason.contains("50 %"), "{reason}");
        assert_eq!(graded(0.89, 0.3).0, Grade::Fair);
        let (grade, reason) = graded(0.91, 0.3);
        assert!(grade == Grade::Poor && reason.contains("91 %"), "{reason}");
        // However small the share is: this error is larger than most shares of wrong surfaces.
        assert_eq!(graded(0.01, 1.9).0, Grade::Good);
        let (grade, reason) = graded(0.01, 2.1);
        assert!(grade == Grade::Poor && reason.contains("uncertain by 21 %"), "{reason}");
    }

    #[test]
    fn fits_without_a_surface_are_poor_and_no_fits_fair() {
        let of =
            |finds_none| verdict(&Estimates { finds_none, ..Estimates::default() }, &Diagnosis::default());
        assert_eq!(of(true).grade, Grade::Poor);
        assert!(of(true).reasons[0].contains("no fit found a surface"));
        assert_eq!(of(false).grade, Grade::Fair);
    }

    fn estimates(iou: f64) -> Estimates {
        Estimates { expected_iou: Some(iou), ..Estimates::default() }
    }

    #[test]
    fn causes_and_doubts_lower_the_grade() {
        let of = |cause: Option<Cause>, iou: f64| {
            let causes = cause.into_iter().collect();
            verdict(&estimates(iou), &Diagnosis { causes, ..Diagnosis::default() })
        };
        let cause = |undone| Cause { what: "feet".into(), hint: "scale".into(), left: [0.9, 0.02], undone };
        let poor = of(Some(cause(false)), 0.8);
        assert_eq!(poor.grade, Grade::Poor);
        assert!(
            poor.to_string().starts_with("poor: feet (of held-out pairs 90 %")
                && poor.to_string().contains("scale")
        );
        assert_eq!(of(Some(cause(true)), 0.8).grade, Grade::Fair);
        let doubts = vec!["perhaps the laser walks".to_owned()];
        let doubted = verdict(&estimates(0.8), &Diagnosis { doubts, ..Diagnosis::default() });
        assert!(doubted.grade == Grade::Fair && doubted.reasons[0].contains("perhaps"), "{doubted}");
        let samples = ResponseSamples { samples: vec![0.5, 0.0, 0.5], width: 0.01, start: 0.0 };
        let pulse = FoundPulse {
            samples: Some(samples),
            ..FoundPulse::of(Shape::SHARP, Reflectance::Cosine, &[], 0.0, None)
        };
        let echoed = verdict(&Estimates { pulse: Some(pulse), ..estimates(0.8) }, &Diagnosis::default());
        assert!(echoed.grade == Grade::Fair && echoed.reasons[0].contains("echoes"), "{echoed}");
        let doubt = of(None, 0.2);
        assert!(doubt.grade == Grade::Fair && doubt.reasons.iter().any(|r| r.contains("IoU of only 0.20")));
    }
}
