//! A time axis that runs backwards, as of a counter that starts at the photon and stops at the laser pulse.

use crate::data::Capture;

/// Share of the second differences of the distance of first light along rows and columns that are below zero where time runs backwards,
/// and of those above where it runs forwards: the distance of a point is convex, and so is the least of several but where they cross.
const CONCAVE: f64 = 0.9;
const CONVEX: f64 = 0.75;
/// Largest median of the second differences of squared distances, relative to those of a point; rounding adds to 1.
const OF_A_POINT: f64 = 1.15;

impl Capture {
    /// Turns the time axis round where the first light breaks the law that the last one keeps, bin 0 being the last of the record.
    pub(super) fn undo_reversal(&mut self) -> Option<String> {
        let shares = |bends: &[f64]| {
            let [below, up_to] = [bends.partition_point(|b| *b < 0.0), bends.partition_point(|b| *b <= 0.0)];
            [below, bends.len() - up_to].map(|count| count as f64 / bends.len() as f64)
        };
        if shares(&self.bends(|distance| distance)?)[0] < CONCAVE {
            return None;
        }
        let bins = self.bins;
        self.histograms.chunks_exact_mut(bins).for_each(<[f32]>::reverse);
        let is_convex = self.bends(|distance| distance).is_some_and(|bends| shares(&bends)[1] >= CONVEX);
        let squares = self.bends(|distance| distance * distance);
        if !(is_convex && squares.is_some_and(|bends| bends[bends.len() / 2] < OF_A_POINT)) {
            self.histograms.chunks_exact_mut(bins).for_each(<[f32]>::reverse);
            return None;
        }
        Some(
            "the time axis runs backwards, as of a counter that photons start and the laser stops: the bins are turned round, the last one \
             at the wall (store H = H[::-1])"
                .into(),
        )
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::super::tests::scan;
    use super::*;

    /// Photons of a small thing 0.2 m behind the wall, of another one, and of a background.
    fn photons(most: f64) -> Capture {
        let mut random = Pcg64::seed_from_u64(3);
        scan(|ix, iy, bin| {
            let thing = |x: f64, y: f64, far: f64| {
                let path = (far * far + (x - ix as f64).powi(2) + (y - iy as f64).powi(2)).sqrt();
                (-(bin as f64 + 0.5 - 4.0 * path).powi(2) / 4.0).exp()
            };
            let mean = most * (thing(6.0, 7.0, 10.0) + 0.5 * thing(9.0, 8.0, 12.0)) + 0.006 * most;
            Poisson::new(mean).unwrap().sample(&mut random) as f32
        })
    }

    fn reversed(capture: &Capture) -> Capture {
        let mut reversed = capture.clone();
        reversed.histograms.chunks_exact_mut(capture.bins).for_each(<[f32]>::reverse);
        reversed
    }

    #[test]
    fn a_time_axis_that_runs_backwards_is_turned_round() {
        for most in [1000.0, 100.0] {
            let right = photons(most);
            let mut stored = reversed(&right);
            assert!(stored.undo_reversal().is_some_and(|note| note.contains("backwards")), "{most}");
            assert!(stored == right);
            assert_eq!(stored.undo_reversal(), None);
        }
    }

    #[test]
    fn few_photons_prove_nothing() {
        for most in [1.0, 0.1] {
            assert_eq!(photons(most).undo_reversal(), None);
        }
    }
}
