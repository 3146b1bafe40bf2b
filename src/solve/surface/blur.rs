//! Residuals averaged along time while the surface is far from its place.
//!
//! A depth's gradient tells of the next bin only. A pixel that is several bins off finds its way by what a Gaussian over
//! them makes of its residual, G² W (A v - h): the gradient of a least-squares fit of histograms that were averaged themselves.
//! The Gaussian narrows to nothing; what is minimised in the end is the objective itself. Where photons are few there is
//! nothing to be averaged but noise, and it is narrower by their share.

use crate::capture::PulseTaps;

/// Gaussians, each narrower than the one before.
pub const BLURS: usize = 4;

/// Bins that the first one's sigma has at most.
const MOST: f64 = 8.0;

/// Bins: a narrower one would change nothing.
const LEAST: f64 = 0.35;

/// Share of the iterations that they take.
const UNTIL: f64 = 0.5;

/// How far a Gaussian's taps reach to each side, in sigmas.
const REACH: f64 = 3.0;

/// Bins that the widest adds to a pulse's taps.
pub const ADDED: usize = 2 * (REACH * MOST * std::f64::consts::SQRT_2) as usize + 2;

/// Sigma of the first Gaussian in bins where so many are `wanted`, for histograms of whose energy such a share is noise; none
/// if it would change nothing.
pub fn first(wanted: f64, noise: f64) -> Option<f64> {
    let sigma = (1.0 - noise.clamp(0.0, 1.0)) * wanted.min(MOST);
    (sigma > LEAST).then_some(sigma)
}

/// The number of the Gaussian that iteration `at` of so many goes by, if it goes by one.
pub fn number(at: usize, iterations: usize) -> Option<usize> {
    let number = (at as f64 / (UNTIL * iterations as f64) * BLURS as f64) as usize;
    (number < BLURS).then_some(number)
}

/// The buffer `pulse_taps` with so many words for each set: the pulse's own taps, and those by which residuals go back through
/// it and through a Gaussian's square, for each of them.
pub fn words(pulse: Option<&PulseTaps>, first: f64, room: usize) -> Vec<f32> {
    let sharp = PulseTaps::identity();
    let pulse = pulse.unwrap_or(&sharp);
    let narrowed =
        (0..BLURS).map(|k| pulse.blurred(first * (1.0 - k as f64 / BLURS as f64) * 2f64.sqrt(), REACH));
    let mut all = vec![];
    for (set, taps) in std::iter::once(pulse.clone()).chain(narrowed).enumerate() {
        all.extend(taps.words());
        all.resize((set + 1) * room, 0.0);
    }
    all
}
