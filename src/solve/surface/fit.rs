//! Fits of a surface with a given support, at one resolution.

use std::sync::Arc;
use std::time::Instant;

use super::held_out::HeldOut;
use super::model::{outline_of, take};
use super::needs::HEIGHTS_KEPT;
use super::schedule::{FitIteration, bonds, divide, extract, keep, render, start, turn};
use super::weights::{Placed, weights};
use super::{Pixels, SurfaceOptions, needs, passes};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::{Buffer, BufferPlan, Gpu, Place, Schedule, check};
use crate::maps::Maps;
use crate::solve::drive::{Driven, Steps, Watch, drive, maps_stage, stage_values};
use crate::solve::estimate::energy;
use crate::solve::on_device::{OnDevice, read_maps, trace_rows};
use crate::solve::outline::{self, TimedSchedule};
use crate::solve::over_pairs::turns_of_finish;
use crate::solve::passes::{FINISH, RESIDUAL, objective};
use crate::solve::plan::RESIDUAL_HOST;
use crate::solve::prepared::Planned;
use crate::solve::{Level, Plan, Problem};
use crate::transport::Rows;
use crate::transport::kernels::*;

/// Iterations between two comparisons of the objective; bonds and prior weights are renewed with them.
const CHECK: usize = 10;
/// A larger logarithm of the objective is a rise: batches differ by less.
const RISE: f64 = 0.05;
/// Factors of the steps after a rise, and after a comparison without one. Evidence: benches/NOTES.md, "Lengths of steps".
const SHORTER: f64 = 0.5;
const LONGER: f64 = 1.2;
/// A model explains the light up to this error. Beyond it, fits begin with the longest steps.
pub(super) const MOST_ERROR: f64 = 0.04;

/// Batches that are all rendered for the scale of the albedos.
const FEW: usize = 4;

/// The present state, and the best one so far.
const KEPT: [Buffer; 2] = [buffer::HEIGHTS, HEIGHTS_KEPT];

/// A fit at one resolution, prepared for a scan.
pub(crate) struct Fit {
    pub planned: Planned,
    rows: Rows,
    options: SurfaceOptions,
    /// Pixels of the surface on the device.
    pixels: usize,
    /// Energies of the batches of pairs.
    energies: Vec<f64>,
    /// Which pairs judge it.
    judge: Judge,
    /// The residual of the present surface is there for the host.
    is_compared: bool,
    /// The length of its next steps as a share of the longest ones: it stays from run to run.
    pub step: f64,
}

/// How long a fit runs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    /// Iterations of this fit.
    pub iterations: usize,
    /// Iterations of the schedule that are left out before these, of a fit that begins near its result.
    pub skipped: usize,
    /// Iterations of the schedule, if it does not end with this fit.
    pub scheduled: Option<usize>,
    /// Iterations of the whole solve, for progress.
    pub of: usize,
    /// The residual of the layers, if the scale of their albedos is that of the data; else the scale is found first.
    pub known: Option<f64>,
    /// What earlier fits left, which weighs the prior at first; else what the layers leave.
    pub level: Option<f64>,
    /// It ends at this time.
    pub until: Option<Instant>,
}

/// Which pairs judge a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Judge {
    /// None.
    None,
    /// Pairs that are held out.
    HeldOut,
    /// All pairs, which it takes, too.
    All,
}

impl Run {
    /// A whole fit of these iterations, in a solve of `of`.
    pub fn of(iterations: usize, of: usize) -> Run {
        Run { iterations, skipped: 0, scheduled: None, of, known: None, level: None, until: None }
    }

    /// The fit of a round, which leaves the end of its schedule out.
    pub fn of_round(self) -> Run {
        Run { scheduled: Some(super::rounds_of::SCHEDULED), ..self }
    }
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
        judge: Judge,
    ) -> Result<Fit> {
        let holds_out = judge == Judge::HeldOut;
        let Problem { capture, grid, memory, .. } = *problem;
        let (outline, rows) = outline_of(capture, &grid, options, holds_out);
        let asked = needs::OfFit { options, iterations };
        let mut plan = Plan::new(&outline, grid, capture.resolution(), &asked, &gpu.abilities(), false)?;
        if let Some(level) = judging(&plan, judge) {
            let cells = plan.cells_at(level);
            plan.buffers.push(BufferPlan::new(RESIDUAL_HOST, cells as u64 * 4, Place::Readback));
        }
        check(&plan.buffers, &gpu.memory(), memory)?;
        let planned = Planned::new(gpu, outline, plan, memory);
        Ok(Fit {
            planned,
            rows,
            options: options.clone(),
            pixels: 0,
            energies: vec![],
            judge,
            is_compared: false,
            step: 1.0,
        })
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
        let job = self.planned.made()?;
        let (plan, executor) = (job.plan.clone(), &mut job.executor);
        let mut reserve = |s: &Schedule| executor.reserve(s);
        reserve(&Schedule::of(|s| cleared(s, &plan)))?;
        reserve(&Schedule::of(|s| divide(s, &plan)))?;
        let iterations = plan.demand.iterations;
        let steps = whole(&plan, iterations[1]);
        outline::each(&plan, &steps, iterations[0]..iterations[0] + iterations[1], &mut reserve)?;
        reserve(&Schedule::of(|s| keep(s, needs::pixels(&plan), KEPT)))?;
        reserve(&Schedule::of(|s| compared(s, &plan, &steps.levels[0], 1, 0)))
    }

    /// Takes the counts of a capture.
    ///
    /// # Errors
    /// The device fails.
    pub fn take(&mut self, capture: &Capture) -> Result<()> {
        self.is_compared = false;
        let Fit { planned, rows, options, energies, .. } = self;
        let job = planned.made()?;
        take(capture, options, rows, &mut job.model);
        job.queue_counts()?;
        let batches = &job.plan.levels.batches;
        *energies = match &batches[..] {
            [] => vec![energy(&job.model, 0..job.plan.finest().pairs)],
            _ => batches.iter().map(|b| energy(&job.model, b.first..b.first + b.pairs)).collect(),
        };
        job.run(|s, plan| {
            cleared(s, plan);
            divide(s, plan);
        })
    }

    /// The factor of the albedos of `layers` that explains most of the counts, and the quality with it; `None` if they explain no
    /// light.
    ///
    /// # Errors
    /// The device fails.
    pub fn seen(&mut self, layers: &[Maps]) -> Result<Option<(f64, Quality)>> {
        let job = self.planned.made()?;
        let level = job.plan.levels.pixels.expect("a fit has pixels");
        let pixels = Pixels::of(layers, needs::pixels(&job.plan));
        (self.pixels, self.is_compared) = (pixels.len(), false);
        let [noise, energy] = job.light();
        let placed = match pixels.is_empty() {
            true => None,
            false => place(job, &level, &pixels, (level, energy), 0)?,
        };
        Ok(placed.map(|(placed, scale)| (scale, Quality { noise, energy, left: placed.left })))
    }

    /// What the present surface leaves of the pairs that judge it: of those that are fitted where none are held out.
    ///
    /// # Errors
    /// The device fails.
    pub fn judged(&mut self) -> Result<Option<HeldOut>> {
        let count = self.pixels;
        let job = self.planned.made()?;
        let Some(level) = judging(&job.plan, self.judge).copied().filter(|_| count > 0) else {
            return Ok(None);
        };
        if !self.is_compared {
            job.run(|s, plan| residual(s, plan, &level, count))?;
        }
        let residual: Vec<f32> = job.executor.read(RESIDUAL_HOST, ..job.plan.cells_at(&level));
        let pairs = &self.rows.pairs()[level.first..level.first + level.pairs];
        Ok(Some(HeldOut::of(&job.model, &level, pairs, &residual)))
    }

    /// Fits the pixels of `layers`, and replaces the layers by the result. The quality is `None` if they explain no light.
    ///
    /// The objective, prior included, is compared every [`CHECK`] iterations. A rise restores the best state so far and halves
    /// the steps, which grow again slowly; the best state is the result.
    ///
    /// # Errors
    /// The device fails, or the watch cancels.
    pub fn run(
        &mut self,
        layers: &mut [Maps],
        Run { iterations, skipped, scheduled, of, known, level: level_before, until }: Run,
        watch: &mut Watch<'_>,
        mut driven: Driven,
    ) -> Result<(Driven, Option<Quality>)> {
        let gpu = self.planned.gpu().clone();
        let (clock, options) = (Instant::now(), &self.options);
        let job = self.planned.made()?;
        let gpu_before = job.executor.gpu_seconds();
        let level = job.plan.levels.pixels.expect("a fit has pixels");
        let pixels = Pixels::of(layers, needs::pixels(&job.plan));
        let [count, begin] = [pixels.len(), driven.trace.last().map_or(0, |p| p.iteration)];
        (self.pixels, self.is_compared) = (count, false);
        let [noise, energy] = job.light();
        let placed = placed(job, &level, &pixels, &self.energies, known, begin)?;
        let Some(mut placed) = placed else {
            driven.seconds += clock.elapsed().as_secs_f64();
            driven.gpu_seconds += job.executor.gpu_seconds() - gpu_before;
            return Ok((driven, None));
        };
        let all = scheduled.unwrap_or(skipped + iterations);
        let mut best = Objective { log: f64::INFINITY, left: placed.left / energy, losses: [f64::NAN; 2] };
        placed.left = level_before.map_or(placed.left, |left| left.min(placed.left));
        let mut factor = self.step;
        let set_weights = |job: &mut OnDevice, placed: Placed, factor: f64| {
            let weights = weights(&job.model, &level, placed, options, all, factor);
            job.add(buffer::SURFACE_WEIGHTS, bytemuck::cast_slice(&weights))
        };
        set_weights(job, placed, factor)?;
        // Maps on the way show pixels without a surface as they were; those at the end have their own.
        if watch.maps_every.is_some() || !watch.maps_at.is_empty() {
            job.add(buffer::COLUMNS, bytemuck::cast_slice(&columns(&layers[0])))?;
        }
        job.queue(|s, _| keep(s, count, KEPT));
        driven.seconds += clock.elapsed().as_secs_f64();
        driven.gpu_seconds += job.executor.gpu_seconds() - gpu_before;
        let of_layers = pixels.of_layers(layers[0].albedo.len());
        let (mut done, mut since_rest, mut is_kept, mut restored) = (0, 0, true, false);
        // Frames compare their end with their beginning only: each comparison allocates.
        let check = if self.judge != Judge::None { CHECK } else { iterations };
        while done < iterations {
            let here = check.min(iterations - done);
            let segment = Segment { begin: begin + done, at: skipped + done, since_rest, all, of };
            let steps = Steps { until, ..steps(&job.plan, level, of_layers, segment) };
            driven = drive(&gpu, job, begin + done + here, steps, watch, Some(driven))?;
            let reached = driven.trace.last().map_or(begin, |p| p.iteration) - begin;
            if reached == done {
                break;
            }
            let [first, last] = objectives(job, &self.energies, begin + done..begin + reached);
            if done == 0 {
                best = Objective { left: best.left, ..first };
            }
            let rises = last.log.is_nan() || last.log > best.log + RISE;
            since_rest += here;
            if rises {
                factor *= SHORTER;
                (placed.left, since_rest) = (best.left * energy, 0);
                if let Some(point) = driven.trace.last_mut() {
                    // That of the state that is restored.
                    [point.loss, point.data_loss] = best.losses;
                }
                set_weights(job, placed, factor)?;
                put_back(job, &level, count);
            } else if last.log <= best.log {
                best = last;
                if factor < 1.0 {
                    (factor, placed.left) = ((factor * LONGER).min(1.0), best.left * energy);
                    set_weights(job, placed, factor)?;
                }
                job.queue(|s, _| keep(s, count, KEPT));
            }
            (is_kept, restored) = (rises || last.log <= best.log, rises);
            if reached < done + here {
                break;
            }
            done = reached;
        }
        let quality = Quality { noise, energy, left: best.left * energy };
        // Where the model leaves much, rises tell of that, not of the steps.
        self.step = if quality.model_error() <= MOST_ERROR { factor } else { 1.0 };
        if restored || !is_kept {
            job.queue(|s, _| keep(s, count, [KEPT[1], KEPT[0]]));
        }
        extract_layers(job, self.judge, &level, of_layers, layers)?;
        self.is_compared = true;
        driven.maps = layers[0].clone();
        Ok((driven, Some(quality)))
    }
}

/// Puts the best state of `count` pixels back, and Adam at rest.
fn put_back(job: &mut OnDevice, level: &Level, count: usize) {
    job.queue(|s, plan| {
        keep(s, count, [KEPT[1], KEPT[0]]);
        start(s, plan, level, count, needs::points_of(plan));
    });
}

/// Renders the pairs of `level` that judge a fit, and leaves the residual for the host.
fn residual(s: &mut Schedule, plan: &Plan, level: &Level, count: usize) {
    render(s, plan, level, count, &RESIDUAL);
    s.copy(buffer::RESIDUAL, RESIDUAL_HOST, plan.cells_at(level) as u64 * 4);
}

/// Leaves the residual of the pairs that judge the present state for the host, and the state in the layers.
fn extract_layers(
    job: &mut OnDevice,
    judge: Judge,
    level: &Level,
    of_layers: [usize; 2],
    layers: &mut [Maps],
) -> Result<()> {
    if let Some(judging) = judging(&job.plan, judge).copied() {
        job.queue(|s, plan| residual(s, plan, &judging, of_layers.iter().sum()));
    }
    for (layer, maps) in layers.iter_mut().enumerate() {
        *maps = shown(job, level, maps, of_layers, layer)?;
    }
    Ok(())
}

/// The maps with the present state of a layer; pixels without a surface keep what `maps` has.
fn shown(
    job: &mut OnDevice,
    level: &Level,
    maps: &Maps,
    of_layers: [usize; 2],
    layer: usize,
) -> Result<Maps> {
    job.add(buffer::COLUMNS, bytemuck::cast_slice(&columns(maps)))?;
    job.run(|s, _| {
        maps_stage(s, level);
        extract(s, level, of_layers, layer);
    })?;
    Ok(read_maps(&job.executor, &level.grid, true))
}

/// The pairs that judge a fit: those that are held out, or some of the fitted ones where none are.
fn judging(plan: &Plan, judge: Judge) -> Option<&Level> {
    let all = plan.levels.pixels.as_ref();
    match judge {
        Judge::None => None,
        Judge::HeldOut => plan.levels.held_out.as_ref().or(plan.batch(0)).or(all),
        Judge::All => all,
    }
}

/// The objective of a state.
#[derive(Debug, Clone, Copy)]
struct Objective {
    /// Logarithm of the objective over the energy, prior included.
    log: f64,
    /// Share of the energy that the data term is.
    left: f64,
    /// The objective, prior included, and the plain data loss.
    losses: [f64; 2],
}

/// The objectives of the first of these iterations, and of the last ones, in the mean over different batches.
fn objectives(job: &OnDevice, energies: &[f64], rows: std::ops::Range<usize>) -> [Objective; 2] {
    let all = trace_rows(job, rows.clone());
    let of = |(i, row): (usize, &[u32; TRACE_ROW as usize])| {
        let [data, prior, plain] =
            [TRACE_OBJECTIVE, TRACE_L1, TRACE_DATA].map(|at| f64::from(f32::from_bits(row[at as usize])));
        let energy = energies[i % energies.len()].max(f64::MIN_POSITIVE);
        [((data + prior) / energy).ln(), data / energy, data + prior, plain]
    };
    let each: Vec<[f64; 4]> = rows.zip(&all).map(of).collect();
    let mean = |of: &[[f64; 4]]| {
        let [log, left, loss, plain] =
            [0, 1, 2, 3].map(|k| of.iter().map(|v| v[k]).sum::<f64>() / of.len() as f64);
        Objective { log, left, losses: [loss, plain] }
    };
    [mean(&each[..1]), mean(&each[each.len() - each.len().min(energies.len())..])]
}

/// Sets to zero what sums begin with.
pub(crate) fn cleared(s: &mut Schedule, plan: &Plan) {
    for cleared in [buffer::COUNTS, buffer::HISTOGRAMS] {
        s.fill(cleared, plan.bytes_of(cleared), 0);
    }
}

/// Iterations of a fit between two comparisons of the objective.
#[derive(Clone, Copy)]
struct Segment {
    /// The first one in the whole solve, from 0, and in the schedule of the fit.
    begin: usize,
    at: usize,
    /// Iterations since Adam was at rest.
    since_rest: usize,
    /// Iterations of the schedule of the fit, and of the whole solve, for progress.
    all: usize,
    of: usize,
}

/// The steps that the driver runs for a segment, with the given pixels in each layer. Maps on the way show the first layer.
fn steps(
    plan: &Plan,
    level: Level,
    of_layers: [usize; 2],
    Segment { begin, at, since_rest, all, of }: Segment,
) -> Steps<'static> {
    let count = of_layers.iter().sum();
    Steps {
        levels: vec![plan.batch(0).copied().unwrap_or(level)],
        start: Box::new(move |s, _| {
            if since_rest > 0 {
                bonds(s, &level, count, begin);
            }
        }),
        iteration: Box::new(move |s, plan, _, i| {
            let done = i - begin;
            let one = FitIteration { iteration: i, at: at + done, since_rest: since_rest + done };
            turn(s, plan, &level, count, one, all);
        }),
        due: Box::new(move |s, _, _, done| {
            if (done - begin).is_multiple_of(CHECK) {
                bonds(s, &level, count, done);
            }
        }),
        extract: Box::new(move |s, level| extract(s, level, of_layers, 0)),
        has_maps: false,
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
        ..steps(
            plan,
            level,
            [count, 0],
            Segment { begin, at: 0, since_rest: 0, all: iterations, of: begin + iterations },
        )
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

/// Places pixels for a fit, with the scale that explains most of the data unless the residual with theirs is `known`; `None` if they
/// explain none. Overwrites the trace from row `row` on.
fn placed(
    job: &mut OnDevice,
    level: &Level,
    pixels: &Pixels,
    energies: &[f64],
    known: Option<f64>,
    row: usize,
) -> Result<Option<Placed>> {
    let [_, energy] = job.light();
    if pixels.is_empty() {
        return Ok(None);
    }
    if let Some(left) = known {
        return place_known(job, level, pixels, [energy, left]).map(Some);
    }
    // With many batches one is enough for the scale: rendering all pairs would take longer than the iterations.
    let compared = match &job.plan.levels.batches {
        all if all.len() > FEW => (all[0], energies[0]),
        _ => (*level, energy),
    };
    Ok(place(job, level, pixels, compared, row)?.map(|(placed, _)| placed))
}

/// Queues the columns and places of pixels.
fn add_pixels(job: &mut OnDevice, level: &Level, pixels: &Pixels) -> Result<()> {
    let [x, y, _] = level.grid.n;
    let places = pixels.places(x * y);
    job.add(buffer::PIXELS, bytemuck::cast_slice(&pixels.columns))?;
    job.add(buffer::PIXEL_OF, bytemuck::cast_slice(&places))
}

/// Queues depths, and albedos times a scale.
fn add_heights(job: &mut OnDevice, pixels: &Pixels, scale: f64) -> Result<()> {
    let of = |(z, a): (&f32, &f32)| [*z, (scale * f64::from(*a)) as f32];
    let heights: Vec<[f32; 2]> = pixels.depth.iter().zip(&pixels.albedo).map(of).collect();
    job.add(buffer::HEIGHTS, bytemuck::cast_slice(&heights))
}

fn brightest(pixels: &Pixels) -> f64 {
    f64::from(pixels.albedo.iter().fold(0.0f32, |a, b| a.max(*b)))
}

/// Places pixels whose albedos have the scale of the data, of which they leave `left`.
fn place_known(
    job: &mut OnDevice,
    level: &Level,
    pixels: &Pixels,
    [energy, left]: [f64; 2],
) -> Result<Placed> {
    add_pixels(job, level, pixels)?;
    add_heights(job, pixels, 1.0)?;
    job.queue(|s, plan| start(s, plan, level, pixels.len(), needs::points_of(plan)));
    Ok(Placed { pixels: pixels.len(), most: brightest(pixels), explained: energy - left, left })
}

/// Places pixels, with their albedos scaled so that they explain most of the pairs that are `compared`, whose energy is given;
/// `None` if they explain none. Also returns the scale. Overwrites the trace from row `row` on: two rows.
fn place(
    job: &mut OnDevice,
    level: &Level,
    pixels: &Pixels,
    (of, measured): (Level, f64),
    row: usize,
) -> Result<Option<(Placed, f64)>> {
    add_pixels(job, level, pixels)?;
    // |A v - h|² and |2 A v - h|² give, with |h|², the factor of v that leaves least.
    add_heights(job, pixels, 1.0)?;
    job.queue(|s, plan| {
        s.stage("surface", &stage_values(level, row));
        start(s, plan, level, pixels.len(), needs::points_of(plan));
        compared(s, plan, &of, pixels.len(), row);
    });
    add_heights(job, pixels, 2.0)?;
    job.run(|s, plan| {
        s.stage("surface", &stage_values(level, row));
        compared(s, plan, &of, pixels.len(), row + 1);
    })?;
    let objective =
        |row: &[u32; TRACE_ROW as usize]| f64::from(f32::from_bits(row[TRACE_OBJECTIVE as usize]));
    let [once, twice] = [row, row + 1].map(|row| objective(&trace_rows(job, row..row + 1)[0]));
    let rendered = 0.5 * (measured - 2.0 * once + twice);
    let scale = 0.5 * (rendered + measured - once) / rendered;
    if !(scale.is_finite() && scale > 0.0) {
        return Ok(None);
    }
    add_heights(job, pixels, scale)?;
    let [_, energy] = job.light();
    let explained = energy * scale * scale * rendered / measured;
    let most = scale * brightest(pixels);
    Ok(Some((Placed { pixels: pixels.len(), most, explained, left: energy - explained }, scale)))
}

/// Renders `pixels` pixels and writes the objective to row `row` of the trace.
fn compared(s: &mut Schedule, plan: &Plan, level: &Level, pixels: usize, row: usize) {
    render(s, plan, level, pixels, objective(plan));
    s.dispatch(&FINISH, [1, 1, 1], turns_of_finish(plan))
        .bind(buffer::SCENE, level.scene)
        .with(Push { iteration: row as u32, ..Default::default() });
}
