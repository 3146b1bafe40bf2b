//! The thread that solves the frames of a session, and what it shares with the callers.

use std::any::Any;
use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::ExternalFrame;
use super::external::Exchange;
use super::feed::{Feed, KeptCounts};
use super::latency::{Latencies, Latency};
use super::moving::{RunningRoom, Subtracted, subtract};
use super::options::{FrameId, SessionOptions, too_long};
use crate::capture::{Capture, RoomLight};
use crate::engine::{Prepared, Progress, Reconstruction, Watch};
use crate::gpu::Gpu;
use crate::gpu::external::TimelinePoint;
use crate::judge::{conclude, with_maps};
use crate::maps::Maps;
use crate::{Error, Kind, Result, Verdict, panic_message};

/// How often a frame that waits for its counts looks whether it was cancelled.
const LOOK: Duration = Duration::from_millis(20);

/// A solved frame: see [`super::Frame`].
pub(super) struct Solved {
    pub result: Reconstruction,
    pub left: Option<Arc<Capture>>,
}

/// What there is of the newest frame.
pub(super) enum Taken {
    /// Its result.
    Done(FrameId, Result<Box<Solved>>),
    /// It is being solved, or waits.
    NotYet,
    /// Nothing: the last result was taken, or there was no frame yet.
    Nothing,
}

/// A frame that waits.
struct Waiting {
    id: FrameId,
    counts: WaitingCounts,
    since: Instant,
}

enum WaitingCounts {
    Host(Vec<f32>),
    External(ExternalFrame),
}

struct State {
    feed: Feed,
    /// The last counts of every pair, or their sums, from when they are needed on.
    kept: Option<KeptCounts>,
    /// Pairs and bins.
    size: [usize; 2],
    /// Frames that wait, the oldest first.
    waiting: VecDeque<Waiting>,
    /// Memory for counts.
    spare: Vec<Vec<f32>>,
    /// The frame that the thread solves, and when it was submitted.
    solving: Option<(FrameId, Instant)>,
    /// The result of a frame, until it is taken.
    done: Option<(FrameId, Result<Box<Solved>>)>,
    /// The last frame's number.
    newest: FrameId,
    latencies: Latencies,
    /// The session is being dropped.
    closing: bool,
    /// Why no more frames are solved.
    broken: Option<Error>,
}

/// An empty list with memory for `count` counts. It was written once, so that the system gives it now, not when the
/// first frame comes.
fn touched(counts: usize) -> Vec<f32> {
    let mut list = vec![f32::NAN; counts];
    list.clear();
    list
}

/// What the thread shares with the callers.
pub(super) struct Shared {
    state: Mutex<State>,
    /// The state changed.
    changed: Condvar,
    /// Frames up to this number are cancelled.
    cancelled: AtomicU64,
}

impl Shared {
    /// For frames with these numbers of pairs and bins.
    pub fn new(pairs: usize, bins: usize, feed: Feed) -> Shared {
        Shared {
            state: Mutex::new(State {
                feed,
                kept: matches!(feed, Feed::Sum { .. }).then(|| KeptCounts::new([pairs, bins], feed)),
                size: [pairs, bins],
                waiting: VecDeque::with_capacity(2),
                // One frame is solved while the next is submitted.
                spare: (0..2).map(|_| touched(pairs * bins)).collect(),
                solving: None,
                done: None,
                newest: FrameId(0),
                latencies: Latencies::with_room(),
                closing: false,
                broken: None,
            }),
            changed: Condvar::new(),
            cancelled: AtomicU64::new(0),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Every change leaves a whole state, so a thread that panicked has damaged nothing.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives the thread a frame: the counts of the pairs that are `measured`, or of all. `scan` checks what they make.
    pub fn submit(&self, histograms: &[f32], measured: Option<&[bool]>, scan: &Capture) -> Result<FrameId> {
        let mut state = self.state();
        state.admit()?;
        let State { feed, size, kept, spare, .. } = &mut *state;
        if measured.is_some() || kept.is_some() {
            // What is kept must not take wrong counts. Dark ones it may, where they are a part of what is solved.
            match (*feed, measured) {
                (Feed::Sum { .. }, _) | (_, Some(_)) => scan.check_finite(histograms)?,
                _ => scan.check_counts(histograms)?,
            }
            kept.get_or_insert_with(|| KeptCounts::new(*size, *feed));
        }
        let mut counts = spare.pop().unwrap_or_default();
        counts.clear();
        let checked = match kept {
            None => scan.copy_checked(histograms, &mut counts),
            Some(kept) => {
                kept.take(histograms, measured);
                kept.give(&mut counts);
                scan.check_counts(&counts)
            }
        };
        if let Err(error) = checked {
            spare.push(counts);
            return Err(error);
        }
        let replaces = matches!(state.feed, Feed::Newest | Feed::Sum { .. });
        if let Some(old) = if replaces { state.waiting.pop_back() } else { None } {
            state.drop_frame(old);
        }
        let id = state.add(WaitingCounts::Host(counts));
        self.changed.notify_all();
        Ok(id)
    }

    /// Gives the thread a frame that lies in a caller's buffer.
    pub fn submit_external(&self, frame: ExternalFrame) -> Result<FrameId> {
        let mut state = self.state();
        state.admit()?;
        if let Some(old) = if state.feed == Feed::Newest { state.waiting.pop_back() } else { None } {
            state.drop_frame(old);
        }
        let id = state.add(WaitingCounts::External(frame));
        self.changed.notify_all();
        Ok(id)
    }

    /// Takes the result of a frame, if one is there by `end`, also of one that another thread submits meanwhile. Without an
    /// end, waits as long as it takes, if there is a frame.
    pub fn taken(&self, end: Option<Instant>) -> Taken {
        let mut state = self.state();
        loop {
            if let Some((id, result)) = state.done.take() {
                // The next one may wait for this.
                self.changed.notify_all();
                return Taken::Done(id, result);
            }
            let is_idle = state.solving.is_none() && state.waiting.is_empty();
            if state.broken.is_some() || is_idle && end.is_none() {
                return Taken::Nothing;
            }
            let left = end.map(|end| end.saturating_duration_since(Instant::now()));
            state = match left {
                None => self.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
                Some(Duration::ZERO) => return Taken::NotYet,
                Some(left) => {
                    self.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0
                }
            };
        }
    }

    /// Cancels the frame that is being solved, or the next one if none is.
    pub fn cancel(&self) {
        let state = self.state();
        let next = state.solving.map(|s| s.0).or(state.waiting.front().map(|w| w.id));
        if let Some(id) = next {
            self.cancelled.fetch_max(id.0, Relaxed);
        }
    }

    pub fn is_idle(&self) -> bool {
        let state = self.state();
        state.solving.is_none() && state.waiting.is_empty()
    }

    /// How long frames take.
    pub fn latency(&self) -> Latency {
        self.state().latencies.reported()
    }

    /// Ends the thread.
    pub fn close(&self) {
        self.state().closing = true;
        self.cancelled.store(u64::MAX, Relaxed);
        self.changed.notify_all();
    }

    pub(super) fn is_cancelled(&self, id: FrameId) -> bool {
        id.0 <= self.cancelled.load(Relaxed)
    }

    /// Waits for a frame, and puts its counts into `scan` or returns it, if it is external; `None` at the end of the session.
    fn next(&self, scan: &mut Capture) -> Option<(FrameId, Option<ExternalFrame>)> {
        let mut state = self.state();
        loop {
            if state.closing {
                return None;
            }
            // Where every frame counts, no result is dropped.
            let may = state.done.is_none() || !matches!(state.feed, Feed::Every { .. });
            if let Some(frame) = if may { state.waiting.pop_front() } else { None } {
                let (counts, external) = match frame.counts {
                    WaitingCounts::Host(counts) => (counts, None),
                    WaitingCounts::External(external) => {
                        (state.spare.pop().unwrap_or_default(), Some(external))
                    }
                };
                let old = std::mem::replace(&mut scan.histograms, counts);
                if old.capacity() > 0 {
                    state.spare.push(old);
                }
                state.solving = Some((frame.id, frame.since));
                return Some((frame.id, external));
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Gives back the buffers of frames that will not be solved.
    fn release_all(&self, gpu: &Gpu) {
        for frame in std::mem::take(&mut self.state().waiting) {
            if let WaitingCounts::External(mut external) = frame.counts {
                external.release(gpu);
            }
        }
    }

    /// Leaves the result of a frame.
    fn leave(&self, id: FrameId, result: Result<Solved>, broken: Option<Error>) {
        let mut state = self.state();
        if let Some((_, since)) = state.solving.take().filter(|_| result.is_ok()) {
            state.latencies.add(since, Instant::now());
        }
        state.done = Some((id, result.map(Box::new)));
        state.broken = broken;
        self.changed.notify_all();
    }
}

impl State {
    /// A frame that another one takes the place of.
    fn drop_frame(&mut self, old: Waiting) {
        self.latencies.dropped += u64::from(self.feed == Feed::Newest);
        if let WaitingCounts::Host(counts) = old.counts {
            self.spare.push(counts);
        }
    }

    /// Lets a frame wait.
    fn add(&mut self, counts: WaitingCounts) -> FrameId {
        if self.feed == Feed::One {
            self.done = None;
        }
        self.newest.0 += 1;
        self.waiting.push_back(Waiting { id: self.newest, counts, since: Instant::now() });
        self.newest
    }

    /// Whether there is room for another frame.
    fn admit(&self) -> Result<()> {
        if let Some(error) = &self.broken {
            return Err(error.clone());
        }
        if self.closing {
            return Err(Error::options(
                "the session is closed",
                "make a new one, or keep it while frames come",
            ));
        }
        match (self.feed, self.solving.map(|s| s.0).or(self.waiting.front().map(|w| w.id))) {
            (Feed::One, Some(FrameId(id))) => Err(Error::options(
                format!("frame {id} is still being solved, and a session solves one at a time"),
                "wait for it, poll until it is done, cancel it and wait, or let frames wait (Feed)",
            )),
            (Feed::Every { most }, _) if self.waiting.len() >= most => Err(Error::options(
                format!("{most} frames wait already"),
                "take results, let more wait, or drop frames (Feed::Newest)",
            )),
            _ => Ok(()),
        }
    }
}

/// What the thread has.
pub(super) struct Worker {
    pub gpu: Gpu,
    pub shared: Arc<Shared>,
    pub prepared: Box<dyn Prepared>,
    /// The scan; with the counts of a frame while that is solved.
    pub scan: Capture,
    /// The same in the wider bins that the solver takes, if it does.
    pub summed: Option<Capture>,
    /// Of the empty room that the scan holds, which is subtracted from every frame with a gain of its own.
    pub room: Option<RoomLight>,
    /// What rests in the frames, in its place ([`SessionOptions::moving`]).
    pub running: Option<RunningRoom>,
    /// Copies frames from and to buffers of the caller, if the session takes such.
    pub exchange: Option<Exchange>,
    /// See [`conclude`].
    pub mask_fraction: Option<f64>,
    /// The verdict on the capture that the session was made with.
    pub verdict: Arc<Verdict>,
    pub options: SessionOptions,
}

impl Worker {
    /// Solves frames until the session ends, or until a solve panics.
    pub fn work(mut self) {
        let shared = self.shared.clone();
        while let Some((id, mut external)) = shared.next(&mut self.scan) {
            let solved = catch_unwind(AssertUnwindSafe(|| match &mut external {
                Some(external) => self.solve_external(id, external),
                None => self.solve(id),
            }));
            match solved {
                Ok(result) => shared.leave(id, result, None),
                Err(panic) => {
                    external.iter_mut().for_each(|external| external.release(&self.gpu));
                    let error = defect(id, &*panic);
                    shared.leave(id, Err(error.clone()), Some(error));
                    break;
                }
            }
        }
        shared.release_all(&self.gpu);
    }

    /// Solves a frame in a caller's buffer, and gives its maps back.
    fn solve_external(&mut self, id: FrameId, external: &mut ExternalFrame) -> Result<Solved> {
        let solved = self
            .wait_for(id, external.counts.after)
            .and_then(|()| self.take(external))
            .and_then(|()| self.solve(id))
            .and_then(|solved| self.give(external, &solved.result.maps).map(|()| solved));
        if solved.is_err() {
            external.release(&self.gpu);
        }
        solved
    }

    /// Copies the counts of a frame from the caller's buffer, and checks them as counts of the host.
    fn take(&mut self, external: &mut ExternalFrame) -> Result<()> {
        let Worker { exchange, scan, .. } = self;
        let number = scan.pair_count() * scan.bins;
        let mut counts = std::mem::take(&mut scan.histograms);
        let taken = external_only(exchange)?.take(&mut external.counts, number, &mut counts);
        let checked = taken.and_then(|()| scan.check_counts(&counts));
        scan.histograms = counts;
        checked
    }

    /// Writes the maps of a frame into the caller's buffer.
    fn give(&mut self, external: &mut ExternalFrame, maps: &Maps) -> Result<()> {
        external.give(external_only(&mut self.exchange)?, maps, &self.gpu)
    }

    /// Waits until a frame's counts are there: here, where it can be cancelled, and where no time limit of the device's runs.
    fn wait_for(&self, id: FrameId, after: Option<TimelinePoint>) -> Result<()> {
        let Some(after) = after else { return Ok(()) };
        let begun = Instant::now();
        while !self.gpu.wait_for(after, LOOK)? {
            let late = self.options.time_limit.filter(|limit| begun.elapsed() > *limit);
            if late.is_some() || self.shared.is_cancelled(id) {
                let stopped = Error::new(
                    Kind::Cancelled,
                    "the frame was cancelled before its counts were there",
                    "submit it again, or the next one",
                );
                return Err(late.map_or(stopped.clone(), |limit| too_long(limit, stopped)));
            }
        }
        Ok(())
    }

    fn solve(&mut self, id: FrameId) -> Result<Solved> {
        let Worker { shared, prepared, scan, summed, room, running, mask_fraction, verdict, options, .. } =
            self;
        let begun = Instant::now();
        let subtracted = match running {
            Some(running) => Some(running.subtract(scan)),
            None => room.as_ref().map(|light| subtract(scan, light)),
        };
        let (left, is_noise, whole) = match subtracted {
            Some(Subtracted::Left(left, is_noise)) => (Some(left), is_noise, None),
            Some(Subtracted::None(why)) => (None, false, Some(why)),
            None => (None, false, None),
        };
        let scan = left.as_deref().unwrap_or(scan);
        let scan = match summed {
            Some(summed) => {
                summed.take_sums(scan);
                &*summed
            }
            None => scan,
        };
        let mut late = false;
        let mut hear = |progress: &Progress| {
            late = options.time_limit.is_some_and(|limit| begun.elapsed() > limit);
            if late || shared.is_cancelled(id) {
                return ControlFlow::Break(());
            }
            options.hear.as_mut().map_or(ControlFlow::Continue(()), |hear| hear(id, progress))
        };
        let mut watch = Watch { hear: &mut hear, maps_every: options.maps_every, maps_at: &[] };
        let solved = prepared.solve(scan, &mut watch);
        let mut result = match (solved, options.time_limit) {
            (Err(e), Some(limit)) if late && e.kind == Kind::Cancelled => return Err(too_long(limit, e)),
            (solved, _) => solved?,
        };
        conclude(scan, *mask_fraction, &mut result);
        if is_noise {
            result.maps = Maps::empty([result.maps.nx, result.maps.ny], result.maps.extent);
            result.warnings =
                vec!["nothing moves: what is left of the frame is noise, and the maps are empty".into()];
        }
        result.verdict = Some(with_maps(verdict, &result.warnings));
        result.warnings.extend(whole);
        Ok(Solved { result, left })
    }
}

/// The buffers of a session that takes external frames; others refuse such frames when they are submitted.
fn external_only(exchange: &mut Option<Exchange>) -> Result<&mut Exchange> {
    exchange.as_mut().ok_or_else(host_only)
}

/// The error of an external frame for another session.
pub(super) fn host_only() -> Error {
    Error::options("this session takes counts from the host only", "make it with `external` in its options")
}

/// The error of a frame whose solve panicked.
fn defect(id: FrameId, panic: &(dyn Any + Send)) -> Error {
    let text = panic_message(panic).unwrap_or("no message");
    Error::device(
        format!("frame {}: the solve stopped at a defect ({text})", id.0),
        "make a new session, and report the defect with the frame's counts",
    )
}
