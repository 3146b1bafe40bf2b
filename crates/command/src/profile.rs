//! Where the time of a solve goes: every kernel compared with the device's limits, the device's idle time, and the
//! host's work.
//!
//! [`profile`] solves as [`thirdbounce::job::run`] does, with a time stamp after every command. Nothing else is different, so the
//! device's work is the same. [`limits::measure`] measures the device's limits. [`check::check`] compares the device's
//! results with the float64 reference.

pub mod check;
pub mod compile;
mod kernels;
pub mod limits;
mod on_host;
mod trace;
mod work;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

use serde::{Deserialize, Serialize};

pub use compile::device_of;

use crate::json::write_json;
use thirdbounce::engine::{Plan, Progress};
use thirdbounce::export::report;
use thirdbounce::gpu::{Gpu, HostSpan, Recording};
use thirdbounce::job::report::settings;
use thirdbounce::job::{Loaded, Request, places, reconstruct};
use thirdbounce::transport::Grid;
use thirdbounce::{Error, Result, export, solve};

pub use kernels::{Gaps, IterationProfile, KernelProfile};
pub use limits::DeviceLimits;
pub use work::Limit;

/// What to profile, and the files to write. [`Request::out`] is ignored.
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

/// The whole profile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// Version of this program.
    pub version: String,
    /// The device.
    pub device: report::Device,
    /// All settings as they were resolved.
    pub settings: serde_json::Value,
    /// The device's limits.
    pub limits: DeviceLimits,
    /// All kernels, the longest first.
    pub kernels: Vec<KernelProfile>,
    /// The time of an iteration.
    pub iterations: IterationProfile,
    /// The device's idle time.
    pub gaps: Gaps,
    /// Calls and seconds of each kind of work on the host while solving. Work inside other work counts in both.
    pub host: BTreeMap<String, HostTime>,
    /// Sums over the run.
    pub totals: ProfileTotals,
    /// Messages of the validation layer, if it was on.
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
pub struct ProfileTotals {
    /// Seconds of loading the capture.
    pub load_s: f64,
    /// Seconds of preparing: plan, memory, kernels, uploads.
    pub prepare_s: f64,
    /// Seconds of solving by the host's clock, from the first iteration's submission to the maps.
    pub solve_s: f64,
    /// Device seconds of all kernels, copies and fills of the solver.
    pub device_s: f64,
    /// Seconds of writing results.
    pub export_s: f64,
    /// Active voxels times laser-sensor pairs, summed over iterations; forward and backward count once.
    pub pairs: f64,
    /// Pair evaluations per second of solving.
    pub pairs_per_s: f64,
    /// The most device memory in use at once, bytes.
    pub peak_device_bytes: u64,
}

/// Solves, measures where the time goes, and writes the files that the request names. `say` is called with a line
/// before each step. `hear` is called with the solver's progress and may cancel.
///
/// # Errors
/// Those of [`thirdbounce::job::run`], and a device without time stamps.
pub fn profile(
    what: &ProfileRequest,
    loaded: &Loaded,
    say: &mut dyn FnMut(&str),
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Profile> {
    let request = Request { timings: true, ..what.request.clone() };
    request.settings.check()?;
    for file in [&what.json, &what.trace].into_iter().flatten() {
        places::check_file(file)?;
    }
    what.out.as_deref().map(places::check_results).transpose()?;
    let job = request.job(&loaded.capture);
    job.grid()?;
    let gpu = request.open()?;
    check_clock(&gpu)?;
    say(&format!("measuring the limits of {}", gpu.info.name));
    let limits = limits::measure(&gpu)?;
    // The fits of estimates are no part of the profile.
    let job = solve::resolve(&gpu, job, hear)?;
    let (estimates, pulse) = (job.estimates.clone(), job.capture.pulse.clone());
    let request = Request { settings: job.settled(), ..request };
    let with_pulse = estimates.pulse.is_some().then(|| {
        let capture = loaded.capture.clone().with(|c| c.pulse = pulse);
        Loaded { capture, ..loaded.clone() }
    });
    let loaded = with_pulse.as_ref().unwrap_or(loaded);
    reconstruct::warm_up(&request, loaded, &gpu)?;
    gpu.take_recording();

    say("solving, with a time stamp after every command");
    let began = gpu.now();
    let mut done =
        reconstruct::solve(&request, (request.job(&loaded.capture), loaded), &gpu, None, None, hear)?;
    done.job.estimates = estimates;
    let result = &done.result;
    let start = Instant::now();
    if let Some(out) = &what.out {
        let _span = gpu.span("export");
        export::write_maps(out, &result.maps)?;
    }
    let export_s = start.elapsed().as_secs_f64();

    let mut recording = gpu.take_recording();
    let prepare_s = complete(&mut recording, began, loaded.seconds);
    let voxels = voxels_of(&result.plan, done.job.solver.common().min_depth);
    let kernels = kernels::times(
        &recording,
        &work::works_of(&result.plan, gpu.is_host()),
        &result.trace,
        &voxels,
        &limits,
    );
    let profile = Profile {
        version: env!("CARGO_PKG_VERSION").into(),
        device: device_of(&gpu),
        settings: settings(&request, loaded, &done),
        limits,
        iterations: kernels::iterations(&recording),
        gaps: kernels::gaps(&recording),
        host: host_times(&recording),
        totals: ProfileTotals {
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

/// Voxels beyond the least depth, by the lateral resolution of a level.
fn voxels_of(plan: &Plan, min_depth: f64) -> BTreeMap<u64, usize> {
    let far = |g: &Grid| {
        let layers = ((min_depth - g.origin.z) / g.pitch.z - 1e-6).ceil().max(0.0);
        g.n[0] * g.n[1] * g.n[2].saturating_sub(layers as usize)
    };
    plan.levels.volume.iter().map(|l| (l.grid.n[0] as u64, far(&l.grid))).collect()
}

fn check_clock(gpu: &Gpu) -> Result<()> {
    if gpu.has_clock() {
        return Ok(());
    }
    Err(Error::device(
        format!("{} has no time stamps", gpu.info.name),
        "choose another device: without time stamps, kernels cannot be timed one by one",
    ))
}

/// Adds the spans that were not recorded: loading, before the device was opened, and planning, from the start of the
/// solve to its first allocation. Returns the seconds until the first iteration was recorded.
fn complete(recording: &mut Recording, began: f64, load_seconds: f64) -> f64 {
    let after =
        |what: &str| recording.host.iter().find(|s| s.what == what && s.from >= began).map(|s| s.from);
    let planned = after("allocate").unwrap_or(began);
    // Later uploads are part of the solve.
    let first =
        recording.device.iter().filter(|r| r.stage.is_some()).map(|r| r.from).fold(f64::INFINITY, f64::min);
    let uploads = recording.host.iter().filter(|s| s.what == "upload" && s.to <= first);
    let ready = uploads.map(|s| s.to).fold(planned, f64::max);
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
