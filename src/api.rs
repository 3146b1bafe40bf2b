//! A capture to maps in one call, and sessions for frames of one scan.

use std::borrow::Cow;
use std::ops::ControlFlow;

use crate::capture::{Capture, conditioning};
use crate::engine::{Bins, Progress, Reconstruction, Watch};
use crate::gpu::Gpu;
use crate::judge::{Job, calibrated_scan};
#[cfg(feature = "formats")]
use crate::maps::{Maps, Truth};
#[cfg(feature = "formats")]
use crate::measure::Metrics;
use crate::session::{Session, SessionOptions};
use crate::settings::{Calibrate, DevicePosition, Settings};
use crate::{Result, solve};

/// Reconstructs a capture that [`read`] or [`prepare`] has made ready.
///
/// # Errors
/// `Kind::Options` and `Kind::Input`: settings that are out of range or do not fit the capture. `Kind::Memory`: more than there
/// is. `Kind::Device`: the device fails.
pub fn reconstruct(gpu: &Gpu, capture: &Capture, settings: &Settings) -> Result<Reconstruction> {
    reconstruct_with(gpu, capture, settings, &mut |_| ControlFlow::Continue(()))
}

/// As [`reconstruct`], and calls `on_progress` with the progress of estimates and solve. `Break` cancels: `Kind::Cancelled`.
///
/// # Errors
/// As [`reconstruct`].
pub fn reconstruct_with(
    gpu: &Gpu,
    capture: &Capture,
    settings: &Settings,
    on_progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Reconstruction> {
    capture.check()?;
    let capture = settings.with_instrument(capture)?;
    let job = Job { warnings: capture.warnings(), ..Job::of(settings, Cow::Borrowed(&capture)) };
    let mut watch = Watch::of(on_progress);
    let (job, mut result) = solve::solve(gpu, job, &mut watch)?;
    result.notes = job.estimates.notes();
    Ok(result)
}

/// A session for frames of the scan of `frame`: planned, compiled and allocated once. Where `frame` has counts, they give the
/// estimates of [`reconstruct`] for all frames. Returns the estimates as sentences, too.
///
/// # Errors
/// Settings, scan, memory or device do not allow the solve.
pub fn session(
    gpu: &Gpu,
    frame: &Capture,
    settings: &Settings,
    options: SessionOptions,
) -> Result<(Session, Vec<String>)> {
    session_with(gpu, frame, settings, options, &mut |_| ControlFlow::Continue(()))
}

/// As [`session`], and calls `on_progress` with the progress of the fits of estimates. `Break` cancels: `Kind::Cancelled`.
///
/// # Errors
/// As [`session`].
pub fn session_with(
    gpu: &Gpu,
    frame: &Capture,
    settings: &Settings,
    options: SessionOptions,
    on_progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<(Session, Vec<String>)> {
    frame.check_scan()?;
    options.check_moving(frame)?;
    if !frame.histograms.is_empty() {
        frame.check_counts(&frame.histograms)?;
    }
    let warning = conditioning::check_units(frame)?;
    let mut settings = settings.clone();
    settings.bins = options.sum.map(Bins::Sum).or(settings.bins);
    let frame = &*calibrated_scan(settings.calibrate.as_ref(), frame)?;
    // Frames are used unchanged.
    settings.calibrate = Some(Calibrate::None);
    settings.memory = options.memory.or(settings.memory);
    settings.mask_fraction = options.mask_fraction.or(settings.mask_fraction);
    let frame = settings.for_frames(frame)?;
    let unused = (frame.devices != [None; 2] && settings.device_at.is_none()).then(|| {
        "the capture names a device near the wall; frames of a session are used unchanged: divide them if its light weakens with distance"
            .to_owned()
    });
    settings.device_at = Some(DevicePosition::None);
    let job = solve::resolve(gpu, Job::of(&settings, Cow::Borrowed(&frame)), on_progress)?;
    let notes = job.estimates.notes().into_iter().chain(warning).chain(unused).collect();
    Ok((Session::of(gpu, &frame, &job, options)?, notes))
}

/// Reads a capture in any known format and prepares it: see [`prepare`].
///
/// # Errors
/// `Kind::Input`, beginning with the path: a file that is missing, damaged or of no known format. `Kind::Options` if the file
/// lacks a value, such as the size of the wall. `Kind::Memory` if the counts do not fit.
#[cfg(feature = "formats")]
pub fn read(path: impl AsRef<std::path::Path>, settings: &Settings) -> Result<Capture> {
    Ok(crate::job::load(path.as_ref(), settings)?.capture)
}

/// Prepares a capture that a program holds, by the group `Capture` of the settings: pairs that were not measured are left out,
/// pile-up is corrected, normals of a curved wall are estimated, and direct light is gated away.
///
/// # Errors
/// Those of [`Capture::check`].
#[cfg(feature = "formats")]
pub fn prepare(capture: Capture, settings: &Settings) -> Result<Capture> {
    Ok(crate::job::take(capture, settings)?.capture)
}

/// Writes maps into a folder, which is made if it is missing: npz, EXR, pictures, points and a mesh. Returns the files.
///
/// # Errors
/// `Kind::Output` if a file cannot be written.
#[cfg(feature = "formats")]
pub fn write(folder: impl AsRef<std::path::Path>, maps: &Maps) -> Result<Vec<std::path::PathBuf>> {
    crate::export::write_maps(folder.as_ref(), maps)
}

/// A result in a folder.
#[cfg(feature = "formats")]
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Written {
    /// Albedo, depth, normals, mask and depth error by pixel.
    pub maps: Maps,
    /// Figures against the truth, if there is one.
    pub metrics: Option<Metrics>,
    /// Estimates and what was done to the capture, as sentences.
    pub notes: Vec<String>,
    /// The verdict on the result.
    pub verdict: crate::Verdict,
    /// What looks wrong with the capture or the result, as sentences.
    pub warnings: Vec<String>,
    /// The files: those of [`write()`], `report.html` and `report.json`.
    pub files: Vec<std::path::PathBuf>,
}

/// Reads a capture, reconstructs it as [`reconstruct_with`] does, and writes all files of `thirdbounce reconstruct` into `folder`,
/// with the page and the report. With a file of `truth`, both have its figures. Files appear together, after the solve.
///
/// # Errors
/// Those of [`read`], [`reconstruct_with`] and [`write()`]; `Kind::Input`: a truth that cannot be read.
#[cfg(feature = "formats")]
pub fn reconstruct_file(
    gpu: &Gpu,
    capture: impl AsRef<std::path::Path>,
    settings: &Settings,
    truth: Option<&std::path::Path>,
    folder: impl AsRef<std::path::Path>,
    on_progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Written> {
    use crate::job;
    use crate::job::Request;
    let truth = truth.map(std::path::Path::to_path_buf);
    let request = Request { truth, ..Request::new(settings.clone(), folder.as_ref()) };
    job::check_results(&request.out)?;
    let loaded = job::load(capture.as_ref(), settings)?;
    let done = job::solve(&request, &loaded, gpu, on_progress)?.write(&request)?;
    Ok(Written {
        maps: done.maps,
        metrics: done.report.metrics,
        notes: [&loaded.notes[..], &done.notes].concat(),
        verdict: done.verdict,
        warnings: done.warnings,
        files: done.files,
    })
}

/// Measures maps against truth by their own mask, or by the share `mask_fraction` of the brightest albedo.
///
/// # Errors
/// `Kind::Input`: the truth covers another part of the wall. `Kind::Options`: a fraction outside 0 to 1.
#[cfg(feature = "formats")]
pub fn evaluate(maps: &Maps, truth: &Truth, mask_fraction: Option<f64>) -> Result<Metrics> {
    crate::job::evaluate_maps(&mut maps.clone(), truth, mask_fraction)
}

/// Reads truth that `thirdbounce simulate --truth` wrote.
///
/// # Errors
/// `Kind::Input`: a file that is missing, damaged, or no truth.
#[cfg(feature = "formats")]
pub fn read_truth(path: impl AsRef<std::path::Path>) -> Result<Truth> {
    crate::export::npz::read_truth(path.as_ref())
}
