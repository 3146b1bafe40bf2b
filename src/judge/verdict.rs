//! The verdict on a result, by what was found wrong with the capture, what a surface leaves of held-out pairs, and the IoU that is expected.

use super::estimates::Estimates;
use super::finding::CaptureFinding;
use crate::surface::Left;
use crate::{Grade, Verdict};

pub use bands::{EXPECTED_IOU, OF_RESULT};

/// Bands of the verdict. Evidence: benches/NOTES.md, "Verdict".
mod bands {
    /// Least share beyond noise, less two standard errors, of results that are fair. Measured scenes with light that no surface sends
    /// leave up to a half and are right.
    pub const FAIR: f64 = 0.25;
    /// The same without errors taken off: of 43 proper captures one leaves more (.47, IoU .37); captures of wrong points left .35 and .38
    /// and had an IoU of 0.
    pub const MOST: f64 = 0.3;
    /// Least share beyond noise, and least standard error of the share, of poor results.
    pub const POOR: f64 = 0.9;
    pub const UNCERTAIN: f64 = 0.2;
    /// Expected IoU below which results are fair: of the start, and of the result.
    pub const EXPECTED_IOU: f64 = 0.4;
    pub const OF_RESULT: f64 = 0.45;
}

/// Estimated echoes reduce the IoU by up to .18 (benches/NOTES.md, "Causes").
const ECHOES: &str = "the estimated impulse response has echoes, which reduces the accuracy of the surface: measure the impulse response and set it";

/// The verdict on estimates: before a solve, without what the maps say.
pub fn verdict(estimates: &Estimates) -> Verdict {
    let mut verdict = Verdict { expected_iou: estimates.expected_iou, ..Verdict::GOOD };
    for doubt in estimates.findings.iter().filter_map(CaptureFinding::doubt) {
        verdict.add(Grade::Fair, doubt);
    }
    if estimates.has_samples() {
        verdict.add(Grade::Fair, ECHOES);
    }
    match estimates.left() {
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
        () if left.certain() > bands::FAIR || share > bands::MOST => Grade::Fair,
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
    use super::super::finding::FindingSource;
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
        assert_eq!([graded(0.29, 0.6).0, graded(0.31, 0.6).0], [Grade::Good, Grade::Fair]);
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
        let of = |finds_none| verdict(&Estimates { finds_none, ..Estimates::default() });
        assert_eq!(of(true).grade, Grade::Poor);
        assert!(of(true).reasons[0].contains("no fit found a surface"));
        assert_eq!(of(false).grade, Grade::Fair);
    }

    fn estimates(iou: f64) -> Estimates {
        Estimates { expected_iou: Some(iou), ..Estimates::default() }
    }

    #[test]
    fn findings_and_doubts_lower_the_grade() {
        let of = |finding: Option<CaptureFinding>, iou: f64| {
            verdict(&Estimates { findings: finding.into_iter().collect(), ..estimates(iou) })
        };
        let found = |source, is_used| CaptureFinding {
            is_used,
            ..CaptureFinding::new(source, "feet".into(), "scale")
        };
        let without = of(None, 0.8).reasons.len();
        for (finding, words) in [
            (found(FindingSource::Searched, true), "undone here"),
            (found(FindingSource::Searched, false), "perhaps feet"),
            (found(FindingSource::File, false), "contradict"),
            (found(FindingSource::Empty, false), "not used"),
        ] {
            let graded = of(Some(finding), 0.8);
            assert!(graded.grade == Grade::Fair && graded.reasons[0].contains(words), "{graded}");
        }
        for finding in [
            found(FindingSource::Set, true),
            found(FindingSource::Named, false),
            found(FindingSource::Empty, true),
        ] {
            assert_eq!(of(Some(finding), 0.8).reasons.len(), without);
        }
        let samples = ResponseSamples { samples: vec![0.5, 0.0, 0.5], width: 0.01, start: 0.0 };
        let pulse = FoundPulse {
            samples: Some(samples),
            ..FoundPulse::of(Shape::SHARP, Reflectance::Cosine, &[], 0.0, None)
        };
        let echoed = verdict(&Estimates { pulse: Some(pulse), ..estimates(0.8) });
        assert!(echoed.grade == Grade::Fair && echoed.reasons[0].contains("echoes"), "{echoed}");
        let doubt = of(None, 0.2);
        assert!(doubt.grade == Grade::Fair && doubt.reasons.iter().any(|r| r.contains("IoU of only 0.20")));
    }
}
