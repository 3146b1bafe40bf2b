//! Ctrl-C: breaks off the solver between two steps; a second one, or one where nothing is being solved or
//! written, ends the process at once.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use thirdbounce::{Error, Result};

static CARE: AtomicBool = AtomicBool::new(false);
static ASKED: AtomicBool = AtomicBool::new(false);

/// Starts to listen.
pub fn listen() -> Result<()> {
    ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::Relaxed) || !CARE.load(Ordering::Relaxed) {
            std::process::exit(130);
        }
        super::progress::say("stopping (again to stop at once)");
    })
    .map_err(|e| Error::device(format!("Ctrl-C cannot be listened to: {e}"), "run it from a usual terminal"))
}

/// From now on files may be in the making: Ctrl-C waits until [`asked`] is looked at.
pub fn take_care() {
    CARE.store(true, Ordering::Relaxed);
}

/// Breaks off if Ctrl-C was pressed.
pub fn asked() -> ControlFlow<()> {
    if ASKED.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
