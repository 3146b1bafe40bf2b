//! Progress to a Python function, and signals from Python to a solve.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use engine::engine::{Doing, Progress};
use engine::{Error, Result};
use pyo3::prelude::*;

use crate::error::guarded;

/// Reports progress to a Python function and checks for signals.
pub struct Teller {
    progress: Option<Py<PyAny>>,
    /// Only the main thread receives signals.
    hears_signals: bool,
    raised: Raised,
    pace: Mutex<LastReport>,
}

/// Least time between two reports of one phase.
const EVERY: Duration = Duration::from_millis(200);
/// Share of the work that estimates are, where there are any.
const OF_ESTIMATES: f64 = 0.5;

/// What was reported last. Reports never go back.
struct LastReport {
    /// The frame of a session.
    frame: u64,
    began: Instant,
    doing: &'static str,
    iteration: usize,
    iterations: usize,
    loss: f64,
    lateral: usize,
    fraction: f64,
    has_estimates: bool,
    reported: Option<Instant>,
}

impl LastReport {
    fn new(frame: u64) -> LastReport {
        LastReport {
            frame,
            began: Instant::now(),
            doing: "",
            iteration: 0,
            iterations: 1,
            loss: f64::NAN,
            lateral: 0,
            fraction: 0.0,
            has_estimates: false,
            reported: None,
        }
    }

    /// The report of a progress; `None` if it is not due.
    fn report(&mut self, progress: &Progress) -> Option<Report> {
        let p = &progress.point;
        let doing = match progress.doing {
            Doing::Preview => "preview",
            Doing::Trial | Doing::Search => "trial",
            Doing::Solve => "solve",
        };
        if doing != self.doing {
            (self.doing, self.iteration, self.iterations, self.reported) = (doing, 0, 1, None);
            self.has_estimates |= doing == "trial";
        }
        self.iteration = p.iteration.max(self.iteration);
        self.iterations = progress.iterations.max(self.iteration).max(1);
        (self.loss, self.lateral) = (p.loss, p.lateral);
        let is_last = self.iteration == self.iterations;
        if self.reported.is_some_and(|at| at.elapsed() < EVERY) && !is_last {
            return None;
        }
        self.reported = Some(Instant::now());
        let done = self.iteration as f64 / self.iterations as f64;
        let of_all = match (doing, self.has_estimates) {
            ("trial", _) => OF_ESTIMATES * done,
            (_, true) => OF_ESTIMATES + (1.0 - OF_ESTIMATES) * done,
            (_, false) => done,
        };
        self.fraction = self.fraction.max(of_all);
        Some(self.now(doing, progress.remaining.map(|s| s.max(0.0))))
    }

    fn now(&self, doing: &'static str, remaining: Option<f64>) -> Report {
        let seconds = self.began.elapsed().as_secs_f64();
        (doing, self.iteration, self.iterations, seconds, remaining, self.loss, self.lateral, self.fraction)
    }
}

/// What is being done, iterations and their largest number, seconds, seconds left, loss, lateral pixels, share of the whole.
type Report = (&'static str, usize, usize, f64, Option<f64>, f64, usize, f64);

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
        Teller { progress, hears_signals, raised: Raised::default(), pace: Mutex::new(LastReport::new(0)) }
    }

    /// Where it leaves what is raised.
    pub fn raised(&self) -> Raised {
        self.raised.clone()
    }

    /// As [`Teller::hear`], of a frame of a session.
    pub fn hear_frame(&self, frame: u64, progress: &Progress) -> ControlFlow<()> {
        {
            let mut pace = self.pace.lock().unwrap_or_else(PoisonError::into_inner);
            if pace.frame != frame {
                *pace = LastReport::new(frame);
            }
        }
        self.hear(progress)
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

    /// Reports the end of a solve, which may come before its last iteration, with what was done.
    pub fn finish(&self) {
        let Some(function) = &self.progress else { return };
        let report = {
            let mut pace = self.pace.lock().unwrap_or_else(PoisonError::into_inner);
            pace.fraction = 1.0;
            pace.now("done", Some(0.0))
        };
        let called = Python::try_attach(|py| function.call1(py, report).map(drop));
        if let Some(Err(raised)) = called {
            *self.raised.slot() = Some(raised);
        }
    }

    fn ask(&self, py: Python<'_>, progress: &Progress) -> PyResult<bool> {
        if self.hears_signals {
            py.check_signals()?;
        }
        let Some(function) = &self.progress else { return Ok(true) };
        let report = self.pace.lock().unwrap_or_else(PoisonError::into_inner).report(progress);
        let Some(report) = report else { return Ok(true) };
        let answer = function.call1(py, report)?;
        Ok(!answer.bind(py).is(pyo3::types::PyBool::new(py, false).to_owned()))
    }
}
