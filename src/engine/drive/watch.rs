//! Progress of a solve.

use std::ops::ControlFlow;

use crate::maps::Maps;
use crate::transport::Grid;

/// Progress reports to a caller.
#[derive(Debug, Clone)]
pub struct Progress {
    /// What the solve is doing.
    pub doing: Doing,
    /// The newest point of the trace.
    pub point: TracePoint,
    /// Iterations of the whole solve.
    pub iterations: usize,
    /// Expected remaining seconds, if known.
    pub remaining: Option<f64>,
    /// The maps after that iteration, if it is one that [`Watch`] asks for.
    pub maps: Option<Maps>,
}

/// What a solve is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Doing {
    /// What a surface begins with is there: the maps that come with it. Nothing is fitted yet.
    Preview,
    /// A quick solve before the one that was asked for.
    Trial,
    /// A search for faults of the instrument: iterations are fits.
    Search,
    /// The solve itself.
    Solve,
}

/// A callback with the progress; `Break` cancels.
pub type OnProgress<'h> = dyn FnMut(&Progress) -> ControlFlow<()> + 'h;

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

impl<'w> Watch<'w> {
    /// Progress without maps.
    pub fn of(hear: &'w mut OnProgress<'w>) -> Watch<'w> {
        Watch { hear, maps_every: None, maps_at: &[] }
    }
}

/// A point of the trace: the state after an iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePoint {
    /// Iterations done.
    pub iteration: usize,
    /// Seconds since solving began, without those spent on measuring.
    pub seconds: f64,
    /// Seconds of device time among them.
    pub gpu_seconds: f64,
    /// Lateral voxels of the grid.
    pub lateral: usize,
    /// Pairs that the iteration took; the losses are means over their bins.
    pub pairs: usize,
    /// Active voxels.
    pub active: usize,
    /// Active voxels over voxels of the grid at that resolution.
    pub active_ratio: f64,
    /// What the solver minimises.
    pub loss: f64,
    /// The mean over the bins of the squared difference, without any solver's weights or regularisation.
    pub data_loss: f64,
}

impl TracePoint {
    /// Before the first iteration on a grid.
    pub(crate) fn before(grid: &Grid, pairs: usize) -> TracePoint {
        TracePoint { pairs, active: grid.voxels(), active_ratio: 1.0, ..TracePoint::first(grid.n[0], 0.0) }
    }

    /// The point before the first fit, for maps with this number of lateral pixels.
    pub(crate) fn first(lateral: usize, seconds: f64) -> TracePoint {
        TracePoint {
            iteration: 0,
            seconds,
            gpu_seconds: 0.0,
            lateral,
            pairs: 0,
            active: 0,
            active_ratio: 0.0,
            loss: f64::NAN,
            data_loss: f64::NAN,
        }
    }
}
