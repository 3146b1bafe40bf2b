//! Residuals averaged along time while the surface is far from its place.
//!
//! The gradient of a depth sees the next bin only. A Gaussian over its residual, G² W (A v - h), leads a pixel that is
//! several bins off: the gradient of a least-squares fit of averaged histograms. The Gaussian narrows to nothing, so
//! the end of the solve minimises the objective itself. Where photons are few it would average noise, so it is
//! narrower by the share of noise.

use crate::capture::PulseTaps;

/// Gaussians, each narrower than the one before.
pub const BLURS: usize = 4;

/// The largest sigma of the first one, bins.
const MOST: f64 = 8.0;

/// The smallest sigma, bins: a narrower one would change nothing.
const LEAST: f64 = 0.35;

/// Share of the iterations that they take.
const UNTIL: f64 = 0.5;

/// How far a Gaussian's taps reach to each side, in sigmas.
const REACH: f64 = 3.0;

/// Bins that the widest adds to the pulse's taps.
pub const ADDED: usize = 2 * (REACH * MOST * std::f64::consts::SQRT_2) as usize + 2;

/// Sigma of the first Gaussian, bins. `wanted` is the sigma asked for, bins; `noise` is the share of noise in the
/// energy of the histograms. `None` if it would change nothing.
pub fn first(wanted: f64, noise: f64) -> Option<f64> {
    let sigma = (1.0 - noise.clamp(0.0, 1.0)) * wanted.min(MOST);
    (sigma > LEAST).then_some(sigma)
}

/// The number of the Gaussian of iteration `at` of `iterations`, if it has one.
pub fn number(at: usize, iterations: usize) -> Option<usize> {
    let number = (at as f64 / (UNTIL * iterations as f64) * BLURS as f64) as usize;
    (number < BLURS).then_some(number)
}

/// The buffer `pulse_taps`, `room` words for each set: the pulse's own taps, then for each Gaussian the taps that take
/// residuals back through the pulse and the square of the Gaussian.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_narrow_in_half_of_the_iterations() {
        let all: Vec<_> = (0..10).map(|at| number(at, 10)).collect();
        assert_eq!(all, [Some(0), Some(0), Some(1), Some(2), Some(3), None, None, None, None, None]);
        assert_eq!([number(0, 1), number(1, 1)], [Some(0), None]);
        assert_eq!(first(2.0, 0.0), Some(2.0));
        assert_eq!(first(100.0, 0.5), Some(4.0));
        assert_eq!([first(2.0, 0.95), first(0.0, 0.0), first(2.0, 1.5)], [None; 3]);
    }

    #[test]
    fn every_set_has_room_and_its_moments() {
        let pulse = PulseTaps { before: 1, weights: vec![0.25, 0.5, 0.25] };
        let room = 2 + pulse.weights.len() + ADDED;
        for (pulse, moment) in [(None, 0.0), (Some(&pulse), 0.5)] {
            let words = words(pulse, MOST, room);
            assert_eq!(words.len(), (1 + BLURS) * room);
            for (set, words) in words.chunks(room).enumerate() {
                let (before, count) = (words[0] as f64, words[1] as usize);
                let taps = &words[2..2 + count];
                let moment_of = |power| -> f64 {
                    taps.iter()
                        .enumerate()
                        .map(|(i, w)| f64::from(*w) * (i as f64 - before).powi(power))
                        .sum()
                };
                assert!((moment_of(0) - 1.0).abs() < 1e-5 && moment_of(1).abs() < 1e-5, "{set}");
                // The first is the pulse alone; then a Gaussian's square, twice its variance, cut off at three sigmas.
                let wide = if set == 0 { 0.0 } else { 2.0 * (MOST * (5 - set) as f64 / 4.0).powi(2) };
                assert!(
                    (moment_of(2) - moment) <= wide + 1e-4 && (moment_of(2) - moment) >= 0.95 * wide - 1e-4
                );
            }
        }
    }
}
