//! What is wrong with a capture, by the pairs that no fit takes: a cause is right if a surface explains far more of them once it is
//! undone. And the verdict on a result, which the cause, the residual and the network's expectation decide.

use std::ops::ControlFlow;

use crate::Result;
use crate::capture::Capture;
use crate::estimation::{self, EstimateRequest, Estimates, Shown};
use crate::gpu::Gpu;
use crate::solve::Progress;
use crate::{Grade, Verdict};

mod lines;
mod scale;

pub use bands::EXPECTED_IOU;
pub use lines::LineDelays;
pub use scale::Rescaled;

/// Bands of the verdict. Evidence: benches/NOTES.md, "Verdict".
mod bands {
    /// Least share beyond noise, less two standard errors, of results that are fair, and of poor ones. Measured scenes with light that no
    /// surface sends leave up to a half and are right.
    pub const LEFT: [f64; 2] = [0.25, 0.95];
    /// Least share beyond noise, less two standard errors, from which other scales are tried: proper captures leave less, but for rooms.
    pub const DOUBTED: f64 = 0.15;
    /// Expected IoU below which results are fair.
    pub const EXPECTED_IOU: f64 = 0.4;
}

/// What is wrong with a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Cause {
    /// What it is.
    pub what: String,
    /// The option or edit that undoes it.
    pub hint: String,
    /// Shares of held-out pairs beyond noise, as the capture is and once the cause is undone.
    pub left: [f64; 2],
    /// Whether it is undone.
    pub undone: bool,
}

impl Cause {
    /// The cause as a sentence.
    pub fn sentence(&self) -> String {
        let [before, after] = self.left.map(|share| 100.0 * share);
        let done = if self.undone { "undone here; " } else { "" };
        format!(
            "{} (of held-out pairs {before:.0} % is left beyond noise, {after:.0} % once it is undone): {done}{}",
            self.what, self.hint
        )
    }
}

/// What was found in a capture.
#[derive(Debug, Clone, Default)]
pub struct Diagnosis {
    /// The cause that held-out pairs prove.
    pub cause: Option<Cause>,
    /// The scale at which closed forms are sharper.
    pub scale: Option<Rescaled>,
    /// The capture without the delays of its lines.
    pub calibrated: Option<Capture>,
}

/// Tries delays of lines and other scales on a capture whose `estimates` leave much of the held-out pairs. Delays are undone if it
/// `calibrates`.
///
/// # Errors
/// The device fails, or `hear` cancels.
pub fn diagnose(
    request: &EstimateRequest,
    capture: &Capture,
    estimates: &Estimates,
    calibrates: bool,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Diagnosis> {
    let is_doubtful = match &estimates.shown {
        Some(shown) => shown.held.left().certain() > bands::DOUBTED,
        None => found_nothing(estimates),
    };
    let scale = if is_doubtful { scale::rescaled(request, capture, gpu) } else { None };
    let found = Diagnosis { scale, ..Diagnosis::default() };
    let Some(shown) = &estimates.shown else { return Ok(found) };
    let mut trial = |capture: &Capture| estimation::shown(request, estimates, capture, gpu, hear);
    let Some((delays, after)) = lines::calibrate(shown, capture, &mut trial)? else {
        return Ok(found);
    };
    let cause = Cause {
        what: delays.what(),
        hint: "measure the delay of each line, or correct the times before they are binned".into(),
        left: [shown.held.left().excess(), after.excess()],
        undone: calibrates,
    };
    Ok(Diagnosis { cause: Some(cause), calibrated: calibrates.then(|| delays.undone(capture)), ..found })
}

/// Whether fits were tried and none found a surface.
fn found_nothing(estimates: &Estimates) -> bool {
    estimates.candidates.is_empty() && estimates.model.as_ref().is_some_and(|m| m.failed.is_some())
}

/// The verdict on estimates: before a solve, without what the maps say.
pub fn verdict(estimates: &Estimates, diagnosis: &Diagnosis) -> Verdict {
    let mut verdict = Verdict { expected_iou: estimates.expected_iou, ..Verdict::GOOD };
    if let Some(cause) = &diagnosis.cause {
        verdict.add(if cause.undone { Grade::Fair } else { Grade::Poor }, cause.sentence());
    }
    if let Some(scale) = &diagnosis.scale {
        verdict.add(Grade::Poor, scale.sentence());
    }
    match estimates.shown.as_ref().map(|shown: &Shown| shown.held.left()) {
        None => verdict.add(
            Grade::Fair,
            match found_nothing(estimates) {
                true => "no fit found a surface that explains the counts",
                false => "no pairs were held out to judge it",
            },
        ),
        Some(left) => {
            let (least, share) = (left.certain(), 100.0 * left.excess());
            verdict.left = Some([left.excess(), left.standard_error()]);
            let [fair, poor] = bands::LEFT.map(|band| least > band);
            let grade = if poor {
                Grade::Poor
            } else if fair {
                Grade::Fair
            } else {
                Grade::Good
            };
            if grade > Grade::Good {
                verdict.add(
                    grade,
                    format!(
                        "the surface leaves {share:.0} % of the light of held-out pairs beyond noise: light that is not of the scene, or a \
                         fault without a name"
                    ),
                );
            }
        }
    }
    if let Some(iou) = estimates.expected_iou.filter(|iou| *iou < EXPECTED_IOU) {
        verdict.add(Grade::Fair, format!("the learned start expects an IoU of only {iou:.2}"));
    }
    verdict
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimates(iou: f64) -> Estimates {
        Estimates { expected_iou: Some(iou), ..Estimates::default() }
    }

    #[test]
    fn causes_and_doubts_lower_the_grade() {
        let of = |cause: Option<Cause>, iou: f64| {
            verdict(&estimates(iou), &Diagnosis { cause, ..Diagnosis::default() })
        };
        let cause = |undone| Cause { what: "feet".into(), hint: "scale".into(), left: [0.9, 0.02], undone };
        let poor = of(Some(cause(false)), 0.8);
        assert_eq!(poor.grade, Grade::Poor);
        assert!(
            poor.to_string().starts_with("poor: feet (of held-out pairs 90 %")
                && poor.to_string().contains("scale")
        );
        assert_eq!(of(Some(cause(true)), 0.8).grade, Grade::Fair);
        let doubt = of(None, 0.2);
        assert!(doubt.grade == Grade::Fair && doubt.reasons.iter().any(|r| r.contains("IoU of only 0.20")));
    }
}
