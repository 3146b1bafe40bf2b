//! Drives a solver: submits its schedule block by block, reads the trace behind, measures on the way.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::checkpoint::{self, Checkpoint, Keep, Keeper};
use super::job::{Job, read_maps};
use super::{Level, Plan};
use crate::gpu::{DeviceKind, Gpu, Schedule, Ticket};
use crate::maps::Maps;
use crate::transport::kernels::*;
use crate::{Error, Kind, Result};

/// A point of the trace: the state after an iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePoint {
    /// Iterations done.
    pub iteration: usize,
    /// Seconds since solving began, without those spent on measuring.
    pub seconds: f64,
    /// Seconds of device time among them.
    pub gpu_seconds: f64,
    pub lateral: usize,
    /// Pairs that the iteration took; the losses are means over their bins.
    pub pairs: usize,
    pub active: usize,
    /// Active voxels over voxels of the grid at that resolution.
    pub active_ratio: f64,
    /// What the solver minimises.
    pub loss: f64,
    /// The mean over the bins of the squared difference, without any solver's weights or regularisation.
    pub data_loss: f64,
}

/// What a caller hears while the device works.
#[derive(Debug, Clone)]
pub struct Progress {
    pub point: TracePoint,
    pub iterations: usize,
    /// The maps after that iteration, if it is one that [`Watch`] asks for.
    pub maps: Option<Maps>,
    /// Of a quick solve before the one that was asked for.
    pub trial: bool,
}

/// What a caller wants to hear.
pub struct Watch<'w> {
    /// Told of every point of the trace; may break off.
    pub hear: &'w mut dyn FnMut(&Progress) -> ControlFlow<()>,
    /// Extract the maps after every so-manieth iteration. The device is idle then, and neither the extraction
    /// nor the time spent in `hear` counts. (Between such iterations `hear` runs beside a working device, so
    /// there is nothing to take off: what it hides would be the solver's own work.)
    pub maps_every: Option<usize>,
    /// And after these iterations.
    pub maps_at: &'w [usize],
}

/// What goes on beside a solve.
pub struct Beside<'b, 'w> {
    pub watch: &'b mut Watch<'w>,
    pub keep: Option<Keep<'b>>,
}

impl<'b, 'w> From<&'b mut Watch<'w>> for Beside<'b, 'w> {
    fn from(watch: &'b mut Watch<'w>) -> Beside<'b, 'w> {
        Beside { watch, keep: None }
    }
}

/// A solver as its driver sees it.
pub(super) struct Steps<'s> {
    /// What it runs at, in turn.
    pub levels: &'s [Level],
    /// Before the first iteration.
    pub start: Schedule,
    /// Iteration i (from 0) at a level.
    pub iteration: &'s dyn Fn(&Plan, &Level, usize) -> Schedule,
    /// What is due after so many iterations, before the next one; may move the level on.
    pub due: &'s dyn Fn(&Plan, &mut usize, usize) -> Schedule,
    /// Leaves the level's maps in `columns_host`.
    pub extract: &'s dyn Fn(&Level) -> Schedule,
    /// Weight of the trace's L1 column in the loss at a level.
    pub l1_weight: &'s dyn Fn(&Level) -> f64,
    /// Iterations that the whole solve is to have, for those who listen.
    pub of: usize,
    /// Stop at the finest level, with all pairs, once the objective's data term is not above this: the rest is noise.
    pub stop_below: Option<f64>,
}

/// What driving yields.
pub(super) struct Driven {
    pub trace: Vec<TracePoint>,
    pub maps: Maps,
    /// The level that the last iteration ran at.
    pub level: Level,
    /// Active voxels times pairs, summed over iterations.
    pub pairs: u64,
    pub seconds: f64,
    /// Seconds of device time among them.
    pub gpu_seconds: f64,
}

/// Runs `steps` up to the iteration `iterations`, from the first or after what was driven `before`. Two blocks are in
/// flight, so the device never waits for the host.
///
/// Errors: the device's; [`Kind::Cancelled`] if the watch broke off; a loss that is not finite.
pub(super) fn drive(
    gpu: &Gpu,
    job: &mut Job<'_>,
    iterations: usize,
    mut steps: Steps<'_>,
    watch: &mut Watch<'_>,
    mut keeper: Option<Keeper<'_>>,
    before: Option<Driven>,
) -> Result<Driven> {
    let gpu_before = job.executor.gpu_seconds();
    let has_normals = job.plan.reflectance.has_normals();
    let mut clock = Clock { start: Instant::now(), paused: Duration::ZERO, before: 0.0 };
    let mut reader = Reader { gpu_before, trace: vec![], pairs: 0 };
    let mut flights: VecDeque<(Ticket, std::ops::Range<usize>, Level)> = VecDeque::new();
    let mut block = Schedule::default();
    let (mut level, mut first, mut begin) = (0, 0, 0);
    let levels = steps.levels;
    // Known only behind: what the last block that was heard of had active. The first domain is all there is.
    let mut active = levels[0].grid.voxels();
    // What is due between the iteration before and the next.
    let mut change = Schedule::default();
    if let Some(from) = keeper.as_mut().and_then(|k| k.keep.from.take()) {
        checkpoint::restore(job, &from)?;
        (level, first, active, begin) = (from.level, from.first, from.active, from.iteration);
        let ticket = job.executor.submit(&Schedule::default())?;
        flights.extend(from.pending.iter().map(|[a, b, at]| (ticket, *a..*b, levels[*at])));
        change = (steps.due)(&job.plan, &mut level, begin);
        job.executor.wait(ticket)?;
        let gpu_before = job.executor.gpu_seconds() - from.gpu_seconds;
        reader = Reader { gpu_before, trace: from.trace, pairs: from.pairs };
        clock = Clock { start: Instant::now(), paused: Duration::ZERO, before: from.seconds };
    } else {
        if let Some(Driven { trace, pairs, seconds, gpu_seconds, .. }) = before {
            let last = trace.last().copied();
            begin = last.map_or(0, |p| p.iteration);
            first = begin;
            active = last.map_or(active, |p| p.active);
            reader = Reader { gpu_before: gpu_before - gpu_seconds, trace, pairs };
            clock.before = seconds;
        }
        block.stage("start", &stage_values(&levels[level], begin));
        block.extend(std::mem::take(&mut steps.start));
    }
    let mut reached = levels[level];
    let mut level_before = level;
    for i in begin..iterations {
        if let Some(keeper) = keeper.as_mut().filter(|k| i > begin && k.is_due(i)) {
            // The block goes on after this: what is read of it, and when, is as without a checkpoint.
            let ticket = job.executor.submit(&std::mem::take(&mut block))?;
            job.executor.wait(ticket)?;
            let pause = Instant::now();
            let _span = gpu.span("checkpoint");
            let number = |l: &Level| levels.iter().position(|k| k == l).unwrap_or(0);
            let pending = flights.iter().map(|(_, rows, at)| [rows.start, rows.end, number(at)]).collect();
            let (seconds, gpu_seconds) = (clock.seconds(), job.executor.gpu_seconds() - reader.gpu_before);
            let buffers = checkpoint::download(job)?;
            let (identity, trace, pairs) = (keeper.identity.clone(), reader.trace.clone(), reader.pairs);
            let (iteration, level) = (i, level_before);
            (keeper.keep.save)(Checkpoint {
                identity,
                iteration,
                level,
                first,
                active,
                pending,
                trace,
                pairs,
                seconds,
                gpu_seconds,
                buffers,
            })?;
            clock.paused += pause.elapsed();
        }
        let here = levels[level];
        if !change.commands.is_empty() {
            block.stage("domain", &stage_values(&here, i));
            block.extend(std::mem::take(&mut change));
        }
        block.stage("iteration", &stage_values(&here, i));
        block.extend((steps.iteration)(&job.plan, &here, i));
        let done = i + 1;
        let last = done == iterations;
        let measured =
            watch.maps_every.is_some_and(|n| done.is_multiple_of(n)) || watch.maps_at.contains(&done);
        // A change of the level ends a block, so that all its rows belong to one.
        level_before = level;
        if !last {
            change = (steps.due)(&job.plan, &mut level, done);
        }
        let changes = !change.commands.is_empty();
        if !(last || measured || changes || done - first >= block_length(gpu, active * here.pairs)) {
            continue;
        }
        let ticket = job.executor.submit(&std::mem::take(&mut block))?;
        flights.push_back((ticket, first..done, here));
        reached = here;
        first = done;
        let mut fitted = false;
        // Waits first and listens then, so that with nothing in flight the clock may stand still.
        let mut back = vec![];
        while flights.len() > if last || measured { 0 } else { 2 } {
            let (ticket, rows, at) = flights.pop_front().expect("not empty");
            job.executor.wait(ticket)?;
            back.push((rows, at, [clock.seconds(), job.executor.gpu_seconds()]));
        }
        let (pause, gpu_pause) = (Instant::now(), job.executor.gpu_seconds());
        for (rows, at, seconds) in back {
            let (point, objective) = reader.read(job, rows, &at, (steps.l1_weight)(&at), seconds)?;
            active = point.active;
            fitted |= Some(&at) == levels.last() && steps.stop_below.is_some_and(|s| objective <= s);
            let maps = (measured && point.iteration == done).then(|| {
                job.executor
                    .run(&maps_of(&steps, &at))
                    .map(|()| read_maps(&job.executor.arena, &at.grid, has_normals))
            });
            let progress = Progress { point, iterations: steps.of, maps: maps.transpose()?, trial: false };
            if (watch.hear)(&progress).is_break() {
                let what = format!("cancelled after {} iterations", point.iteration);
                return Err(Error::new(Kind::Cancelled, what, "run it again"));
            }
        }
        if flights.is_empty() {
            clock.paused += pause.elapsed();
            reader.gpu_before += job.executor.gpu_seconds() - gpu_pause;
        }
        if fitted {
            break;
        }
    }
    // What was under way when the fit was seen is part of the result.
    for (ticket, rows, at) in std::mem::take(&mut flights) {
        job.executor.wait(ticket)?;
        let seconds = [clock.seconds(), job.executor.gpu_seconds()];
        reader.read(job, rows, &at, (steps.l1_weight)(&at), seconds)?;
    }
    job.executor.run(&maps_of(&steps, &reached))?;
    let maps = read_maps(&job.executor.arena, &reached.grid, has_normals);
    let seconds = clock.seconds();
    let gpu_seconds = job.executor.gpu_seconds() - reader.gpu_before;
    Ok(Driven { trace: reader.trace, maps, level: reached, pairs: reader.pairs, seconds, gpu_seconds })
}

fn maps_of(steps: &Steps<'_>, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    s.stage("maps", &[("lateral", level.grid.n[0] as u64)]);
    s.extend((steps.extract)(level));
    s
}

/// What labels and traces tell of a stage: the next iteration (from 0) and the level it runs at.
pub(super) fn stage_values(level: &Level, iteration: usize) -> [(&'static str, u64); 3] {
    [("iteration", iteration as u64), ("lateral", level.grid.n[0] as u64), ("pairs", level.pairs as u64)]
}

/// Seconds since the start, less the pauses.
struct Clock {
    start: Instant,
    paused: Duration,
    /// Spent before this process went on from a checkpoint.
    before: f64,
}

impl Clock {
    fn seconds(&self) -> f64 {
        self.before + self.start.elapsed().saturating_sub(self.paused).as_secs_f64()
    }
}

/// Iterations of a submission: about a fifth of a second of work, so that progress moves and cancelling is
/// quick, yet the device never waits for the host.
fn block_length(gpu: &Gpu, pairs_per_iteration: usize) -> usize {
    let rate = if gpu.info.kind == DeviceKind::Cpu { 1e8 } else { 3e10 };
    (0.2 * rate / pairs_per_iteration.max(1) as f64).clamp(1.0, 50.0) as usize
}

struct Reader {
    gpu_before: f64,
    trace: Vec<TracePoint>,
    pairs: u64,
}

impl Reader {
    /// Reads the device's trace of some iterations, all run at `level`, and adds a point for the last; with it the
    /// objective's data term there.
    fn read(
        &mut self,
        job: &Job<'_>,
        iterations: std::ops::Range<usize>,
        level: &Level,
        l1_weight: f64,
        [seconds, gpu_seconds]: [f64; 2],
    ) -> Result<(TracePoint, f64)> {
        let rows: &[[u32; TRACE_ROW as usize]] = bytemuck::cast_slice(job.executor.arena.mapped("trace"));
        let voxels = level.grid.voxels();
        let (mut loss, mut data_loss, mut objective) = (0.0, 0.0, 0.0);
        let mut active = 0;
        for i in iterations.clone() {
            let row = rows[i];
            super::faults::check(&row, i + 1, job.plan.vectors)?;
            active = row[TRACE_ACTIVE as usize] as usize;
            data_loss = f64::from(f32::from_bits(row[TRACE_DATA as usize]));
            objective = f64::from(f32::from_bits(row[TRACE_OBJECTIVE as usize]));
            let l1 = f64::from(f32::from_bits(row[TRACE_L1 as usize]));
            loss = objective + l1_weight * l1;
            if !loss.is_finite() {
                return Err(Error::new(
                    Kind::Options,
                    format!("the loss is {loss} at iteration {}", i + 1),
                    "use smaller steps or weights (--learning-rate, --l1, --peak), and check the capture (`thirdbounce info`)",
                ));
            }
            self.pairs += (active * level.pairs) as u64;
        }
        let point = TracePoint {
            iteration: iterations.end,
            seconds,
            gpu_seconds: gpu_seconds - self.gpu_before,
            lateral: level.grid.n[0],
            pairs: level.pairs,
            active,
            active_ratio: active as f64 / voxels as f64,
            loss,
            data_loss,
        };
        self.trace.push(point);
        Ok((point, objective))
    }
}
