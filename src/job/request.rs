//! A whole run: settings, and the files that it reads and writes.

use std::borrow::Cow;
use std::path::PathBuf;

use super::places;
use crate::capture::Capture;
use crate::gpu::{Faults, Gpu, GpuOptions};
use crate::judge::Job;
use crate::maps::Truth;
use crate::settings::Settings;
use crate::{Result, export};

/// The reconstruction of a capture, and the places of its results. The capture is given separately.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Request {
    /// The settings of the reconstruction.
    pub settings: Settings,
    /// Folder of the results.
    pub out: PathBuf,
    /// File for the volume, .npz or .hdf5.
    pub volume_file: Option<PathBuf>,
    /// File for what is known of every pixel, .npz, for training (`learn/README.md`).
    pub layers_file: Option<PathBuf>,
    /// Truth to measure the result against.
    pub truth: Option<PathBuf>,
    /// Add a point to the trace after every Nth iteration, with the figures if there is truth. 0: figures only at the
    /// end. `None`: 10 with truth, 0 without. Measuring does not count as solving.
    pub trace_every: Option<usize>,
    /// Show `preview.png` in the folder of the results while the solve runs.
    pub preview: bool,
    /// Time every kernel, and record the work of host and device.
    pub timings: bool,
    /// Folder in which compiled kernels are kept between runs, see [`usual_pipeline_cache`].
    pub pipeline_cache: Option<PathBuf>,
    /// Turn on the Vulkan validation layer.
    pub validation: bool,
    /// Faults to cause on the device; for tests.
    pub faults: Faults,
}

impl Request {
    /// A request with these settings, and the defaults for the rest.
    pub fn new(settings: impl Into<Settings>, out: impl Into<PathBuf>) -> Request {
        Request { settings: settings.into(), out: out.into(), ..Request::default() }
    }

    /// The solver with its options for a capture, before estimates.
    pub fn job<'c>(&self, capture: &'c Capture) -> Job<'c> {
        Job::of(&self.settings, Cow::Borrowed(capture))
    }

    pub fn open(&self) -> Result<Gpu> {
        Gpu::open(&self.gpu_options())
    }

    pub fn gpu_options(&self) -> GpuOptions {
        GpuOptions {
            device: self.settings.device.clone(),
            pipeline_cache: self.pipeline_cache.clone(),
            validation: self.validation,
            timings: self.timings,
            faults: self.faults,
            ..GpuOptions::default()
        }
    }

    /// Checks everything but places that can be checked before the work begins. Returns the truth, if its file is given.
    pub fn check(&self) -> Result<Option<Truth>> {
        self.settings.check()?;
        self.truth.as_deref().map(export::npz::read_truth).transpose()
    }

    /// Checks that the results can be written.
    pub fn check_places(&self) -> Result<()> {
        places::check_results(&self.out)?;
        self.volume_file.as_deref().map_or(Ok(()), places::check_volume)
    }

    /// Iterations between measured points of the trace; 0 measures only the end.
    pub fn trace_step(&self) -> usize {
        self.trace_every.unwrap_or(if self.truth.is_some() { 10 } else { 0 })
    }
}

/// The folder in which the command keeps compiled kernels; `None` if no cache folder is known.
pub fn usual_pipeline_cache() -> Option<PathBuf> {
    let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let folder = absolute("XDG_CACHE_HOME").or_else(|| absolute("HOME").map(|home| home.join(".cache")))?;
    Some(folder.join("thirdbounce/kernels"))
}
