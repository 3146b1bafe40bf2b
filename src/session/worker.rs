//! The thread that solves the frames of a session, and what it shares with the callers.

use std::any::Any;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::{FrameId, SessionOptions, too_long};
use crate::capture::Capture;
use crate::solve::{Beside, Prepared, Progress, Reconstruction, Watch, conclude};
use crate::{Error, Kind, Result};

/// What a session is doing.
pub(super) enum Phase {
    /// Nothing: the last result was taken, or there was no frame yet.
    Idle,
    /// The counts of a frame are there.
    Submitted(FrameId),
    /// The thread solves a frame.
    Solving(FrameId),
    /// The result of a frame is there.
    Done(FrameId, Result<Box<Reconstruction>>),
}

struct State {
    phase: Phase,
    /// The counts of the newest frame, while the thread does not have them.
    counts: Vec<f32>,
    /// The last frame's number.
    newest: FrameId,
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
    /// With room for so many counts.
    pub fn with_room(counts: usize) -> Shared {
        Shared {
            state: Mutex::new(State {
                phase: Phase::Idle,
                counts: Vec::with_capacity(counts),
                newest: FrameId(0),
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

    /// Gives the thread a frame.
    pub fn submit(&self, histograms: &[f32]) -> Result<FrameId> {
        let mut state = self.state();
        if let Some(error) = &state.broken {
            return Err(error.clone());
        }
        if let Phase::Submitted(FrameId(id)) | Phase::Solving(FrameId(id)) = state.phase {
            return Err(Error::options(
                format!("frame {id} is still being solved, and a session solves one at a time"),
                "wait for it, poll until it is done, or cancel it and wait",
            ));
        }
        state.counts.clear();
        state.counts.extend_from_slice(histograms);
        state.newest.0 += 1;
        state.phase = Phase::Submitted(state.newest);
        self.changed.notify_all();
        Ok(state.newest)
    }

    /// Takes the result of the newest frame, if it is there by `end`; waits as long as it takes without an end.
    pub fn taken(&self, end: Option<Instant>) -> Phase {
        let mut state = self.state();
        loop {
            let left = end.map(|end| end.saturating_duration_since(Instant::now()));
            match state.phase {
                Phase::Idle => return Phase::Idle,
                Phase::Done(..) => return std::mem::replace(&mut state.phase, Phase::Idle),
                Phase::Submitted(id) | Phase::Solving(id) if left.is_some_and(|l| l.is_zero()) => {
                    return Phase::Solving(id);
                }
                _ => {}
            }
            state = match left {
                None => self.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
                Some(left) => {
                    self.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0
                }
            };
        }
    }

    /// Cancels the frame that is submitted or being solved.
    pub fn cancel(&self) {
        if let Phase::Submitted(id) | Phase::Solving(id) = self.state().phase {
            self.cancelled.fetch_max(id.0, Relaxed);
        }
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
            if let Phase::Submitted(id) = state.phase {
                std::mem::swap(&mut scan.histograms, &mut state.counts);
                state.phase = Phase::Solving(id);
                return Some(id);
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Leaves the result of a frame, and gives its counts' memory back.
    fn leave(&self, id: FrameId, result: Result<Reconstruction>, scan: &mut Capture, broken: Option<Error>) {
        let mut state = self.state();
        std::mem::swap(&mut scan.histograms, &mut state.counts);
        state.phase = Phase::Done(id, result.map(Box::new));
        state.broken = broken;
        self.changed.notify_all();
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
                Ok(result) => shared.leave(id, result, &mut self.scan, None),
                Err(panic) => {
                    let error = defect(id, &*panic);
                    shared.leave(id, Err(error.clone()), &mut self.scan, Some(error));
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
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
    Error::device(
        format!("frame {}: the solve stopped at a defect ({text})", id.0),
        "make a new session, and report the defect with the frame's counts",
    )
}
