//! How sharp an image may be: what sharpens raises noise.
//!
//! The noise of photon counts is known without a model. If every photon counts as 1 or as -1, by the toss of a coin, a bin
//! has the mean 0 and the variance of its count. So what a method makes of tossed counts has the noise of the true image
//! and nothing else. A method with a setting for its sharpness makes both images, and takes the sharpest setting whose noise
//! would not be taken for surface.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::image::{brightest, level_over_haze};
use crate::Result;
use crate::capture::Capture;
use crate::maps::percentile;
use crate::solve::option::{OptionValue, Options};
use crate::solve::{ImageNoise, Sharpness};

/// The setting of a method that trades sharpness for noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ladder {
    /// Its key among the options.
    pub setting: &'static str,
    /// Values to choose from, the sharpest first.
    pub values: &'static [f64],
}

/// Noise of this share is harmless ([`ImageNoise::share`]). Fitted on simulated scenes (benches/NOTES.md).
const HARMLESS: f64 = 0.67;

/// Counts above this are tossed as a sum of this many coins, whose distribution is as good as that of all.
const COINS: u32 = 64;

/// The options with a value of a setting.
pub fn with<M: Options + Clone>(options: &M, setting: &str, value: f64) -> M {
    let mut options = options.clone();
    options.set(setting, &OptionValue::Number(value));
    options
}

impl Ladder {
    /// The ladder, if the options leave its setting open.
    pub fn if_open(self, options: &dyn Options) -> Option<Ladder> {
        (options.get(self.setting) == Some(OptionValue::Unset)).then_some(self)
    }

    /// The sharpest value, where noise is not known.
    pub fn sharpest(&self) -> Sharpness {
        Sharpness { setting: self.setting, value: self.values[0], sharpest: self.values[0], noise: None }
    }

    /// The softest value.
    pub fn softest(&self) -> f64 {
        self.values[self.values.len() - 1]
    }

    /// Chooses. `try_value` tells the noise of a value, and what it made of it: the latter is returned for the chosen one.
    ///
    /// # Errors
    /// `try_value` fails.
    pub fn choose<T>(
        &self,
        mut try_value: impl FnMut(f64) -> Result<(ImageNoise, T)>,
    ) -> Result<(Sharpness, T)> {
        let (last, sharper) = self.values.split_last().expect("a ladder has values");
        let of = |value: f64, noise: ImageNoise| Sharpness { value, noise: Some(noise), ..self.sharpest() };
        for value in sharper {
            let (noise, made) = try_value(*value)?;
            if noise.share <= HARMLESS {
                return Ok((of(*value, noise), made));
            }
        }
        let (noise, made) = try_value(*last)?;
        Ok((of(*last, noise), made))
    }
}

/// The noise of a volume. `light` and `tossed` are the volumes of the counts and of tossed counts, with
/// `depths` voxels a column; `share` is that of the mask.
pub fn noise(light: &[f32], tossed: &[f32], depths: usize, share: f64) -> ImageNoise {
    let dark = brightest(tossed, depths);
    let over = |percent: f64| percentile(&dark, percent).map_or(0.0, f64::from);
    let level = level_over_haze(&brightest(light, depths), share);
    ImageNoise { share: level.map_or(0.0, |level| over(90.0) / level), floor: over(99.0) }
}

/// The capture with a sign for every photon. Its counts are photon counts.
pub fn with_random_signs(capture: &Capture) -> Capture {
    let mut tossed = capture.clone();
    tossed.histograms.par_chunks_exact_mut(capture.bins).enumerate().for_each(|(pair, counts)| {
        let mut coins = Pcg64::seed_from_u64(pair as u64);
        counts.iter_mut().for_each(|count| *count = sum_of_signs(*count, &mut coins));
    });
    tossed
}

/// The sum of `count` signs.
fn sum_of_signs(count: f32, coins: &mut Pcg64) -> f32 {
    // NaN, an unknown count, stays.
    if count <= 0.0 || count.is_nan() {
        return count;
    }
    let of = |coins: &mut Pcg64, n: u32| 2.0 * (coins.next_u64() >> (64 - n)).count_ones() as f32 - n as f32;
    if count <= COINS as f32 {
        of(coins, count as u32)
    } else {
        of(coins, COINS) * (count / COINS as f32).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn tossed_counts_have_no_mean_and_the_variance_of_their_counts() {
        for count in [0.0f32, 1.0, 3.0, 64.0, 1000.0] {
            let (pairs, bins) = (64, 256);
            let points = vec![DVec3::ZERO; pairs];
            let capture =
                Capture::new([pairs, 1], points.clone(), points, bins, 0.01, vec![count; pairs * bins]);
            let tossed = with_random_signs(&capture).histograms;
            let n = tossed.len() as f64;
            let mean = tossed.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
            let variance = tossed.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / n;
            // Four standard deviations of each.
            let count = f64::from(count);
            assert!(mean.abs() <= 4.0 * (count / n).sqrt(), "{count}: {mean}");
            assert!((variance - count).abs() <= 4.0 * count * (2.0 / n).sqrt(), "{count}: {variance}");
        }
    }

    #[test]
    fn the_sharpest_value_without_harm_is_chosen() {
        let ladder = Ladder { setting: "width", values: &[1.0, 2.0, 4.0] };
        let with = |noise: f64| {
            let mut tried = vec![];
            let (chosen, made) = ladder
                .choose(|value| {
                    tried.push(value);
                    Ok((ImageNoise { share: noise / value, floor: 0.0 }, value))
                })
                .unwrap();
            assert_eq!(made, chosen.value);
            assert_eq!(tried.last(), Some(&chosen.value));
            assert_eq!(chosen.noise.map(|n| n.share), Some(noise / chosen.value));
            (chosen.value, tried.len())
        };
        assert_eq!(with(0.5), (1.0, 1));
        assert_eq!(with(1.2), (2.0, 2));
        // Nothing is soft enough: the softest.
        assert_eq!(with(100.0), (4.0, 3));
    }

    #[test]
    fn noise_is_told_by_what_it_shows_beside_the_surface() {
        // A third of the columns has a surface of 1, in haze; noise of 0.3 in one of five.
        let depths = 4;
        let column =
            |i: usize, value: f32| (0..depths).map(move |z| if z == i % depths { value } else { 0.0 });
        let light: Vec<f32> = (0..300).flat_map(|i| column(i, if i % 3 == 0 { 1.0 } else { 0.02 })).collect();
        let of = |value: f32| -> Vec<f32> {
            (0..300).flat_map(|i| column(i, if i % 5 == 0 { value } else { 0.1 * value })).collect()
        };
        let found = noise(&light, &of(0.3), depths, 0.5);
        assert!((found.share - 0.6).abs() < 0.02 && (found.floor - 0.3).abs() < 1e-6, "{found:?}");
        assert_eq!(noise(&vec![0.0; 1200], &of(0.3), depths, 0.5).share, 0.0);
    }
}
