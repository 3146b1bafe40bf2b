//! Sessions: frames of one scan.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use engine::engine::{Progress, VolumeMap};
use engine::maps::Maps;
use engine::session::{self as engine_session, Canceller, Feed, Frame, Hear, SessionOptions, Submitter};
use engine::surface::Follow;
use engine::{Error, Result};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::capture::{Arrays, flat};
use crate::error::guarded;
use crate::reconstruct::set_volume;
use crate::settings::{self, Texts};
use crate::tell::{Raised, Teller, heard};
use crate::{devices, maps};

/// How often a thread that waits looks for signals.
const LOOK: Duration = Duration::from_millis(20);

/// Maps of a frame, its number, seconds of its solve, warnings with the verdict, and volume.
type Waited = (Maps, u64, f64, (Vec<String>, Option<&'static str>), Option<VolumeMap>);

/// A session behind a lock, so that several threads may call it. Submitting and cancelling need no lock.
#[pyclass(module = "thirdbounce._native", frozen)]
pub struct Session {
    session: Mutex<Option<engine_session::Session>>,
    submitter: Submitter,
    canceller: Canceller,
    /// A frame was submitted, and its result was not taken. Not used where frames may wait for each other.
    is_pending: AtomicBool,
    may_wait: bool,
    /// What the progress function raised.
    raised: Raised,
}

/// What becomes of frames that come while one is solved.
#[derive(FromPyObject)]
pub enum FeedGiven {
    /// What a running sum is multiplied by before each frame.
    Decay(f64),
    /// `one`, `newest`, `every` or `sum:` and the decay.
    Word(String),
}

impl FeedGiven {
    fn feed(&self) -> Result<Feed> {
        match self {
            FeedGiven::Decay(decay) => Ok(Feed::Sum { decay: *decay }),
            FeedGiven::Word(word) => word.parse(),
        }
    }
}

fn closed() -> Error {
    Error::options("the session is closed", "make a new one")
}

impl Session {
    fn locked(&self) -> MutexGuard<'_, Option<engine_session::Session>> {
        // A session is whole after a panic: its thread has the rest.
        self.session.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The maps of the next result, its number and its seconds, if it is there by then.
    fn wait_for(&self, limit: Duration) -> Result<Option<Waited>> {
        let mut session = self.locked();
        let session = session.as_mut().ok_or_else(closed)?;
        if !self.may_wait && !self.is_pending.load(Relaxed) {
            return Err(Error::options("there is no frame to wait for", "submit one first"));
        }
        let found = session.wait_for(limit);
        self.is_pending.store(matches!(found, Ok(None)), Relaxed);
        let packed = |frame: &Frame| {
            let result = &frame.result;
            let (warnings, volume) = (result.warnings.clone(), result.volume.clone());
            let verdict = result.verdict.as_ref().map(|verdict| verdict.grade.name());
            (result.maps.clone(), frame.id.0, result.solve_seconds, (warnings, verdict), volume)
        };
        Ok(found?.map(packed))
    }
}

#[pymethods]
impl Session {
    /// Compiles and allocates everything for frames of the scan that `arrays` describes. `follow`: frames follow each other, with the
    /// seconds of each, if they are limited. `moving`: frames of the background of what moves.
    #[new]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        arrays: Arrays<'_>,
        settings: Texts,
        time_limit: Option<f64>,
        progress: Option<Py<PyAny>>,
        feed: Option<FeedGiven>,
        follow: Option<(Option<f64>,)>,
        moving: Option<usize>,
    ) -> PyResult<Session> {
        let feed = guarded(py, None, || feed.map_or(Ok(Feed::One), |given| given.feed()))?;
        let scan = guarded(py, None, || arrays.capture())?;
        // The session's own thread calls it: signals come to the thread that waits.
        let teller = Teller::new(progress, false);
        let raised = teller.raised();
        let session = heard(py, None, move || {
            let time = |name: &str, seconds: Option<f64>| {
                let time = seconds.map(Duration::try_from_secs_f64).transpose();
                time.map_err(|e| Error::options(format!("{name}: {e}"), "give seconds, or None"))
            };
            let time_limit = time("time_limit", time_limit)?;
            let follow = follow.map(|(budget,)| time("budget", budget)).transpose()?;
            let follow = follow.map(|budget| Follow { budget, ..Follow::default() });
            let settings = settings::settings(&settings)?;
            let gpu = devices::open(&settings.device)?;
            let teller = Arc::new(teller);
            let of_session = teller.clone();
            let hear: Hear = Box::new(move |id, p: &Progress| of_session.hear_frame(id.0, p));
            let options = SessionOptions {
                time_limit,
                hear: Some(hear),
                feed,
                follow,
                moving,
                ..SessionOptions::default()
            };
            let made = engine::session_with(&gpu, &scan, &settings, options, &mut |p| teller.hear(p));
            made.map(|(session, _)| session)
        })?;
        let (submitter, canceller) = (session.submitter(), session.canceller());
        let (session, is_pending) = (Mutex::new(Some(session)), AtomicBool::new(false));
        Ok(Session { session, submitter, canceller, is_pending, may_wait: feed != Feed::One, raised })
    }

    /// Begins to solve a frame, and returns its number. The counts, of all pairs or of those that were `measured`, are copied.
    fn submit(
        &self,
        py: Python<'_>,
        counts: PyReadonlyArray1<'_, f32>,
        measured: Option<PyReadonlyArray1<'_, bool>>,
    ) -> PyResult<u64> {
        guarded(py, None, || {
            let counts = flat(&counts)?;
            let id = match &measured {
                None => self.submitter.submit(counts)?,
                Some(measured) => {
                    let measured: Vec<bool> = measured.as_array().iter().copied().collect();
                    self.submitter.submit_part(counts, &measured)?
                }
            };
            self.is_pending.store(true, Relaxed);
            Ok(id.0)
        })
    }

    /// Frames that were solved and dropped; seconds of the last frame, median, 90th and 99th percentile; results in a second.
    fn latency(&self) -> (u64, u64, [f64; 4], f64) {
        let latency = self.submitter.latency();
        let seconds = [latency.last, latency.median, latency.p90, latency.p99].map(|time| time.as_secs_f64());
        (latency.frames, latency.dropped, seconds, latency.frames_per_second)
    }

    /// Waits for the frame that was submitted last; `None` if it is not solved after `seconds`. A signal cancels the frame.
    fn wait<'py>(&self, py: Python<'py>, seconds: Option<f64>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let end = seconds.map(|s| Instant::now() + Duration::try_from_secs_f64(s.max(0.0)).unwrap_or(LOOK));
        let found = loop {
            let left = end.map_or(LOOK, |end| end.saturating_duration_since(Instant::now()).min(LOOK));
            let found = guarded(py, None, || py.detach(|| self.wait_for(left)));
            if let Some(raised) = self.raised.take() {
                return Err(raised);
            }
            if let Err(signal) = py.check_signals() {
                self.canceller.cancel();
                return Err(signal);
            }
            match found? {
                Some(found) => break Some(found),
                None if end.is_some_and(|end| Instant::now() >= end) => break None,
                None => {}
            }
        };
        let packed = |(solved, frame, seconds, (warnings, verdict), volume)| {
            let made = maps::dictionary(py, solved)?;
            made.set_item("frame", frame)?;
            made.set_item("seconds", seconds)?;
            made.set_item("warnings", warnings)?;
            made.set_item("verdict", verdict)?;
            set_volume(&made, volume)?;
            Ok(made)
        };
        found.map(packed).transpose()
    }

    /// Cancels the frame that is being solved. Any thread.
    fn cancel(&self) {
        self.canceller.cancel();
    }

    /// Stops what the session does, and gives its memory back.
    fn close(&self, py: Python<'_>) {
        // Its thread may be waiting for the interpreter to tell of its progress.
        py.detach(|| drop(self.locked().take()));
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let session = self.locked().take();
        Python::try_attach(|py| py.detach(|| drop(session)));
    }
}
