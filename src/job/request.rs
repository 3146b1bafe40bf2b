//! The settings of a reconstruction.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use super::{Bins, FindPulse, Resolved, SolverOptions, places};
use crate::capture::Capture;
use crate::estimation::{EstimateRequest, Estimates};
use crate::export;
use crate::gpu::{Faults, Gpu, GpuOptions};
use crate::maps::{Maps, Truth};
use crate::solve::{Discretisation, Preset, Problem, Ready, pixel_of};
use crate::transport::{Grid, Volume};
use crate::{Error, Result};

/// What to reconstruct, how, and where the results go. The capture is given separately.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// The preset that the solver's options started from; only for the report.
    pub preset: Option<Preset>,
    /// The solver with its options.
    pub solver: SolverOptions,
    /// How many of the capture's bins are one for the solver.
    pub bins: Bins,
    /// Voxel size along z in metres; `None` takes the bin width, or half of the voxel's width if that is more.
    pub depth_pitch: Option<f64>,
    /// The box to reconstruct; `None` takes the wall's extent and the depths that the gate allows.
    pub volume: Option<Volume>,
    /// Most device memory to use, in bytes.
    pub memory: Option<u64>,
    /// Index or part of the name of the device.
    pub device: Option<String>,
    /// Folder in which compiled kernels are kept between runs, see [`super::usual_pipeline_cache`].
    pub pipeline_cache: Option<PathBuf>,
    /// Turn on the Vulkan validation layer.
    pub validation: bool,
    /// Time every kernel, and record what host and device do when.
    pub timings: bool,
    /// Use the sizes that [`super::profile::tune`] found for this device and kind of scene, if there are any.
    pub tuned: bool,
    /// The solver's options for each model of reflectance that trials choose among; empty if the model is known. The
    /// first is the usual one, that of `solver`.
    pub models: Vec<SolverOptions>,
    /// Whether to find the width of the instrument's pulse first, if the capture holds no pulse.
    pub find_pulse: FindPulse,
    /// Show `preview.png` in the folder of the results while the solve runs.
    pub preview: bool,
    /// Faults to cause on the device; for tests.
    pub faults: Faults,
    /// Truth to measure the result against.
    pub truth: Option<PathBuf>,
    /// A pixel is surface above this share of the brightest albedo; `None`: the method defines the mask.
    pub mask_fraction: Option<f64>,
    /// Add a point to the trace after every Nth iteration, with the figures if there is truth. 0: figures only at the
    /// end. `None`: 10 with truth, 0 without. Measuring does not count as solving.
    pub trace_every: Option<usize>,
    /// Keep maps and pictures of these iterations, in `snapshots/000100` and so on.
    pub snapshots: Vec<usize>,
    /// Folder of the results.
    pub out: PathBuf,
    /// File for the volume, .npz or .hdf5.
    pub volume_file: Option<PathBuf>,
}

impl Request {
    /// The solve of a capture on a grid that is asked for.
    pub(super) fn problem<'c>(&self, capture: &'c Capture, grid: Grid) -> Problem<'c> {
        Problem { capture, grid, memory: self.memory, with_volume: self.volume_file.is_some() }
    }

    /// A request with the given options and the defaults for the rest.
    pub fn new(solver: impl Into<SolverOptions>, out: impl Into<PathBuf>) -> Request {
        Request {
            preset: None,
            solver: solver.into(),
            bins: Bins::Auto,
            depth_pitch: None,
            volume: None,
            memory: None,
            device: None,
            pipeline_cache: None,
            validation: false,
            timings: false,
            tuned: false,
            models: vec![],
            find_pulse: FindPulse::Never,
            preview: false,
            faults: Faults::default(),
            truth: None,
            mask_fraction: None,
            trace_every: None,
            snapshots: vec![],
            out: out.into(),
            volume_file: None,
        }
    }

    /// How finely the capture is solved.
    pub fn discretisation(&self) -> Discretisation {
        Discretisation { bins: self.bins, depth_pitch: self.depth_pitch, volume: self.volume }
    }

    /// The grid for a capture whose bins are those of the solver.
    ///
    /// # Errors
    /// Those of [`Discretisation::grid`].
    pub fn grid(&self, capture: &Capture) -> Result<Grid> {
        self.discretisation().grid(&self.solver, capture)
    }

    /// Sums the bins of a capture, whose pulse is known if it ever will be, and makes the grid for it.
    ///
    /// # Errors
    /// Those of [`Discretisation::ready`].
    pub(super) fn ready<'c>(&self, capture: Cow<'c, Capture>) -> Result<Ready<'c>> {
        self.discretisation().ready(&self.solver, capture)
    }

    /// How many bins of a capture are one for the solver. The counts do not matter.
    pub(super) fn sum(&self, capture: &Capture) -> usize {
        self.discretisation().sum(&self.solver, capture)
    }

    /// What trials are to find before the solve.
    pub(super) fn ask(&self) -> EstimateRequest<'_> {
        EstimateRequest {
            solver: &self.solver,
            models: &self.models,
            find_pulse: self.find_pulse,
            discretisation: self.discretisation(),
            memory: self.memory,
        }
    }

    /// The request and the capture with what trials found.
    ///
    /// # Errors
    /// Those of [`Estimates::settle`].
    pub(super) fn settled<'c>(
        &self,
        found: &Estimates,
        capture: &'c Capture,
    ) -> Result<(Request, Cow<'c, Capture>)> {
        let (solver, capture) = found.settle(&self.solver, &self.models, capture)?;
        Ok((Request { solver, ..self.clone() }, capture))
    }

    /// Width of a pixel of the maps, metres ([`pixel_of`]).
    pub(super) fn pixel(&self, capture: &Capture) -> f64 {
        pixel_of(capture, self.volume, self.solver.common().lateral)
    }

    pub(super) fn open(&self) -> Result<Gpu> {
        Gpu::open(&self.gpu_options())
    }

    fn gpu_options(&self) -> GpuOptions {
        GpuOptions {
            device: self.device.clone(),
            pipeline_cache: self.pipeline_cache.clone(),
            validation: self.validation,
            timings: self.timings,
            faults: self.faults,
            ..GpuOptions::default()
        }
    }

    /// Checks everything but places that can be checked before the work begins. Returns the truth, if its file is given.
    pub(super) fn check(&self) -> Result<Option<Truth>> {
        self.solver.check()?;
        Maps::check_mask_fraction(self.mask_fraction)?;
        let iterations = self.solver.all_iterations();
        if let Some(beyond) = self.snapshots.iter().find(|i| !(1..=iterations).contains(*i)) {
            return Err(Error::options(
                format!("the snapshots include iteration {beyond}"),
                format!("give iterations from 1 to the last, {iterations}"),
            ));
        }
        self.truth.as_deref().map(export::npz::read_truth).transpose()
    }

    /// Checks that the results can be written.
    pub(super) fn check_places(&self) -> Result<()> {
        places::check_results(&self.out)?;
        for iteration in &self.snapshots {
            places::check_results(&Request::snapshot_folder(&self.out, *iteration))?;
        }
        self.volume_file.as_deref().map_or(Ok(()), places::check_volume)
    }

    /// Iterations between measured points of the trace; 0 measures only the end.
    pub(super) fn trace_step(&self) -> usize {
        self.trace_every.unwrap_or(if self.truth.is_some() { 10 } else { 0 })
    }

    /// The folder below `out` for the maps after an iteration.
    pub(super) fn snapshot_folder(out: &Path, iteration: usize) -> PathBuf {
        out.join("snapshots").join(format!("{iteration:06}"))
    }
}

impl Resolved {
    /// The request for a capture whose pulse nobody gave: kept sizes, the solver's usual mask, and a search for the pulse
    /// where that is usual. The rest is that of [`Request::new`].
    pub fn request(self) -> Request {
        Request {
            preset: Some(self.preset),
            tuned: true,
            mask_fraction: self.solver.usual_mask(),
            find_pulse: self.find_pulse(),
            models: self.models,
            ..Request::new(self.solver, "")
        }
    }
}

/// Says that `sum` bins are one of `width` metres of path; `None` if none were summed.
pub(super) fn summed_note(sum: usize, width: f64) -> Option<String> {
    let text =
        format!("{sum} bins are summed into one of {:.3} mm, as pixels and pulse blur more", 1e3 * width);
    (sum > 1).then_some(text)
}

/// Reads an amount of memory: a number in MiB, or a number with K, M or G after it.
///
/// # Errors
/// Any other text.
pub fn memory_bytes(text: &str) -> Result<u64> {
    let wrong = || {
        Error::options(
            format!("the memory budget is {text:?}"),
            "give a number in MiB, or a number with K, M or G after it: 512, 512M or 2G",
        )
    };
    let trimmed = text.trim();
    let lower = trimmed.to_ascii_lowercase();
    let number = lower.trim_end_matches("ib").trim_end_matches('b');
    let (digits, unit) = match number.chars().last() {
        Some('k') => (&number[..number.len() - 1], 10),
        Some('m') => (&number[..number.len() - 1], 20),
        Some('g') => (&number[..number.len() - 1], 30),
        _ => (number, 20),
    };
    let value: f64 = digits.trim().parse().map_err(|_| wrong())?;
    let bytes = value * f64::from(1u32 << unit);
    if !(bytes.is_finite() && (1.0..9e18).contains(&bytes)) {
        return Err(wrong());
    }
    Ok(bytes as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_read_in_mebibytes_or_with_a_unit() {
        let read = |text| memory_bytes(text).ok();
        assert_eq!(read("512"), Some(512 << 20));
        assert_eq!(read("64k"), Some(64 << 10));
        assert_eq!(read("1.5 G"), Some(3 << 29));
        assert_eq!(read("2GiB"), Some(2 << 30));
        assert_eq!(read("300MB"), Some(300 << 20));
        for wrong in ["", "G", "-1", "0", "NaN", "inf", "1e300", "3T", "1,5G", "\u{e9}"] {
            assert_eq!(read(wrong), None, "{wrong:?}");
        }
    }
}
