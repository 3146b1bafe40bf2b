//! Negative counts: others took the background off. How strong the noise of a bin without light is.

use std::ops::Range;

use rayon::prelude::*;

use crate::data::Capture;
use crate::data::rows::is_small;

/// The negative counts of a capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Negatives {
    /// How many counts are negative.
    pub count: usize,
    /// Variance of a bin without light, counts squared.
    pub variance: f64,
}

/// The bins without light: of all stretches of a sixteenth of the bins behind the strongest one, that with the lowest
/// mean. With that mean. `None` if there are fewer bins behind the strongest. `mean` is the mean histogram, `[bin]`.
pub fn quiet_bins(mean: &[f64]) -> Option<(Range<usize>, f64)> {
    let peak = (0..mean.len()).max_by(|a, b| mean[*a].total_cmp(&mean[*b]))?;
    let window = (mean.len() / 16).max(1);
    let behind = mean[peak + 1..].windows(window).map(|w| w.iter().sum::<f64>() / window as f64);
    let lowest = behind.enumerate().reduce(|a, b| if b.1 < a.1 { b } else { a })?;
    let first = peak + 1 + lowest.0;
    Some((first..first + window, lowest.1))
}

#[doc(hidden)]
impl Capture {
    /// The negative counts; `None` if no count is negative.
    ///
    /// The variance is that of the bins without light ([`quiet_bins`]), from second differences along time, which a
    /// slow change does not touch: their square is 1.5 variances on average. If there are no such bins, it is the mean
    /// square of the negative counts: noise around zero is as strong below as above.
    pub fn negatives(&self) -> Option<Negatives> {
        // Most captures have none, which is quick to see.
        let any = |counts: &[f32]| counts.iter().fold(false, |any, v| any | (*v < 0.0));
        let found = match is_small(&self.histograms) {
            true => any(&self.histograms),
            false => self.histograms.par_chunks(1 << 14).any(any),
        };
        if !found {
            return None;
        }
        let below = |(count, squares): (usize, f64), v: &f32| match *v < 0.0 {
            true => (count + 1, squares + f64::from(*v).powi(2)),
            false => (count, squares),
        };
        let (count, squares) = self.histograms.iter().fold((0, 0.0), below);
        let quiet = quiet_bins(&self.mean_histogram()).filter(|(bins, _)| bins.len() >= 3);
        let variance = match quiet {
            Some((bins, _)) => {
                let stretches = self.histograms.chunks_exact(self.bins).map(|h| &h[bins.clone()]);
                let seconds = stretches.flat_map(|h| h.windows(3)).map(|w| {
                    let [a, b, c] = [w[0], w[1], w[2]].map(f64::from);
                    (b - 0.5 * (a + c)).powi(2)
                });
                seconds.sum::<f64>() / (1.5 * (self.pair_count() * (bins.len() - 2)) as f64)
            }
            None => squares / count as f64,
        };
        Some(Negatives { count, variance })
    }

    /// What to tell about negative counts.
    pub(crate) fn negative_note(&self) -> Option<String> {
        self.negatives().map(|found| {
            format!(
                "{} of {} counts are negative, so the background was taken off before: the noise of a bin without \
                 light is estimated as {:.3e} counts (standard deviation)",
                found.count,
                self.histograms.len(),
                found.variance.sqrt()
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal, Poisson};
    use rand_pcg::Pcg64;

    use super::*;

    /// 64 pairs of 160 bins: a peak and a tail that falls to nothing, with noise on top.
    fn noisy(mut noise: impl FnMut(f64) -> f64) -> Capture {
        let points: Vec<DVec3> = (0..64).map(|k| DVec3::new((k / 8) as f64, (k % 8) as f64, 0.0)).collect();
        let light = |b: usize| if b < 20 { 0.0 } else { 200.0 * (-0.1 * (b as f64 - 20.0)).exp() };
        let counts = (0..64 * 160).map(|i| noise(light(i % 160)) as f32).collect();
        Capture::new([8, 8], points.clone(), points, 160, 0.01, counts)
    }

    #[test]
    fn the_noise_of_an_empty_bin_is_found() {
        let mut rng = Pcg64::seed_from_u64(1);
        for dark in [0.05, 1.0, 40.0] {
            let taken_off = noisy(|light| Poisson::new(light + dark).unwrap().sample(&mut rng) - dark)
                .negatives()
                .unwrap();
            assert!((taken_off.variance / dark - 1.0).abs() < 0.25, "{dark}: {taken_off:?}");
        }
        let normal = Normal::new(0.0, 3.0).unwrap();
        let c = noisy(|light| light + normal.sample(&mut rng));
        let found = c.negatives().unwrap();
        assert!((found.variance / 9.0 - 1.0).abs() < 0.2, "{found:?}");
        assert_eq!(found.count, c.histograms.iter().filter(|v| **v < 0.0).count());
        // The peak is last, so no bins are known to be dark.
        let turned = Capture { histograms: c.histograms.iter().rev().copied().collect(), ..c.clone() };
        let short = Capture {
            bins: 140,
            histograms: turned.histograms.chunks(160).flat_map(|h| &h[..140]).copied().collect(),
            ..turned
        };
        assert!((short.negatives().unwrap().variance / 9.0 - 1.0).abs() < 0.3, "{:?}", short.negatives());
        assert_eq!(noisy(|light| light).negatives(), None);
    }
}
