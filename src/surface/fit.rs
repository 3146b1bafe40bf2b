//! Fits of a surface with a given support, at one resolution.

use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use super::held_out::HeldOut;
use super::model::{outline_of, take};
use super::options::SurfaceOptions;
use super::pixels::Pixels;
use super::schedule::{CHECK, Judged, check, divide, extract, iteration, place, place_known, render, start};
use super::weights::Unplaced;
use crate::Result;
use crate::capture::Capture;
use crate::engine::noise::energy;
use crate::engine::passes::RESIDUAL;
use crate::engine::{
    COLUMNS_HOST, Driven, Iterate, Level, OnDevice, Pass, Plan, Planned, Problem, RESIDUAL_HOST,
    TimedSchedule, TracePoint, UPLOAD, Watch, columns_of, drive, maps_of, maps_stage, outline, read_whole,
    stage_values, submit_whole,
};
use crate::gpu::{self, Buffer, BufferPlan, Gpu, Place, Schedule, Ticket};
use crate::maps::Maps;
use crate::surface::{needs, passes};
use crate::transport::Rows;
use crate::transport::kernels::*;

/// A model explains the light up to this error. Beyond it, fits begin with the longest steps.
pub(super) const MOST_ERROR: f64 = 0.04;

/// Batches that are all rendered for the scale of the albedos.
const FEW: usize = 4;

/// The maps of the second layer, and what a fit knows of itself, for the host.
const BEHIND_HOST: Buffer = Buffer::named("behind_host");
const WEIGHTS_HOST: Buffer = Buffer::named("surface_weights_host");

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
    /// There is room for the residual of all pairs on the host.
    with_residuals: bool,
    /// The residual of the present surface is there for the host.
    is_compared: bool,
    /// Albedos are in units of this fit's data: those of a closed form may be thousands of times smaller.
    is_scaled: bool,
    /// The length of its next steps as a share of the longest ones: it stays from run to run.
    pub step: f64,
    /// A run that the device was given ([`Fit::begin`]).
    flight: Option<(Ticket, PlacedRun)>,
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

    /// Iterations of the schedule.
    fn all(&self) -> usize {
        self.scheduled.unwrap_or(self.skipped + self.iterations)
    }

    /// The fit of a round, which leaves the end of its schedule out.
    pub fn of_round(self) -> Run {
        Run { scheduled: Some(crate::surface::rounds_of::SCHEDULED), ..self }
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
        let scan = capture.resolution();
        let mut plan = needs::plan(&outline, grid, scan, options, iterations, 0, &gpu.abilities())?;
        let with_residuals = options.concludes(&grid, holds_out);
        let of_all = plan.levels.pixels.as_ref().filter(|_| with_residuals);
        if let Some(cells) = judging(&plan, judge).into_iter().chain(of_all).map(|l| plan.cells_at(l)).max() {
            plan.buffers.push(BufferPlan::new(RESIDUAL_HOST, cells as u64 * 4, Place::Readback));
        }
        share_with_host(&mut plan);
        gpu::check(&plan.buffers, &gpu.memory(), memory)?;
        let planned = Planned::new(gpu, outline, plan, memory);
        Ok(Fit {
            planned,
            rows,
            options: options.clone(),
            pixels: 0,
            energies: vec![],
            judge,
            with_residuals,
            is_compared: false,
            is_scaled: false,
            step: 1.0,
            flight: None,
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
        let whole = PlacedRun::whole(&plan, iterations[1]);
        outline::each(&plan, &whole, whole.iterations(), &mut reserve)?;
        let (level, pixels) = (whole.pairs, needs::pixels(&plan));
        reserve(&Schedule::of(|s| place(s, &plan, [&level; 2], pixels, 0, true)))
    }

    /// Takes the counts of a capture.
    ///
    /// # Errors
    /// The device fails.
    pub fn take(&mut self, capture: &Capture) -> Result<()> {
        (self.is_compared, self.is_scaled) = (false, false);
        let Fit { planned, rows, options, energies, .. } = self;
        let job = planned.made()?;
        take(capture, options, rows, &mut job.model);
        job.queue_counts()?;
        let batches = &job.plan.levels.batches;
        *energies = match &batches[..] {
            [] => vec![job.light()[1]],
            _ => batches.iter().map(|b| energy(&job.model, b.first..b.first + b.pairs)).collect(),
        };
        let words: Vec<f32> = energies.iter().map(|energy| *energy as f32).collect();
        job.add(buffer::SURFACE_ENERGIES, bytemuck::cast_slice(&words))?;
        job.queue(|s, plan| {
            cleared(s, plan);
            divide(s, plan);
        });
        Ok(())
    }

    /// The factor of the albedos of `layers` that explains most of the counts, and the quality with it; `None` if they explain no
    /// light. `is_near`: the layers were fitted to other counts of this scan, so that the factor is near one.
    ///
    /// # Errors
    /// The device fails.
    pub fn seen(&mut self, layers: &[Maps], is_near: bool) -> Result<Option<(f64, Quality)>> {
        let job = self.planned.made()?;
        let level = job.plan.levels.pixels.expect("a fit has pixels");
        let scaled_by = ScaledBy { level, energy: job.light()[1], is_near };
        if self.place(layers, Run::of(0, 0), 0, scaled_by)?.is_none() {
            return Ok(None);
        }
        let job = self.planned.made()?;
        job.run(|s, _| s.copy(buffer::SURFACE_WEIGHTS, WEIGHTS_HOST, u64::from(SURFACE_WEIGHTS) * 4))?;
        Ok(RunResult::read(job).map(|found| (found.scale, found.quality)))
    }

    /// What layers whose albedos have the scale of the counts leave of the pairs that judge a fit.
    ///
    /// # Errors
    /// The device fails.
    pub fn rendered(&mut self, layers: &[Maps]) -> Result<Option<HeldOut>> {
        let scaled_by = self.scaled_by()?;
        let run = Run { known: Some(0.0), ..Run::of(0, 0) };
        self.place(layers, run, 0, scaled_by)?.map_or(Ok(None), |_| self.judged())
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

    /// What the present surface leaves of at most some of the pairs that it was fitted to; `None` if it has no pixels, or there is no
    /// room for it.
    ///
    /// # Errors
    /// The device fails.
    pub fn residuals(&mut self, most: usize) -> Result<Option<Residuals>> {
        let count = self.pixels;
        self.is_compared = false;
        let job = self.planned.made()?;
        let Some(level) = job.plan.levels.pixels.filter(|_| count > 0 && self.with_residuals) else {
            return Ok(None);
        };
        job.run(|s, plan| residual(s, plan, &level, count))?;
        let residual: Vec<f32> = job.executor.read(RESIDUAL_HOST, ..job.plan.cells_at(&level));
        let model = &job.model;
        let (scene, bins) = (model.scene_of(&level.grid, level.pairs), model.bins);
        let unit = 1.0 / (2.0 * f64::from(scene.loss_scale) * f64::from(scene.render_scale));
        let factor = |weight: f64| if weight > 0.0 { (unit / weight) as f32 } else { 0.0 };
        let factors: Vec<f32> = (0..bins).map(|bin| factor(model.bin_weight(bin))).collect();
        let pairs = level.pairs.min(most);
        let rows = model.bins_of(&residual);
        Ok(Some(Residuals {
            pairs: self.rows.pairs()[level.first..level.first + pairs].to_vec(),
            bins,
            differences: rows[..pairs * bins]
                .iter()
                .zip(factors.iter().cycle())
                .map(|(v, f)| v * f)
                .collect(),
            measured: model.measured[level.first * bins..][..pairs * bins].to_vec(),
            path: [model.t_start, model.bin_width],
        }))
    }

    /// Fits the pixels of `layers`, and replaces the layers by the result. The quality is `None` if they explain no light.
    ///
    /// The objective, prior included, is compared every [`CHECK`] iterations on the device (`surface_judge`). A rise restores the
    /// best state so far and halves the steps, which grow again slowly; the best state is the result.
    ///
    /// # Errors
    /// The device fails, or the watch cancels.
    pub fn run(
        &mut self,
        layers: &mut [Maps],
        run: Run,
        watch: &mut Watch<'_>,
        mut driven: Driven,
    ) -> Result<(Driven, Option<Quality>)> {
        let (gpu, clock) = (self.planned.gpu().clone(), Instant::now());
        let begin = driven.trace.last().map_or(0, |p| p.iteration);
        let scaled_by = self.scaled_by()?;
        let placed = self.place(layers, run, begin, scaled_by)?;
        driven.seconds += clock.elapsed().as_secs_f64();
        let Some(of_layers) = placed else { return Ok((driven, None)) };
        let (judge, job) = (self.judge, self.planned.made()?);
        // Maps on the way show pixels without a surface as they were; those at the end have their own.
        if watch.maps_every.is_some() || !watch.maps_at.is_empty() {
            job.add(buffer::COLUMNS, bytemuck::cast_slice(&columns(&layers[0])))?;
        }
        let of_run = PlacedRun::of(&job.plan, run, begin, of_layers, judge);
        driven = drive(&gpu, job, begin + run.iterations, &of_run, watch, Some(driven))?;
        let quality = self.result(layers)?;
        if quality.is_some() {
            driven.maps = layers[0].clone();
        }
        Ok((driven, quality))
    }

    /// Gives the device a whole run of the pixels of `layers`, that begins with iteration `begin`; [`Fit::end`] takes its result.
    /// Meanwhile other fits may begin.
    ///
    /// # Errors
    /// The device fails.
    pub fn begin(&mut self, layers: &[Maps], run: Run, begin: usize) -> Result<()> {
        let scaled_by = self.scaled_by()?;
        self.flight = None;
        let Some(of_layers) = self.place(layers, run, begin, scaled_by)? else { return Ok(()) };
        let (judge, job) = (self.judge, self.planned.made()?);
        let of_run = PlacedRun::of(&job.plan, run, begin, of_layers, judge);
        self.flight = Some((submit_whole(job, &of_run, of_run.iterations())?, of_run));
        Ok(())
    }

    /// Waits for what [`Fit::begin`] gave the device, and replaces the layers by the result: the last point of the trace, and the
    /// quality. `None` if they explain no light.
    ///
    /// # Errors
    /// The device fails, or a loss is not finite.
    pub fn end(&mut self, layers: &mut [Maps]) -> Result<Option<(TracePoint, Quality)>> {
        let Some((ticket, of_run)) = self.flight.take() else { return Ok(None) };
        let point = read_whole(self.planned.in_use(), &of_run, ticket, of_run.iterations())?;
        Ok(self.result(layers)?.map(|quality| (point, quality)))
    }

    /// Replaces the layers by what a run left for the host, and gives its quality. `None` if they explain no light.
    fn result(&mut self, layers: &mut [Maps]) -> Result<Option<Quality>> {
        let job = self.planned.made()?;
        let level = job.plan.levels.pixels.expect("a fit has pixels");
        let Some(RunResult { quality, factor, .. }) = RunResult::read(job) else { return Ok(None) };
        for (layer, maps) in layers.iter_mut().enumerate() {
            *maps = shown(job, &level, maps, layer);
        }
        (self.is_compared, self.is_scaled) = (true, true);
        // Where the model leaves much, rises tell of that, not of the steps.
        self.step = if quality.model_error() <= MOST_ERROR { factor } else { 1.0 };
        Ok(Some(quality))
    }

    /// What gives a run the scale of its albedos. With many batches one is enough: rendering all pairs would take longer than the
    /// iterations.
    fn scaled_by(&mut self) -> Result<ScaledBy> {
        let Fit { planned, energies, is_scaled, .. } = self;
        let job = planned.made()?;
        let level = job.plan.levels.pixels.expect("a fit has pixels");
        let (level, energy) = match &job.plan.levels.batches {
            all if all.len() > FEW => (all[0], energies[0]),
            _ => (level, job.light()[1]),
        };
        Ok(ScaledBy { level, energy, is_near: *is_scaled })
    }

    /// Queues what places the pixels of `layers` for a run that begins with iteration `begin`. Overwrites the trace from that row on,
    /// two rows. How many pixels each layer has; `None` without pixels.
    fn place(
        &mut self,
        layers: &[Maps],
        run: Run,
        begin: usize,
        scaled_by: ScaledBy,
    ) -> Result<Option<[usize; 2]>> {
        let Fit { planned, options, step, .. } = self;
        let job = planned.made()?;
        let level = job.plan.levels.pixels.expect("a fit has pixels");
        let pixels = Pixels::of(layers, needs::pixels(&job.plan));
        (self.pixels, self.is_compared) = (pixels.len(), false);
        if pixels.is_empty() {
            return Ok(None);
        }
        let unplaced = Unplaced {
            pixels: pixels.len(),
            brightest: f64::from(pixels.albedo.iter().fold(0.0f32, |a, b| a.max(*b))),
            energies: [job.light()[1], scaled_by.energy],
            known: run.known,
            before: run.level,
            skipped: run.skipped,
        };
        let weights = unplaced.weights(&job.model, &level, options, run.all(), *step);
        let [x, y, _] = level.grid.n;
        let heights: Vec<[f32; 2]> = pixels.depth.iter().zip(&pixels.albedo).map(|(z, a)| [*z, *a]).collect();
        job.add(buffer::SURFACE_WEIGHTS, bytemuck::cast_slice(&weights))?;
        job.add(buffer::PIXELS, bytemuck::cast_slice(&pixels.columns))?;
        job.add(buffer::PIXEL_OF, bytemuck::cast_slice(&pixels.places(x * y)))?;
        job.add(buffer::HEIGHTS, bytemuck::cast_slice(&heights))?;
        job.queue(|s, plan| {
            s.stage("surface", &stage_values(&level, begin));
            start(s, plan, &level, pixels.len(), needs::points_of(plan));
            match run.known {
                Some(_) => place_known(s, plan, &level, pixels.len()),
                // Far from it the scale is a small difference of large numbers, and only a guess.
                None => (usize::from(scaled_by.is_near)..2).for_each(|turn| {
                    place(s, plan, [&level, &scaled_by.level], pixels.len(), begin, turn == 0);
                }),
            }
        });
        Ok(Some(pixels.of_layers(layers[0].albedo.len())))
    }
}

/// What a surface leaves of pairs.
pub(crate) struct Residuals {
    /// The pair of the capture for each row.
    pub pairs: Vec<usize>,
    pub bins: usize,
    /// What is rendered less what is measured, and what is measured, `[pair * bins + bin]`.
    pub differences: Vec<f32>,
    pub measured: Vec<f32>,
    /// Path at which the first bin begins, and width of a bin, metres.
    pub path: [f64; 2],
}

/// What gives the scale of albedos.
struct ScaledBy {
    /// Pairs whose light does, and the data term of their measurement.
    level: Level,
    energy: f64,
    /// Whether the albedos are near it already.
    is_near: bool,
}

/// What the kernels found in a run.
struct RunResult {
    /// Factor of the albedos that were given.
    scale: f64,
    /// Of the best state.
    quality: Quality,
    /// Length of the next steps as a share of the longest ones.
    factor: f64,
}

impl RunResult {
    /// From the block that the run left for the host; `None` if the pixels explain no light.
    fn read(job: &mut OnDevice) -> Option<RunResult> {
        let [noise, energy] = job.light();
        let words: Vec<f32> = job.executor.read(WEIGHTS_HOST, ..SURFACE_WEIGHTS as usize);
        let [scale, left, factor] =
            [SURFACE_SCALE, SURFACE_BEST_LEFT, SURFACE_FACTOR].map(|index| f64::from(words[index as usize]));
        let quality = Quality { noise, energy, left: left * energy };
        (scale > 0.0).then_some(RunResult { scale, quality, factor })
    }
}

/// Adds what runs exchange with the host: one submission takes the pixels with the counts.
pub(super) fn share_with_host(plan: &mut Plan) {
    let weights = u64::from(SURFACE_WEIGHTS) * 4;
    for (buffer, bytes) in [(BEHIND_HOST, plan.bytes_of(COLUMNS_HOST)), (WEIGHTS_HOST, weights)] {
        plan.buffers.push(BufferPlan::new(buffer, bytes, Place::Readback));
    }
    let pixels = needs::uploaded(plan);
    plan.buffers.iter_mut().filter(|b| b.buffer == UPLOAD).for_each(|b| b.bytes += pixels);
}

/// Renders the pairs of `level` that judge a fit, and leaves the residual for the host.
fn residual(s: &mut Schedule, plan: &Plan, level: &Level, count: usize) {
    render(s, plan, level, count, &RESIDUAL);
    s.copy(buffer::RESIDUAL, RESIDUAL_HOST, plan.cells_at(level) as u64 * 4);
}

/// Leaves for the host: the residual of the pairs that judge the present state, the state as maps of each layer, and what the fit
/// knows of itself.
fn result(s: &mut Schedule, plan: &Plan, judge: Judge, level: &Level, of_layers: [usize; 2]) {
    if let Some(judging) = judging(plan, judge) {
        residual(s, plan, judging, of_layers.iter().sum());
    }
    maps_stage(s, level);
    let layers = if of_layers[1] > 0 { 2 } else { 1 };
    for (layer, to) in [COLUMNS_HOST, BEHIND_HOST].into_iter().enumerate().take(layers) {
        s.fill(buffer::COLUMNS, plan.bytes_of(buffer::COLUMNS), 0);
        extracted(s, level, of_layers, layer, to);
    }
    s.copy(buffer::SURFACE_WEIGHTS, WEIGHTS_HOST, u64::from(SURFACE_WEIGHTS) * 4);
}

/// Leaves the maps with a layer for the host.
fn extracted(s: &mut Schedule, level: &Level, of_layers: [usize; 2], layer: usize, to: Buffer) {
    extract(s, level, of_layers, layer);
    s.copy(buffer::COLUMNS, to, (level.grid.n[0] * level.grid.n[1]) as u64 * 32);
}

/// The maps that [`result`] left of a layer; pixels without a surface keep what `maps` has.
fn shown(job: &OnDevice, level: &Level, maps: &Maps, layer: usize) -> Maps {
    let mut all = columns(maps);
    let found = columns_of(&job.executor, [COLUMNS_HOST, BEHIND_HOST][layer], &level.grid);
    all.iter_mut().zip(found).filter(|(_, found)| found[3] > 0.0).for_each(|(column, found)| *column = found);
    maps_of(&all, &level.grid, true)
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

/// Sets to zero what sums begin with.
pub(crate) fn cleared(s: &mut Schedule, plan: &Plan) {
    for cleared in [buffer::COUNTS, buffer::HISTOGRAMS] {
        s.fill(cleared, plan.bytes_of(cleared), 0);
    }
}

/// A run of iterations of given pixels as the driver sees it. Maps on the way show the first layer.
#[derive(Clone, Copy)]
struct PlacedRun {
    run: Run,
    /// Iterations of the whole solve before it.
    begin: usize,
    level: Level,
    /// The pairs of an iteration.
    pairs: Level,
    /// Pixels of each layer.
    of_layers: [usize; 2],
    judge: Judge,
    /// It begins with what places its pixels.
    is_whole: bool,
}

impl PlacedRun {
    fn of(plan: &Plan, run: Run, begin: usize, of_layers: [usize; 2], judge: Judge) -> PlacedRun {
        let level = plan.levels.pixels.expect("a fit has pixels");
        let pairs = plan.batch(0).copied().unwrap_or(level);
        PlacedRun { run, begin, level, pairs, of_layers, judge, is_whole: false }
    }

    /// A fit of all pixels that there is room for.
    fn whole(plan: &Plan, iterations: usize) -> PlacedRun {
        let begin = plan.demand.iterations[0];
        let run = Run::of(iterations, begin + iterations);
        PlacedRun { is_whole: true, ..PlacedRun::of(plan, run, begin, [needs::pixels(plan), 0], Judge::None) }
    }

    fn iterations(&self) -> Range<usize> {
        self.begin..self.begin + self.run.iterations
    }

    fn count(&self) -> usize {
        self.of_layers.iter().sum()
    }

    /// What is judged when `done` iterations of the whole solve are done: those since the last comparison.
    fn judged(&self, done: usize) -> Judged {
        let own = done - self.begin;
        let before = own.saturating_sub(1) / CHECK * CHECK;
        let first = if before == 0 { JUDGE_FIRST } else { 0 };
        Judged { iterations: [self.begin + before, done], at: self.run.skipped + own, flags: first }
    }
}

impl Iterate for PlacedRun {
    fn levels(&self) -> &[Level] {
        std::slice::from_ref(&self.pairs)
    }

    fn start(&self, s: &mut Schedule, plan: &Plan) {
        if self.is_whole {
            start(s, plan, &self.level, self.count(), needs::points_of(plan));
        }
    }

    fn iteration(&self, s: &mut Schedule, plan: &Plan, _: &Level, i: usize) {
        let own = i - self.begin;
        iteration(s, plan, &self.level, self.count(), [i, self.run.skipped + own, self.run.all()]);
        if (own + 1).is_multiple_of(CHECK) && own + 1 < self.run.iterations {
            check(s, plan, &self.level, self.count(), self.judged(i + 1));
        }
    }

    fn last(&self, s: &mut Schedule, plan: &Plan, done: usize) {
        let PlacedRun { begin, run, .. } = *self;
        if done > begin {
            let judged = self.judged(done);
            // A run that is late ends after a comparison or between two.
            let is_judged = (done - begin).is_multiple_of(CHECK) && done - begin < run.iterations;
            let from = if is_judged { done } else { judged.iterations[0] };
            let judged = Judged { iterations: [from, done], flags: judged.flags | JUDGE_LAST, ..judged };
            check(s, plan, &self.level, self.count(), judged);
        }
        result(s, plan, self.judge, &self.level, self.of_layers);
    }

    fn extract(&self, s: &mut Schedule, level: &Level) {
        extracted(s, level, self.of_layers, 0, COLUMNS_HOST);
    }

    fn has_maps(&self) -> bool {
        false
    }

    fn passes(&self) -> &'static [&'static Pass] {
        passes::ALL
    }

    fn of(&self) -> usize {
        self.run.of
    }

    fn until(&self) -> Option<Instant> {
        self.run.until
    }
}

/// The schedules of a fit of all pixels that there is room for.
pub(super) fn outline(plan: &Plan) -> Vec<TimedSchedule> {
    let [begin, iterations] = plan.demand.iterations;
    outline::of("surface", plan, &PlacedRun::whole(plan, iterations), begin..begin + iterations)
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
