//! Submitting frames, from any thread.

use std::sync::Arc;

use super::options::FrameId;
use super::worker::Shared;
use super::{Feed, Latency};
use crate::capture::Capture;
use crate::{Error, Result};

/// Submits frames to a session from any thread, while another one waits for results ([`super::Session::submitter`]).
#[derive(Clone)]
pub struct Submitter {
    shared: Arc<Shared>,
    /// The scan, without counts.
    scan: Arc<Capture>,
    feed: Feed,
}

impl Submitter {
    pub(super) fn new(shared: Arc<Shared>, scan: Capture, feed: Feed) -> Submitter {
        Submitter { shared, scan: Arc::new(scan), feed }
    }

    /// How long the last frames took, and how many were dropped.
    pub fn latency(&self) -> Latency {
        self.shared.latency()
    }

    /// Pairs and bins of a frame.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.scan.pair_count(), self.scan.bins]
    }

    /// What becomes of frames that come while one is solved.
    pub(super) fn feed(&self) -> Feed {
        self.feed
    }

    /// As [`super::Session::submit`].
    ///
    /// # Errors
    /// Those of [`super::Session::submit`]; [`crate::Kind::Options`] after the session was dropped.
    pub fn submit(&self, histograms: &[f32]) -> Result<FrameId> {
        self.shared.submit(histograms, None, &self.scan)
    }

    /// As [`super::Session::submit_part`].
    ///
    /// # Errors
    /// Those of [`super::Session::submit_part`]; [`crate::Kind::Options`] after the session was dropped.
    pub fn submit_part(&self, histograms: &[f32], measured: &[bool]) -> Result<FrameId> {
        let pairs = self.scan.pair_count();
        if measured.len() != pairs {
            return Err(Error::input(
                format!("{} values of `measured` for {pairs} pairs", measured.len()),
                "say for every pair whether it was measured",
            ));
        }
        self.shared.submit(histograms, Some(measured), &self.scan)
    }
}
