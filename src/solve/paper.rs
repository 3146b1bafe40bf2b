//! The solver of "Domain Reduction Strategy for Non-Line-of-Sight Imaging" (ECCV 2024).

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::time::Instant;

use super::{Level, NoiseTerm, PaperOptions, Plan, domain, iteration};
use crate::capture::Capture;
use crate::gpu::{Arena, Executor, Gpu, KernelTime, Schedule, Ticket};
use crate::maps::Maps;
use crate::transport::kernels::*;
use crate::transport::{Grid, Model};
use crate::{Error, Kind, Result};

/// A point of the trace: the state after an iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePoint {
    /// Iterations done.
    pub iteration: usize,
    /// Seconds since solving began.
    pub seconds: f64,
    /// Seconds of device time among them.
    pub gpu_seconds: f64,
    pub lateral: usize,
    pub active: usize,
    /// Active voxels over voxels of the grid at that resolution.
    pub active_ratio: f64,
    /// Data term plus L1 term.
    pub loss: f64,
}

/// What a caller hears while the device works.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    pub point: TracePoint,
    pub iterations: usize,
}

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
    pub plan: Plan,
    /// Pair evaluations, forward and backward together counted once.
    pub pairs: u64,
    pub solve_seconds: f64,
    pub device_bytes: u64,
    /// Per kernel, if the device was opened with timings.
    pub kernels: Vec<(&'static str, KernelTime)>,
}

/// The model that `options` make of a confocal capture.
///
/// Errors: a capture that is not confocal.
pub fn model(capture: &Capture, options: &PaperOptions) -> Result<Model> {
    if !capture.is_confocal() {
        return Err(Error::input(
            "the paper's solver is for confocal captures, and here laser and sensor points differ",
            "give a confocal capture",
        ));
    }
    let noise =
        if options.noise == NoiseTerm::Off { [0.0; 2] } else { [options.noise_base, options.noise_span] };
    Ok(Model {
        min_depth: options.min_depth,
        sampling: options.sampling,
        binning: options.binning,
        gradient: options.gradient,
        l1: options.l1,
        noise,
        learning_rate: options.learning_rate,
        betas: [options.beta1, options.beta2],
        epsilon: options.epsilon,
        keep_above: options.keep_above,
        seed: options.seed,
        ..Model::new(capture, options.peak)
    })
}

/// A job on the device: buffers filled, kernels made, first domain listed.
pub struct Job<'g> {
    pub plan: Plan,
    pub model: Model,
    pub executor: Executor<'g>,
}

impl<'g> Job<'g> {
    /// Allocates and uploads. `memory` is a budget in bytes.
    ///
    /// Errors: those of [`Arena::new`] and of the device.
    pub fn new(gpu: &'g Gpu, model: Model, plan: Plan, memory: Option<u64>) -> Result<Job<'g>> {
        let arena = Arena::new(gpu, &plan.buffers, memory)?;
        let mut executor = Executor::new(gpu, arena)?;
        plan.add_kernels(&mut executor)?;
        let mut job = Job { plan, model, executor };
        job.upload()?;
        Ok(job)
    }

    /// Fills the buffers that hold the capture and the constants.
    pub fn upload(&mut self) -> Result<()> {
        let Job { plan, model, executor } = self;
        let wall: Vec<f32> =
            model.wall.iter().flat_map(|w| [w.x as f32, w.y as f32, w.z as f32, 0.0]).collect();
        upload(executor, "wall", bytemuck::cast_slice(&wall))?;
        upload(executor, "measured", bytemuck::cast_slice(&model.measured))?;
        let mut taps = vec![(plan.taps.len() - 1) as f32];
        taps.extend(plan.taps.iter().map(|w| *w as f32));
        upload(executor, "taps", bytemuck::cast_slice(&taps))?;
        for level in &plan.levels {
            upload(executor, level.scene, bytemuck::bytes_of(&model.scene(&level.grid)))?;
        }
        Ok(())
    }
}

/// Copies `bytes` to a device buffer through the upload buffer, in as many parts as it takes.
pub fn upload(executor: &mut Executor<'_>, buffer: &'static str, bytes: &[u8]) -> Result<()> {
    let size = executor.arena.mapped("upload").len();
    for (i, part) in bytes.chunks(size).enumerate() {
        executor.arena.mapped_mut("upload")[..part.len()].copy_from_slice(part);
        let mut s = Schedule::default();
        s.commands.push(crate::gpu::Command::Copy {
            from: "upload",
            from_offset: 0,
            to: buffer,
            to_offset: (i * size) as u64,
            bytes: part.len() as u64,
        });
        executor.run(&s)?;
    }
    Ok(())
}

/// Runs the solver. `hear` is told of every point of the trace and may break off.
///
/// Errors: bad options, a capture that does not fit the solver, memory, device; [`Kind::Cancelled`] if `hear`
/// broke off; a loss that is not finite.
pub fn reconstruct(
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    options: &PaperOptions,
    memory: Option<u64>,
    with_volume: bool,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Reconstruction> {
    options.check()?;
    let model = model(capture, options)?;
    let plan = Plan::new(&model, grid, capture.scan, options, &gpu.abilities(), with_volume)?;
    let mut job = Job::new(gpu, model, plan, memory)?;
    let mut run =
        Run { start: Instant::now(), gpu_before: job.executor.gpu_seconds(), trace: vec![], pairs: 0 };

    let mut flights: VecDeque<(Ticket, usize, usize, Level)> = VecDeque::new();
    let mut block = domain::initialise(&job.plan, &job.plan.levels[0]);
    let mut level = 0;
    let mut first = 0;
    // Known only behind: what the last block that was heard of had active. The first domain is all there is.
    let mut active = job.plan.levels[0].grid.voxels();
    for i in 0..options.iterations {
        let step = (i % options.restart_every) as u32 + 1;
        block.extend(iteration(&job.plan, &job.plan.levels[level], i as u32, step));
        let done = i + 1;
        let last = done == options.iterations;
        let here = job.plan.levels[level];
        let change =
            if last { Schedule::default() } else { domain::due(&job.plan, options, &mut level, done) };
        let changes = !change.commands.is_empty();
        block.extend(change);
        if !(last || changes || done - first >= block_length(gpu, active * job.plan.pairs)) {
            continue;
        }
        let ticket = job.executor.submit(&std::mem::take(&mut block))?;
        flights.push_back((ticket, first, done, here));
        first = done;
        // Two blocks in flight keep the device busy while the host reads behind.
        while flights.len() > if last { 0 } else { 2 } {
            let (ticket, from, to, at) = flights.pop_front().expect("not empty");
            job.executor.wait(ticket)?;
            let point = run.read(&job, from, to, &at)?;
            active = point.active;
            if hear(&Progress { point, iterations: options.iterations }).is_break() {
                return Err(Error::new(
                    Kind::Cancelled,
                    format!("cancelled after {to} iterations"),
                    "run it again",
                ));
            }
        }
    }
    let level = job.plan.levels[level];
    let mut schedule = domain::extract(&level);
    let storage = level.grid.storage() as u64;
    if with_volume {
        schedule.copy("raw", "raw_host", storage * 16);
        schedule.copy("mask", "mask_host", storage / 8);
    }
    job.executor.run(&schedule)?;
    let solve_seconds = run.start.elapsed().as_secs_f64();
    Ok(Reconstruction {
        maps: read_maps(&job.executor.arena, &level.grid),
        volume: with_volume.then(|| read_volume(&job.executor.arena, &level.grid)),
        trace: run.trace,
        pairs: run.pairs,
        solve_seconds,
        device_bytes: job.executor.arena.bytes(),
        kernels: job.executor.times().iter().map(|(n, t)| (*n, *t)).collect(),
        plan: job.plan,
    })
}

/// Iterations of a submission: about a fifth of a second of work, so that progress moves and cancelling is
/// quick, yet the device never waits for the host.
fn block_length(gpu: &Gpu, pairs_per_iteration: usize) -> usize {
    let rate = if gpu.info.kind == crate::gpu::DeviceKind::Cpu { 1e8 } else { 3e10 };
    (0.2 * rate / pairs_per_iteration.max(1) as f64).clamp(1.0, 50.0) as usize
}

struct Run {
    start: Instant,
    gpu_before: f64,
    trace: Vec<TracePoint>,
    pairs: u64,
}

impl Run {
    /// Reads rows `from..to` of the device's trace, all run at `level`.
    fn read(&mut self, job: &Job<'_>, from: usize, to: usize, level: &Level) -> Result<TracePoint> {
        let rows: &[[u32; TRACE_ROW as usize]] = bytemuck::cast_slice(job.executor.arena.mapped("trace"));
        let voxels = level.grid.voxels();
        let mut point = None;
        for (i, row) in rows.iter().enumerate().take(to).skip(from) {
            let active = row[TRACE_ACTIVE as usize] as usize;
            let data = f64::from(f32::from_bits(row[TRACE_DATA as usize]));
            let l1 = f64::from(f32::from_bits(row[TRACE_L1 as usize]));
            let loss = data + job.model.l1 * l1 / voxels as f64;
            if !loss.is_finite() {
                return Err(Error::new(
                    Kind::Options,
                    format!("the loss is {loss} at iteration {}", i + 1),
                    "use a smaller --learning-rate, and check the capture (`thirdbounce info`)",
                ));
            }
            self.pairs += (active * job.plan.pairs) as u64;
            point = Some(TracePoint {
                iteration: i + 1,
                seconds: self.start.elapsed().as_secs_f64(),
                gpu_seconds: job.executor.gpu_seconds() - self.gpu_before,
                lateral: level.grid.n[0],
                active,
                active_ratio: active as f64 / voxels as f64,
                loss,
            });
        }
        let point = point.expect("a block has an iteration");
        self.trace.push(point);
        Ok(point)
    }
}

fn read_maps(arena: &Arena<'_>, grid: &Grid) -> Maps {
    let columns: &[[f32; 8]] = bytemuck::cast_slice(arena.mapped("columns_host"));
    let columns = &columns[..grid.n[0] * grid.n[1]];
    let pick = |found: bool, v: f32| if found { v } else { f32::NAN };
    let albedo: Vec<f32> = columns.iter().map(|c| c[0]).collect();
    Maps {
        nx: grid.n[0],
        ny: grid.n[1],
        extent: grid.extent(),
        depth: columns.iter().map(|c| pick(c[3] > 0.0, c[1])).collect(),
        normal: columns.iter().map(|c| [c[4], c[5], c[6]].map(|v| pick(c[3] > 0.0, v))).collect(),
        mask: Maps::mask_of(&albedo, Maps::MASK_FRACTION),
        mask_fraction: Maps::MASK_FRACTION,
        albedo,
    }
}

fn read_volume(arena: &Arena<'_>, grid: &Grid) -> VolumeMap {
    let raw: &[[f32; 4]] = bytemuck::cast_slice(arena.mapped("raw_host"));
    let mask: &[u32] = bytemuck::cast_slice(arena.mapped("mask_host"));
    let mut albedo = Vec::with_capacity(grid.voxels());
    for x in 0..grid.n[0] {
        for y in 0..grid.n[1] {
            for z in 0..grid.n[2] {
                let i = grid.index([x, y, z]);
                let a = raw[i][0];
                let value = if a > 0.0 { a } else { a.exp_m1() };
                albedo.push(if mask[i / 32] >> (i % 32) & 1 == 1 { value } else { 0.0 });
            }
        }
    }
    VolumeMap { grid: *grid, albedo }
}
