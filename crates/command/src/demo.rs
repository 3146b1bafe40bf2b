//! The whole process on a built-in scene: simulate, reconstruct, measure, draw.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::overview;
use thirdbounce::engine::Progress;
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::job::{Outcome, Request, load, places, run};
use thirdbounce::surface::SurfaceOptions;
use thirdbounce::{Result, capture, export};
use thirdbounce_simulate::{RenderOptions, Scene, simulate, truth};

/// The result of the demo.
#[derive(Debug)]
pub struct Demo {
    /// The reconstruction.
    pub outcome: Outcome,
    /// Seconds that the simulation took.
    pub simulate_seconds: f64,
    /// Seconds of the whole demo.
    pub seconds: f64,
    /// The picture with result and truth side by side.
    pub overview: PathBuf,
}

/// Simulates a scene, reconstructs it into `out` and writes `capture.npz`, `truth.npz` and `overview.png`
/// beside the results. `say` is called with a line before each step, `hear` as in [`run()`].
///
/// # Errors
/// A place that cannot be written, no device, or the errors of [`run()`].
pub fn demo(
    out: &Path,
    device: Option<String>,
    say: &mut dyn FnMut(&str),
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Demo> {
    let start = Instant::now();
    places::check_results(out)?;
    // A missing device is an error before anything is written. The run opens the device again.
    Gpu::open(&GpuOptions { device: device.clone(), ..GpuOptions::default() })?;
    let scene = Scene::named("figure")?;
    say("simulating a hidden figure that is scanned at 32 x 32 points of a 1 m wall");
    let rendering = simulate(&scene, &RenderOptions { noise: 0.02, ..RenderOptions::default() })?;
    let real = truth(&scene, 128)?;
    let (capture_file, truth_file) = (out.join("capture.npz"), out.join("truth.npz"));
    capture::write(&rendering.capture, &capture_file)?;
    export::npz::write_truth(&truth_file, &real)?;
    let simulate_seconds = start.elapsed().as_secs_f64();

    say("reconstructing it from the light that bounced three times");
    let mut request = Request::new(SurfaceOptions::default(), out);
    request.settings.device = device;
    request.truth = Some(truth_file);
    let loaded = load(&capture_file, &request.settings)?;
    let outcome = run(&request, &loaded, hear)?;
    let path = out.join("overview.png");
    overview::write(&path, &outcome.maps, &real)?;
    Ok(Demo { outcome, simulate_seconds, seconds: start.elapsed().as_secs_f64(), overview: path })
}
