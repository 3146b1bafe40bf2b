//! Progress to a Python function, and signals from Python to a solve.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use engine::solve::{Doing, Progress};
use pyo3::prelude::*;

/// Tells a Python function of the progress, and asks Python whether a signal came.
pub struct Teller {
    progress: Option<Py<PyAny>>,
    /// Only the main thread hears signals.
    hears_signals: bool,
    raised: Raised,
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
        let told =
            (doing, p.iteration, progress.iterations, p.seconds, progress.remaining, p.loss, p.lateral);
        let answer = function.call1(py, told)?;
        Ok(!answer.bind(py).is(pyo3::types::PyBool::new(py, false).to_owned()))
    }
}
