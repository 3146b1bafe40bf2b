//! The mean histogram, which several steps need, computed once for the same counts.

use std::ops::Range;

use crate::data::Capture;

/// The mean histogram of a capture, if it was computed.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct MeanOnce(Option<Vec<f64>>);

impl MeanOnce {
    /// The mean histogram of `capture`. Between two calls its counts change only as [`MeanOnce::changed`] and
    /// [`MeanOnce::keep`] report.
    pub(crate) fn of(&mut self, capture: &Capture) -> &[f64] {
        self.0.get_or_insert_with(|| capture.mean_histogram())
    }

    /// Counts changed.
    pub(crate) fn changed(&mut self) {
        self.0 = None;
    }

    /// Only these bins are left.
    pub(crate) fn keep(&mut self, bins: Range<usize>) {
        self.0 = self.0.take().map(|mean| mean[bins].to_vec());
    }
}
