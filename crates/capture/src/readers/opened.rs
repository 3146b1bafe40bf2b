//! A capture as it was read, whatever its format.

use crate::Capture;
use crate::conditioning::Conditioned;

/// A capture as it was read.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Opened {
    /// The capture.
    pub capture: Capture,
    /// Pairs of the file that were left out because they were not measured.
    pub dropped: usize,
    /// Sentences that say what was assumed and what was left out, and why.
    pub notes: Vec<String>,
}

impl From<Conditioned> for Opened {
    fn from(Conditioned { capture, dropped, notes, .. }: Conditioned) -> Opened {
        Opened { capture, dropped, notes }
    }
}
