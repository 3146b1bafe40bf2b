//! Pile-up: a detector with a long dead time records only the first photon of every laser pulse, so late light is too
//! weak.

use crate::capture::Capture;
use crate::{Error, Result};
use rayon::prelude::*;

/// Most photons of a laser pulse that are detected on average. Beyond it nothing but the first bins is left.
const MOST: f64 = 20.0;

/// Expected counts of a detector that records only the first photon of every laser pulse. The capture holds what it
/// would count if it recorded all. `mean` photons of a laser pulse are detected on average of the pair with the most
/// counts, and fewer of others. Photons before the first bin are left out. The capture then holds the number of laser
/// pulses.
///
/// With r_b = counts of bin b / laser pulses, a laser pulse is counted in bin b with the probability
/// exp(-Σ_{a<b} r_a) (1 - exp(-r_b)) (Coates 1968).
///
/// # Errors
/// A mean out of range.
pub fn pile_up(capture: &mut Capture, mean: f64) -> Result<()> {
    check(Some(mean))?;
    let of = |histogram: &[f32]| -> Vec<f64> { histogram.iter().map(|v| f64::from(*v)).collect() };
    let pulses = laser_pulses(capture.histograms.chunks_exact(capture.bins).map(of), mean);
    // Without light there are none.
    capture.cycles = Some(pulses).filter(|pulses| *pulses > 0.0);
    capture.histograms.par_chunks_mut(capture.bins).for_each(|histogram| {
        let mut counts = of(histogram);
        keep_first(&mut counts, pulses);
        histogram.iter_mut().zip(counts).for_each(|(value, count)| *value = count as f32);
    });
    Ok(())
}

/// Number of laser pulses per pair, if `mean` photons of a laser pulse are detected of the pair with the most counts.
pub(super) fn laser_pulses(counts: impl Iterator<Item = Vec<f64>>, mean: f64) -> f64 {
    counts.map(|counts| counts.iter().sum::<f64>()).fold(0.0, f64::max) / mean
}

/// Turns the expected counts of all photons of a pair into those of the first photon of every laser pulse.
pub(super) fn keep_first(counts: &mut [f64], pulses: f64) {
    // Laser pulses whose photons are all yet to come.
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
            format!("{mean} photons of a laser pulse are to be detected on average"),
            format!("give a number above 0 and up to {MOST}, usually 0.01 to 0.1"),
        )),
        _ => Ok(()),
    }
}
