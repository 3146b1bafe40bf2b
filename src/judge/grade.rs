//! The verdict on a result: that on the estimates, with what the maps say and what is known of the capture.

use std::sync::Arc;

use super::job::Job;
use super::verdict::{EXPECTED_IOU, OF_RESULT};
use crate::engine::Reconstruction;
use crate::{Grade, Verdict};

/// Gives a result its verdict, and its warnings those of the capture. Where the result is poor, its warnings have the first reason, too.
pub fn grade(job: &Job<'_>, result: &mut Reconstruction) {
    let mut verdict = job.verdict.clone();
    // That of the conclusion replaces that of the start.
    if let Some(iou) = result.evidence.as_ref().map(|evidence| evidence.expected_iou) {
        let verdict = Arc::make_mut(&mut verdict);
        // What light no surface explains, no pixel is right by.
        let iou = verdict.left.map_or(iou, |[share, _]| iou.min((1.0 - share).max(0.0)));
        let before = verdict.expected_iou.replace(iou);
        if iou < OF_RESULT && before.is_none_or(|before| before >= EXPECTED_IOU) {
            verdict
                .add(Grade::Fair, format!("the result's IoU with the truth is expected to be only {iou:.2}"));
        }
    }
    let mut verdict = with_maps(&verdict, &result.warnings);
    add_capture(Arc::make_mut(&mut verdict), &job.warnings, &job.faults);
    result.warnings.splice(0..0, job.warnings.iter().cloned());
    let first = verdict.reasons.first().filter(|_| verdict.grade == Grade::Poor);
    result.warnings.extend(first.filter(|reason| !result.warnings.contains(reason)).cloned());
    result.verdict = Some(verdict);
}

/// The verdict with what the maps say: each warning makes it poor, or only fair if the network sees the scene well all the same, as
/// before a wall that sends most of the light.
pub fn with_maps(verdict: &Arc<Verdict>, warnings: &[String]) -> Arc<Verdict> {
    let mut verdict = verdict.clone();
    let is_seen = verdict.expected_iou.is_some_and(|iou| iou >= EXPECTED_IOU);
    for warning in warnings {
        Arc::make_mut(&mut verdict).add(if is_seen { Grade::Fair } else { Grade::Poor }, warning);
    }
    verdict
}

/// Adds what is known of the capture: faults that are certain make the verdict poor, what looks wrong fair.
fn add_capture(verdict: &mut Verdict, warnings: &[String], faults: &[String]) {
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
            add_capture(&mut verdict, warnings, faults);
            (verdict.grade, verdict.reasons)
        };
        assert_eq!(graded(&odd, &[]), (Grade::Fair, odd.clone()));
        let (grade, reasons) = graded(&odd, &broken);
        assert_eq!(grade, Grade::Poor);
        assert!(reasons.contains(&broken[0]));
    }
}
