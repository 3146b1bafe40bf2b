//! Pile-up: a detector with a long dead time records only the first photon of every laser pulse, which attenuates
//! late light.

use crate::capture::Capture;
use crate::{Error, Result};
use rayon::prelude::*;

/// Maximum mean number of detected photons per laser pulse. Beyond it only the first bins contain counts.
const MOST: f64 = 20.0;

/// Converts the counts of an ideal detector to the expected counts of one that records only the first photon of every
/// laser pulse. `mean` is the mean number of detected photons per laser pulse for the brightest pair; other pairs
/// have fewer. Photons before the first bin are ignored. Stores the number of laser pulses in the capture.
///
/// With r_b = counts of bin b / laser pulses, the probability of a count in bin b per laser pulse is exp(-Σ_{a<b}
/// r_a) (1 - exp(-r_b)) (Coates 1968).
///
/// # Errors
/// A mean out of range.
pub fn pile_up(capture: &mut Capture, mean: f64) -> Result<()> {
    check(Some(mean))?;
    let of = |histogram: &[f32]| -> Vec<f64> { histogram.iter().map(|v| f64::from(*v)).collect() };
    let pulses = laser_pulses(capture.histograms.chunks_exact(capture.bins).map(of), mean);
    // No pulses without light.
    capture.cycles = Some(pulses).filter(|pulses| *pulses > 0.0);
    capture.histograms.par_chunks_mut(capture.bins).for_each(|histogram| {
        let mut counts = of(histogram);
        keep_first(&mut counts, pulses);
        histogram.iter_mut().zip(counts).for_each(|(value, count)| *value = count as f32);
    });
    Ok(())
}

/// Laser pulses per pair for `mean` detected photons per pulse of the brightest pair.
pub(super) fn laser_pulses(counts: impl Iterator<Item = Vec<f64>>, mean: f64) -> f64 {
    counts.map(|counts| counts.iter().sum::<f64>()).fold(0.0, f64::max) / mean
}

/// Converts expected counts of all photons of a pair to those of the first photon of every laser pulse.
pub(super) fn keep_first(counts: &mut [f64], pulses: f64) {
    // Laser pulses without a detected photon so far.
    let mut waiting = pulses;
    for count in counts {
        let first = if pulses > 0.0 { waiting * -(-*count / pulses).exp_m1() } else { 0.0 };
        waiting -= first;
        *count = first;
    }
}

/// Checks the range of the mean.
pub(super) fn check(mean: Option<f64>) -> Result<()> {
    match mean {
        Some(mean) if !(mean > 0.0 && mean <= MOST) => Err(Error::options(
            format!("{mean} photons per laser pulse on average"),
            format!("give a number above 0 and up to {MOST}, usually 0.01 to 0.1"),
        )),
        _ => Ok(()),
    }
}
