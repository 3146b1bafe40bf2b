//! The solver, prepared for captures of one scan: the volume and the surface.

use std::sync::Arc;
use std::time::Instant;

use super::follow::{self, Follow, Pace, rate};
use super::frames::{ForFrames, Frames};
use super::{
    VectorOptions, albedo_of, iteration, make_ready, outline_of, solve_volume, steps, stop_below, take,
};
use crate::advice::{Remedy, advice};
use crate::capture::Capture;
use crate::gpu::caller::{Lent, Moment};
use crate::gpu::{Gpu, Schedule};
use crate::maps::Maps;
use crate::solve::drive::{Driven, Steps, Watch, drive};
use crate::solve::estimate::energy;
use crate::solve::intake::{self, LentCounts};
use crate::solve::on_device::trace_rows;
use crate::solve::prepared::Planned;
use crate::solve::result::finish;
use crate::solve::surface::{self, Beginning, Continuation};
use crate::solve::{
    Beside, OnDevice, Plan, Prepared, Problem, Reconstruction, TracePoint, domain, outline, passes,
};
use crate::transport::Rows;
use crate::transport::kernels::*;
use crate::{Error, Result};

/// Prepares the solver for captures of one scan. Takes the arguments of [`super::reconstruct`]; the capture's counts may
/// be left out.
///
/// # Errors
/// Options, scan or device do not allow the solve.
pub fn prepare(gpu: &Gpu, problem: &Problem<'_>, options: &VectorOptions) -> Result<impl Prepared + use<>> {
    prepare_for_frames(gpu, problem, options, Frames::default())
}

/// As [`prepare`], for frames of a session.
///
/// # Errors
/// As [`prepare`].
pub fn prepare_for_frames(
    gpu: &Gpu,
    problem: &Problem<'_>,
    options: &VectorOptions,
    frames: Frames,
) -> Result<impl Prepared + use<>> {
    options.check()?;
    let Problem { capture, grid, memory, with_volume } = *problem;
    let how = frames.follow;
    how.map(|how| how.check(options)).transpose()?;
    let (outline, rows) = outline_of(capture, &grid, options);
    let needs = ForFrames(options, frames);
    let plan = Plan::new(&outline, grid, capture.resolution(), &needs, &gpu.abilities(), with_volume)?
        .within(&needs, &gpu.memory(), memory)?;
    if (how.is_some() || frames.lent.is_some()) && plan.division.cut.is_some() {
        return Err(Error::memory(
            "frames that follow each other, or lie in a caller's buffer, need all pairs on the device at once: they fit only in parts",
            advice!["allow more with " Memory ", use " {Remedy::SMALLER_JOB} ", or leave both out"],
        ));
    }
    let planned = Planned::new(gpu, outline, plan, memory);
    let following = how.map(|how| Chain { how, pace: Pace::default(), last: None });
    Ok(PreparedVector { planned, rows, options: options.clone(), with_volume, following })
}

struct PreparedVector {
    planned: Planned,
    rows: Rows,
    options: VectorOptions,
    with_volume: bool,
    /// If frames follow each other.
    following: Option<Chain>,
}

/// Frames that follow each other.
struct Chain {
    how: Follow,
    pace: Pace,
    /// What the next one begins with; `None`: it begins cold.
    last: Option<Last>,
}

/// What a frame leaves for the next, beside the state on the device.
struct Last {
    /// What the counts were multiplied by.
    scale: f64,
    /// The volume's data term at the end.
    left: f64,
    /// The maps, and those of the volume before the surface.
    maps: Maps,
    volume: Maps,
}

impl Prepared for PreparedVector {
    fn plan(&self) -> &Arc<Plan> {
        self.planned.plan()
    }

    fn allocate(&mut self) -> Result<()> {
        let PreparedVector { planned, options, rows, following, .. } = self;
        let OnDevice { plan, executor, model, .. } = planned.made(|job| make_all_ready(job, rows))?;
        let mut reserve = |schedule: &Schedule| executor.reserve(schedule);
        outline::each(plan, &steps(plan, options), 0..options.iterations, &mut reserve)?;
        surface::each(plan, &options.surface, &mut reserve)?;
        if following.is_some() {
            follow::each(plan, options, model, &mut reserve)?;
        }
        if plan.demand.lent.is_some() {
            intake::each(plan, rows, &mut reserve)?;
        }
        Ok(())
    }

    fn solve(&mut self, capture: &Capture, beside: Beside<'_, '_>) -> Result<Reconstruction> {
        let Beside { watch, lent } = beside;
        let mut counts = Counts { capture, lent };
        if self.following.is_none() {
            return self.cold(&mut counts, watch);
        }
        let begun = Instant::now();
        // After an error the state on the device is no frame's: the next one begins cold.
        let last = self.following.as_mut().and_then(|f| f.last.take());
        if let Some(last) = last
            && let Some(done) = self.warm(&mut counts, watch, last, begun)?
        {
            return Ok(done);
        }
        self.cold(&mut counts, watch)
    }

    fn give(&mut self, content: &[u8], to: &Lent, done: Option<Moment>) -> Result<()> {
        self.planned.give(content, to, done)
    }
}

/// The counts of a frame: in a caller's buffer, or the capture's.
struct Counts<'c> {
    capture: &'c Capture,
    lent: Option<&'c mut LentCounts>,
}

impl Counts<'_> {
    /// Takes them as the measurement of `job`, and uploads what is on the host.
    /// `scale`: see [`take`]. `keep`: a lent buffer is not given back yet. Returns the share of noise in the energy of lent counts.
    fn take(
        &mut self,
        job: &mut OnDevice,
        options: &VectorOptions,
        rows: &Rows,
        scale: Option<f64>,
        keep: bool,
    ) -> Result<Option<f64>> {
        match &mut self.lent {
            Some(lent) => intake::take(job, rows, lent, [options.background, keep], scale).map(Some),
            None => {
                take(self.capture, options, rows, &mut job.model, scale);
                Ok(None)
            }
        }
    }
}

/// Uploads what every solve begins with, and which rows are the model's.
fn make_all_ready(job: &mut OnDevice, rows: &Rows) -> Result<()> {
    make_ready(job)?;
    if job.plan.demand.lent.is_some() { intake::upload_rows(job, rows) } else { Ok(()) }
}

impl PreparedVector {
    /// Solves from the beginning.
    fn cold(&mut self, counts: &mut Counts<'_>, watch: &mut Watch<'_>) -> Result<Reconstruction> {
        let begun = Instant::now();
        let PreparedVector { planned, rows, options, with_volume, following, .. } = self;
        let gpu = planned.gpu().clone();
        let job = planned.made(|job| make_all_ready(job, rows))?;
        let noise = counts.take(job, options, rows, None, false)?;
        if noise.is_none() {
            job.upload_counts()?;
        }
        let budget = following.as_ref().and_then(|f| f.how.budget);
        let share = following.as_ref().map_or(1.0, |f| f.pace.share(budget));
        let shortened = shortened(options, share, job.plan.levels.volume.len());
        let options = shortened.as_ref().unwrap_or(options);
        let until = |share: f64| budget.map(|b| begun + b.mul_f64(share));
        let mut driven = solve_volume(&gpu, job, options, watch, until(VOLUME))?;
        let volume_iterations = driven.trace.last().map_or(0, |p| p.iteration);
        let volume = following.is_some().then(|| (Volume::of(job, &driven), rate_at_end(&driven.trace)));
        let mut surface_left = false;
        if options.surface.iterations > 0 {
            let refined = surface::refine(&gpu, job, &options.surface, watch, driven, Beginning::Volume)?;
            (driven, surface_left) = (refined.driven, refined.left);
        }
        if let (Some(chain), Some((volume, volume_rate))) = (following, volume) {
            let share = options.iterations as f64 / self.options.iterations as f64;
            chain.pace.learn_cold(share, begun.elapsed().as_secs_f64());
            let of_surface = &driven.trace[volume.points.min(driven.trace.len())..];
            chain.pace.learn_rates([volume_rate, rate(of_surface)]);
            chain.last = volume.is_whole.then(|| Last {
                scale: 1.0 / job.model.counts_per_unit,
                left: volume.left,
                maps: driven.maps.clone(),
                volume: volume.maps,
            });
        }
        Ok(Reconstruction {
            volume_iterations,
            surface_left,
            has_mask: false,
            noise,
            ..finish(job, driven, with_volume.then_some(albedo_of))?
        })
    }

    /// Solves from where the last frame ended; `None` if the scene is another one. Begun at `begun`.
    fn warm(
        &mut self,
        counts: &mut Counts<'_>,
        watch: &mut Watch<'_>,
        last: Last,
        begun: Instant,
    ) -> Result<Option<Reconstruction>> {
        let PreparedVector { planned, rows, options, with_volume, following, .. } = self;
        let Some(Chain { how, pace, last: next }) = following else { return Ok(None) };
        let options = &*options;
        let gpu = planned.gpu().clone();
        let job = planned.made(make_ready)?;
        let noise = counts.take(job, options, rows, Some(last.scale), true)?;
        if noise.is_none() {
            job.upload_counts()?;
        }
        let level = *job.plan.finest();
        job.executor.run_once(|s| follow::look(s, &job.plan, &level, options))?;
        let driven = looked(job, &last.maps, begun);
        let change = follow::change(data_term(job, 0), last.left, energy(job.model_of(&level), level.pairs));
        if change.is_nan() || change > how.cut_above {
            return Ok(None);
        }
        if let Some(lent) = &mut counts.lent {
            lent.release(&gpu)?;
        }
        let [volume_iterations, surface_iterations] = pace.iterations(how.budget, how.wanted(options));
        let until = |share: f64| how.budget.map(|b| begun + b.mul_f64(share));
        let scene = job.model_of(&level).scene_of(&level.grid, level.pairs);
        let above = how.grow_above;
        let steps = Steps {
            levels: vec![level],
            start: Box::new(move |s, plan| follow::grow(s, plan, &level, options, &scene, above)),
            iteration: Box::new(|s, plan, level, i| iteration(s, plan, level, i as u32)),
            due: Box::new(|_, _, _, _| ()),
            extract: Box::new(domain::extract),
            passes: [passes::ALL, super::passes::ALL],
            l1_weight: Box::new(|_| 1.0),
            of: 1 + volume_iterations + surface_iterations,
            after: vec![],
            stop_below: stop_below(options),
            shrinks: true,
            until: until(VOLUME),
        };
        let mut driven = drive(&gpu, job, 1 + volume_iterations, steps, watch, Some(driven))?;
        let volume = Volume::of(job, &driven);
        let mut surface_left = false;
        if surface_iterations > 0 {
            let mut of_surface = options.surface.clone();
            of_surface.iterations = surface_iterations;
            let on =
                Beginning::Frame(Continuation { maps: &last.maps, volume: &last.volume, until: until(1.0) });
            let refined = surface::refine(&gpu, job, &of_surface, watch, driven, on)?;
            (driven, surface_left) = (refined.driven, refined.left);
        }
        let [of_volume, of_surface] = {
            let (volume, surface) = driven.trace.split_at(volume.points.min(driven.trace.len()));
            // The first point is that of the look, and growing is behind it.
            [rate(&volume[1..]), rate(surface)]
        };
        pace.learn_rates([of_volume, of_surface]);
        let done = driven.trace.last().map_or(0, |p| p.iteration);
        let iterations = [volume.iterations - 1, done - volume.iterations];
        pace.learn_warm(iterations, begun.elapsed().as_secs_f64());
        *next = Some(Last { left: volume.left, maps: driven.maps.clone(), volume: volume.maps, ..last });
        Ok(Some(Reconstruction {
            volume_iterations: volume.iterations,
            surface_left,
            has_mask: false,
            is_warm: true,
            noise,
            ..finish(job, driven, with_volume.then_some(albedo_of))?
        }))
    }
}

/// The share of a frame's time by which the volume must end; the rest is the surface's.
const VOLUME: f64 = 0.7;

/// What a volume's run leaves, before a surface uses the trace.
struct Volume {
    iterations: usize,
    /// Points of the trace.
    points: usize,
    /// Its data term at the end.
    left: f64,
    /// Whether it reached the finest grid with all pairs.
    is_whole: bool,
    /// Its maps.
    maps: Maps,
}

impl Volume {
    fn of(job: &OnDevice, driven: &Driven) -> Volume {
        let iterations = driven.trace.last().map_or(0, |p| p.iteration);
        Volume {
            iterations,
            points: driven.trace.len(),
            left: if iterations > 0 { data_term(job, iterations - 1) } else { f64::NAN },
            is_whole: iterations > 0 && driven.level == *job.plan.finest(),
            maps: driven.maps.clone(),
        }
    }
}

/// The data term in row `row` of the trace.
fn data_term(job: &OnDevice, row: usize) -> f64 {
    f64::from(f32::from_bits(trace_rows(job, row..row + 1)[0][TRACE_OBJECTIVE as usize]))
}

/// Seconds of an iteration at the last level, by the trace of a volume.
fn rate_at_end(trace: &[TracePoint]) -> Option<f64> {
    let last = trace.last()?;
    let same = trace.iter().rposition(|p| (p.lateral, p.pairs) != (last.lateral, last.pairs));
    rate(&trace[same.map_or(0, |before| before)..])
}

/// What the look at a new frame tells: the first point of its trace, which is no step. `maps` are those of the last frame.
fn looked(job: &OnDevice, maps: &Maps, begun: Instant) -> Driven {
    let row = trace_rows(job, 0..1)[0];
    let value = |index: u32| f64::from(f32::from_bits(row[index as usize]));
    let (level, active) = (*job.plan.finest(), row[TRACE_ACTIVE as usize] as usize);
    let point = TracePoint {
        iteration: 1,
        seconds: begun.elapsed().as_secs_f64(),
        gpu_seconds: 0.0,
        lateral: level.grid.n[0],
        pairs: level.pairs,
        active,
        active_ratio: active as f64 / level.grid.voxels() as f64,
        loss: value(TRACE_OBJECTIVE),
        data_loss: value(TRACE_DATA),
    };
    let pairs = (active * level.rendered.count) as u64;
    Driven { trace: vec![point], pairs, seconds: point.seconds, ..Driven::begun(maps.clone(), level) }
}

/// The options with a `share` of their iterations; `None` if that is all of them. A solve with `levels` levels reaches the
/// last one.
fn shortened(options: &VectorOptions, share: f64, levels: usize) -> Option<VectorOptions> {
    if share >= 1.0 {
        return None;
    }
    let part = |n: usize, least: usize| ((share * n as f64) as usize).max(least);
    Some(options.clone().with(|o| {
        o.iterations = part(o.iterations, 2 * levels).min(options.iterations);
        o.growth_iterations = part(o.growth_iterations, levels);
        o.domain.coarse_iterations = part(o.domain.coarse_iterations, 1);
        o.domain.reduce_every = part(o.domain.reduce_every, 2);
        o.bound_every = 3 * o.domain.reduce_every;
        o.surface.iterations = part(o.surface.iterations, o.surface.iterations.min(1));
    }))
}
