//! Fits of a surface with a given support, at one resolution.

use std::sync::Arc;
use std::time::Instant;

use super::model::{outline_of, take};
use super::schedule::{bonds, divide, extract, later_iteration, render, start};
use super::weights::{Placed, weights};
use super::{Pixels, SurfaceOptions, needs, passes};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::{Gpu, Schedule};
use crate::maps::Maps;
use crate::solve::drive::{Driven, Steps, Watch, drive, stage_values};
use crate::solve::on_device::{OnDevice, read_maps, trace_rows, upload};
use crate::solve::outline::{self, TimedSchedule};
use crate::solve::over_pairs::{scene_of_sums, turns_of_finish};
use crate::solve::passes::{FINISH, objective};
use crate::solve::prepared::Planned;
use crate::solve::{Level, Plan, Problem};
use crate::transport::Rows;
use crate::transport::kernels::*;

/// Bonds and prior weights are renewed after every Nth iteration.
const RENEW: usize = 10;

/// A fit at one resolution, prepared for a scan.
pub(crate) struct Fit {
    pub planned: Planned,
    rows: Rows,
    options: SurfaceOptions,
}

/// How long a fit runs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    /// Iterations of this fit.
    pub iterations: usize,
    /// Iterations of the schedule that are left out before these, of a fit that begins near its result.
    pub skipped: usize,
    /// Iterations of the whole solve, for progress.
    pub of: usize,
    /// The residual of the layers, if the scale of their albedos is that of the data; else the scale is found first.
    pub known: Option<f64>,
    /// It ends at this time.
    pub until: Option<Instant>,
}

/// Noise and model error of a fit, as data terms of the objective.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Quality {
    /// Photon noise.
    pub noise: f64,
    /// The measurement.
    pub energy: f64,
    /// The residual of the last iteration.
    pub left: f64,
}

impl Quality {
    /// Share of photon noise in the energy of the measurement.
    pub fn noise_share(&self) -> f64 {
        (self.noise / self.energy).clamp(0.0, 1.0)
    }

    /// Share of the measurement's energy that the surface leaves.
    pub fn left_share(&self) -> f64 {
        (self.left / self.energy).clamp(0.0, 1.0)
    }

    /// Residual beyond noise, as a share of the signal's energy.
    pub fn model_error(&self) -> f64 {
        ((self.left - self.noise) / (self.energy - self.noise)).clamp(0.0, 1.0)
    }
}

impl Fit {
    /// Plans a fit of at most `iterations[1]` iterations, after `iterations[0]` of other fits.
    ///
    /// # Errors
    /// Options, scan or device do not allow it.
    pub fn new(
        gpu: &Gpu,
        problem: &Problem<'_>,
        options: &SurfaceOptions,
        iterations: [usize; 2],
    ) -> Result<Fit> {
        let Problem { capture, grid, memory, .. } = *problem;
        let (outline, rows) = outline_of(capture, &grid, options);
        let asked = needs::OfFit { options, iterations };
        let plan = Plan::new(&outline, grid, capture.resolution(), &asked, &gpu.abilities(), false)?;
        let plan = plan.within(&asked, &gpu.memory(), memory)?;
        Ok(Fit { planned: Planned::new(gpu, outline, plan, memory), rows, options: options.clone() })
    }

    /// Levels, passes and buffers.
    pub fn plan(&self) -> &Arc<Plan> {
        self.planned.plan()
    }

    /// Depths that surfaces may have, metres.
    pub fn depth_range(&self) -> [f32; 2] {
        self.plan().levels.maps.depth_range().map(|z| z as f32)
    }

    /// Allocates buffers and makes kernels.
    ///
    /// # Errors
    /// Memory or device do not allow it.
    pub fn allocate(&mut self) -> Result<()> {
        let job = self.planned.made(|_| Ok(()))?;
        let (plan, executor) = (job.plan.clone(), &mut job.executor);
        let mut reserve = |s: &Schedule| executor.reserve(s);
        reserve(&Schedule::of(|s| cleared(s, &plan)))?;
        reserve(&Schedule::of(|s| divide(s, &plan)))?;
        let iterations = plan.demand.iterations;
        let steps = whole(&plan, iterations[1]);
        outline::each(&plan, &steps, iterations[0]..iterations[0] + iterations[1], &mut reserve)?;
        reserve(&Schedule::of(|s| compared(s, &plan, &steps.levels[0], 1, 0)))
    }

    /// Takes the counts of a capture.
    ///
    /// # Errors
    /// The device fails.
    pub fn take(&mut self, capture: &Capture) -> Result<()> {
        let Fit { planned, rows, options } = self;
        let job = planned.made(|_| Ok(()))?;
        take(capture, options, rows, &mut job.model);
        job.upload_counts()?;
        job.executor.run_once(|s| {
            cleared(s, &job.plan);
            divide(s, &job.plan);
        })
    }

    /// The factor of the albedos of `layers` that explains most of the counts, and the quality with it; `None` if they explain no
    /// light.
    ///
    /// # Errors
    /// The device fails.
    pub fn seen(&mut self, layers: &[Maps]) -> Result<Option<(f64, Quality)>> {
        let job = self.planned.made(|_| Ok(()))?;
        let level = job.plan.levels.pixels.expect("a fit has pixels");
        let pixels = Pixels::of(layers, needs::pixels(&job.plan));
        let placed = if pixels.is_empty() { None } else { place(job, &level, &pixels, 0, None)? };
        let [noise, energy] = job.light();
        Ok(placed.map(|(placed, scale)| (scale, Quality { noise, energy, left: placed.left })))
    }

    /// Fits the pixels of `layers`, and replaces the layers by the result. The quality is `None` if they explain no light.
    ///
    /// # Errors
    /// The device fails, or the watch cancels.
    pub fn run(
        &mut self,
        layers: &mut [Maps],
        how: Run,
        watch: &mut Watch<'_>,
        driven: Driven,
    ) -> Result<(Driven, Option<Quality>)> {
        let gpu = self.planned.gpu().clone();
        let job = self.planned.made(|_| Ok(()))?;
        run(&gpu, job, &self.options, layers, how, watch, driven)
    }
}

/// [`Fit::run`] on a job whose counts are uploaded.
pub(crate) fn run(
    gpu: &Gpu,
    job: &mut OnDevice,
    options: &SurfaceOptions,
    layers: &mut [Maps],
    Run { iterations, skipped, of, known, until }: Run,
    watch: &mut Watch<'_>,
    mut driven: Driven,
) -> Result<(Driven, Option<Quality>)> {
    let (clock, gpu_before) = (Instant::now(), job.executor.gpu_seconds());
    let level = job.plan.levels.pixels.expect("a fit has pixels");
    let pixels = Pixels::of(layers, needs::pixels(&job.plan));
    let begin = driven.trace.last().map_or(0, |p| p.iteration);
    let placed = if pixels.is_empty() { None } else { place(job, &level, &pixels, begin, known)? };
    if let Some((placed, _)) = placed {
        let weights = weights(&job.model, &level, placed, options, skipped + iterations);
        upload(&mut job.executor, buffer::SURFACE_WEIGHTS, bytemuck::cast_slice(&weights))?;
        upload(&mut job.executor, buffer::COLUMNS, bytemuck::cast_slice(&columns(&layers[0])))?;
    }
    driven.seconds += clock.elapsed().as_secs_f64();
    driven.gpu_seconds += job.executor.gpu_seconds() - gpu_before;
    if placed.is_none() {
        return Ok((driven, None));
    }
    let of_layers = pixels.of_layers(layers[0].albedo.len());
    let steps = Steps { until, ..steps(&job.plan, level, of_layers, begin, [iterations, skipped, of]) };
    let driven = drive(gpu, job, begin + iterations, steps, watch, Some(driven))?;
    layers[0] = driven.maps.clone();
    if let Some(behind) = layers.get_mut(1) {
        upload(&mut job.executor, buffer::COLUMNS, bytemuck::cast_slice(&columns(behind)))?;
        job.executor.run_once(|s| extract(s, &level, of_layers, 1))?;
        *behind = read_maps(&job.executor, &level.grid, true);
    }
    let [noise, energy] = job.light();
    let quality = Quality {
        noise,
        energy,
        left: objective_of(job, driven.trace.last().map_or(begin, |p| p.iteration - 1)),
    };
    Ok((driven, Some(quality)))
}

/// Sets to zero what sums begin with.
pub(crate) fn cleared(s: &mut Schedule, plan: &Plan) {
    for cleared in [buffer::COUNTS, buffer::HISTOGRAMS] {
        s.fill(cleared, plan.bytes_of(cleared), 0);
    }
}

/// The steps that the driver runs, after `begin` iterations: `iterations` of a surface with the given pixels in each layer, of
/// `of` in all. Maps on the way show the first layer.
fn steps(
    plan: &Plan,
    level: Level,
    of_layers: [usize; 2],
    begin: usize,
    [iterations, skipped, of]: [usize; 3],
) -> Steps<'static> {
    let count = of_layers.iter().sum();
    Steps {
        levels: vec![plan.batch(0).copied().unwrap_or(level)],
        start: Box::new(|_, _| ()),
        iteration: Box::new(move |s, plan, _, i| {
            later_iteration(s, plan, &level, count, [i, i - begin, iterations], skipped)
        }),
        due: Box::new(move |s, _, _, done| {
            if (done - begin).is_multiple_of(RENEW) {
                bonds(s, &level, count, done);
            }
        }),
        extract: Box::new(move |s, level| extract(s, level, of_layers, 0)),
        passes: [crate::solve::passes::ALL, passes::ALL],
        l1_weight: Box::new(|_| 1.0),
        of,
        shrinks: false,
        until: None,
    }
}

/// The steps of a fit of all pixels that there is room for.
fn whole(plan: &Plan, iterations: usize) -> Steps<'static> {
    let level = plan.levels.pixels.expect("a fit has pixels");
    let (count, begin) = (needs::pixels(plan), plan.demand.iterations[0]);
    Steps {
        start: Box::new(move |s, plan| start(s, plan, &level, count, needs::points_of(plan))),
        ..steps(plan, level, [count, 0], begin, [iterations, 0, begin + iterations])
    }
}

/// The schedules of a fit of all pixels that there is room for.
pub(super) fn outline(plan: &Plan) -> Vec<TimedSchedule> {
    let [begin, iterations] = plan.demand.iterations;
    outline::of("surface", plan, &whole(plan, iterations), begin..begin + iterations)
}

/// The maps in the layout of the device.
fn columns(maps: &Maps) -> Vec<[f32; 8]> {
    let of_pixel = |((a, z), n): ((&f32, &f32), &[f32; 3])| {
        let of = |v: f32| if z.is_finite() && v.is_finite() { v } else { 0.0 };
        let found = if z.is_finite() { 1.0 } else { 0.0 };
        [*a, of(*z), 0.0, found, of(n[0]), of(n[1]), of(n[2]), 0.0]
    };
    maps.albedo.iter().zip(&maps.depth).zip(&maps.normal).map(of_pixel).collect()
}

/// Uploads the pixels. Their albedos are scaled so that they explain most of the data, unless the residual `left` of their scale
/// is known; `None` if they explain none. Also returns the scale. Overwrites row `row` of the trace.
fn place(
    job: &mut OnDevice,
    level: &Level,
    pixels: &Pixels,
    row: usize,
    left: Option<f64>,
) -> Result<Option<(Placed, f64)>> {
    let heights = |scale: f64| -> Vec<[f32; 2]> {
        pixels.depth.iter().zip(&pixels.albedo).map(|(z, a)| [*z, (scale * f64::from(*a)) as f32]).collect()
    };
    let ([x, y, _], points) = (level.grid.n, needs::points_of(&job.plan));
    upload(&mut job.executor, buffer::PIXELS, bytemuck::cast_slice(&pixels.words()))?;
    upload(&mut job.executor, buffer::PIXEL_OF, bytemuck::cast_slice(&pixels.places(x * y)))?;
    let most = f64::from(pixels.albedo.iter().fold(0.0f32, |a, b| a.max(*b)));
    let [_, measured] = job.light();
    if let Some(left) = left {
        upload(&mut job.executor, buffer::HEIGHTS, bytemuck::cast_slice(&heights(1.0)))?;
        job.executor.run_once(|s| start(s, &job.plan, level, pixels.len(), points))?;
        return Ok(Some((Placed { pixels: pixels.len(), most, explained: measured - left, left }, 1.0)));
    }
    // |A v - h|² and |2 A v - h|² give, with |h|², the factor of v that leaves least.
    let mut residuals = [0.0; 2];
    for (times, residual) in (1..).zip(&mut residuals) {
        upload(&mut job.executor, buffer::HEIGHTS, bytemuck::cast_slice(&heights(f64::from(times))))?;
        job.executor.run_once(|s| {
            s.stage("surface", &stage_values(level, row));
            if times == 1 {
                start(s, &job.plan, level, pixels.len(), points);
            }
            compared(s, &job.plan, level, pixels.len(), row);
        })?;
        *residual = objective_of(job, row);
    }
    let [once, twice] = residuals;
    let rendered = 0.5 * (measured - 2.0 * once + twice);
    let scale = 0.5 * (rendered + measured - once) / rendered;
    if !(scale.is_finite() && scale > 0.0) {
        return Ok(None);
    }
    upload(&mut job.executor, buffer::HEIGHTS, bytemuck::cast_slice(&heights(scale)))?;
    let explained = scale * scale * rendered;
    let left = measured - explained;
    Ok(Some((Placed { pixels: pixels.len(), most: scale * most, explained, left }, scale)))
}

/// Renders `pixels` pixels and writes the objective to row `row` of the trace.
fn compared(s: &mut Schedule, plan: &Plan, level: &Level, pixels: usize, row: usize) {
    render(s, plan, level, pixels, objective(plan));
    s.dispatch(&FINISH, [1, 1, 1], turns_of_finish(plan))
        .bind(buffer::SCENE, scene_of_sums(plan, level))
        .with(Push { iteration: row as u32, ..Default::default() });
}

/// The data term in row `row` of the trace.
fn objective_of(job: &OnDevice, row: usize) -> f64 {
    f64::from(f32::from_bits(trace_rows(job, row..row + 1)[0][TRACE_OBJECTIVE as usize]))
}
