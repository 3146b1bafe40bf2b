//! Where the time of a solve goes: every kernel against what the device can do at most, the device's idle time, the
//! host's part.
//!
//! [`profile`] solves as [`super::run`] does, with a time stamp behind every command; nothing else is different, so
//! the device's work is the same. [`limits::measure`] finds what the device does at most, [`check::check`] whether it
//! computes what the float64 twins do.

pub mod check;
mod kernels;
pub mod limits;
mod trace;
pub mod tune;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::report::settings;
use super::words::{plain, write_json};
use super::{Loaded, Request, places, reconstruct};
use crate::export::{self, report};
use crate::gpu::{Gpu, HostSpan, Recording};
use crate::solve::{Plan, Progress};
use crate::transport::Grid;
use crate::{Error, Result};

pub use kernels::{Floor, Gaps, IterationProfile, KernelProfile};
pub use limits::DeviceLimits;

/// What to profile, and where that is written. [`Request::out`] is not looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct ProfileRequest {
    /// What to solve.
    pub request: Request,
    /// File for the whole profile.
    pub json: Option<PathBuf>,
    /// File for the timeline, for Perfetto and chrome://tracing.
    pub trace: Option<PathBuf>,
    /// Folder for the maps; without one they are not written.
    pub out: Option<PathBuf>,
}

/// Everything that a profile tells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// Version of this program.
    pub version: String,
    /// The device.
    pub device: report::Device,
    /// All settings as they were resolved.
    pub settings: serde_json::Value,
    /// What the device can do at most.
    pub limits: DeviceLimits,
    /// The longest first.
    pub kernels: Vec<KernelProfile>,
    /// What an iteration costs.
    pub iterations: IterationProfile,
    /// The device's idle time.
    pub gaps: Gaps,
    /// What the host did while solving, the calls and seconds of each; what lies inside another counts in both.
    pub host: BTreeMap<String, HostTime>,
    /// Sums over the run.
    pub totals: Totals,
    /// What the validation layer said, if it was asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub validation: Vec<String>,
}

/// A kind of work on the host.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct HostTime {
    /// How often it was done.
    pub calls: u64,
    /// Seconds in all.
    pub seconds: f64,
}

/// Sums over a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Totals {
    /// Seconds of loading the capture.
    pub load_s: f64,
    /// Plan, memory, kernels, uploads.
    pub prepare_s: f64,
    /// On the host's clock, from the first iteration's submission to the maps.
    pub solve_s: f64,
    /// Of all kernels, copies and fills of the solver.
    pub device_s: f64,
    /// Seconds of writing results.
    pub export_s: f64,
    /// Active voxels times laser-sensor pairs, summed over iterations; forward and backward count once.
    pub pairs: f64,
    /// Pair evaluations per second of solving.
    pub pairs_per_s: f64,
    /// The most device memory that was taken, bytes.
    pub peak_device_bytes: u64,
}

/// Solves and tells where the time went; writes the files that the request names. `say` is told what comes next,
/// `hear` of the solver's progress, and may break off.
///
/// # Errors
/// As [`super::run`]; a device without time stamps.
pub fn profile(
    what: &ProfileRequest,
    loaded: &Loaded,
    say: &mut dyn FnMut(&str),
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Profile> {
    let request = Request { timings: true, ..what.request.clone() };
    request.solver.check()?;
    for file in [&what.json, &what.trace].into_iter().flatten() {
        places::check_file(file)?;
    }
    what.out.as_deref().map(places::check_results).transpose()?;
    let grid = request.grid(&loaded.capture)?;
    let gpu = request.open()?;
    check_clock(&gpu)?;
    say(&format!("measuring what {} does at most", gpu.info.name));
    let limits = limits::measure(&gpu)?;
    // Its trials are no part of the profile.
    let (capture, found) = super::find_pulse::settle(&request, &loaded.capture, &gpu, None, hear)?;
    let with_pulse = match capture {
        Cow::Owned(capture) => Some(Loaded { capture, ..loaded.clone() }),
        Cow::Borrowed(_) => None,
    };
    let loaded = with_pulse.as_ref().unwrap_or(loaded);
    let request = Request { find_pulse: false, ..request };
    reconstruct::warm_up(&request, loaded, &gpu, grid)?;
    gpu.take_recording();

    say("solving, with a time stamp behind every command");
    let began = gpu.now();
    let done = reconstruct::Finished {
        pulse: found,
        ..reconstruct::solve(&request, loaded, &gpu, grid, None, hear)?
    };
    let result = &done.result;
    let start = Instant::now();
    if let Some(out) = &what.out {
        let _span = gpu.span("export");
        export::write_maps(out, &result.maps)?;
    }
    let export_s = start.elapsed().as_secs_f64();

    let mut recording = gpu.take_recording();
    let prepare_s = complete(&mut recording, began, loaded.seconds);
    let voxels = voxels_of(&result.plan, request.solver.common().min_depth);
    let kernels = kernels::times(&recording, &result.trace, &voxels, &limits);
    let profile = Profile {
        version: env!("CARGO_PKG_VERSION").into(),
        device: device_of(&gpu),
        settings: settings(&request, loaded, &grid, &done),
        limits,
        iterations: kernels::iterations(&recording),
        gaps: kernels::gaps(&recording),
        host: host_times(&recording),
        totals: Totals {
            load_s: loaded.seconds,
            prepare_s,
            solve_s: result.solve_seconds,
            device_s: kernels.iter().map(|k| k.seconds).sum(),
            export_s,
            pairs: result.pairs as f64,
            pairs_per_s: result.pairs as f64 / result.solve_seconds.max(1e-9),
            peak_device_bytes: result.device_bytes,
        },
        kernels,
        validation: gpu.validation_messages(),
    };
    if let Some(file) = &what.trace {
        write_json(file, &trace::events(&recording, &gpu.info.name), false)?;
    }
    if let Some(file) = &what.json {
        write_json(file, &profile, true)?;
    }
    Ok(profile)
}

/// Voxels that are not too near, by the lateral resolution of a level.
fn voxels_of(plan: &Plan, min_depth: f64) -> BTreeMap<u64, usize> {
    let far = |g: &Grid| {
        let layers = ((min_depth - g.origin.z) / g.pitch.z - 1e-6).ceil().max(0.0);
        g.n[0] * g.n[1] * g.n[2].saturating_sub(layers as usize)
    };
    let levels = plan.levels.iter().chain(&plan.pixel_levels);
    levels.map(|l| (l.grid.n[0] as u64, far(&l.grid))).collect()
}

fn check_clock(gpu: &Gpu) -> Result<()> {
    if gpu.has_clock() {
        return Ok(());
    }
    Err(Error::device(
        format!("{} has no time stamps", gpu.info.name),
        "its kernels cannot be timed one by one: choose another device with --device",
    ))
}

/// The device as reports name it.
pub fn device_of(gpu: &Gpu) -> report::Device {
    let (name, driver) = (gpu.info.name.clone(), gpu.info.driver.clone());
    report::Device { name, driver, kind: plain(&gpu.info.kind) }
}

/// Adds the spans that nobody recorded: loading, which was before the device was opened, and planning, which is from
/// the solve's beginning to its first memory. Yields the seconds until the first iteration was recorded.
fn complete(recording: &mut Recording, began: f64, load_seconds: f64) -> f64 {
    let after =
        |what: &str| recording.host.iter().find(|s| s.what == what && s.from >= began).map(|s| s.from);
    let planned = after("allocate").unwrap_or(began);
    let ready = recording.host.iter().filter(|s| s.what == "upload").map(|s| s.to).fold(planned, f64::max);
    recording.host.push(HostSpan { what: "plan", from: began, to: planned });
    let opened = recording.host.iter().map(|s| s.from).fold(0.0, f64::min);
    recording.host.push(HostSpan { what: "load", from: opened - load_seconds, to: opened });
    recording.host.sort_by(|a, b| a.from.total_cmp(&b.from).then(b.to.total_cmp(&a.to)));
    ready - began
}

fn host_times(recording: &Recording) -> BTreeMap<String, HostTime> {
    let mut all: BTreeMap<String, HostTime> = BTreeMap::new();
    for span in &recording.host {
        let time = all.entry(span.what.into()).or_default();
        time.calls += 1;
        time.seconds += span.to - span.from;
    }
    all
}
