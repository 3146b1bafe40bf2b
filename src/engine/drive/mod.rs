//! Drives a solver: submits its schedules block by block, reads the trace of finished blocks, and extracts maps on the
//! way.

use std::collections::VecDeque;
use std::ops::Range;
use std::time::Instant;

use super::on_device::{Lists, OnDevice, read_maps};
use crate::engine::plan::{Level, passes};
use crate::gpu::{Gpu, Schedule, Ticket};
use crate::maps::Maps;
use crate::transport::kernels::buffer;
use crate::{Error, Kind, Result};

mod ahead;
mod clock;
mod iterate;
mod reader;
mod watch;
mod whole;

use ahead::Ahead;
use clock::Clock;
pub(crate) use iterate::Iterate;
use reader::Reader;
pub use watch::{Doing, OnProgress, Progress, TracePoint, Watch};
pub(crate) use whole::{read_whole, submit_whole};

/// The result of driving a solver.
pub(crate) struct Driven {
    pub trace: Vec<TracePoint>,
    /// Those of the run before where this one was to leave none ([`Steps::has_maps`]).
    pub maps: Maps,
    /// The level that the last iteration ran at.
    pub level: Level,
    /// Active voxels times pairs, summed over iterations.
    pub pairs: u64,
    pub seconds: f64,
    /// Seconds of device time among them.
    pub gpu_seconds: f64,
}

impl Driven {
    /// Maps that an earlier run left at `level`, for what follows them.
    pub fn begun(maps: Maps, level: Level) -> Driven {
        Driven { trace: vec![], maps, level, pairs: 0, seconds: 0.0, gpu_seconds: 0.0 }
    }
}

/// Submissions in flight, so that the device never waits for the host.
const IN_FLIGHT: usize = 2;

/// Runs `steps` up to iteration `iterations`, from the first one or from the end of `before`.
///
/// # Errors
/// The device fails, the watch cancels ([`Kind::Cancelled`]), or a loss is not finite.
pub(crate) fn drive(
    gpu: &Gpu,
    device: &mut OnDevice,
    iterations: usize,
    steps: &dyn Iterate,
    watch: &mut Watch<'_>,
    before: Option<Driven>,
) -> Result<Driven> {
    let mut run = RunningSolve::begin(gpu, device, steps, watch, before)?;
    run.iterations = iterations;
    // A point for every block at most.
    run.reader.trace.reserve(iterations.saturating_sub(run.first));
    for i in run.first..iterations {
        run.add(i);
        if run.block_ends(i + 1) && (run.submit(i + 1)? || run.cancelled.is_some()) {
            break;
        }
    }
    match run.cancelled {
        Some(after) => {
            let what = format!("cancelled by the caller after {after} iterations");
            Err(Error::new(Kind::Cancelled, what, "run it again"))
        }
        None => run.end(),
    }
}

/// A solve that is running.
struct RunningSolve<'r, 'w> {
    gpu: &'r Gpu,
    device: &'r mut OnDevice,
    steps: &'r dyn Iterate,
    watch: &'r mut Watch<'w>,
    iterations: usize,
    clock: Clock,
    reader: Reader,
    flights: VecDeque<SubmittedBlock>,
    /// Blocks that are done and not yet reported, with the seconds of host and device by then.
    back: Vec<(SubmittedBlock, [f64; 2])>,
    /// The first iteration of the next block ([`Lists::block`]).
    block_from: usize,
    /// The first iteration of this run, and its level.
    first: usize,
    first_level: usize,
    /// Levels of the next iteration and of the last one.
    level: usize,
    level_before: usize,
    /// The level of the last submitted iteration.
    reached: Level,
    /// Active voxels in the last block that was read.
    active: usize,
    ahead: Option<Ahead>,
    /// What the watch heard last, with the seconds that remained.
    last: (TracePoint, Option<f64>),
    /// The iterations that the watch had heard of when it cancelled.
    cancelled: Option<usize>,
    /// The maps of the run before, if they stay.
    maps: Option<Maps>,
    /// What follows the last iteration is submitted.
    is_ended: bool,
}

/// A submitted block: its iterations, and the level that all of them run at.
struct SubmittedBlock {
    ticket: Ticket,
    rows: Range<usize>,
    level: Level,
}

impl<'r, 'w> RunningSolve<'r, 'w> {
    fn begin(
        gpu: &'r Gpu,
        device: &'r mut OnDevice,
        steps: &'r dyn Iterate,
        watch: &'r mut Watch<'w>,
        before: Option<Driven>,
    ) -> Result<RunningSolve<'r, 'w>> {
        let first_level = steps.levels()[0];
        // A run that failed may have left something.
        device.lists.block.clear();
        device.lists.change.clear();
        let mut run = RunningSolve {
            clock: Clock::start(device.executor.gpu_seconds()),
            gpu,
            device,
            steps,
            watch,
            cancelled: None,
            iterations: 0,
            reader: Reader::default(),
            flights: VecDeque::new(),
            back: vec![],
            block_from: 0,
            first: 0,
            first_level: 0,
            level: 0,
            level_before: 0,
            reached: first_level,
            // At first every voxel may be active.
            active: first_level.grid.voxels(),
            ahead: None,
            last: (TracePoint::before(&first_level.grid, first_level.pairs), None),
            maps: None,
            is_ended: false,
        };
        run.start(before);
        run.reached = run.steps.levels()[run.level];
        (run.first_level, run.level_before) = (run.level, run.level);
        Ok(run)
    }

    /// Begins with the start schedule, after `before` if it is given.
    fn start(&mut self, before: Option<Driven>) {
        if let Some(Driven { trace, maps, pairs, seconds, gpu_seconds, .. }) = before {
            self.maps = Some(maps).filter(|_| !self.steps.has_maps());
            if let Some(last) = trace.last() {
                (self.first, self.active, self.last.0) = (last.iteration, last.active, *last);
            }
            self.block_from = self.first;
            self.reader = Reader { trace, pairs };
            self.clock.resume_from([seconds, gpu_seconds]);
        }
        let OnDevice { plan, queue, lists: Lists { block, .. }, .. } = &mut *self.device;
        queue.move_into(block);
        block.stage("start", &stage_values(&self.steps.levels()[self.level], self.first));
        self.steps.start(block, plan);
    }

    /// Adds iteration `i` to the block, and finds what is due after it.
    fn add(&mut self, i: usize) {
        let here = self.steps.levels()[self.level];
        let OnDevice { plan, lists: Lists { block, change, .. }, .. } = &mut *self.device;
        if !change.commands.is_empty() {
            block.stage("domain", &stage_values(&here, i));
            block.append(change);
        }
        block.stage("iteration", &stage_values(&here, i));
        self.steps.iteration(block, plan, &here, i);
        self.level_before = self.level;
        if i + 1 < self.iterations {
            self.steps.due(change, plan, &mut self.level, i + 1);
        } else {
            self.steps.last(block, plan, i + 1);
            self.is_ended = true;
        }
    }

    /// Whether the maps are asked for after `done` iterations.
    fn is_measured(&self, done: usize) -> bool {
        self.watch.maps_every.is_some_and(|n| done.is_multiple_of(n)) || self.watch.maps_at.contains(&done)
    }

    /// Whether the block ends after `done` iterations. A change of the level ends it, so that all its rows belong to
    /// one level.
    fn block_ends(&self, done: usize) -> bool {
        let pairs = self.active * self.steps.levels()[self.level_before].pairs;
        done == self.iterations
            || self.is_measured(done)
            || !self.device.lists.change.commands.is_empty()
            || done - self.block_from >= block_length(self.gpu, pairs, self.steps.until().is_some())
    }

    /// Submits the block, which ends after `done` iterations, and reads the blocks before it. Returns whether the run
    /// is late.
    fn submit(&mut self, done: usize) -> Result<bool> {
        let Some(ticket) = self.submit_block()? else { return Ok(true) };
        self.reached = self.steps.levels()[self.level_before];
        self.flights.push_back(SubmittedBlock { ticket, rows: self.block_from..done, level: self.reached });
        self.block_from = done;
        let measured = self.is_measured(done);
        let behind = if measured || done == self.iterations { 0 } else { IN_FLIGHT };
        // Waits first and calls the watch afterwards: the clock may stand still only with nothing in flight.
        while self.flights.len() > behind {
            let flight = self.flights.pop_front().expect("not empty");
            self.device.executor.wait(flight.ticket)?;
            self.back.push((flight, self.clock.now(self.device.executor.gpu_seconds())));
        }
        let pause = self.clock.pause();
        let gpu_pause = self.device.executor.gpu_seconds();
        let mut late = false;
        let mut back = std::mem::take(&mut self.back);
        for (flight, seconds) in back.drain(..) {
            if self.cancelled.is_none() {
                late |= self.hear(flight, seconds, measured.then_some(done))?;
            }
        }
        self.back = back;
        if self.flights.is_empty() {
            self.clock.resume(pause);
            self.clock.leave_out_gpu(self.device.executor.gpu_seconds() - gpu_pause);
        }
        Ok(late)
    }

    /// Submits the block; `None` if the watch cancels. An iteration of a volume may take minutes on the host's processors, so
    /// progress is reported within it there.
    fn submit_block(&mut self) -> Result<Option<Ticket>> {
        let RunningSolve { clock, watch, last: (last, left), steps, .. } = self;
        let mut hear = || {
            let seconds = clock.now(0.0)[0].max(last.seconds);
            let remaining = left.map(|left| (left - seconds + last.seconds).max(0.0));
            let point = TracePoint { seconds, ..*last };
            (watch.hear)(&Progress {
                doing: Doing::Solve,
                point,
                iterations: steps.of(),
                remaining,
                maps: None,
            })
        };
        let hear = steps.shrinks().then_some(&mut hear as _);
        let submitted = self.device.lists.submit(&mut self.device.executor, hear)?;
        if submitted.is_none() {
            self.cancelled = Some(self.last.0.iteration);
        }
        Ok(submitted)
    }

    /// Reads the trace of a finished block and tells the watch, with the maps if they are asked for after its last
    /// iteration. Returns whether the run is late.
    fn hear(&mut self, flight: SubmittedBlock, seconds: [f64; 2], measured: Option<usize>) -> Result<bool> {
        let point = self.read(&flight, seconds)?;
        self.active = point.active;
        let maps = match measured {
            Some(done) if point.iteration == done => Some(self.maps(&flight.level)?),
            _ => None,
        };
        // What is ahead is found when the first block is done: before it, the device would wait.
        let OnDevice { plan, lists: Lists { unused, .. }, .. } = &mut *self.device;
        let run = [self.first, self.first_level, self.iterations];
        let ahead = self.ahead.get_or_insert_with(|| Ahead::new(self.steps, plan, run, unused));
        let remaining = ahead.seconds(&point, self.reader.pairs);
        self.last = (point, remaining);
        let progress = Progress { doing: Doing::Solve, point, iterations: self.steps.of(), remaining, maps };
        let reported = progress.point.iteration;
        if (self.watch.hear)(&progress).is_break() {
            self.cancelled = Some(reported);
            return Ok(false);
        }
        let at_end = Some(&flight.level) == self.steps.levels().last();
        Ok(at_end && self.steps.until().is_some_and(|until| Instant::now() >= until))
    }

    fn read(&mut self, flight: &SubmittedBlock, seconds: [f64; 2]) -> Result<TracePoint> {
        let l1_weight = self.steps.l1_weight(&flight.level);
        let passes = &[passes::ALL, self.steps.passes()];
        // Blocks in flight write other rows.
        let OnDevice { executor, lists: Lists { rows, .. }, .. } = &mut *self.device;
        executor.read_behind(flight.ticket, buffer::TRACE, flight.rows.clone(), rows);
        self.reader.read(rows, flight.rows.clone(), &flight.level, l1_weight, passes, seconds)
    }

    /// The maps at a level. Waits for the device.
    fn maps(&mut self, level: &Level) -> Result<Maps> {
        self.device.run(|s, _| {
            maps_stage(s, level);
            self.steps.extract(s, level);
        })?;
        // A surface has the normals of its depths even where light does not depend on them.
        let plan = &self.device.plan;
        let has_normals = plan.scene.reflectance.has_normals() || plan.levels.pixels.is_some();
        Ok(read_maps(&self.device.executor, &level.grid, has_normals))
    }

    /// Waits for the blocks in flight and takes the result. Blocks that were in flight when the run was late are
    /// part of it.
    fn end(mut self) -> Result<Driven> {
        for flight in std::mem::take(&mut self.flights) {
            self.device.executor.wait(flight.ticket)?;
            let seconds = self.clock.now(self.device.executor.gpu_seconds());
            self.read(&flight, seconds)?;
        }
        if !self.is_ended {
            let done = self.reader.trace.last().map_or(self.first, |point| point.iteration);
            let OnDevice { plan, executor, lists: Lists { block, .. }, .. } = &mut *self.device;
            self.steps.last(block, plan, done);
            executor.run(block)?;
            block.clear();
        }
        let reached = self.reached;
        let maps = self.maps.take().map_or_else(|| self.maps(&reached), Ok)?;
        let [seconds, gpu_seconds] = self.clock.now(self.device.executor.gpu_seconds());
        let Reader { trace, pairs } = self.reader;
        Ok(Driven { trace, maps, level: reached, pairs, seconds, gpu_seconds })
    }
}

/// Begins the stage that leaves the maps of a level.
pub(crate) fn maps_stage(s: &mut Schedule, level: &Level) {
    s.stage("maps", &[("lateral", level.grid.n[0] as u64)]);
}

/// The values of a stage for labels and timelines: the next iteration (from 0) and its level.
pub(crate) fn stage_values(level: &Level, iteration: usize) -> [(&'static str, u64); 3] {
    [("iteration", iteration as u64), ("lateral", level.grid.n[0] as u64), ("pairs", level.pairs as u64)]
}

/// Iterations of a block: about a fifth of a second of work at the rate of the device's kind. Progress moves, cancelling is
/// quick, and the device never waits for the host. The executor divides a block that takes longer. A run that must end in
/// time has blocks of a few iterations.
fn block_length(gpu: &Gpu, pairs_per_iteration: usize, must_end: bool) -> usize {
    let most = if must_end { 4.0 } else { 64.0 };
    (0.2 * gpu.expected_rate() / pairs_per_iteration.max(1) as f64).clamp(1.0, most) as usize
}
