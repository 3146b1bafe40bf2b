//! Counts that end at the largest number that a counter can hold.

use crate::data::Capture;

/// Minimum number of bins with the largest count, and minimum ratio to those with one count less, for saturation.
const LEAST: usize = 32;
const TIMES: usize = 4;

#[doc(hidden)]
impl Capture {
    /// What to tell about counts that are cut off: many bins hold the largest one, and few hold one less. `None` if none are,
    /// or if the values are no whole counts.
    pub fn clipped_note(&self) -> Option<String> {
        if !self.integer_counts {
            return None;
        }
        let [_, most] = self.range();
        let holds = |value: f32| -> usize {
            self.of_rows(|row| row.iter().filter(|v| **v == value).count()).into_iter().sum()
        };
        // Most captures end here, after one look at their counts for each.
        let at = if most < 2.0 { 0 } else { holds(most) };
        if at < LEAST || at <= TIMES * holds(most - 1.0) {
            return None;
        }
        // Copies of one histogram hold its largest count as often.
        let rows = |pair: &usize| *pair == 0 || self.histogram(*pair) != self.histogram(pair - 1);
        let own = (0..self.pair_count()).filter(rows).flat_map(|pair| self.histogram(pair));
        (own.filter(|v| **v == most).count() >= LEAST).then(|| {
            format!(
                "{at} bins hold {most} counts and none more: a counter that is full cuts the light off there, and shapes suffer \
                 (measure for a shorter time, or with wider counters)"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::*;

    /// The first histogram for all pairs.
    fn changed_to_copies(capture: Capture) -> Capture {
        Capture { histograms: capture.histogram(0).repeat(64), ..capture }
    }

    #[test]
    fn counts_that_end_at_one_number_are_told() {
        let points = vec![DVec3::ZERO; 64];
        let capture = |mean: f64, most: f32| {
            let mut random = Pcg64::seed_from_u64(3);
            let counts = Poisson::new(mean).unwrap().sample_iter(&mut random).take(6400);
            let counts = counts.map(|v: f64| (v as f32).min(most)).collect();
            Capture {
                integer_counts: true,
                ..Capture::new([8, 8], points.clone(), points.clone(), 100, 0.01, counts)
            }
        };
        assert!(capture(60.0, 60.0).clipped_note().is_some_and(|n| n.contains("60 counts")));
        // A few bins, single photons, and whatever is whole.
        for (mean, most) in [(60.0, 1e9), (3.0, 1e9), (0.01, 1e9), (0.5, 1.0), (1e-9, 1e9)] {
            assert_eq!(capture(mean, most).clipped_note(), None, "{mean} {most}");
        }
        let copies = changed_to_copies(capture(60.0, 1e9));
        assert_eq!(copies.clipped_note(), None);
        let scaled = Capture { integer_counts: false, ..capture(60.0, 60.0) };
        assert_eq!(scaled.clipped_note(), None);
    }
}
