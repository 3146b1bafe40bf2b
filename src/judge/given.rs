//! What settings, files and the counts themselves say of the instrument: the light of the empty room, a calibration, the position of a
//! device, a peak that all pairs share. Each is undone first, if held-out pairs allow it.

use std::borrow::Cow;
use std::path::Path;
use std::time::Instant;

use super::correction::stored;
use super::decide::{CaptureFinding, EvidenceGate, FindingSource, both, both_in_counts};
use super::job::Job;
use super::physics::held;
use crate::capture::{Capture, GainLaw, gain};
use crate::engine::noise::{background, variance_per_count};
use crate::engine::{OnProgress, room_light, without_room};
use crate::gpu::Gpu;
use crate::methods::SolverOptions;
use crate::settings::{Calibrate, Correction, DevicePosition};
use crate::surface::{HeldOut, Left};
use crate::{Error, Result};

/// Least ratio of the largest gain to the least one: a law that changes less than this changes no maps.
const LEAST_RATIO: f64 = 1.02;

/// A correction that is given, and the versions of the capture with it, the usual one first.
struct Offer {
    finding: CaptureFinding,
    /// What is kept without it, if that is not the capture as it is.
    without: Option<Capture>,
    versions: Vec<Version>,
}

struct Version {
    name: &'static str,
    what: String,
    capture: Capture,
    /// By which the counts of each pair are divided.
    gains: Option<Vec<f64>>,
}

/// Undoes what is given of the instrument.
///
/// # Errors
/// A file that cannot be read, or that does not suit the scan; a position that is set and not in front of the wall; the device
/// fails, or `hear` cancels.
pub fn given<'c>(mut job: Job<'c>, gpu: &Gpu, hear: &mut OnProgress<'_>) -> Result<Job<'c>> {
    let clock = Instant::now();
    for offered in [empty_room, shared, calibration, device] {
        if let Some(offer) = offered(&job)?.filter(|_| job.has_light()) {
            job = tried(job, offer, gpu, hear)?;
            job.estimates.seconds = clock.elapsed().as_secs_f64();
        }
    }
    Ok(job)
}

/// The job with the version that held-out pairs prefer, or without any.
fn tried<'c>(mut job: Job<'c>, offer: Offer, gpu: &Gpu, hear: &mut OnProgress<'_>) -> Result<Job<'c>> {
    let Offer { mut finding, without: mut kept, mut versions } = offer;
    let [is_room, is_searched, is_named] =
        [FindingSource::Empty, FindingSource::Searched, FindingSource::Named].map(|of| finding.source == of);
    if is_room || is_searched {
        // Shadows are negative; the capture is what it was.
        job.settings.preset = Some(job.preset);
    }
    let is_asked = !is_searched && !is_named;
    let mut chosen = (!versions.is_empty() && is_asked).then_some(0);
    if matches!(job.solver, SolverOptions::Surface(_)) && !versions.is_empty() {
        let none = held(&job, kept.as_ref().unwrap_or(&job.capture), gpu, hear)?;
        let fits = versions.iter().map(|v| held(&job, &v.capture, gpu, hear)).collect::<Result<Vec<_>>>()?;
        let left = |held: &Option<HeldOut>| held.as_ref().map(HeldOut::left);
        let lefts: Vec<Option<Left>> = fits.iter().map(left).collect();
        let all = [("none", left(&none))].into_iter();
        let all = all.chain(versions.iter().map(|v| v.name).zip(lefts.iter().cloned()));
        finding.left = all.map(|(name, left)| (name.into(), left.map(|left| left.figures()))).collect();
        let gate = EvidenceGate::of(finding.source);
        let passes = |at: usize| match (&fits[at], &none) {
            (Some(after), Some(before)) if is_room => {
                both_in_counts(after, before).is_none_or(|both| gate.passes(&both))
            }
            (Some(after), Some(before)) => gate.passes(&both(after, before, versions[at].gains.as_deref())),
            // A surface is better than none.
            (after, before) => after.is_some() || before.is_none() && is_asked,
        };
        chosen = best(&lefts).or(chosen).filter(|at| passes(*at));
    }
    finding.is_used = chosen.is_some();
    if let Some(Version { name, what, capture, .. }) = chosen.map(|at| versions.swap_remove(at)) {
        finding.what = what;
        finding.law = finding.at.map(|_| name.into());
        kept = Some(capture);
    } else if finding.source == FindingSource::File {
        finding.corrections.clear();
    }
    if let Some(capture) = kept {
        job = Job { why: job.why, ..job.again(Cow::Owned(capture)) };
    }
    if finding.is_used || !is_searched {
        job.estimates.findings.push(finding);
    }
    Ok(job)
}

/// The version that leaves least: its index. Those that come first are more usual and stay where the difference is chance.
fn best(versions: &[Option<Left>]) -> Option<usize> {
    let found = versions.iter().enumerate().filter_map(|(i, left)| Some((i, left.as_ref()?)));
    let (at, least) = found.min_by(|a, b| a.1.excess().total_cmp(&b.1.excess()))?;
    let is_alike = |left: &Option<Left>| left.as_ref().is_some_and(|left| !least.is_less(left));
    Some(versions[..at].iter().position(is_alike).unwrap_or(at))
}

/// The least and the largest of some gains.
fn range(gains: &[f64]) -> [f64; 2] {
    let all = || gains.iter().copied();
    [all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max)]
}

/// The subtraction of the empty room that the capture holds.
fn empty_room(job: &Job<'_>) -> Result<Option<Offer>> {
    let Some(light) = job.has_light().then(|| room_light(&job.capture)).flatten() else { return Ok(None) };
    let without = job.capture.outline().with(|c| c.histograms = job.capture.histograms.clone());
    let what = "the empty capture";
    let mut finding = CaptureFinding::new(
        FindingSource::Empty,
        format!("{what}: no gain makes its light a part of the capture's"),
        "it has to show the same place in the same light, turned alike, without the object",
    );
    let version = without_room(&job.capture, &light).map(|(gain, capture)| {
        let mean = gain.of_pair.iter().sum::<f64>() / gain.of_pair.len().max(1) as f64;
        let ([least, most], share) = (range(&gain.of_pair), 100.0 * gain.share);
        finding.what = format!("{what} leaves more of the light of held-out pairs than is left without it");
        finding.gain = Some([least, mean, most]);
        let what = format!(
            "{what} is subtracted with the gain {mean:.3} ({least:.3} to {most:.3} over the pairs): {share:.1} % of the counts"
        );
        Version { name: "subtracted", what, capture, gains: None }
    });
    Ok(Some(Offer { finding, without: Some(without), versions: Vec::from_iter(version) }))
}

/// The subtraction of a peak that all pairs share.
fn shared(job: &Job<'_>) -> Result<Option<Offer>> {
    let capture = &*job.capture;
    // What an empty room was subtracted from has none.
    if !job.has_light() || !job.calibrates() || capture.noise.is_some() {
        return Ok(None);
    }
    let Some((left, what)) = without_shared(capture) else { return Ok(None) };
    let hint = "take away what reflects it, or measure the empty room";
    let finding = CaptureFinding::new(FindingSource::Searched, what.clone(), hint);
    let version = Version { name: "subtracted", what, capture: left, gains: None };
    Ok(Some(Offer { finding, without: None, versions: vec![version] }))
}

/// The capture without light that all pairs share, and what that is; `None` where there is none, or nothing else.
fn without_shared(capture: &Capture) -> Option<(Capture, String)> {
    let per_count = variance_per_count(capture);
    let light = capture.shared_light(per_count)?;
    let sum = |capture: &Capture| capture.histograms.iter().map(|v| f64::from(*v)).sum::<f64>();
    let (all, count) = (light.iter().sum::<f64>(), capture.pair_count() as f64);
    let top = (0..capture.bins).max_by(|a, b| light[*a].total_cmp(&light[*b])).unwrap_or(0);
    let path = capture.t_start + (top as f64 + 0.5) * capture.bin_width;
    let share = 100.0 * all * count / sum(capture);
    let what = format!(
        "the same peak in every pair at a path of {path:.3} m, {share:.1} % of the counts, as of a cover glass or the instrument's own light"
    );
    // Counts with a noise of their own are those of the scene alone.
    let (mut left, ground) = (capture.clone(), background(capture));
    for row in left.histograms.chunks_exact_mut(capture.bins) {
        row.iter_mut().zip(&light).for_each(|(v, light)| *v -= (light + ground) as f32);
    }
    let floor = per_count * (all / capture.bins as f64 + ground);
    (left.noise, left.integer_counts) = (Some([per_count, floor]), false);
    // A room that lights all points alike is no peak: without it and the background too little is left.
    (sum(&left) > 0.0).then_some((left, what))
}

/// The corrections of the file that is set.
fn calibration(job: &Job<'_>) -> Result<Option<Offer>> {
    let Some(set @ Calibrate::File(file)) = &job.settings.calibrate else { return Ok(None) };
    let (capture, finding) = undone(file, set.corrections()?, &job.capture)?;
    let version = Version { name: "calibrated", what: finding.what.clone(), capture, gains: None };
    let versions = if finding.corrections.is_empty() { vec![] } else { vec![version] };
    Ok(Some(Offer { finding, without: None, versions }))
}

/// The capture without the corrections of a file.
fn undone(file: &Path, corrections: Vec<Correction>, capture: &Capture) -> Result<(Capture, CaptureFinding)> {
    let name = file.display();
    const HINT: &str = "give the report.json of a capture of the same rig";
    let what = format!("the calibration {name} has nothing to undo");
    let mut finding = CaptureFinding::new(FindingSource::File, what, HINT);
    finding.file = Some(file.into());
    let (mut capture, mut what) = (capture.clone(), vec![]);
    for correction in corrections {
        let known = stored(&correction, &capture);
        match known.map_err(|what| Error::input(format!("{name}: {what}"), HINT))? {
            Some((law, scan)) => {
                what.push((law.what)(&scan, &correction.numbers));
                capture = law.undone(&capture, &scan, &correction.numbers);
                finding.corrections.push(correction);
            }
            None => finding.left_out.push(correction.law),
        }
    }
    if !what.is_empty() {
        finding.what = format!("undone by the calibration {name}: {}", what.join("; "));
    }
    Ok((capture, finding))
}

/// The scan of a session without what the file that is set holds of its points and its time zero.
///
/// # Errors
/// A file that cannot be read, that does not suit the scan, or whose corrections change the counts of frames.
pub fn calibrated_scan<'c>(setting: Option<&Calibrate>, scan: &'c Capture) -> Result<Cow<'c, Capture>> {
    let Some(set @ Calibrate::File(file)) = setting else { return Ok(Cow::Borrowed(scan)) };
    let corrections = set.corrections()?;
    for correction in &corrections {
        if let Ok(Some((law, _))) = stored(correction, scan)
            && law.changes_counts()
        {
            let (name, law) = (file.display(), law.name);
            return Err(Error::options(
                format!("{name}: {law:?} changes counts, and frames of a session are used unchanged"),
                "correct each frame, and set calibrate to none",
            ));
        }
    }
    undone(file, corrections, scan).map(|(capture, _)| Cow::Owned(capture))
}

/// The laws of the devices that are set, else of those that the capture names.
fn device(job: &Job<'_>) -> Result<Option<Offer>> {
    let (capture, set) = (&*job.capture, job.settings.device_at);
    let named = match set {
        Some(DevicePosition::None) => return Ok(None),
        Some(DevicePosition::At(at)) => capture.clone().with(|c| c.devices = [Some(at); 2]),
        None if capture.devices == [None; 2] => return Ok(None),
        None => capture.clone(),
    };
    if set.is_some() && named.gains(GainLaw::Laser).is_none() {
        return Err(named.behind(GainLaw::Laser));
    }
    let place = match named.devices {
        [Some(laser), Some(sensor)] if laser != sensor => {
            format!("{} (laser) and {} (detector)", gain::place(laser), gain::place(sensor))
        }
        [Some(at), _] | [None, Some(at)] => gain::place(at),
        [None, None] => "unknown".into(),
    };
    let mut versions: Vec<Version> = vec![];
    for law in GainLaw::ALL {
        let is_new = |gains: &Vec<f64>| {
            let [least, most] = range(gains);
            most >= LEAST_RATIO * least && versions.iter().all(|v| v.gains.as_ref() != Some(gains))
        };
        let Some(gains) = named.gains(law).filter(is_new) else { continue };
        let what = format!(
            "{} weakens by cos / distance\u{b2} as from a device at {place}: the counts are divided by it",
            law.light()
        );
        let version = |capture| Version { name: law.name(), what, capture, gains: Some(gains) };
        versions.extend(named.without_gains(law).map(version));
    }
    let why = match versions.is_empty() {
        false => "",
        true if GainLaw::ALL.into_iter().any(|law| named.gains(law).is_some()) => ", whose gains are even",
        true => ", which is not in front of every wall point",
    };
    let mut finding = CaptureFinding::new(
        if set.is_some() { FindingSource::Set } else { FindingSource::Named },
        format!("a device at {place}{why}: the counts are not divided by cos / distance\u{b2} from there"),
        "check the position, or set it to none",
    );
    finding.at = Some(named.devices.map(|at| at.map(|at| at.to_array())));
    Ok(Some(Offer { finding, without: None, versions }))
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, dvec3};

    use super::*;

    /// 8 x 8 confocal pairs of a wall of 2 m, a count in every bin of its number.
    fn capture() -> Capture {
        let at = |i: usize| 2.0 * (i as f64 + 0.5) / 8.0 - 1.0;
        let points: Vec<DVec3> = (0..64).map(|pair| dvec3(at(pair / 8), at(pair % 8), 0.0)).collect();
        let counts = (0..64 * 40).map(|at| (at % 40) as f32).collect();
        Capture::new([8, 8], points.clone(), points, 40, 0.01, counts)
    }

    fn correction(law: &str, numbers: &[f64]) -> Correction {
        Correction { law: law.into(), numbers: numbers.to_vec(), middle: [0.5, 0.0], half: 2.0 }
    }

    /// Exact light over a room whose light is nearly the same for all points.
    #[test]
    fn what_leaves_no_light_is_no_shared_peak() {
        let of = |light: f32| {
            let points: Vec<DVec3> = (0..256).map(|p| dvec3((p / 16) as f64, (p % 16) as f64, 0.0)).collect();
            let value = |pair: usize, bin: usize| {
                let scene = if bin == 20 + pair / 4 { light } else { 0.0 };
                let shared = if (100..104).contains(&bin) { 9.0 } else { 0.0 };
                scene + shared + 0.25
            };
            let counts = (0..256 * 150).map(|at| value(at / 150, at % 150)).collect();
            Capture::new([16, 16], points.clone(), points, 150, 0.01, counts)
        };
        let (left, what) = without_shared(&of(1.0)).expect("a peak");
        let most = left.histograms.iter().fold(0.0f32, |most, v| most.max(v.abs()));
        assert!(what.contains("path of 1.0") && most < 2.0, "{what}: {most}");
        assert!(of(-0.2).shared_light(0.0).is_some() && without_shared(&of(-0.2)).is_none());
    }

    #[test]
    fn corrections_of_a_file_are_about_its_wall() {
        let capture = capture();
        let undone = |of: Correction| undone(Path::new("rig.json"), vec![of], &capture);
        let (wider, finding) = undone(correction("scale", &[0.1])).unwrap();
        let given = capture.laser[0];
        assert!(wider.laser[0].distance(dvec3(0.5 + 1.1 * (given.x - 0.5), 1.1 * given.y, 0.0)) < 1e-12);
        assert!(finding.what.contains("1.100 times"), "{}", finding.what);
        for (law, numbers) in [("moved along x", vec![0.1; 4]), ("gains of rows", vec![0.1; 8])] {
            assert_eq!(undone(correction(law, &numbers)).unwrap().1.left_out, [law]);
        }
        let late = [0.0, 0.02, 0.0, 0.02, 0.0, 0.02, 0.0, 0.02];
        let (early, _) = undone(correction("delays of rows", &late)).unwrap();
        assert_eq!(early.histogram(3)[..4], [2.0, 3.0, 4.0, 5.0]);
        for (of, what) in [
            (correction("shear", &[0.1; 2]), "no law \"shear\" of 2 numbers"),
            (correction("delays of rows", &[0.1; 9]), "it has 9 delays of rows, the capture has 8"),
        ] {
            let error = undone(of).unwrap_err();
            assert!(error.what.contains(what) && error.what.starts_with("rig.json: "), "{error}");
        }
    }

    #[test]
    fn the_version_that_leaves_least_is_best_but_for_chance() {
        let left = |mean: f64, scatter: f64| {
            let of = |i: usize| [mean + scatter * if i.is_multiple_of(2) { 1.0 } else { -1.0 }, 100.0];
            Some(Left { pairs: (0..64).map(of).collect(), noise: 0.0 })
        };
        assert_eq!(best(&[left(4.0, 0.1), left(4.5, 0.1)]), Some(0));
        assert_eq!(best(&[left(4.5, 0.1), left(4.0, 0.1)]), Some(1));
        assert_eq!(best(&[left(4.0, 0.1), left(3.9, 2.0)]), Some(0), "the usual one, but for chance");
        assert_eq!(best(&[None, left(9.0, 0.1)]), Some(1));
        assert_eq!(best(&[None]), None);
    }
}
