//! Finds how much light counts that changes slowly along time.
//!
//! What a fit leaves of pairs that it has not seen is photon noise, which is white, and what the model does not explain,
//! which is slow. Least squares want both alike in every bin. So slow light counts as much less as more of it is left than
//! of fast light: generalised least squares (Aitken 1936) with a spectrum of two steps. Where photons are few, noise is
//! most of what is left, and all light counts alike.

use serde::{Deserialize, Serialize};

use crate::solve::vector::LEAST_FLOOR;

/// With a floor above this the high-pass changes too little to be worth its kernel.
const HIGHEST: f64 = 0.7;

/// The result of the search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FoundHighPass {
    /// Length of the high-pass, metres of path; 0: there is none.
    pub length: f64,
    /// What it leaves of the amplitude of light that does not change.
    pub floor: f64,
    /// What a volume without it leaves of slow and of fast light in pairs that it has not seen, over photon noise there:
    /// amplitudes, so 1 is noise alone.
    pub left: [f64; 2],
}

impl FoundHighPass {
    /// Of what a volume leaves, over photon noise: mean squares of slow light, and of fast light.
    pub(super) fn of(length: f64, bands: [f64; 2]) -> FoundHighPass {
        let left = bands.map(f64::sqrt);
        let floor = (1.0 / left[0]).max(LEAST_FLOOR);
        match floor <= HIGHEST {
            true => FoundHighPass { length, floor, left },
            // No light, or none that changes slowly.
            false => FoundHighPass { length: 0.0, floor: 1.0, left },
        }
    }

    /// The result as a sentence.
    pub fn note(&self) -> String {
        let FoundHighPass { length, floor, left: [slow, _] } = self;
        let what = match *length {
            0.0 => "light counts alike however slowly it changes along time".into(),
            _ => format!(
                "light that changes over more than {length:.3} m of path counts {floor:.2} times as much as other light"
            ),
        };
        format!(
            "{what}: a fit leaves {slow:.1} times as much of it in pairs that it has not seen as of noise (give the length of the \
             high-pass to skip the trial)"
        )
    }
}
