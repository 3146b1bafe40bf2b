//! Random choices.

use rand::RngExt;
use rand_pcg::Pcg64;

/// Random numbers of one seed.
pub(super) struct Dice(pub(super) Pcg64);

impl Dice {
    /// Evenly spread from `low` to `high`.
    pub fn of(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Spread from `low` to `high` evenly in the logarithm.
    pub fn log(&mut self, low: f64, high: f64) -> f64 {
        self.of(low.ln(), high.ln()).exp()
    }

    /// True so often, from 0 to 1.
    pub fn so_often(&mut self, share: f64) -> bool {
        self.of(0.0, 1.0) < share
    }

    /// As [`Dice::so_often`]; what never happens needs no random number.
    pub fn maybe(&mut self, share: f64) -> bool {
        share > 0.0 && self.so_often(share)
    }

    /// One of these, each as often as its weight says.
    pub fn one<T: Clone>(&mut self, weighed: &[(f64, T)]) -> T {
        one_at(self.of(0.0, 1.0), weighed)
    }

    pub fn sign(&mut self) -> f64 {
        if self.so_often(0.5) { 1.0 } else { -1.0 }
    }
}

/// The one of these that lies at a share from 0 to 1 of all weights.
pub(super) fn one_at<T: Clone>(share: f64, weighed: &[(f64, T)]) -> T {
    let mut left = share * weighed.iter().map(|w| w.0).sum::<f64>();
    let chosen = weighed.iter().find(|(weight, _)| {
        left -= weight;
        left < 0.0
    });
    chosen.or(weighed.last()).expect("something to choose").1.clone()
}
