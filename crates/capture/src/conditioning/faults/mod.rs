//! Faults of counters, scanners and files that counts prove without a model of the scene. What can be undone is undone, with a
//! note; the rest is named as a fault. A test that a proper capture could fail by chance does not belong here.

mod counters;
mod ends;
mod enlarged;
mod extra_lines;
mod lines;
mod multiples;
mod order;
mod repeated;
mod reversed;
mod roots;
mod single_bins;
mod triggers;

use super::mean::MeanOnce;
use crate::data::{Capture, PairKind};
use crate::error::{Error, Result};

/// Fewer pairs or bins prove nothing.
const LEAST_PAIRS: usize = 16;
const LEAST_BINS: usize = 16;

/// What was found in a capture.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// What was undone.
    pub notes: Vec<String>,
    /// What could not be undone.
    pub faults: Vec<String>,
    /// What was undone as far as can be known.
    pub warnings: Vec<String>,
    /// Pairs that were left out.
    pub dropped: usize,
    /// Whether counts changed or moved to other bins or pairs, but for single bins.
    pub has_moved: bool,
}

/// Finds the faults of a capture in the order in which they hide each other: wrong numbers, wrong pairs, wrong bins.
pub(super) fn undo(capture: &mut Capture, mean: &mut MeanOnce) -> Result<Found> {
    let mut found = Found::default();
    if capture.pair_count() < LEAST_PAIRS || capture.bins < LEAST_BINS {
        return Ok(found);
    }
    found.notes.extend(capture.undo_sign());
    match capture.undo_wraps() {
        Some(Ok(note)) => found.notes.push(note),
        Some(Err(fault)) => found.faults.push(fault),
        None => {}
    }
    found.notes.extend(capture.undo_multiples());
    found.notes.extend(capture.undo_unit());
    if let Some((gone, note)) = capture.undo_enlargement() {
        found.dropped += gone;
        found.notes.push(note);
    }
    found.has_moved = !found.notes.is_empty();
    if let Some(kept) = capture.without_repeats() {
        let all = capture.pair_count();
        let gone = all - kept.pairs.len();
        if kept.pairs.len() == 1 {
            return Err(Error::input(
                format!("all {all} pairs have the same histogram, as of one that was repeated"),
                "store the histogram of each point of the scan",
            ));
        }
        found.dropped += gone;
        found.notes.push(format!(
            "{gone} of {all} pairs are left out: their histograms are exact copies of the one before, as of a scan that stopped and \
             was filled with its last counts"
        ));
        *capture = capture.keep(&kept.pairs, kept.scan);
        if kept.pairs.len() < LEAST_PAIRS {
            mean.changed();
            return Ok(found);
        }
    }
    let is_scan =
        matches!(capture.pair_kind(), PairKind::Confocal | PairKind::OneLaser | PairKind::OneSensor);
    if is_scan {
        while let Some((kept, warning)) = capture.without_extra_lines() {
            found.dropped += capture.pair_count() - kept.pairs.len();
            found.warnings.push(warning);
            *capture = capture.keep(&kept.pairs, kept.scan);
        }
        let mut moved: Vec<String> = capture.turn_lines().into_iter().collect();
        moved.extend(capture.undo_order());
        moved.extend(capture.undo_reversal());
        found.has_moved |= !moved.is_empty();
        found.notes.extend(moved);
    }
    // The mean histogram of what is right so far.
    mean.changed();
    let rolled = capture.undo_roll(mean.of(capture));
    if rolled.is_some() {
        mean.changed();
    }
    let overflown = capture.without_overflow(mean.of(capture))?;
    if overflown.is_some() {
        mean.keep(0..capture.bins);
    }
    found.has_moved |= rolled.is_some() || overflown.is_some();
    let mended = if is_scan { capture.mend_single_bins() } else { None };
    if mended.is_some() {
        mean.changed();
    }
    found.notes.extend(rolled.into_iter().chain(overflown).chain(mended));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use glam::dvec3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::*;

    pub const SIDE: usize = 16;
    pub const BINS: usize = 100;

    /// A confocal scan of 0.3 m with bins of 1 cm; `count` is that of column, row and bin.
    pub fn scan(mut count: impl FnMut(usize, usize, usize) -> f32) -> Capture {
        let points: Vec<_> = (0..SIDE * SIDE)
            .map(|p| dvec3(0.02 * (p / SIDE) as f64, 0.02 * (p % SIDE) as f64, 0.0))
            .collect();
        let all = (0..SIDE * SIDE).flat_map(|p| (0..BINS).map(move |bin| (p / SIDE, p % SIDE, bin)));
        let counts = all.map(|(ix, iy, bin)| count(ix, iy, bin)).collect();
        let capture = Capture::new([SIDE, SIDE], points.clone(), points, BINS, 0.01, counts);
        Capture { integer_counts: true, ..capture }
    }

    /// Photons of two small things and of a background: a proper capture.
    pub fn noisy() -> Capture {
        let mut random = Pcg64::seed_from_u64(5);
        scan(|ix, iy, bin| {
            let thing = |x: f64, y: f64, far: f64| {
                let path = (far * far + (x - ix as f64).powi(2) + (y - iy as f64).powi(2)).sqrt();
                (-(bin as f64 - 2.0 * path - 10.0).powi(2) / 8.0).exp()
            };
            let mean = 120.0 * thing(3.0, 5.0, 14.0) + 60.0 * thing(12.0, 13.0, 20.0) + 0.7;
            Poisson::new(mean).unwrap().sample(&mut random) as f32
        })
    }

    #[test]
    fn a_proper_capture_has_no_fault() {
        let mut capture = noisy();
        let found = undo(&mut capture, &mut MeanOnce::default()).unwrap();
        assert_eq!((capture, found.notes.len(), found.faults.len(), found.dropped), (noisy(), 0, 0, 0));
    }

    #[test]
    fn a_single_histogram_is_no_scan() {
        let one = noisy();
        let mut capture = scan(|_, _, bin| one.histogram(3 * SIDE + 5)[bin]);
        let error = undo(&mut capture, &mut MeanOnce::default()).unwrap_err();
        assert!(error.what.contains("all 256 pairs have the same histogram"), "{error}");
        let mut capture = scan(|ix, iy, bin| one.histogram(if ix + iy == 0 { 0 } else { 3 * SIDE + 5 })[bin]);
        let found = undo(&mut capture, &mut MeanOnce::default()).unwrap();
        assert_eq!((capture.pair_count(), found.dropped), (2, 254));
    }
}
