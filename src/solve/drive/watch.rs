//! What accompanies a solve: who hears of it, and where its counts are.

use std::ops::ControlFlow;

use crate::maps::Maps;
use crate::solve::intake::LentCounts;
use crate::solve::trace::TracePoint;

/// What a caller is told while the device works.
#[derive(Debug, Clone)]
pub struct Progress {
    /// What the solve is doing.
    pub doing: Doing,
    /// The newest point of the trace.
    pub point: TracePoint,
    /// Iterations of the whole solve.
    pub iterations: usize,
    /// Seconds that the rest is expected to take, as far as that can be told.
    pub remaining: Option<f64>,
    /// The maps after that iteration, if it is one that [`Watch`] asks for.
    pub maps: Option<Maps>,
}

/// What a solve is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Doing {
    /// A first picture is there, of the maps that come with it. Nothing is solved yet.
    Preview,
    /// A quick solve before the one that was asked for.
    Trial,
    /// The solve itself.
    Solve,
}

/// What a caller wants to hear.
pub struct Watch<'w> {
    /// Called with every point of the trace; may cancel the solve.
    pub hear: &'w mut dyn FnMut(&Progress) -> ControlFlow<()>,
    /// Extract the maps after every Nth iteration. The device is idle then: neither the extraction nor the time in
    /// `hear` counts. Between such iterations `hear` runs while the device works, so nothing is subtracted.
    pub maps_every: Option<usize>,
    /// Extract the maps after these iterations, too.
    pub maps_at: &'w [usize],
}

/// What accompanies a solve: a watch, and counts in a buffer of the caller.
pub struct Beside<'b, 'w> {
    /// Hears of every point of the trace.
    pub watch: &'b mut Watch<'w>,
    /// The counts, if they lie in a caller's buffer; else they are the capture's. For a solver that was prepared for it.
    pub lent: Option<&'b mut LentCounts>,
}

impl<'b, 'w> From<&'b mut Watch<'w>> for Beside<'b, 'w> {
    fn from(watch: &'b mut Watch<'w>) -> Beside<'b, 'w> {
        Beside { watch, lent: None }
    }
}
