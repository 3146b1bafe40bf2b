//! What follows estimates and solve: the verdict, by what was found wrong with the capture, what a surface leaves of held-out pairs, and
//! the IoU that is expected; which pixels are surface, and how far their depths are off.

use std::sync::Arc;

use glam::DVec3;

use super::decide::CaptureFinding;
use super::estimates::Estimates;
use super::job::Job;
use crate::capture::{Capture, Pulse};
use crate::engine::{Reconstruction, background, variances};
use crate::maps::{Conditions, Maps};
use crate::methods::SolverOptions;
use crate::surface::Left;
use crate::transport::Reflectance;
use crate::{Grade, Verdict};

/// Least share beyond noise, less two standard errors, of results that are fair. Measured scenes with light that no surface sends
/// leave up to a half and are right. Evidence of the thresholds: benches/NOTES.md, "Verdict".
const FAIR: f64 = 0.25;
/// The same without errors taken off: of 43 proper captures one leaves more (.47, IoU .37); captures of wrong points left .35 and .38
/// and had an IoU of 0.
const MOST: f64 = 0.3;
/// Least share beyond noise, and least standard error of the share, of poor results.
const POOR: f64 = 0.9;
const UNCERTAIN: f64 = 0.2;
/// Expected IoU below which results are fair: of the start, and of the result.
const EXPECTED_IOU: f64 = 0.4;
const OF_RESULT: f64 = 0.45;

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
    let is_uncertain = error > UNCERTAIN;
    let grade = match () {
        () if is_uncertain || share > POOR => Grade::Poor,
        () if left.certain() > FAIR || share > MOST => Grade::Fair,
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

/// A residual ratio from here on explains hardly anything of the measurement.
const UNEXPLAINED: f64 = 0.95;
/// If noise has more than this share of the energy of the counts, no surface can explain them.
const NOISY: f64 = 0.8;
/// From this share of the pixels on, the surface is everywhere.
const EVERYWHERE: f64 = 0.99;

/// How much longer a path becomes per metre along a spot: the usual sine of its angle with the wall's normal.
const SLANT: f64 = 0.35;

/// Sets the mask of the result's maps ([`Maps::set_mask`]), unless the method determined it and no share is given; and the
/// expected depth error of all layers. Sets the warnings. Where edges determined a mask, small parts with uncertain depths leave it ([`Maps::leave_out_uncertain_parts`]).
/// `capture` is what was solved.
pub fn conclude(capture: &Capture, mask_fraction: Option<f64>, result: &mut Reconstruction) {
    if mask_fraction.is_some() || !result.has_mask {
        result.maps.set_mask(mask_fraction);
    }
    let all = conditions_of(capture, result.plan.scene.reflectance);
    let last = result.trace.last().map_or(0, |p| p.iteration);
    let is_volume = last <= result.volume_iterations;
    // Maps of the surface's resolution may show the volume's voxels.
    let lateral = result.maps.nx.min(result.lateral);
    let level = result.plan.levels.volume.iter().find(|l| l.grid.n[0] == lateral);
    let pitch = level.unwrap_or(result.plan.finest()).grid.pitch;
    let known = Conditions { voxel: if is_volume { [pitch.x, pitch.z] } else { [0.0; 2] }, ..all };
    let by_edges = mask_fraction.is_none() && result.plan.levels.pixels.is_some();
    set_errors(&mut result.maps, &known, by_edges);
    let residual = result.trace.last().and_then(|p| result.residual(p.data_loss));
    result.warnings = warnings(&result.maps.mask, residual, all.noise);
}

/// The maps of an iterate as a user gets them from a run that ends with it.
pub fn as_result(job: &Job<'_>, maps: &Maps) -> Maps {
    let mut maps = maps.clone();
    let (fraction, solver) = (job.mask_fraction(), &job.solver);
    if fraction.is_some() {
        maps.set_mask(fraction);
    } else if solver.name() == SolverOptions::DEFAULT {
        set_errors(&mut maps, &conditions_of(&job.capture, solver.common().reflectance), true);
    }
    maps
}

/// The conditions of a capture for maps of a surface.
fn conditions_of(capture: &Capture, reflectance: Reflectance) -> Conditions {
    let pulse = capture.pulse.as_ref().map_or(0.0, Pulse::fwhm);
    let spots = [capture.laser_spot, capture.sensor_spot].map(|spot| SLANT * spot.unwrap_or(0.0));
    Conditions {
        noise: noise(capture),
        width: capture.bin_width.hypot(pulse).hypot(spots[0]).hypot(spots[1]),
        aperture: aperture(capture),
        voxel: [0.0; 2],
        two_cosines: reflectance == Reflectance::Lambertian,
    }
}

/// What looks wrong with a result: its mask, its residual ratio if it has one, and the share of the counts' energy that is
/// noise.
fn warnings(mask: &[bool], residual: Option<f64>, noise: f64) -> Vec<String> {
    let check = "check the unit of lengths and times, time zero, the order of the axes and the gate";
    let unexplained = residual.filter(|r| *r > UNEXPLAINED && noise < NOISY).map(|r| {
        format!("the maps explain hardly anything of the measurement: the residual is {r:.3}; {check}")
    });
    let spread = match mask.iter().filter(|m| **m).count() {
        0 => Some(format!("no surface was found, the maps are empty: {check}")),
        n if n as f64 >= EVERYWHERE * mask.len() as f64 => Some(format!(
            "all of the picture counts as surface, which no scene smaller than the wall shows: {check}"
        )),
        _ => None,
    };
    unexplained.into_iter().chain(spread).collect()
}

/// Sets the expected depth error. If the mask is `by_edges`, small parts with uncertain depths leave it.
fn set_errors(maps: &mut Maps, known: &Conditions, by_edges: bool) {
    // What a network says of mask and errors of the first layer stays.
    let said = maps.probability.as_ref().and_then(|_| maps.depth_error.take());
    maps.set_depth_error(known);
    if said.is_some() {
        maps.depth_error = said;
    } else if by_edges && maps.leave_out_uncertain_parts() {
        // The brightness of the mask counts.
        maps.set_depth_error(known);
    }
}

/// The variance of all bins over their squared counts without background; 1 without light.
fn noise(capture: &Capture) -> f64 {
    let background = background(capture);
    let [per_count, empty] = variances(capture, background);
    let light = || capture.histograms.iter().map(|v| f64::from(*v) - background);
    let variance: f64 = light().map(|v| per_count * v + empty).sum();
    let energy: f64 = light().map(|v| v * v).sum();
    if energy > 0.0 { (variance / energy).clamp(0.0, 1.0) } else { 1.0 }
}

/// The mean extent of laser and sensor points over that of all points; 1 for a single point.
fn aperture(capture: &Capture) -> f64 {
    let extent = |points: &mut dyn Iterator<Item = &DVec3>| {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        points.for_each(|p| (low, high) = (low.min(*p), high.max(*p)));
        (high - low).length()
    };
    let [laser, sensor] = [&capture.laser, &capture.sensor].map(|points| extent(&mut points.iter()));
    let all = extent(&mut capture.laser.iter().chain(&capture.sensor));
    if all > 0.0 { 0.5 * (laser + sensor) / all } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::decide::FindingSource;
    use super::super::estimates::FoundPulse;
    use super::super::response::ResponseSamples;
    use super::*;

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
            (found(FindingSource::Empty, false), "is not used: feet"),
        ] {
            let graded = of(Some(finding), 0.8);
            assert!(graded.grade == Grade::Fair && graded.reasons[0].contains(words), "{graded}");
        }
        for finding in [found(FindingSource::Set, true), found(FindingSource::Named, false)] {
            assert_eq!(of(Some(finding), 0.8).reasons.len(), without);
        }
        let samples = ResponseSamples { samples: vec![0.5, 0.0, 0.5], width: 0.01, start: 0.0 };
        let (trials, samples) = (vec![], Some(samples));
        let pulse = FoundPulse { fwhm: 0.0, tail: 0.0, samples, trials, seconds: 0.0, failed: None };
        let echoed = verdict(&Estimates { pulse: Some(pulse), ..estimates(0.8) });
        assert!(echoed.grade == Grade::Fair && echoed.reasons[0].contains("echoes"), "{echoed}");
        let doubt = of(None, 0.2);
        assert!(doubt.grade == Grade::Fair && doubt.reasons.iter().any(|r| r.contains("IoU of only 0.20")));
    }

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

    /// A row of nine pairs with these laser points, and sensor points from -1 to 1 m.
    fn row(laser: impl Fn(f64) -> f64, histogram: &[f32]) -> Capture {
        let at = |x: f64| DVec3::new(x, 0.0, 0.0);
        let sensor: Vec<f64> = (0..9).map(|i| f64::from(i) / 4.0 - 1.0).collect();
        let laser = sensor.iter().map(|x| at(laser(*x))).collect();
        let sensor = sensor.iter().map(|x| at(*x)).collect();
        Capture::new([9, 1], laser, sensor, histogram.len(), 0.01, histogram.repeat(9))
    }

    #[test]
    fn one_laser_point_is_half_an_aperture() {
        let of = |laser: &dyn Fn(f64) -> f64| aperture(&row(laser, &[1.0]));
        assert_eq!([of(&|x| x), of(&|_| 0.0), of(&|x| 0.5 * x)], [1.0, 0.5, 0.75]);
        let mut single = row(|_| 0.0, &[1.0]);
        single.sensor = single.laser.clone();
        assert_eq!(aperture(&single), 1.0);
    }

    #[test]
    fn a_residual_near_one_and_surface_everywhere_or_nowhere_are_warned_of() {
        let of = |surface: usize, residual, noise| {
            let mask: Vec<bool> = (0..400).map(|p| p < surface).collect();
            warnings(&mask, residual, noise).join("; ")
        };
        assert_eq!(of(100, Some(0.7), 0.1), "");
        assert_eq!(of(100, None, 0.1), "");
        assert!(of(100, Some(0.987), 0.1).contains("residual is 0.987"));
        assert_eq!(of(100, Some(0.987), 0.9), "", "noise that no surface explains");
        assert!(of(0, Some(0.7), 0.1).contains("no surface was found"));
        assert!(
            of(400, Some(0.99), 0.1).contains("0.990") && of(400, None, 0.1).contains("all of the picture")
        );
        assert!(of(397, None, 0.1).contains("all of the picture") && of(390, None, 0.1).is_empty());
    }

    #[test]
    fn noise_is_the_variance_over_the_energy() {
        let mut photons = row(|x| x, &[0.0, 4.0, 2.0, 0.0]);
        photons.integer_counts = true;
        // Nothing is behind the light, so there is no background: 6 over 16 + 4.
        assert!((noise(&photons) - 0.3).abs() < 1e-9, "{}", noise(&photons));
        assert_eq!(noise(&row(|x| x, &[0.0; 4])), 1.0);
    }
}
