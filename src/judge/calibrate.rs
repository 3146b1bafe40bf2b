//! The calibration that is given: undone before anything else, and judged by held-out pairs.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use glam::DVec2;

use super::calibration::FoundCalibration;
use super::estimate::held;
use super::job::Job;
use super::laws::{LAWS, Law, LawScan, WallFrame};
use super::lines::{LineDelays, Lines};
use super::suspects::both;
use crate::capture::Capture;
use crate::engine::Progress;
use crate::gpu::Gpu;
use crate::methods::SolverOptions;
use crate::settings::{Calibrate, Correction};
use crate::{Error, Result};

/// A correction as this build knows it.
enum KnownCorrection {
    Law(&'static Law),
    Lines(Lines),
}

impl KnownCorrection {
    fn of(correction: &Correction) -> Option<KnownCorrection> {
        let lines = [Lines::Columns, Lines::Rows].into_iter();
        let law =
            LAWS.iter().find(|law| law.name == correction.law && law.steps.len() == correction.numbers.len());
        law.map(KnownCorrection::Law).or(lines.map(KnownCorrection::Lines).find(
            |known| matches!(known, KnownCorrection::Lines(lines) if correction.law == format!("delays of {lines}")),
        ))
    }
}

/// A capture without a correction, and what that is in words. `None` if the correction is of its own capture alone, or of another kind
/// of scan.
fn undone(of: &Correction, capture: &Capture, file: &Path) -> Result<Option<(Capture, String)>> {
    let wrong = |what: String| {
        Error::input(
            format!("{}: {what}", file.display()),
            "give the report.json of a capture of the same rig",
        )
    };
    match KnownCorrection::of(of) {
        None => {
            let count = of.numbers.len();
            Err(wrong(format!("no law {:?} of {count} numbers is known", of.law)))
        }
        Some(KnownCorrection::Lines(lines)) => {
            let (has, wants) = (lines.count(capture.scan), of.numbers.len());
            if has != wants {
                return Err(wrong(format!(
                    "it has delays of {wants} {lines}, the capture has {has} {lines}"
                )));
            }
            let delays = LineDelays { lines, delays: of.numbers.clone() };
            Ok(Some((delays.undone(capture), delays.what())))
        }
        Some(KnownCorrection::Law(law)) => {
            let frame = WallFrame { middle: DVec2::from_array(of.middle), half: of.half };
            let scan = LawScan { frame, ..LawScan::of(capture) };
            if !law.is_of_rig || !(law.applies)(&scan) {
                return Ok(None);
            }
            Ok(Some((law.undone(capture, &scan, &of.numbers), (law.what)(&scan, &of.numbers))))
        }
    }
}

/// The capture without the corrections of a file, and these.
fn given(
    file: &Path,
    corrections: Vec<Correction>,
    capture: &Capture,
) -> Result<(Capture, FoundCalibration)> {
    let mut found = FoundCalibration { file: Some(file.into()), ..FoundCalibration::default() };
    let mut capture = capture.clone();
    for correction in corrections {
        match undone(&correction, &capture, file)? {
            Some((without, what)) => {
                capture = without;
                found.corrections.push(correction);
                found.what.push(what);
            }
            None => found.left_out.push(correction.law),
        }
    }
    found.given = found.corrections.len();
    Ok((capture, found))
}

/// Undoes what the file that is set holds, and has held-out pairs judge it.
///
/// # Errors
/// A file that cannot be read, or that does not suit the scan; the device fails, or `hear` cancels.
pub fn calibrate<'c>(
    job: Job<'c>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Job<'c>> {
    let clock = Instant::now();
    let Some(set @ Calibrate::File(file)) = &job.settings.calibrate else { return Ok(job) };
    let (capture, mut found) = given(file, set.corrections()?, &job.capture)?;
    if matches!(job.solver, SolverOptions::Surface(_)) && job.has_light() && found.given > 0 {
        let [without, with] = [held(&job, &job.capture, gpu, hear)?, held(&job, &capture, gpu, hear)?];
        if let Some([without, with]) = without.as_ref().zip(with.as_ref()).map(|(a, b)| both(a, b)) {
            found.left = Some([&without, &with].map(|left| [left.excess(), left.standard_error()]));
            found.is_doubtful = without.is_less(&with);
        }
        found.is_doubtful |= without.is_some() && with.is_none();
    }
    if found.is_doubtful {
        (found.corrections, found.given) = (vec![], 0);
    }
    let mut job = if found.given > 0 { job.again(Cow::Owned(capture)) } else { job };
    job.estimates.seconds += clock.elapsed().as_secs_f64();
    job.estimates.calibration = Some(found);
    Ok(job)
}

/// The scan of a session without what the file that is set holds of its points and its time zero.
///
/// # Errors
/// A file that cannot be read, that does not suit the scan, or whose corrections change the counts of frames.
pub fn calibrated_scan<'c>(setting: Option<&Calibrate>, scan: &'c Capture) -> Result<Cow<'c, Capture>> {
    let Some(set @ Calibrate::File(file)) = setting else { return Ok(Cow::Borrowed(scan)) };
    let changes_counts = |of: &Correction| match KnownCorrection::of(of) {
        Some(KnownCorrection::Law(law)) => law.is_of_rig && law.of_pair.is_some() && !law.delays_all(),
        Some(KnownCorrection::Lines(_)) => true,
        None => false,
    };
    let corrections = set.corrections()?;
    if let Some(of) = corrections.iter().find(|of| changes_counts(of)) {
        return Err(Error::options(
            format!(
                "{}: {:?} changes counts, and frames of a session are used unchanged",
                file.display(),
                of.law
            ),
            "correct each frame, and set calibrate to none",
        ));
    }
    given(file, corrections, scan).map(|(capture, _)| Cow::Owned(capture))
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

    #[test]
    fn a_correction_is_about_the_wall_on_which_it_was_found() {
        let capture = capture();
        let file = Path::new("rig.json");
        let (wider, what) = undone(&correction("scale", &[0.1]), &capture, file).unwrap().unwrap();
        let given = capture.laser[0];
        assert!(wider.laser[0].distance(dvec3(0.5 + 1.1 * (given.x - 0.5), 1.1 * given.y, 0.0)) < 1e-12);
        assert!(what.contains("1.100 times"), "{what}");
        // What is of one capture alone is left out.
        assert!(undone(&correction("moved along x", &[0.1; 4]), &capture, file).unwrap().is_none());
        assert!(undone(&correction("rows", &[0.5, 0.1]), &capture, file).unwrap().is_none());
        let lines = LineDelays { lines: Lines::Rows, delays: vec![0.02; 8] }.correction(&capture);
        let (early, _) = undone(&lines, &capture, file).unwrap().unwrap();
        assert_eq!(early.histogram(3)[..4], [2.0, 3.0, 4.0, 5.0]);
        for (of, what) in [
            (correction("shear", &[0.1; 2]), "no law \"shear\" of 2 numbers"),
            (correction("delays of rows", &[0.1; 9]), "delays of 9 rows, the capture has 8 rows"),
        ] {
            let error = undone(&of, &capture, file).unwrap_err();
            assert!(error.what.contains(what) && error.what.starts_with("rig.json: "), "{error}");
        }
    }

    #[test]
    fn what_is_undone_is_a_correction_that_undoes_the_same() {
        let capture = capture();
        let scan = LawScan::of(&capture);
        for law in LAWS.iter().filter(|law| law.is_of_rig && (law.applies)(&scan)) {
            let numbers: Vec<f64> = law.steps.iter().map(|[step, _]| 0.5 * step).collect();
            let correction = law.correction(&numbers, scan.frame);
            let (again, _) = undone(&correction, &capture, Path::new("rig.json")).unwrap().unwrap();
            assert_eq!(again, law.undone(&capture, &scan, &numbers), "{law:?}");
        }
    }
}
