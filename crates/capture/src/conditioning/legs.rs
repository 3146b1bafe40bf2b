//! Removes the outer legs (laser device to wall, wall to sensor device) from recorded paths.

use crate::data::Capture;
use crate::error::{Error, Result};
use crate::host;

/// Checks a capture without the pairs that were not measured, which are left out later.
///
/// # Errors
/// Those of [`Capture::check`]; `Kind::Memory` if there is none for a copy.
pub fn check_measured(capture: &Capture) -> Result<()> {
    host::ask("a copy of the counts", host::bytes(capture.histograms.len(), size_of::<f32>()))?;
    capture.clone().without_missing(true)?.0.check()
}

/// Shifts every histogram of `capture` down by its own leg (`legs`, metres, one per pair), so that only the inner path
/// is left. A shift by a part of a bin splits each count linearly between two bins, which keeps the sum. Paths below
/// zero are dropped. The new range begins with the earliest inner path recorded by any pair (at least 0). It ends with
/// the last inner path recorded by all pairs, or later if there is signal later. A pair whose leg is NaN (an unknown
/// wall point) or whose histogram is NaN in every bin is NaN in every bin afterwards.
///
/// # Errors
/// `Kind::Input` if a leg is infinite, all legs are NaN, or nothing is left; `Kind::Memory` if the counts do not fit.
pub fn remove(capture: &Capture, legs: &[f64]) -> Result<Capture> {
    let (shortest, longest) =
        legs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b): (f64, f64), &l| (a.min(l), b.max(l)));
    let width = capture.bin_width;
    let t_start = (capture.t_start - longest).max(0.0);
    let bins = ((capture.t_end() - shortest - t_start) / width - 1e-6).ceil();
    if !(shortest.is_finite() && longest.is_finite() && bins.is_finite())
        || legs.len() != capture.pair_count()
    {
        return Err(Error::input(
            format!("the outer legs range from {shortest} m to {longest} m"),
            "check the positions of the laser and the sensor",
        ));
    }
    if bins < 1.0 || bins > 4.0 * capture.bins as f64 + 4.0 {
        return Err(Error::input(
            format!(
                "removing the outer legs ({shortest:.3} m to {longest:.3} m) from paths of {:.3} m to {:.3} m \
                 leaves no valid range",
                capture.t_start,
                capture.t_end()
            ),
            "check the positions of the laser and the sensor, and t_accounts_first_and_last_bounces",
        ));
    }
    let bins = bins as usize;
    let mut histograms = host::filled("the counts", capture.pair_count().saturating_mul(bins), 0.0f32)?;
    for ((from, to), leg) in
        capture.histograms.chunks_exact(capture.bins).zip(histograms.chunks_exact_mut(bins)).zip(legs)
    {
        if leg.is_nan() || from.iter().all(|v| v.is_nan()) {
            to.fill(f32::NAN);
            continue;
        }
        let shift = (capture.t_start - leg - t_start) / width;
        let (whole, part) = (shift.floor(), (shift - shift.floor()) as f32);
        // A shift within 1e-4 of whole bins is taken as whole, so that rounding in the positions does not split counts.
        let (whole, part) = match part {
            p if p < 1e-4 => (whole, 0.0),
            p if p > 1.0 - 1e-4 => (whole + 1.0, 0.0),
            p => (whole, p),
        };
        for (b, &count) in from.iter().enumerate().filter(|(_, c)| **c != 0.0) {
            for (target, share) in [(whole + b as f64, 1.0 - part), (whole + b as f64 + 1.0, part)] {
                if share > 0.0 && target >= 0.0 && target < bins as f64 {
                    to[target as usize] += share * count;
                }
            }
        }
    }
    let common = (((capture.t_end() - longest - t_start) / width + 1e-6).floor().max(1.0) as usize).min(bins);
    let last = histograms
        .chunks_exact(bins)
        .filter_map(|h| h.iter().rposition(|&v| v > 0.0))
        .max()
        .map_or(common, |b| common.max(b + 1));
    let kept = histograms.chunks_exact(bins).flat_map(|h| &h[..last]).copied();
    let histograms = host::collected("the counts", capture.pair_count() * last, kept)?;
    let whole = histograms.iter().all(|v| v.is_nan() || v.fract() == 0.0);
    Ok(Capture {
        bins: last,
        t_start,
        histograms,
        integer_counts: capture.integer_counts && whole,
        ..capture.clone()
    })
}
