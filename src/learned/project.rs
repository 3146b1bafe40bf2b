//! Back-projection of the bands into the box of the network.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::sizes::{BANDS, DEEP, NEAR, PITCH, SAMPLES, SIDE, STEP};
use super::tensor::Tensor;

/// Columns of a tile along x and y, and voxels of it along z.
const TILE: usize = 16;
/// Pairs whose bands are added to a voxel at a time.
const TOGETHER: usize = 8;
/// Samples of a pair that a tile needs, at most: the paths in it differ by twice its diagonal.
const WINDOW: usize = 128;
/// Lines between those of two pairs, so that the same sample of many pairs is not in the same set of the nearest cache.
const APART: usize = 8;
/// Adding this to a small whole number gives a float with the number in its last bits.
const WHOLE: f32 = 8_388_608.0;

/// Samples of a pair's bands: none of the ones beyond those of the light has any.
pub const ROWS: usize = SAMPLES + WINDOW + 4;

/// The bands of a sample and of the next one: a line of the cache.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct SampleLine([f32; 16]);

/// A pair: laser and sensor point from the middle of the box's face, in walls, and its bands, [[`ROWS`]][band].
pub struct Pair {
    laser: DVec3,
    sensor: DVec3,
    bands: Vec<f32>,
    /// The samples of which a band is not zero.
    lit: Range<usize>,
}

impl Pair {
    pub fn new(laser: DVec3, sensor: DVec3, bands: Vec<f32>) -> Pair {
        let is_lit = |sample: &[f32]| sample.iter().any(|v| *v != 0.0);
        let mut samples = bands.chunks_exact(BANDS);
        let first = samples.position(is_lit);
        let last = bands.chunks_exact(BANDS).rposition(is_lit);
        let lit = first.zip(last).map_or(0..0, |(first, last)| first..last + 1);
        Pair { laser, sensor, bands, lit }
    }

    fn ends(&self) -> [[f32; 3]; 2] {
        [self.laser, self.sensor].map(|p| p.as_vec3().to_array())
    }

    /// Whether it adds anything to the voxels of a tile.
    fn reaches(&self, axes: [&[f32; TILE]; 3]) -> bool {
        let needed = samples(self.ends(), axes);
        // Of the last one, the sample behind it, too.
        needed.start < self.lit.end && self.lit.start <= needed.end
    }
}

/// The bands of all pairs at the voxels of the box, summed, each with a mean square of a ninth; in the first channels of `channels`.
pub fn project(pairs: &[Pair], channels: usize) -> Tensor {
    let tiles: Vec<Vec<[f32; BANDS]>> = (0..(SIDE / TILE).pow(2) * (DEEP / TILE))
        .into_par_iter()
        .map(|tile| {
            let [column, run] = [tile / (DEEP / TILE), tile % (DEEP / TILE)];
            let at = [column / (SIDE / TILE) * TILE, column % (SIDE / TILE) * TILE, run * TILE];
            pulp::Arch::new().dispatch(Tile { pairs, at })
        })
        .collect();
    let squares: Vec<[f64; BANDS]> = tiles
        .par_iter()
        .map(|tile| {
            let add = |sums: [f64; BANDS], v: &[f32; BANDS]| {
                std::array::from_fn(|band| sums[band] + f64::from(v[band]).powi(2))
            };
            tile.iter().fold([0.0; BANDS], add)
        })
        .collect();
    let cells = (SIDE * SIDE * DEEP) as f64;
    let scales: [f32; BANDS] = std::array::from_fn(|band| {
        let squares = squares.iter().map(|of| of[band]).sum::<f64>();
        (1.0 / (3.0 * (squares / cells).sqrt().max(1e-20))) as f32
    });
    let mut volume = Tensor::zeros(channels, [SIDE, SIDE, DEEP]);
    volume.fill(|band, x, y, row| {
        if band >= BANDS {
            return;
        }
        let column = (x / TILE * (SIDE / TILE) + y / TILE) * (DEEP / TILE);
        let within = (x % TILE * TILE + y % TILE) * TILE;
        for (tile, row) in tiles[column..].iter().zip(row.chunks_exact_mut(TILE)) {
            for (v, sum) in row.iter_mut().zip(&tile[within..]) {
                *v = (sum[band] * scales[band]).clamp(-60.0, 60.0);
            }
        }
    });
    volume
}

/// The sums over all pairs at the voxels of a tile, [x][y][z].
struct Tile<'p> {
    pairs: &'p [Pair],
    at: [usize; 3],
}

impl pulp::WithSimd for Tile<'_> {
    type Output = Vec<[f32; BANDS]>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> Vec<[f32; BANDS]> {
        let Tile { pairs, at } = self;
        let lateral = |k: usize| std::array::from_fn(|i| (((at[k] + i) as f64 + 0.5) * PITCH - 0.5) as f32);
        let (xs, ys): ([f32; TILE], [f32; TILE]) = (lateral(0), lateral(1));
        let zs: [f32; TILE] = std::array::from_fn(|z| (NEAR + ((at[2] + z) as f64 + 0.5) * PITCH) as f32);
        let none = SampleLine([0.0; 16]);
        let mut sums = vec![none; TILE * TILE * TILE];
        let mut lines = vec![[none; WINDOW + APART]; TOGETHER];
        // Most records end before the far tiles.
        let pairs: Vec<&Pair> = pairs.iter().filter(|pair| pair.reaches([&xs, &ys, &zs])).collect();
        let (together, alone) = pairs.as_chunks::<TOGETHER>();
        for pairs in together {
            add(simd, pairs, [&xs, &ys], &zs, &mut lines, &mut sums);
        }
        for pair in alone {
            add(simd, std::array::from_ref(pair), [&xs, &ys], &zs, &mut lines, &mut sums);
        }
        sums.iter().map(|SampleLine(both)| std::array::from_fn(|k| both[k] + both[k + BANDS])).collect()
    }
}

/// Adds the bands of some pairs to the sums of a tile: the samples before its voxels and, apart, the shares of the differences.
#[inline(always)]
fn add<S: pulp::Simd, const N: usize>(
    simd: S,
    pairs: &[&Pair; N],
    [xs, ys]: [&[f32; TILE]; 2],
    zs: &[f32; TILE],
    lines: &mut [[SampleLine; WINDOW + APART]],
    sums: &mut [SampleLine],
) {
    let lines: &mut [[SampleLine; WINDOW + APART]; N] = lines.first_chunk_mut().expect("lines of all pairs");
    let mut firsts = [0; N];
    let mut ends = [[[0.0f32; 3]; 2]; N];
    let mut deep = [[[0.0f32; TILE]; 2]; N];
    for p in 0..N {
        ends[p] = pairs[p].ends();
        let needed = samples(ends[p], [xs, ys, zs]);
        firsts[p] = needed.start;
        let bands = &pairs[p].bands[BANDS * firsts[p]..];
        for (i, line) in lines[p].iter_mut().enumerate().take(needed.len()) {
            let (two, _) = S::as_simd_f32s(&bands[BANDS * i..BANDS * i + 16]);
            S::as_mut_simd_f32s(&mut line.0).0.copy_from_slice(two);
        }
        for k in 0..2 {
            for z in 0..TILE {
                deep[p][k][z] = (zs[z] - ends[p][k][2]) * (zs[z] - ends[p][k][2]);
            }
        }
    }
    // Weights of a sample and the next one: 1 - share and share. What follows them in a line is not used.
    let vectors = (2 * BANDS).div_ceil(S::F32_LANES);
    let of = |values: [f32; 2]| SampleLine(std::array::from_fn(|k| values[usize::from(k >= BANDS)]));
    let (signs, ones) = (of([-1.0, 1.0]), of([1.0, 0.0]));
    let (signs, ones) = (S::as_simd_f32s(&signs.0).0, S::as_simd_f32s(&ones.0).0);
    for (column, sums) in sums.as_chunks_mut::<TILE>().0.iter_mut().enumerate() {
        let [x, y] = [xs[column / TILE], ys[column % TILE]];
        let (mut at, mut share) = ([[0u32; TILE]; N], [[0.0f32; TILE]; N]);
        for p in 0..N {
            let aside = |k: usize| {
                let [a, b, _] = ends[p][k];
                simd.splat_f32s((x - a) * (x - a) + (y - b) * (y - b))
            };
            let aside = [aside(0), aside(1)];
            let is_one = ends[p][0] == ends[p][1];
            let (at, _) = S::as_mut_simd_u32s(&mut at[p]);
            let (share, _) = S::as_mut_simd_f32s(&mut share[p]);
            let [first, second] = [S::as_simd_f32s(&deep[p][0]).0, S::as_simd_f32s(&deep[p][1]).0];
            for v in 0..TILE / S::F32_LANES {
                let a = simd.sqrt_f32s(simd.add_f32s(aside[0], first[v]));
                let b = if is_one { a } else { simd.sqrt_f32s(simd.add_f32s(aside[1], second[v])) };
                let path = simd.mul_f32s(simd.add_f32s(a, b), simd.splat_f32s((1.0 / STEP) as f32));
                // Beyond the last sample there is nothing.
                let is_in = simd.less_than_f32s(path, simd.splat_f32s((SAMPLES - 1) as f32));
                let path = simd.select_f32s(is_in, path, simd.splat_f32s(SAMPLES as f32));
                // Rounded in the sum, whose last bits are the whole number: faster than a conversion with its checks.
                let rounded =
                    simd.add_f32s(simd.sub_f32s(path, simd.splat_f32s(0.5)), simd.splat_f32s(WHOLE));
                at[v] = simd.sub_u32s(simd.transmute_u32s_f32s(rounded), simd.splat_u32s(firsts[p] as u32));
                share[v] = simd.sub_f32s(path, simd.sub_f32s(rounded, simd.splat_f32s(WHOLE)));
            }
        }
        for z in 0..TILE {
            let (to, _) = S::as_mut_simd_f32s(&mut sums[z].0);
            let mut sum = [simd.splat_f32s(0.0); 16];
            sum[..vectors].copy_from_slice(&to[..vectors]);
            for p in 0..N {
                let line = &lines[p][at[p][z] as usize % WINDOW].0;
                let (line, _) = S::as_simd_f32s(line);
                let share = simd.splat_f32s(share[p][z]);
                for v in 0..vectors {
                    let is_next = v * S::F32_LANES >= BANDS;
                    let weight = if is_next { share } else { simd.mul_add_e_f32s(share, signs[v], ones[v]) };
                    sum[v] = simd.mul_add_e_f32s(weight, line[v], sum[v]);
                }
            }
            to[..vectors].copy_from_slice(&sum[..vectors]);
        }
    }
}

/// The samples before the voxels of a tile, and one more on each side.
fn samples(ends: [[f32; 3]; 2], axes: [&[f32; TILE]; 3]) -> Range<usize> {
    let [mut near, mut far] = [0.0f32; 2];
    for end in ends {
        let [mut nearest, mut farthest] = [0.0f32; 2];
        for (axis, at) in axes.iter().zip(end) {
            let [below, above] = [axis[0] - at, at - axis[TILE - 1]];
            nearest += below.max(above).max(0.0).powi(2);
            farthest += below.min(above).powi(2);
        }
        near += nearest.sqrt();
        far += farthest.sqrt();
    }
    let sample = |path: f32| ((path * (1.0 / STEP) as f32) as usize).min(SAMPLES);
    let last = if sample(far) + 1 < SAMPLES { sample(far) + 1 } else { SAMPLES };
    sample(near).saturating_sub(1)..last + 1
}

#[cfg(test)]
mod tests {
    use glam::dvec3;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn tiles_beyond_the_light_are_left_out_without_a_change() {
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
                let path = (at.distance(p.laser) + at.distance(p.sensor)) * 128.0;
                let [i, w] = [path.floor(), path.fract()];
                let band = |i: usize| p.bands.get(i * BANDS + band).map_or(0.0, |v| f64::from(*v));
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
