//! A position with its error, where a picture is too much: one to three blobs are fitted to the histograms of a few pairs, and a
//! constant-velocity filter joins their positions over frames. Lengths are metres, paths are metres of light.
//!
//! [`Sight`] is a capture with the light that blobs are expected to send ([`Blob`]); [`locate`] finds how many there are and where,
//! with a covariance that includes what a blob does not describe; [`Calibration`] does so for pairs that known positions calibrate;
//! [`Tracker`] follows them.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

mod blob;
mod calibrate;
mod calibrated;
mod calibration;
mod constants;
mod edge;
mod fit;
mod information;
mod locate;
mod normal;
pub mod program;
mod sight;
mod start;
mod symmetric;
mod tracker;
mod unmeasured;

pub use blob::{Blob, BlobShape};
pub use calibration::{CalibratedPair, Calibration};
pub use edge::Edge;
pub use locate::{Finding, LocateOptions, Position, locate};
pub use sight::Sight;
pub use tracker::{TrackState, Tracker};

use thirdbounce_base::error;
use thirdbounce_capture as capture;
