//! The thread that solves the frames of a session, and what it shares with the callers.

use std::any::Any;
use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::feed::{Feed, Kept};
use super::latency::{Latencies, Latency};
use super::{FrameId, SessionOptions, too_long};
use crate::capture::Capture;
use crate::solve::{Beside, Prepared, Progress, Reconstruction, Watch, conclude};
use crate::{Error, Kind, Result, panic_message};

/// What there is of the newest frame.
pub(super) enum Taken {
    /// Its result.
    Done(FrameId, Result<Box<Reconstruction>>),
    /// It is being solved, or waits.
    NotYet,
    /// Nothing: the last result was taken, or there was no frame yet.
    Nothing,
}

/// A frame that waits.
struct Waiting {
    id: FrameId,
    counts: Vec<f32>,
    since: Instant,
}

struct State {
    feed: Feed,
    /// The last counts of every pair, or their sums, from when they are needed on.
    kept: Option<Kept>,
    /// Pairs and bins.
    size: [usize; 2],
    /// Frames that wait, the oldest first.
    waiting: VecDeque<Waiting>,
    /// Memory for counts.
    spare: Vec<Vec<f32>>,
    /// The frame that the thread solves, and when it was submitted.
    solving: Option<(FrameId, Instant)>,
    /// The result of a frame, until it is taken.
    done: Option<(FrameId, Result<Box<Reconstruction>>)>,
    /// The last frame's number.
    newest: FrameId,
    latencies: Latencies,
    /// The session is being dropped.
    closing: bool,
    /// Why no more frames are solved.
    broken: Option<Error>,
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
    /// For frames of so many pairs and bins.
    pub fn new(pairs: usize, bins: usize, feed: Feed) -> Shared {
        Shared {
            state: Mutex::new(State {
                feed,
                kept: matches!(feed, Feed::Sum { .. }).then(|| Kept::new([pairs, bins], feed)),
                size: [pairs, bins],
                waiting: VecDeque::with_capacity(2),
                spare: vec![Vec::with_capacity(pairs * bins)],
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
        let mut counts = state.spare.pop().unwrap_or_default();
        if measured.is_some() && state.kept.is_none() {
            state.kept = Some(Kept::new(state.size, state.feed));
        }
        counts.clear();
        match &mut state.kept {
            None => counts.extend_from_slice(histograms),
            Some(kept) => {
                kept.take(histograms, measured);
                kept.give(&mut counts);
                if let Err(error) = scan.check_counts(&counts) {
                    state.spare.push(counts);
                    return Err(error);
                }
            }
        }
        let replaces = matches!(state.feed, Feed::Newest | Feed::Sum { .. });
        if let Some(old) = if replaces { state.waiting.pop_back() } else { None } {
            state.latencies.dropped += u64::from(state.feed == Feed::Newest);
            state.spare.push(old.counts);
        }
        if state.feed == Feed::One {
            state.done = None;
        }
        state.newest.0 += 1;
        let id = state.newest;
        state.waiting.push_back(Waiting { id, counts, since: Instant::now() });
        self.changed.notify_all();
        Ok(id)
    }

    /// Takes the result of a frame, if one is there by `end`; waits as long as it takes without an end.
    pub fn taken(&self, end: Option<Instant>) -> Taken {
        let mut state = self.state();
        loop {
            if let Some((id, result)) = state.done.take() {
                // The next one may wait for this.
                self.changed.notify_all();
                return Taken::Done(id, result);
            }
            if state.solving.is_none() && state.waiting.is_empty() || state.broken.is_some() {
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
        self.state().latencies.told()
    }

    /// Ends the thread.
    pub fn close(&self) {
        self.state().closing = true;
        self.cancelled.store(u64::MAX, Relaxed);
        self.changed.notify_all();
    }

    fn is_cancelled(&self, id: FrameId) -> bool {
        id.0 <= self.cancelled.load(Relaxed)
    }

    /// Waits for a frame, and puts its counts into `scan`; `None` at the end of the session.
    fn next(&self, scan: &mut Capture) -> Option<FrameId> {
        let mut state = self.state();
        loop {
            if state.closing {
                return None;
            }
            // Where every frame counts, no result is dropped.
            let may = state.done.is_none() || !matches!(state.feed, Feed::Every { .. });
            if let Some(frame) = if may { state.waiting.pop_front() } else { None } {
                let old = std::mem::replace(&mut scan.histograms, frame.counts);
                if old.capacity() > 0 {
                    state.spare.push(old);
                }
                state.solving = Some((frame.id, frame.since));
                return Some(frame.id);
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Leaves the result of a frame.
    fn leave(&self, id: FrameId, result: Result<Reconstruction>, broken: Option<Error>) {
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
    /// Whether there is room for another frame.
    fn admit(&self) -> Result<()> {
        if let Some(error) = &self.broken {
            return Err(error.clone());
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
    pub shared: Arc<Shared>,
    pub prepared: Box<dyn Prepared>,
    /// The scan; with the counts of a frame while that is solved.
    pub scan: Capture,
    /// See [`conclude`].
    pub mask_fraction: Option<f64>,
    pub options: SessionOptions,
}

impl Worker {
    /// Solves frames until the session ends, or until a solve panics.
    pub fn work(mut self) {
        let shared = self.shared.clone();
        while let Some(id) = shared.next(&mut self.scan) {
            let solved = catch_unwind(AssertUnwindSafe(|| self.solve(id)));
            match solved {
                Ok(result) => shared.leave(id, result, None),
                Err(panic) => {
                    let error = defect(id, &*panic);
                    shared.leave(id, Err(error.clone()), Some(error));
                    return;
                }
            }
        }
    }

    fn solve(&mut self, id: FrameId) -> Result<Reconstruction> {
        let Worker { shared, prepared, scan, mask_fraction, options } = self;
        let begun = Instant::now();
        let mut late = false;
        let mut hear = |progress: &Progress| {
            late = options.time_limit.is_some_and(|limit| begun.elapsed() > limit);
            if late || shared.is_cancelled(id) {
                return ControlFlow::Break(());
            }
            options.hear.as_mut().map_or(ControlFlow::Continue(()), |hear| hear(id, progress))
        };
        let mut watch = Watch { hear: &mut hear, maps_every: options.maps_every, maps_at: &[] };
        let solved = prepared.solve(scan, Beside { watch: &mut watch, keep: None });
        let mut result = match (solved, options.time_limit) {
            (Err(e), Some(limit)) if late && e.kind == Kind::Cancelled => return Err(too_long(limit, e)),
            (solved, _) => solved?,
        };
        conclude(scan, *mask_fraction, &mut result, &mut []);
        Ok(result)
    }
}

/// The error of a frame whose solve panicked.
fn defect(id: FrameId, panic: &(dyn Any + Send)) -> Error {
    let text = panic_message(panic).unwrap_or("no message");
    Error::device(
        format!("frame {}: the solve stopped at a defect ({text})", id.0),
        "make a new session, and report the defect with the frame's counts",
    )
}
