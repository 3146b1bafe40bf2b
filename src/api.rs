//! A capture to maps in one call, and sessions for frames of one scan.

use std::ops::ControlFlow;

use crate::Result;
use crate::capture::{Capture, conditioning};
use crate::gpu::Gpu;
use crate::maps::Maps;
use crate::resolve::Job;
use crate::session::{Session, SessionOptions};
use crate::settings::Settings;
use crate::solve::{Bins, Progress, TracePoint, VolumeMap, Watch};

/// A reconstructed scene.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Solved {
    /// Albedo, depth, normals, mask and depth error by pixel.
    pub maps: Maps,
    /// The volume, with [`Settings::keep_volume`].
    pub volume: Option<VolumeMap>,
    /// Estimates, as sentences.
    pub notes: Vec<String>,
    /// What looks wrong with the capture or the result, as sentences.
    pub warnings: Vec<String>,
    /// A point for each iteration of the solve.
    pub trace: Vec<TracePoint>,
    /// Seconds of estimates and solve.
    pub seconds: f64,
}

/// Reconstructs a capture that [`read`] or [`prepare`] has made ready.
///
/// # Errors
/// `Kind::Options` and `Kind::Input`: settings that are out of range or do not fit the capture. `Kind::Memory`: more than there
/// is. `Kind::Device`: the device fails.
pub fn reconstruct(gpu: &Gpu, capture: &Capture, settings: &Settings) -> Result<Solved> {
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
) -> Result<Solved> {
    capture.check()?;
    let capture = settings.with_instrument(capture)?;
    let job = Job::resolve(settings, &capture, gpu, on_progress)?;
    let mut watch = Watch { hear: on_progress, maps_every: None, maps_at: &[] };
    let mut result = job.solve(gpu, &mut watch)?;
    job.conclude(&mut result, &mut []);
    Ok(Solved {
        maps: result.maps,
        volume: result.volume,
        notes: job.estimates.notes(),
        warnings: [capture.warnings(), result.warnings].concat(),
        trace: result.trace,
        seconds: result.solve_seconds,
    })
}

/// A session for frames of the scan of `frame`: planned, compiled and allocated once. Where `frame` has counts, they give the
/// estimates of [`reconstruct`] for all frames; `on_progress` is called with the progress of their fits and may cancel. Returns
/// the estimates as sentences, too.
///
/// # Errors
/// Settings, scan, memory or device do not allow the solve.
pub fn session(
    gpu: &Gpu,
    frame: &Capture,
    settings: &Settings,
    options: SessionOptions,
    on_progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<(Session, Vec<String>)> {
    frame.check_scan()?;
    if !frame.histograms.is_empty() {
        frame.check_counts(&frame.histograms)?;
    }
    let warning = conditioning::check_units(frame)?;
    let mut settings = settings.clone();
    settings.bins = options.sum.map(Bins::Sum).or(settings.bins);
    settings.memory = options.memory.or(settings.memory);
    settings.mask_fraction = options.mask_fraction.or(settings.mask_fraction);
    let frame = settings.for_frames(frame)?;
    let job = Job::resolve(&settings, &frame, gpu, on_progress)?;
    let notes = job.estimates.notes().into_iter().chain(warning).collect();
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
