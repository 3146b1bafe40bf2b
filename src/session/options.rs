//! Options of a session, and the numbers of its frames.

use std::ops::ControlFlow;
use std::time::Duration;

use super::feed::Feed;
use crate::capture::Capture;
use crate::engine::Progress;
use crate::surface::Follow;
use crate::{Error, Kind, Result};

/// Number of a frame, from 1, in the order of submission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameId(pub u64);

/// Called with the progress of a frame, by the session's thread. May stop the frame.
pub type Hear = Box<dyn FnMut(FrameId, &Progress) -> ControlFlow<()> + Send>;

/// What a session may take and tell.
#[derive(Default)]
pub struct SessionOptions {
    /// How many neighbouring bins are one for the solver; `None`: as many as the command takes
    /// ([`crate::methods::SolverOptions::usual_sum`]).
    pub sum: Option<usize>,
    /// Most device memory to use, in bytes.
    pub memory: Option<u64>,
    /// A pixel is surface above this share of the brightest albedo; `None`: as [`crate::methods::SolverOptions::usual_mask`] says.
    pub mask_fraction: Option<f64>,
    /// Read the volume of every frame back.
    pub with_volume: bool,
    /// A frame that takes longer is stopped.
    pub time_limit: Option<Duration>,
    /// Is called with the progress.
    pub hear: Option<Hear>,
    /// Give `hear` the maps after every Nth iteration.
    pub maps_every: Option<usize>,
    /// What becomes of frames that are submitted while another one is being solved.
    pub feed: Feed,
    /// Begin a frame with the solution of the one before, and keep to a time for each frame. For the surface solver.
    pub follow: Option<Follow>,
    /// Number of solved frames whose static light is subtracted as an empty room, with a gain for each frame, so that moving objects are
    /// left ([`crate::session::MOVING_FRAMES`] is usual). The first five frames are solved as measured, with a warning.
    pub moving: Option<usize>,
    /// Frames may be in buffers of the caller ([`super::Session::submit_external`]).
    pub external: bool,
}

impl SessionOptions {
    /// Checks the background of what moves for frames of this scan.
    pub(crate) fn check_moving(&self, scan: &Capture) -> Result<()> {
        super::moving::check(self.moving, scan)
    }
}

/// The error of a frame that was stopped by its time limit, after what `cancelled` says.
pub(super) fn too_long(limit: Duration, cancelled: Error) -> Error {
    let what = format!("{}: the frame took longer than its limit of {limit:?}", cancelled.what);
    Error::new(Kind::Cancelled, what, "give a longer limit, fewer iterations or fewer pixels")
}
