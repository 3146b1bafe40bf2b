//! Faults of counters, scanners and files that counts prove without a model of the scene. What can be undone is undone, with a
//! note; the rest is named as a fault. A test that a proper capture could fail by chance does not belong here.

mod counters;
mod ends;
mod lines;
mod repeated;
mod single_bins;

use crate::conditioning::Conditioned;
use crate::data::PairKind;
use crate::error::Result;

/// Fewer pairs or bins prove nothing.
const LEAST_PAIRS: usize = 16;
const LEAST_BINS: usize = 16;

/// Finds the faults of a capture in the order in which they hide each other: wrong numbers, wrong pairs, wrong bins.
pub(super) fn found(state: &mut Conditioned) -> Result<()> {
    if state.capture.pair_count() < LEAST_PAIRS || state.capture.bins < LEAST_BINS {
        return Ok(());
    }
    state.notes.extend(state.capture.undo_sign());
    match state.capture.undo_wraps() {
        Some(Ok(note)) => state.note(note),
        Some(Err(fault)) => state.fault(fault),
        None => {}
    }
    if let Some(kept) = state.capture.without_repeats() {
        let all = state.capture.pair_count();
        state.note(format!(
            "{} of {all} pairs are left out: their histograms are exact copies of the one before, as of a scan that stopped and \
             was filled with its last counts",
            all - kept.pairs.len()
        ));
        state.take(Some(kept));
    }
    let is_scan =
        matches!(state.capture.pair_kind(), PairKind::Confocal | PairKind::OneLaser | PairKind::OneSensor);
    if is_scan {
        let note = state.lines_turned();
        state.notes.extend(note);
    }
    state.notes.extend(state.capture.undo_roll());
    let note = state.capture.without_overflow()?;
    state.notes.extend(note);
    if is_scan {
        state.notes.extend(state.capture.mend_single_bins());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::dvec3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::*;
    use crate::data::Capture;

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
        let mut state = Conditioned::begin(noisy(), 0, vec![]);
        found(&mut state).unwrap();
        assert_eq!((state.capture, state.notes.len(), state.faults.len()), (noisy(), 0, 0));
    }
}
