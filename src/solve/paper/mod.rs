//! The solver of "Domain Reduction Strategy for Non-Line-of-Sight Imaging" (ECCV 2024).

use super::checkpoint::Keeper;
use super::drive::{Beside, Driven, Steps, TracePoint, drive};
use super::job::{Job, read_volume};
use super::{Plan, domain, iteration};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::{Gpu, KernelTime, Schedule};
use crate::maps::Maps;
use crate::transport::kernels::{TRACE_LEAST, TRACE_ROW};
use crate::transport::{Grid, Model};

mod options;

pub use options::{Decay, NoiseTerm, PaperOptions, Preset};

/// Volume of a finished solve.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeMap {
    pub grid: Grid,
    /// Albedo, `[(ix * ny + iy) * nz + iz]`, 0 where inactive.
    pub albedo: Vec<f32>,
}

/// What a solve yields.
#[derive(Debug, Clone)]
pub struct Reconstruction {
    pub maps: Maps,
    pub volume: Option<VolumeMap>,
    pub trace: Vec<TracePoint>,
    /// The data loss of an empty volume: the mean over the bins of the squared measurement, as the solver takes it.
    pub empty_loss: f64,
    pub plan: Plan,
    /// Pair evaluations, forward and backward together counted once.
    pub pairs: u64,
    pub solve_seconds: f64,
    pub device_bytes: u64,
    /// The domain was larger than there is room for at some time: its dimmest voxels were left out.
    pub full: bool,
    /// Lateral voxels of the volume that was reached.
    pub lateral: usize,
    /// Iterations of the volume that were done; those behind them in the trace are the surface's.
    pub volume_iterations: usize,
    /// The surface explained the data far worse than the volume: the maps are the volume's.
    pub surface_left: bool,
    /// Per kernel, if the device was opened with timings.
    pub kernels: Vec<(&'static str, KernelTime)>,
}

/// The model that `options` make of a capture for `grid`.
pub fn model(capture: &Capture, grid: &Grid, options: &PaperOptions) -> Model {
    let noise =
        if options.noise == NoiseTerm::Off { [0.0; 2] } else { [options.noise_base, options.noise_span] };
    let mut model = Model {
        min_depth: options.min_depth,
        sampling: options.sampling,
        binning: options.binning,
        gradient: options.gradient,
        l1: options.l1,
        noise,
        learning_rate: options.learning_rate,
        decay_over: if options.learning_rate_decay == Decay::Cosine {
            options.iterations as f64
        } else {
            0.0
        },
        betas: [options.beta1, options.beta2],
        epsilon: options.epsilon,
        keep_above: options.keep_above,
        seed: options.seed,
        ..Model::new(capture, options.reflectance, options.peak, options.general)
    };
    if !options.general {
        model.trim(grid);
    }
    model
}

/// Runs the solver; `beside` is a [`Watch`](super::Watch), or one and a state that is kept on the way or gone on from.
///
/// Errors: bad options, a capture that does not fit the solver, memory, device; [`crate::Kind::Cancelled`] if the
/// watch broke off; a loss that is not finite; what keeping a state yields; a state of another capture, other options or
/// another plan.
pub fn reconstruct<'b, 'w: 'b>(
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    options: &PaperOptions,
    memory: Option<u64>,
    with_volume: bool,
    beside: impl Into<Beside<'b, 'w>>,
) -> Result<Reconstruction> {
    let Beside { watch, keep } = beside.into();
    options.check()?;
    capture.check()?;
    let model = model(capture, &grid, options);
    let plan = Plan::new(&model, grid, capture.resolution(), options, &gpu.abilities(), with_volume)?;
    let mut job = Job::new(gpu, model, plan, memory)?;
    let levels = job.plan.levels.clone();
    let steps = Steps {
        levels: &levels,
        start: domain::initialise(&job.plan, &job.plan.levels[0]),
        iteration: &|plan, level, i| iteration(plan, level, i as u32, (i % options.restart_every) as u32 + 1),
        due: &|plan, level, done| domain::due(plan, options, level, done),
        extract: &domain::extract,
        l1_weight: &|level| options.l1 / level.grid.voxels() as f64,
        of: options.iterations,
        stop_below: None,
    };
    let keeper = Keeper::new(keep, &job, options)?;
    let driven = drive(gpu, &mut job, options.iterations, steps, watch, keeper, None)?;
    finish(job, driven, with_volume)
}

/// What a solve yields, from what its driver left.
pub(super) fn finish(mut job: Job<'_>, driven: Driven, with_volume: bool) -> Result<Reconstruction> {
    let volume = if with_volume {
        let storage = driven.level.grid.storage() as u64;
        let mut s = Schedule::default();
        s.copy("raw", "raw_host", job.plan.capacity as u64 * 16);
        s.copy("mask", "mask_host", storage / 8);
        job.executor.run(&s)?;
        Some(read_volume(&job.executor.arena, &driven.level.grid, job.plan.vectors))
    } else {
        None
    };
    let rows: &[[u32; TRACE_ROW as usize]] = bytemuck::cast_slice(job.executor.arena.mapped("trace"));
    let done = driven.trace.last().map_or(0, |p| p.iteration);
    let full = rows[..done].iter().any(|r| r[TRACE_LEAST as usize] != 0);
    Ok(Reconstruction {
        maps: driven.maps,
        volume,
        trace: driven.trace,
        empty_loss: empty_loss(&job.model),
        pairs: driven.pairs,
        solve_seconds: driven.seconds,
        device_bytes: job.executor.arena.bytes(),
        full,
        surface_left: false,
        lateral: driven.level.grid.n[0],
        volume_iterations: done,
        kernels: job.executor.times().iter().map(|(n, t)| (*n, *t)).collect(),
        plan: job.plan,
    })
}

fn empty_loss(model: &Model) -> f64 {
    model.measured.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / model.elements as f64
}
