//! Back-projection of the bands into the box of the network.

use std::any::Any;
use std::ops::Range;

use bytemuck::{cast, cast_slice, cast_slice_mut};
use glam::DVec3;
use rayon::prelude::*;

use super::sizes::{BANDS, DEEP, NEAR, PITCH, SAMPLES, SIDE, STEP};
use super::tensor::Tensor;

/// Voxels of a block along x, y and z.
const BLOCK: [usize; 3] = [16, 16, 32];
const CELLS: usize = BLOCK[0] * BLOCK[1] * BLOCK[2];
/// Pairs whose bands are added to a block at a time: what it needs of them fits the nearest cache.
const TOGETHER: usize = 4;
/// Values of a line of the cache.
const LINE: usize = 16;
/// Adding this to a small whole number gives a float with the number in its last bits.
const WHOLE: f32 = 12_582_912.0;

/// Samples of a pair's bands: none of the ones beyond those of the light has any.
pub const ROWS: usize = SAMPLES + 2 * LINE;

/// Rows of samples, each of whole lines of the cache.
#[repr(align(64))]
struct BandLines([[f32; ROWS]; BANDS]);

/// A pair: laser and sensor point from the middle of the box's face, and its bands.
pub struct Pair {
    /// In samples.
    ends: [[f32; 3]; 2],
    /// [band][[`ROWS`]].
    bands: Box<BandLines>,
    /// The samples of which a band is not zero.
    lit: Range<usize>,
}

impl Pair {
    /// Of points in walls and of bands [[`ROWS`]][band].
    pub fn new(laser: DVec3, sensor: DVec3, bands: Vec<f32>) -> Pair {
        let is_lit = |sample: &[f32; BANDS]| sample.iter().any(|v| *v != 0.0);
        let samples = bands.as_chunks::<BANDS>().0;
        let first = samples.iter().position(is_lit);
        let last = samples.iter().rposition(is_lit);
        let lit = first.zip(last).map_or(0..0, |(first, last)| first..last + 1);
        let mut rows = Box::new(BandLines([[0.0; ROWS]; BANDS]));
        for (band, to) in rows.0.iter_mut().enumerate() {
            to.iter_mut().zip(samples).for_each(|(to, sample)| *to = sample[band]);
        }
        let ends = [laser, sensor].map(|p| (p / STEP).as_vec3().to_array());
        Pair { ends, bands: rows, lit }
    }

    /// Whether it adds anything to the voxels of a block.
    fn reaches(&self, axes: &[Vec<f32>; 3]) -> bool {
        let [mut near, mut far] = [0.0f32; 2];
        for end in self.ends {
            let [mut nearest, mut farthest] = [0.0f32; 2];
            for (axis, at) in axes.iter().zip(end) {
                let [below, above] = [axis[0] - at, at - axis[axis.len() - 1]];
                nearest += below.max(above).max(0.0).powi(2);
                farthest += below.min(above).powi(2);
            }
            near += nearest.sqrt();
            far += farthest.sqrt();
        }
        // One more on each side for the rounding; of the last one, the sample behind it, too.
        near - 1.0 < self.lit.end as f32 && self.lit.start as f32 <= far + 2.0
    }
}

/// The bands of all pairs at the voxels of the box, summed, each with a mean square of a ninth; in the first channels of `channels`.
pub fn project(pairs: &[Pair], channels: usize) -> Tensor {
    let [across, runs] = [SIDE / BLOCK[1], DEEP / BLOCK[2]];
    let blocks: Vec<Vec<f32>> = (0..SIDE / BLOCK[0] * across * runs)
        .into_par_iter()
        .map(|block| {
            let at =
                [block / runs / across * BLOCK[0], block / runs % across * BLOCK[1], block % runs * BLOCK[2]];
            pulp::Arch::new().dispatch(ProjectedBlock { pairs, at })
        })
        .collect();
    let scales: [f32; BANDS] = std::array::from_fn(|band| {
        let square = |block: &Vec<f32>| -> f64 {
            block[band * CELLS..][..CELLS].iter().map(|v| f64::from(*v).powi(2)).sum()
        };
        let mean = blocks.par_iter().map(square).sum::<f64>() / (SIDE * SIDE * DEEP) as f64;
        (1.0 / (3.0 * mean.sqrt().max(1e-20))) as f32
    });
    let mut volume = Tensor::zeros(channels, [SIDE, SIDE, DEEP]);
    volume.fill(|band, x, y, row| {
        if band >= BANDS {
            return;
        }
        let column = (x / BLOCK[0] * across + y / BLOCK[1]) * runs;
        let within = ((band * BLOCK[0] + x % BLOCK[0]) * BLOCK[1] + y % BLOCK[1]) * BLOCK[2];
        for (block, row) in blocks[column..].iter().zip(row.chunks_exact_mut(BLOCK[2])) {
            for (v, sum) in row.iter_mut().zip(&block[within..]) {
                *v = (sum * scales[band]).clamp(-60.0, 60.0);
            }
        }
    });
    volume
}

/// The sums over all pairs at the voxels of a block, [band][x][y][z].
struct ProjectedBlock<'p> {
    pairs: &'p [Pair],
    at: [usize; 3],
}

impl pulp::WithSimd for ProjectedBlock<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> Vec<f32> {
        let Tiles { wide, deep, axes, places: [xs, ys, zs], middles, before } = Tiles::<S>::of(self.at);
        let [across, runs, tiles] = [BLOCK[1] / wide, BLOCK[2] / deep, CELLS / S::F32_LANES];
        let zero = simd.splat_f32s(0.0);
        let mut sums = vec![[zero; BANDS]; tiles];
        let (mut firsts, mut froms) = (vec![0u32; TOGETHER * tiles], vec![0.0f32; TOGETHER * tiles]);
        let whole = simd.splat_f32s(WHOLE);
        let bits = simd.transmute_u32s_f32s(whole);
        // Windows of the widest vectors are two lines of the cache.
        let start = simd.splat_u32s(if S::F32_LANES == LINE { !(LINE as u32 - 1) } else { !0 });
        let mut is_confocal = [false; TOGETHER];
        let mut behind = vec![[[zero; 2]; TOGETHER]; runs];
        // Most records end before the far blocks.
        let pairs: Vec<&Pair> = self.pairs.iter().filter(|pair| pair.reaches(&axes)).collect();
        for pairs in pairs.chunks(TOGETHER) {
            for (p, pair) in pairs.iter().enumerate() {
                is_confocal[p] = pair.ends[0] == pair.ends[1];
                let to = S::as_mut_simd_u32s(&mut firsts[p * tiles..][..tiles]).0.iter_mut();
                let froms = S::as_mut_simd_f32s(&mut froms[p * tiles..][..tiles]).0;
                for ((to, from), [x, y, z]) in to.zip(froms).zip(&middles) {
                    let mut path = simd.splat_f32s(-before - 0.5);
                    for end in pair.ends {
                        let aside = simd.add_f32s(square(simd, *x, end[0]), square(simd, *y, end[1]));
                        path = simd
                            .add_f32s(path, simd.sqrt_f32s(simd.add_f32s(aside, square(simd, *z, end[2]))));
                    }
                    let path = simd.min_f32s(simd.max_f32s(path, zero), simd.splat_f32s(SAMPLES as f32));
                    let first = simd.sub_u32s(simd.transmute_u32s_f32s(simd.add_f32s(path, whole)), bits);
                    *to = simd.and_u32s(first, start);
                    *from = simd.sub_f32s(simd.transmute_f32s_u32s(simd.add_u32s(*to, bits)), whole);
                }
                for (to, z) in behind.iter_mut().zip(&zs) {
                    for (to, end) in to[p].iter_mut().zip(pair.ends) {
                        // Not zero, of which the estimate of a root is infinite.
                        *to = simd.add_f32s(square(simd, *z, end[2]), simd.splat_f32s(1e-20));
                    }
                }
            }
            for (column, sums) in sums.chunks_exact_mut(runs).enumerate() {
                let mut aside = [[zero; 2]; TOGETHER];
                for (to, pair) in aside.iter_mut().zip(pairs) {
                    for (to, [x, y, _]) in to.iter_mut().zip(pair.ends) {
                        let x = square(simd, xs[column / across], x);
                        *to = simd.add_f32s(x, square(simd, ys[column % across], y));
                    }
                }
                for (run, sums) in sums.iter_mut().enumerate() {
                    let (behind, tile) = (&behind[run], column * runs + run);
                    let mut sum = *sums;
                    for (p, pair) in pairs.iter().enumerate() {
                        let (first, from) = (firsts[p * tiles + tile], froms[p * tiles + tile]);
                        let a = simd.sqrt_f32s(simd.add_f32s(aside[p][0], behind[p][0]));
                        let b = if is_confocal[p] {
                            a
                        } else {
                            root(simd, simd.add_f32s(aside[p][1], behind[p][1]))
                        };
                        let path = simd.add_f32s(a, simd.sub_f32s(b, simd.splat_f32s(from)));
                        let (at, share) = parts(simd, path);
                        let rest = simd.sub_f32s(simd.splat_f32s(1.0), share);
                        for (sum, band) in sum.iter_mut().zip(&pair.bands.0) {
                            let [low, high] = look_up(simd, band, first, at);
                            *sum = simd.mul_add_e_f32s(rest, low, *sum);
                            *sum = simd.mul_add_e_f32s(share, high, *sum);
                        }
                    }
                    *sums = sum;
                }
            }
        }
        in_rows::<S>(&sums, [wide, deep])
    }
}

/// The tiles of a block, each a vector: so few samples lie between the paths of its voxels that they are looked up in registers.
struct Tiles<S: pulp::Simd> {
    /// Voxels of a tile along x and y, and along z.
    wide: usize,
    deep: usize,
    /// Centres of voxels along each axis, samples; the same in the lanes of tiles; and the middles of as many tiles as there are lanes.
    axes: [Vec<f32>; 3],
    places: [Vec<S::f32s>; 3],
    middles: Vec<[S::f32s; 3]>,
    /// The paths of a tile are no shorter than that of its middle less these samples.
    before: f32,
}

impl<S: pulp::Simd> Tiles<S> {
    /// Those of the block that begins at a voxel.
    #[inline(always)]
    fn of(at: [usize; 3]) -> Tiles<S> {
        let wide = if S::F32_LANES < 4 { 1 } else { 2 };
        let deep = S::F32_LANES / (wide * wide);
        let [across, runs] = [BLOCK[1] / wide, BLOCK[2] / deep];
        let axes: [Vec<f32>; 3] = std::array::from_fn(|k| {
            let from = [-0.5, -0.5, NEAR][k];
            let centre = |i: usize| ((from + ((at[k] + i) as f64 + 0.5) * PITCH) / STEP) as f32;
            (0..BLOCK[k]).map(centre).collect()
        });
        let lanes = |values: &dyn Fn(usize) -> f32| -> S::f32s {
            S::as_simd_f32s(&std::array::from_fn::<f32, 16, _>(values)).0[0]
        };
        let places = [
            axes[0].chunks(wide).map(|x| lanes(&|i| x[i / deep / wide % wide])).collect(),
            axes[1].chunks(wide).map(|y| lanes(&|i| y[i / deep % wide])).collect(),
            axes[2].chunks(deep).map(|z| lanes(&|i| z[i % deep])).collect(),
        ];
        let middle = |k: usize, i: usize, n: usize| 0.5 * (axes[k][n * i] + axes[k][n * i + n - 1]);
        let middles = (0..CELLS / S::F32_LANES / S::F32_LANES)
            .map(|i| {
                let tile = |lane: usize| i * S::F32_LANES + lane % S::F32_LANES;
                let x = lanes(&|lane| middle(0, tile(lane) / runs / across, wide));
                let y = lanes(&|lane| middle(1, tile(lane) / runs % across, wide));
                [x, y, lanes(&|lane| middle(2, tile(lane) % runs, deep))]
            })
            .collect();
        // Two legs of half a diagonal each, and a little for the rounding.
        let squares = 2 * (wide - 1).pow(2) + (deep - 1).pow(2);
        let before = ((squares as f64).sqrt() * PITCH / STEP + 0.02) as f32;
        Tiles { wide, deep, axes, places, middles, before }
    }
}

/// The sums of all tiles of this shape as [band][x][y][z].
fn in_rows<S: pulp::Simd>(sums: &[[S::f32s; BANDS]], [wide, deep]: [usize; 2]) -> Vec<f32> {
    let [across, runs] = [BLOCK[1] / wide, BLOCK[2] / deep];
    let mut all = vec![0.0; BANDS * CELLS];
    for (tile, sums) in sums.iter().enumerate() {
        let [x, y, z] = [tile / runs / across * wide, tile / runs % across * wide, tile % runs * deep];
        for (band, sum) in sums.iter().enumerate() {
            for (i, row) in cast_slice(&[*sum]).chunks_exact(deep).enumerate() {
                let column = (band * BLOCK[0] + x + i / wide) * BLOCK[1] + y + i % wide;
                all[column * BLOCK[2] + z..][..deep].copy_from_slice(row);
            }
        }
    }
    all
}

#[inline(always)]
fn square<S: pulp::Simd>(simd: S, a: S::f32s, b: f32) -> S::f32s {
    let d = simd.sub_f32s(a, simd.splat_f32s(b));
    simd.mul_f32s(d, d)
}

/// A root of positive values beside another: of wide vectors an estimate with a step of Newton's, as roots use one unit alone.
#[inline(always)]
fn root<S: pulp::Simd>(simd: S, of: S::f32s) -> S::f32s {
    #[cfg(target_arch = "x86_64")]
    if let Some(v4) = (&simd as &dyn Any).downcast_ref::<pulp::x86::V4>() {
        let inverse = cast(v4.avx512f._mm512_rsqrt14_ps(cast(of)));
        let root = simd.mul_f32s(of, inverse);
        let error = simd.mul_add_f32s(simd.neg_f32s(root), root, of);
        return simd.mul_add_f32s(simd.mul_f32s(inverse, simd.splat_f32s(0.5)), error, root);
    }
    simd.sqrt_f32s(of)
}

/// Whole numbers, in the last bits, and what is beyond them.
#[inline(always)]
fn parts<S: pulp::Simd>(simd: S, of: S::f32s) -> (S::u32s, S::f32s) {
    #[cfg(target_arch = "x86_64")]
    if let Some(v4) = (&simd as &dyn Any).downcast_ref::<pulp::x86::V4>() {
        let of = cast(of);
        return (cast(v4.avx512f._mm512_cvttps_epi32(of)), cast(v4.avx512dq._mm512_reduce_ps::<1>(of)));
    }
    let whole = simd.splat_f32s(WHOLE);
    let rounded = simd.add_f32s(simd.sub_f32s(of, simd.splat_f32s(0.5)), whole);
    (simd.transmute_u32s_f32s(rounded), simd.sub_f32s(of, simd.sub_f32s(rounded, whole)))
}

/// The samples of a band at places behind the first one, and those behind them.
#[inline(always)]
fn look_up<S: pulp::Simd>(simd: S, band: &[f32], first: u32, at: S::u32s) -> [S::f32s; 2] {
    let first = first.min(SAMPLES as u32) as usize;
    #[cfg(target_arch = "x86_64")]
    if let Some(v4) = (&simd as &dyn Any).downcast_ref::<pulp::x86::V4>() {
        let line = |k: usize| pulp::cast(*band[first + k..].first_chunk::<LINE>().expect("a line"));
        let ([low, high], at) = ([line(0), line(LINE)], cast(at));
        let next = v4.avx512f._mm512_add_epi32(at, pulp::cast([1u32; LINE]));
        return [at, next].map(|at| cast(v4.avx512f._mm512_permutex2var_ps(low, at, high)));
    }
    #[cfg(target_arch = "x86_64")]
    if let Some(v3) = (&simd as &dyn Any).downcast_ref::<pulp::x86::V3>() {
        let window = |k: usize| pulp::cast(*band[first + k..].first_chunk::<8>().expect("a window"));
        return [window(0), window(1)].map(|of| cast(v3.avx2._mm256_permutevar8x32_ps(of, cast(at))));
    }
    let mut found = [simd.splat_f32s(0.0); 2];
    for (k, found) in found.iter_mut().enumerate() {
        let found: &mut [f32] = cast_slice_mut(std::slice::from_mut(found));
        for (to, at) in found.iter_mut().zip(cast_slice::<_, u32>(&[at])) {
            *to = band[first + k + *at as usize % LINE];
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use glam::dvec3;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn blocks_beyond_the_light_are_left_out_without_a_change() {
        let mut random = Pcg64::seed_from_u64(1);
        let lit = 40..90;
        let pairs = |is_known: bool| -> Vec<Pair> {
            let mut random = Pcg64::seed_from_u64(1);
            let mut side = || random.random::<f64>() - 0.5;
            let ends: Vec<DVec3> = (0..11).map(|_| dvec3(side(), side(), 0.0)).collect();
            let mut bands = vec![0.0f32; ROWS * BANDS];
            bands[lit.start * BANDS..lit.end * BANDS].fill_with(|| random.random::<f32>() - 0.5);
            let of = |end: &DVec3| {
                let pair = Pair::new(*end, *end, bands.clone());
                assert_eq!(pair.lit, lit);
                Pair { lit: if is_known { lit.clone() } else { 0..ROWS }, ..pair }
            };
            ends.iter().map(of).collect()
        };
        let [few, all] = [true, false].map(|is_known| project(&pairs(is_known), BANDS));
        for _ in 0..200 {
            let mut place = |n: usize| random.random_range(0..n);
            let (band, x, y) = (place(BANDS), place(SIDE), place(SIDE));
            assert_eq!(few.along_z(band, x, y), all.along_z(band, x, y));
        }
    }

    #[test]
    fn voxels_have_the_bands_of_their_paths() {
        let mut random = Pcg64::seed_from_u64(0);
        let pair = |laser: DVec3, sensor: DVec3, random: &mut Pcg64| {
            let mut bands = vec![0.0f32; ROWS * BANDS];
            bands[..SAMPLES * BANDS].iter_mut().for_each(|v| *v = random.random::<f32>() - 0.5);
            Pair::new(laser, sensor, bands)
        };
        let (a, b) = (dvec3(0.3, -0.2, 0.02), dvec3(-0.4, 0.1, -0.01));
        let pairs = [pair(a, a, &mut random), pair(a, b, &mut random)];
        let volume = project(&pairs, BANDS);
        let expected = |x: usize, y: usize, z: usize, band: usize| -> f64 {
            let side = |i: usize| (i as f64 + 0.5) / 64.0 - 0.5;
            let at = dvec3(side(x), side(y), 0.1 + (z as f64 + 0.5) / 64.0);
            let of = |p: &Pair| {
                let leg = |end: [f32; 3]| (128.0 * at).distance(glam::Vec3::from(end).as_dvec3());
                let path = leg(p.ends[0]) + leg(p.ends[1]);
                let [i, w] = [path.floor(), path.fract()];
                let band = |i: usize| p.bands.0[band].get(i).map_or(0.0, |v| f64::from(*v));
                (1.0 - w) * band(i as usize) + w * band(i as usize + 1)
            };
            pairs.iter().map(of).sum()
        };
        let places: Vec<[usize; 3]> = (0..300).map(|i| [i * 7 % 64, i * 13 % 64, i * 29 % 96]).collect();
        for band in 0..BANDS {
            // All voxels of a band have one scale.
            let value = |[x, y, z]: [usize; 3]| f64::from(volume.along_z(band, x, y)[z]);
            let [both, squares] = places.iter().fold([0.0; 2], |[both, squares], at| {
                let e = expected(at[0], at[1], at[2], band);
                [both + e * value(*at), squares + e * e]
            });
            let scale = both / squares;
            for at in &places {
                let e = scale * expected(at[0], at[1], at[2], band);
                assert!((value(*at) - e).abs() < 2e-3, "{band} {at:?}: {} {e}", value(*at));
            }
            let cells = (0..SIDE * SIDE).flat_map(|c| volume.along_z(band, c / SIDE, c % SIDE));
            let mean = cells.map(|v| f64::from(*v).powi(2)).sum::<f64>() / (SIDE * SIDE * DEEP) as f64;
            assert!((9.0 * mean - 1.0).abs() < 1e-4, "{mean}");
        }
    }
}
