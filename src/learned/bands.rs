//! Light of a pair along the path, in five bands: what voxels at this path hear of it, at two scales and with either sign.

use super::project::ROWS;
use super::sizes::{BANDS, SAMPLES, STEP, wide};
use crate::transport::kernels::LEARNED_TAPS;

/// Widths of the Mexican hats and of their odd partners, and of a Gaussian, samples.
const WIDTHS: [f64; 2] = [1.5, 4.0];
const BROAD: f64 = 5.0;
/// Taps on each side.
const REACH: usize = LEARNED_TAPS as usize;
/// The background of a pair is this quantile of its bins, computed from about this many of them.
const QUANTILE: f64 = 0.2;
const LOOKED_AT: usize = 512;
/// Samples whose bands are computed together: those of all bands fit registers.
const BLOCK: usize = 16;
const _: () = assert!(SAMPLES.is_multiple_of(BLOCK));

/// The taps of the bands.
pub struct Bands {
    pub taps: [[f32; 2 * REACH + 1]; BANDS],
}

impl Bands {
    pub fn new() -> Bands {
        let at = |i: usize| i as f64 - REACH as f64;
        let count = 2 * REACH + 1;
        let scaled = |taps: Vec<f64>| -> [f32; 2 * REACH + 1] {
            let sum: f64 = taps.iter().map(|t| t.abs()).sum();
            std::array::from_fn(|i| (taps[i] / sum) as f32)
        };
        let gaussian = |k: f64, s: f64| (-0.5 * (k / s).powi(2)).exp();
        let even = |s: f64| {
            let hat: Vec<f64> =
                (0..count).map(|i| (1.0 - (at(i) / s).powi(2)) * gaussian(at(i), s)).collect();
            let mean = hat.iter().sum::<f64>() / count as f64;
            scaled(hat.into_iter().map(|v| v - mean).collect())
        };
        let odd = |s: f64| scaled((0..count).map(|i| at(i) / s * gaussian(at(i), s)).collect());
        let [fine, coarse] = WIDTHS;
        let broad = scaled((0..count).map(|i| gaussian(at(i), BROAD)).collect());
        Bands { taps: [even(fine), odd(fine), even(coarse), odd(coarse), broad] }
    }

    /// The bands of a histogram whose first bin begins at path `start`, with bins of `width`, both in walls: [sample][band], where
    /// sample i is at path i [`STEP`]. Light counts by the cube of its path.
    pub fn of(&self, counts: &[f32], [start, width]: [f64; 2]) -> Vec<f32> {
        let level = quantile(counts);
        let mut sums = vec![0.0f64];
        sums.extend(counts.iter().scan(0.0, |sum, v| {
            *sum += f64::from(v - level);
            Some(*sum)
        }));
        let until = |path: f64| {
            let x = ((path - start) / width).clamp(0.0, counts.len() as f64);
            let i = (x as usize).min(counts.len() - 1);
            sums[i] + (x - i as f64) * (sums[i + 1] - sums[i])
        };
        let edges: [f64; SAMPLES + 1] = std::array::from_fn(|i| until((i as f64 - 0.5) * STEP));
        let mut light = vec![0.0f32; SAMPLES + 2 * REACH];
        for (i, v) in light[REACH..REACH + SAMPLES].iter_mut().enumerate() {
            *v = ((edges[i + 1] - edges[i]) * (i as f64 * STEP).powi(3)) as f32;
        }
        // Nothing is beyond the last sample.
        let mut bands = vec![0.0f32; ROWS * BANDS];
        for from in (0..SAMPLES).step_by(BLOCK) {
            let light = &light[from..from + BLOCK + 2 * REACH];
            let block = wide(
                #[inline(always)]
                || self.block(light),
            );
            for (i, to) in bands[from * BANDS..].chunks_exact_mut(BANDS).take(BLOCK).enumerate() {
                for (to, of) in to.iter_mut().zip(&block) {
                    // Tails of filters over dark bins: processors take a hundred times as long for denormal numbers.
                    *to = if of[i].is_subnormal() { 0.0 } else { of[i] };
                }
            }
        }
        bands
    }

    /// The bands of a block of samples, from the light around them.
    #[inline(always)]
    fn block(&self, light: &[f32]) -> [[f32; BLOCK]; BANDS] {
        let [mut a, mut b, mut c, mut d, mut e] = [[0.0f32; BLOCK]; BANDS];
        for k in 0..2 * REACH + 1 {
            let light: &[f32; BLOCK] = light[2 * REACH - k..].first_chunk().expect("a block");
            for (to, taps) in [&mut a, &mut b, &mut c, &mut d, &mut e].into_iter().zip(&self.taps) {
                for (to, light) in to.iter_mut().zip(light) {
                    *to += taps[k] * light;
                }
            }
        }
        [a, b, c, d, e]
    }
}

/// A low quantile of the bins.
pub fn quantile(counts: &[f32]) -> f32 {
    let mut some: Vec<f32> = counts.iter().copied().step_by((counts.len() / LOOKED_AT).max(1)).collect();
    let at = QUANTILE * (some.len() - 1) as f64;
    let (i, share) = (at as usize, at.fract() as f32);
    let (_, low, above) = some.select_nth_unstable_by(i, f32::total_cmp);
    let next = above.iter().copied().min_by(f32::total_cmp).unwrap_or(*low);
    *low + share * (next - *low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_of_light_is_where_it_is_in_every_band() {
        // Bins of 1/256 wall from a path of half a wall on; all light in one of them.
        let (start, width, at) = (0.5, 1.0 / 256.0, 200);
        let mut counts = vec![3.0f32; 512];
        counts[at] += 10.0;
        let bands = Bands::new().of(&counts, [start, width]);
        // The bin lies in the samples around this one.
        let path = start + (at as f64 + 0.5) * width;
        let middle = (path / STEP).round() as usize;
        let of = |band: usize| bands.chunks(BANDS).map(move |b| f64::from(b[band])).collect::<Vec<f64>>();
        let all = 10.0 * path.powi(3);
        for band in [0, 2, 4] {
            let top = of(band).iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
            assert!(top.abs_diff(middle) <= 1, "{band}: {top}, {middle}");
        }
        // The Gaussian keeps the light, the others have none of what does not change.
        assert!((of(4).iter().sum::<f64>() / all - 1.0).abs() < 0.02, "{}", of(4).iter().sum::<f64>() / all);
        for band in 0..4 {
            assert!((of(band).iter().sum::<f64>() / all).abs() < 0.02, "{band}");
        }
        // Light behind it is positive in the odd bands.
        for band in [1, 3] {
            assert!(of(band)[middle + 2] > 0.0 && of(band)[middle - 2] < 0.0);
        }
        assert!(bands.len() == ROWS * BANDS && bands[SAMPLES * BANDS..].iter().all(|v| *v == 0.0));
    }

    #[test]
    fn the_background_of_a_pair_is_a_low_quantile() {
        assert_eq!(quantile(&[5.0, 1.0, 3.0, 2.0, 4.0, 6.0]), 2.0);
        assert_eq!(quantile(&[1.0]), 1.0);
        assert!((quantile(&[0.0, 1.0, 2.0, 3.0]) - 0.6).abs() < 1e-6);
    }
}
