//! An impulse response without a shape.

use serde::{Deserialize, Serialize};

use crate::capture::Pulse;

/// An impulse response by samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResponseSamples {
    /// Shares of a path's light; their sum is one.
    pub samples: Vec<f64>,
    /// Width of a sample, metres of path.
    pub width: f64,
    /// Leading edge of the first sample, metres behind the path.
    pub start: f64,
}

impl ResponseSamples {
    /// The impulse response.
    pub fn pulse(&self) -> Pulse {
        Pulse::new(self.samples.clone(), self.width, self.start)
    }

    /// Peaks of at least a tenth of the largest one: metres behind the path, and height over that of the largest one.
    pub fn peaks(&self) -> Vec<[f64; 2]> {
        let most = self.samples.iter().fold(0.0f64, |a, b| a.max(*b));
        let at = |i: Option<usize>| i.and_then(|i| self.samples.get(i)).copied().unwrap_or(0.0);
        let is_peak = |i: &usize| {
            let own = self.samples[*i];
            own >= 0.1 * most && own > at(i.checked_sub(1)) && own >= at(Some(i + 1))
        };
        let of = |i: usize| [self.start + (i as f64 + 0.5) * self.width, self.samples[i] / most];
        (0..self.samples.len()).filter(is_peak).map(of).collect()
    }
}
