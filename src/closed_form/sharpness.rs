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
use crate::engine::{ImageNoise, Sharpness};
use crate::maps::percentile;

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

impl Ladder {
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

/// Errors of a volume other than photon noise, as a share of a surface's level. The brightest noise of a column, four standard
/// deviations, then stays below .4 of a surface (benches/NOTES.md).
const EVEN: f64 = 0.1;

/// Columns with at least this share of the largest ratio of signal to noise tell a surface's level.
const CLEAR: f32 = 0.5;

/// Share of the depths over which the noise is averaged.
const AVERAGED: usize = 8;

/// For each depth, the factor that makes the expected errors of a volume alike at all depths: the inverse falloff amplifies the
/// photon noise of far voxels, which then outshines near surfaces. `light` and `tossed` are as in [`noise`].
pub fn even_weights(light: &[f32], tossed: &[f32], depths: usize) -> Vec<f32> {
    // Twice the mean square of the positive half: volumes may be clipped at zero.
    let mut squares = vec![0.0f64; depths];
    for column in tossed.chunks(depths) {
        column.iter().zip(&mut squares).for_each(|(v, sum)| *sum += 2.0 * f64::from(v.max(0.0)).powi(2));
    }
    let (reach, columns) = ((depths / (2 * AVERAGED)).max(1), (tossed.len() / depths).max(1) as f64);
    let deviation = |z: usize| {
        let around = &squares[z.saturating_sub(reach)..(z + reach + 1).min(depths)];
        (around.iter().sum::<f64>() / (around.len() as f64 * columns)).sqrt()
    };
    let deviations: Vec<f64> = (0..depths).map(deviation).collect();
    // The clearest voxel of each column: its ratio to the noise, and its value.
    let clearest = |column: &[f32]| {
        let ratios =
            column.iter().zip(&deviations).map(|(v, d)| [*v / (*d as f32).max(f32::MIN_POSITIVE), *v]);
        ratios.fold([0.0f32; 2], |best, ratio| if ratio[0] > best[0] { ratio } else { best })
    };
    let clearest: Vec<[f32; 2]> = light.par_chunks(depths).map(clearest).collect();
    let ratios: Vec<f32> = clearest.iter().map(|c| c[0]).collect();
    let least = CLEAR * percentile(&ratios, 99.0).unwrap_or(0.0);
    let values: Vec<f32> = clearest.iter().filter(|c| c[0] >= least).map(|c| c[1]).collect();
    let even = EVEN * f64::from(percentile(&values, 50.0).unwrap_or(0.0));
    let weight = |d: &f64| if *d > 0.0 { (even / even.hypot(*d)) as f32 } else { 1.0 };
    deviations.iter().map(weight).collect()
}

/// Multiplies the values of each depth by its weight.
pub fn weigh(volume: &mut [f32], weights: &[f32]) {
    volume
        .par_chunks_mut(weights.len())
        .for_each(|column| column.iter_mut().zip(weights).for_each(|(v, w)| *v *= w));
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
    fn weights_make_noise_alike_at_all_depths() {
        let depths = 64;
        let far = |z: usize| (z as f32 / 8.0).powi(2);
        let mut random = Pcg64::seed_from_u64(3);
        let mut noise = |of: f32| -> Vec<f32> {
            let one = |i: usize, r: u64| {
                of * far(i % depths) * (sum_of_signs(64.0, &mut Pcg64::seed_from_u64(r)) / 8.0)
            };
            (0..400 * depths).map(|i| one(i, random.next_u64()).max(0.0)).collect()
        };
        // A third of the columns has a near surface, of nine standard deviations of the noise there.
        let (surface, mut light, mut tossed) = (9.0 * far(16), noise(1.0), noise(1.0));
        (0..400).step_by(3).for_each(|c| light[c * depths + 16] += surface);
        let found = |volume: &[f32]| {
            let top = |c: &[f32]| (0..depths).max_by(|a, b| c[*a].total_cmp(&c[*b]));
            volume.chunks(depths).step_by(3).filter(|c| top(c) == Some(16)).count()
        };
        assert!(found(&light) < 20, "far noise is brighter: {}", found(&light));
        let weights = even_weights(&light, &tossed, depths);
        [&mut light, &mut tossed].into_iter().for_each(|volume| weigh(volume, &weights));
        assert!(found(&light) > 130, "{}", found(&light));
        let dark = brightest(&tossed, depths).into_iter().fold(0.0, f32::max);
        assert!(dark < 0.7 * surface * weights[16], "{dark} {}", surface * weights[16]);
        // Without noise worth mentioning nothing changes.
        let weights = even_weights(&light, &noise(1e-4), depths);
        assert!(weights.iter().all(|w| (0.99..=1.0).contains(w)), "{weights:?}");
        assert!(even_weights(&light, &vec![0.0; light.len()], depths).iter().all(|w| *w == 1.0));
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
