//! Ctrl-C cancels the solver between two steps. A second Ctrl-C ends the process at once. So does the first if nothing
//! is being solved or written. SIGTERM and SIGHUP do the same: a cluster's time limit, a container that is stopped, a terminal
//! that is closed.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use thirdbounce::{Error, Result};

use super::terminal::say;

static CARE: AtomicBool = AtomicBool::new(false);
static ASKED: AtomicBool = AtomicBool::new(false);

/// Starts to listen.
pub fn listen() -> Result<()> {
    ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::Relaxed) || !CARE.load(Ordering::Relaxed) {
            std::process::exit(130);
        }
        say("stopping (Ctrl-C again stops at once)");
    })
    .map_err(|e| Error::device(format!("Ctrl-C cannot be handled: {e}"), "run it in another terminal"))
}

/// From now on files may be incomplete: Ctrl-C waits until [`asked`] is called.
pub fn stop_in_order() {
    CARE.store(true, Ordering::Relaxed);
}

/// Whether to go on: breaks if Ctrl-C was pressed.
pub fn asked() -> ControlFlow<()> {
    if ASKED.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
