//! Progress to a Python function, and signals from Python to a solve.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use engine::solve::{Doing, Progress};
use engine::{Error, Result};
use pyo3::prelude::*;

use crate::error::guarded;

/// Reports progress to a Python function and checks for signals.
pub struct Teller {
    progress: Option<Py<PyAny>>,
    /// Only the main thread receives signals.
    hears_signals: bool,
    raised: Raised,
}

/// Interval of signal checks during a wait.
const LOOK: Duration = Duration::from_millis(20);

/// Runs `work` in another thread while this one checks for signals. After a signal the work ends on its own and its result is
/// discarded.
pub fn heard<T: Send + 'static>(
    py: Python<'_>,
    place: Option<&str>,
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let (give, take) = sync_channel(1);
    let work = move || {
        // Discarded after a signal.
        let _ = give.send(catch_unwind(AssertUnwindSafe(work)));
    };
    let thread = std::thread::Builder::new().name("thirdbounce".into()).spawn(work);
    guarded(py, None, || {
        thread
            .map(drop)
            .map_err(|e| Error::memory(format!("a thread does not start ({e})"), "close other programs"))
    })?;
    // A receiver alone may not be lent to code without the interpreter.
    let take = Mutex::new(take);
    let wait = || take.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK);
    loop {
        match py.detach(wait) {
            Ok(done) => return guarded(py, place, || done.unwrap_or_else(|panic| resume_unwind(panic))),
            Err(_) => py.check_signals()?,
        }
    }
}

/// What the function or a signal raised. Its lock is never held while a thread waits for the interpreter.
#[derive(Clone, Default)]
pub struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    fn slot(&self) -> MutexGuard<'_, Option<PyErr>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes what was raised.
    pub fn take(&self) -> Option<PyErr> {
        self.slot().take()
    }
}

impl Teller {
    pub fn new(progress: Option<Py<PyAny>>, hears_signals: bool) -> Teller {
        Teller { progress, hears_signals, raised: Raised::default() }
    }

    /// Where it leaves what is raised.
    pub fn raised(&self) -> Raised {
        self.raised.clone()
    }

    /// Breaks if a signal came, or if the function raised or returned `False`.
    pub fn hear(&self, progress: &Progress) -> ControlFlow<()> {
        if self.raised.slot().is_some() {
            return ControlFlow::Break(());
        }
        // No interpreter: it is ending.
        match Python::try_attach(|py| self.ask(py, progress)) {
            Some(Ok(true)) => ControlFlow::Continue(()),
            Some(Ok(false)) | None => ControlFlow::Break(()),
            Some(Err(raised)) => {
                *self.raised.slot() = Some(raised);
                ControlFlow::Break(())
            }
        }
    }

    fn ask(&self, py: Python<'_>, progress: &Progress) -> PyResult<bool> {
        if self.hears_signals {
            py.check_signals()?;
        }
        let Some(function) = &self.progress else { return Ok(true) };
        let p = &progress.point;
        let doing = match progress.doing {
            Doing::Preview => "preview",
            Doing::Trial => "trial",
            Doing::Solve => "solve",
        };
        let report =
            (doing, p.iteration, progress.iterations, p.seconds, progress.remaining, p.loss, p.lateral);
        let answer = function.call1(py, report)?;
        Ok(!answer.bind(py).is(pyo3::types::PyBool::new(py, false).to_owned()))
    }
}
