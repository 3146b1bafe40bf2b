//! Sessions: frames of one scan.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use engine::maps::Maps;
use engine::session::{self as engine_session, Canceller, Frame, Hear, SessionOptions};
use engine::solve::Progress;
use engine::{Error, Result};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::capture::{Arrays, flat};
use crate::devices;
use crate::error::guarded;
use crate::maps;
use crate::settings::Settings;
use crate::tell::{Raised, Teller};

/// How often a thread that waits looks for signals.
const LOOK: Duration = Duration::from_millis(20);

/// A session behind a lock, so that several threads may call it. Cancelling needs no lock.
#[pyclass(module = "thirdbounce._native", frozen)]
pub struct Session {
    session: Mutex<Option<Open>>,
    canceller: Canceller,
    /// What the progress function raised.
    raised: Raised,
}

/// A session that is not closed.
struct Open {
    session: engine_session::Session,
    /// A frame was submitted, and its result was not taken.
    is_pending: bool,
}

impl Open {
    fn submit(&mut self, counts: &[f32]) -> Result<u64> {
        let id = self.session.submit(counts)?;
        self.is_pending = true;
        Ok(id.0)
    }

    /// The maps of the frame, its number and its seconds, if it is solved by then.
    fn wait_for(&mut self, limit: Duration) -> Result<Option<(Maps, u64, f64)>> {
        if !self.is_pending {
            return Err(Error::options("there is no frame to wait for", "submit one first"));
        }
        let found = self.session.wait_for(limit);
        self.is_pending = matches!(found, Ok(None));
        let packed = |frame: &Frame| (frame.result.maps.clone(), frame.id.0, frame.result.solve_seconds);
        Ok(found?.map(packed))
    }
}

fn closed() -> Error {
    Error::options("the session is closed", "make a new one")
}

impl Session {
    fn locked(&self) -> MutexGuard<'_, Option<Open>> {
        // A session is whole after a panic: its thread has the rest.
        self.session.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Session {
    /// Compiles and allocates everything for frames of the scan that `arrays` describes.
    #[new]
    fn new(
        py: Python<'_>,
        arrays: Arrays<'_>,
        settings: Settings,
        time_limit: Option<f64>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Session> {
        let scan = guarded(py, None, || arrays.capture())?;
        // The session's own thread calls it: signals come to the thread that waits.
        let teller = Teller::new(progress, false);
        let raised = teller.raised();
        let session = guarded(py, None, || {
            py.detach(|| {
                let limit = time_limit.map(Duration::try_from_secs_f64).transpose();
                let time_limit =
                    limit.map_err(|e| Error::options(format!("time_limit: {e}"), "give seconds, or None"))?;
                let choice = settings.choice()?;
                scan.check_scan()?;
                let memory = settings.memory()?;
                let gpu = devices::open(&settings.device)?;
                let tuned = choice.resolve(&scan).tune(&gpu, &scan, memory, &mut |p| teller.hear(p))?;
                let hear: Hear = Box::new(move |_, p: &Progress| teller.hear(p));
                let options =
                    SessionOptions { memory, time_limit, hear: Some(hear), ..SessionOptions::default() };
                engine_session::Session::new(&gpu, &tuned.scan, None, &tuned.solver, options)
            })
        })?;
        let canceller = session.canceller();
        let open = Open { session, is_pending: false };
        Ok(Session { canceller, session: Mutex::new(Some(open)), raised })
    }

    /// Begins to solve a frame, and returns its number. The counts are copied.
    fn submit(&self, py: Python<'_>, counts: PyReadonlyArray1<'_, f32>) -> PyResult<u64> {
        guarded(py, None, || {
            let mut session = self.locked();
            session.as_mut().ok_or_else(closed)?.submit(flat(&counts)?)
        })
    }

    /// Waits for the frame that was submitted last; `None` if it is not solved after `seconds`. A signal cancels the frame.
    fn wait<'py>(&self, py: Python<'py>, seconds: Option<f64>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let end = seconds.map(|s| Instant::now() + Duration::try_from_secs_f64(s.max(0.0)).unwrap_or(LOOK));
        let found = loop {
            let left = end.map_or(LOOK, |end| end.saturating_duration_since(Instant::now()).min(LOOK));
            let found = guarded(py, None, || {
                py.detach(|| -> Result<_> {
                    let mut session = self.locked();
                    session.as_mut().ok_or_else(closed)?.wait_for(left)
                })
            });
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
        let packed = |(solved, frame, seconds)| {
            let made = maps::dictionary(py, solved)?;
            made.set_item("frame", frame)?;
            made.set_item("seconds", seconds)?;
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
