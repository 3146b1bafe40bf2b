//! Photon noise.

use super::pile_up;
use crate::capture::Capture;
use crate::{Error, Result};
use rand::SeedableRng;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Maximum photons or dark counts per bin: integers up to here are exact in single precision.
const MOST_COUNTS: f64 = 1e7;

/// Mean dark counts of every bin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Dark {
    /// A fraction of the photons expected in the strongest bin.
    Fraction(f64),
    /// Counts per bin.
    Counts(f64),
}

/// The capture as photon counts: scaled so that its strongest bin expects `photons` counts, with dark counts added,
/// drawn from Poisson distributions. With `pile_up`, only the first photon of every laser pulse is recorded, as by
/// [`pile_up`](super::pile_up()), after dark counts were added. The counts depend on the seed, not on the number of
/// threads.
///
/// # Errors
/// Photons, dark counts or pile-up out of range, a capture without signal, or values that are negative or not finite.
pub fn photon_noise(
    capture: &Capture,
    photons: f64,
    dark: Dark,
    pile_up: Option<f64>,
    seed: u64,
) -> Result<Capture> {
    Ok(Exposure::of(capture, photons, dark, pile_up)?.draw(capture, seed))
}

/// How long a scene is measured: counts by value, dark counts, laser pulses. That of one capture also draws another one of the same
/// instrument.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Counts for a value of 1.
    scale: f64,
    /// Mean dark counts of a bin.
    dark: f64,
    /// Laser pulses of every pair, if only the first photon of each is recorded.
    pulses: Option<f64>,
}

impl Exposure {
    /// The exposure of [`photon_noise`].
    ///
    /// # Errors
    /// Those of [`photon_noise`].
    pub fn of(capture: &Capture, photons: f64, dark: Dark, pile_up: Option<f64>) -> Result<Exposure> {
        check(Some(photons), dark)?;
        pile_up::check(pile_up)?;
        let values = &capture.histograms;
        if let Some(i) = values.iter().position(|v| !(v.is_finite() && *v >= 0.0)) {
            return Err(Error::input(
                format!("bin {} of pair {} is {}", i % capture.bins, i / capture.bins, values[i]),
                "photon noise needs expected values that are finite and not negative",
            ));
        }
        let peak = values.iter().fold(0f32, |a, &b| a.max(b)) as f64;
        if peak == 0.0 {
            return Err(Error::input(
                format!("the capture {:?} is all zero: there is no strongest bin to scale", capture.name),
                "let the bins cover the scene (more bins, another start) and let the scene face the wall",
            ));
        }
        let dark = match dark {
            Dark::Fraction(fraction) => fraction * photons,
            Dark::Counts(counts) => counts,
        };
        let exposure = Exposure { scale: photons / peak, dark, pulses: None };
        let rows = || capture.histograms.chunks_exact(capture.bins);
        let of_all = |mean: f64| pile_up::laser_pulses(rows().map(|row| exposure.expected(row)), mean);
        Ok(Exposure { pulses: pile_up.map(of_all), ..exposure })
    }

    /// An exposure of this share of the time.
    #[must_use]
    pub fn times(self, share: f64) -> Exposure {
        let Exposure { scale, dark, pulses } = self;
        Exposure { scale: share * scale, dark: share * dark, pulses: pulses.map(|pulses| share * pulses) }
    }

    fn expected(&self, values: &[f32]) -> Vec<f64> {
        values.iter().map(|v| f64::from(*v) * self.scale + self.dark).collect()
    }

    /// Draws the photon counts of a capture whose values are finite and not negative.
    pub fn draw(&self, capture: &Capture, seed: u64) -> Capture {
        let mut noisy = capture.clone();
        noisy.integer_counts = true;
        noisy.cycles = self.pulses;
        noisy.histograms.par_chunks_mut(capture.bins).enumerate().for_each(|(pair, histogram)| {
            let stream = (pair as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let mut rng = Pcg64::seed_from_u64(seed.wrapping_mul(0xd134_2543_de82_ef95) ^ stream);
            let mut means = self.expected(histogram);
            self.pulses.into_iter().for_each(|pulses| pile_up::keep_first(&mut means, pulses));
            for (value, mean) in histogram.iter_mut().zip(means) {
                // Poisson::new refuses a mean of 0, which means no photons.
                *value = Poisson::new(mean).map_or(0.0, |counts| counts.sample(&mut rng) as f32);
            }
        });
        noisy
    }
}

/// Checks the ranges of photons and dark counts.
pub(super) fn check(photons: Option<f64>, dark: Dark) -> Result<()> {
    let (amount, means) = match dark {
        Dark::Fraction(f) => (f, f * photons.unwrap_or(0.0)),
        Dark::Counts(c) => (c, c),
    };
    if !(amount >= 0.0 && means <= MOST_COUNTS) {
        return Err(Error::options(
            format!("the dark counts are {dark:?}"),
            format!("give dark counts of 0 to {MOST_COUNTS:.0} per bin, or a fraction of the photons"),
        ));
    }
    match photons {
        Some(photons) if !(photons > 0.0 && photons <= MOST_COUNTS) => Err(Error::options(
            format!("the photons expected in the strongest bin are {photons}"),
            format!("give a number of photons above 0 and up to {MOST_COUNTS:.0}"),
        )),
        None if amount > 0.0 => Err(Error::options(
            "dark counts are set, but no photons",
            "set the photons expected in the strongest bin too; without them values are not counts",
        )),
        _ => Ok(()),
    }
}
