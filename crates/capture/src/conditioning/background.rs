//! Counts without light: dark counts and stray light, alike in all pairs or different from pair to pair.

use super::negative::quiet_bins;
use crate::data::Capture;

/// Bins whose mean is above that of the quiet ones by at most this share of the strongest mean tell the background of a pair.
const FAINT: f64 = 0.01;

/// The background is taken pair by pair if it differs by this share of the strongest mean: less does no harm, and light that
/// fades slowly differs by a few hundredths (benches/NOTES.md).
const HARMS: f64 = 0.05;

/// Minimum share of the bins covered by a background, which excludes light cut off by a gate.
const LASTS: f64 = 0.15;

/// Fewer pairs do not tell a difference from chance.
const LEAST_PAIRS: usize = 64;

/// The background of a capture, in counts of a bin.
#[derive(Debug, Clone, PartialEq)]
pub struct Background {
    /// That of the mean over all pairs.
    pub level: f64,
    /// That of each pair, if they differ.
    pairs: Option<Vec<f64>>,
}

impl Background {
    /// None at all.
    pub const NONE: Background = Background { level: 0.0, pairs: None };

    /// That of `capture` if it is to be taken off, else none.
    pub fn of(capture: &Capture, taken_off: bool) -> Background {
        if taken_off { capture.background() } else { Background::NONE }
    }

    /// The same for every pair.
    pub fn even(level: f64) -> Background {
        Background { level, pairs: None }
    }

    /// That of one pair.
    pub fn of_pair(&self, pair: usize) -> f64 {
        self.pairs.as_ref().map_or(self.level, |pairs| pairs[pair])
    }

    /// The least and the largest of all pairs, if they differ.
    pub fn range(&self) -> Option<[f64; 2]> {
        let pairs = self.pairs.as_ref()?;
        Some(pairs.iter().fold([f64::INFINITY, 0.0], |[low, high], v| [low.min(*v), high.max(*v)]))
    }
}

#[doc(hidden)]
impl Capture {
    /// The background: the lowest mean, over all pairs, of any sixteenth of the bins behind the strongest one; 0 if there are
    /// fewer bins behind it, about 0 if it was taken off before.
    ///
    /// Of photon counts it is that of each pair, if pairs differ by more than chance and by enough to harm: some stand in
    /// more ambient light than others. Chance is taken out of it by shrinking it toward the mean (James & Stein 1961).
    pub fn background(&self) -> Background {
        self.background_by(&self.mean_histogram())
    }

    /// As [`Capture::background`], by the mean histogram.
    pub(super) fn background_by(&self, mean: &[f64]) -> Background {
        let Some((_, level)) = quiet_bins(mean) else { return Background::NONE };
        let strongest = mean.iter().copied().fold(0.0, f64::max) - level;
        // Cheap for dark captures: nothing can differ by so much.
        let may_differ = self.integer_counts && level > HARMS * strongest && self.pair_count() >= LEAST_PAIRS;
        let pairs = if may_differ { self.levels(mean, [level, strongest]) } else { None };
        Background { level, pairs }
    }

    /// The background of each pair, if they differ.
    fn levels(&self, mean: &[f64], [level, strongest]: [f64; 2]) -> Option<Vec<f64>> {
        let quiet: Vec<usize> = (0..self.bins).filter(|b| mean[*b] <= level + FAINT * strongest).collect();
        let of_pair = |counts: &[f32]| quiet.iter().map(|b| f64::from(counts[*b])).sum::<f64>();
        let bins = quiet.len() as f64;
        if bins < LASTS * self.bins as f64 {
            return None;
        }
        let means = self.of_rows(|counts| of_pair(counts) / bins);
        let count = means.len() as f64;
        let average = means.iter().sum::<f64>() / count;
        let variance = means.iter().map(|m| (m - average).powi(2)).sum::<f64>() / (count - 1.0);
        // That of photons.
        let chance = average / bins;
        let excess = variance - chance;
        if excess < chance || excess.sqrt() < HARMS * strongest {
            return None;
        }
        let kept = excess / variance;
        Some(means.iter().map(|m| (level + kept * (m - average)).max(0.0)).collect())
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::*;

    /// 16 x 16 pairs of 120 bins: light in ten of them, over this background of each pair.
    fn capture(background: impl Fn(usize) -> f64) -> Capture {
        let points = vec![DVec3::ZERO; 256];
        let mut random = Pcg64::seed_from_u64(5);
        let mean = |i: usize| background(i / 120) + if (30..40).contains(&(i % 120)) { 100.0 } else { 0.0 };
        let counts = (0..256 * 120).map(|i| Poisson::new(mean(i)).unwrap().sample(&mut random) as f32);
        Capture {
            integer_counts: true,
            ..Capture::new([16, 16], points.clone(), points, 120, 0.01, counts.collect())
        }
    }

    #[test]
    fn pairs_in_more_ambient_light_have_a_background_of_their_own() {
        let of = |pair: usize| 5.0 + (pair % 16) as f64 * 2.0;
        let found = capture(of).background();
        // Of 80 bins and more, each pair's mean is uncertain by a ninth of the root of 20 counts.
        let off = (0..256).map(|p| (found.of_pair(p) - found.level - (of(p) - 20.0)).powi(2)).sum::<f64>();
        assert!((found.level - 20.0).abs() < 0.5 && (off / 256.0).sqrt() < 0.6, "{}, {off}", found.level);
        let [low, high] = found.range().unwrap();
        assert!((3.0..6.0).contains(&low) && (34.0..38.0).contains(&high), "{low} {high}");
    }

    #[test]
    fn what_differs_by_chance_or_by_little_is_one_background() {
        let even = capture(|_| 20.0).background();
        assert!(even.range().is_none() && (even.level - 20.0).abs() < 0.5, "{}", even.level);
        assert_eq!(even.of_pair(7), even.level);
        // Beyond chance, but hundredths of the light.
        assert_eq!(capture(|pair| 20.0 + 4.0 * (pair % 2) as f64).background().range(), None);
        // Values that are no photons: what is chance is not known.
        let scaled = capture(|pair| 5.0 + (pair % 16) as f64 * 2.0);
        assert_eq!(Capture { integer_counts: false, ..scaled }.background().range(), None);
        // Light that fades up to the last bin, differently in every pair.
        let fades = capture(|_| 1.0);
        let light = |i: usize| {
            (60.0 * (1.0 - (i % 120) as f64 / 150.0) * (1.0 + (i / 120 % 4) as f64)).round() as f32
        };
        let counts = (0..fades.histograms.len()).map(light).collect();
        assert_eq!(Capture { histograms: counts, ..fades }.background().range(), None);
        let dark = Capture::new([1, 1], vec![DVec3::ZERO], vec![DVec3::ZERO], 3, 0.01, vec![0.0, 1.0, 5.0]);
        assert_eq!(dark.background(), Background::even(0.0));
    }
}
