//! Finds how much light counts that changes slowly along time.
//!
//! What a fit leaves of pairs that it has not seen is photon noise, which is white, and what the model does not explain,
//! which is slow. Least squares want both alike in every bin. So slow light counts as much less as more of it is left than
//! of fast light: generalised least squares (Aitken 1936) with a spectrum of two steps. Where photons are few, noise is
//! most of what is left, and all light counts alike.

use serde::{Deserialize, Serialize};

use crate::capture::Capture;
use crate::surface::LEAST_FLOOR;

/// The length of the high-pass, metres of path: a tenth of the wall's width, and two bins at least.
pub fn usual_high_pass(capture: &Capture) -> f64 {
    let [x0, x1, y0, y1] = capture.wall_extent();
    (0.1 * (x1 - x0).max(y1 - y0)).max(2.0 * capture.bin_width)
}

/// With a floor above this the high-pass changes too little to be worth its kernel.
const HIGHEST: f64 = 0.7;

/// Exact values have no noise, and files of state no infinite numbers.
const MOST: f64 = 1e6;

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
        let left = bands.map(|band| band.sqrt().min(MOST));
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
        let beside = if *slow < MOST {
            format!(": {slow:.1} times photon noise remains of them")
        } else {
            String::new()
        };
        match *length {
            0.0 => format!(
                "no high-pass: slow parts of the histograms fit as well as others do{beside} (give the length of the high-pass to skip the \
                 trial)"
            ),
            _ => format!(
                "high-pass: slow parts of the histograms, over more than {length:.3} m of path, are weighed {floor:.2}, as they fit badly \
                 in held-out pairs{beside} (a high-pass of length 0 turns this off)"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_floor_follows_what_is_left_over_noise() {
        let of = |slow: f64| FoundHighPass::of(0.1, [slow * slow, 1.0]);
        assert_eq!((of(1.0).length, of(1.3).length), (0.0, 0.0), "noise alone");
        assert!((of(4.0).floor - 0.25).abs() < 1e-12 && of(4.0).length == 0.1);
        assert_eq!(of(1e3).floor, LEAST_FLOOR);
        // Without noise, and without light: what is kept can be read again.
        for bands in [[f64::INFINITY; 2], [f64::NAN; 2]] {
            let found = FoundHighPass::of(0.1, bands);
            let text = serde_json::to_string(&found).unwrap();
            assert_eq!(serde_json::from_str::<FoundHighPass>(&text).unwrap(), found);
        }
    }
}
