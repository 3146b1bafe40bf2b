//! The trace of a solve.

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
