//! Back-projection of the bands into the box of the network.

use glam::DVec3;
use rayon::prelude::*;

use super::sizes::{BANDS, DEEP, NEAR, PITCH, SAMPLES, SIDE, STEP};
use super::tensor::Tensor;

/// Columns of a tile along x and y, and voxels of it along z: what stays in the nearest cache.
const TILE: usize = 8;
const RUN: usize = 24;
/// Pairs whose bands are added to a voxel at a time.
const TOGETHER: usize = 4;
/// Adding this to a small whole number gives a float with the number in its last bits.
const WHOLE: f32 = 8_388_608.0;

/// A pair: laser and sensor point from the middle of the box's face, in walls, and its bands.
pub struct Pair {
    pub laser: DVec3,
    pub sensor: DVec3,
    pub bands: Vec<[f32; 8]>,
}

/// The bands of all pairs at the voxels of the box, summed, each with a mean square of a ninth; in the first channels of `channels`.
pub fn project(pairs: &[Pair], channels: usize) -> Tensor {
    let tiles: Vec<Vec<[f32; 8]>> = (0..(SIDE / TILE).pow(2) * (DEEP / RUN))
        .into_par_iter()
        .map(|tile| {
            let [column, run] = [tile / (DEEP / RUN), tile % (DEEP / RUN)];
            let at = [column / (SIDE / TILE) * TILE, column % (SIDE / TILE) * TILE, run * RUN];
            pulp::Arch::new().dispatch(Tile { pairs, at })
        })
        .collect();
    let cells = (SIDE * SIDE * DEEP) as f64;
    let scales: Vec<f32> = (0..BANDS)
        .map(|band| {
            let squares = tiles.par_iter().map(|t| t.iter().map(|v| f64::from(v[band]).powi(2)).sum::<f64>());
            (1.0 / (3.0 * (squares.sum::<f64>() / cells).sqrt().max(1e-20))) as f32
        })
        .collect();
    let mut volume = Tensor::zeros(channels, [SIDE, SIDE, DEEP]);
    volume.fill(|band, x, y, row| {
        if band >= BANDS {
            return;
        }
        for (z, v) in row.iter_mut().enumerate() {
            let tile = (x / TILE * (SIDE / TILE) + y / TILE) * (DEEP / RUN) + z / RUN;
            let within = (x % TILE * TILE + y % TILE) * RUN + z % RUN;
            *v = (tiles[tile][within][band] * scales[band]).clamp(-60.0, 60.0);
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
    type Output = Vec<[f32; 8]>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> Vec<[f32; 8]> {
        let Tile { pairs, at } = self;
        let lateral = |k: usize| std::array::from_fn(|i| (((at[k] + i) as f64 + 0.5) * PITCH - 0.5) as f32);
        let (xs, ys): ([f32; TILE], [f32; TILE]) = (lateral(0), lateral(1));
        let zs: [f32; RUN] = std::array::from_fn(|z| (NEAR + ((at[2] + z) as f64 + 0.5) * PITCH) as f32);
        let mut sums = vec![[0.0f32; 8]; TILE * TILE * RUN];
        let (together, alone) = pairs.as_chunks::<TOGETHER>();
        for pairs in together {
            add(pairs, [&xs, &ys], &zs, &mut sums);
        }
        for pair in alone {
            add(std::array::from_ref(pair), [&xs, &ys], &zs, &mut sums);
        }
        sums
    }
}

/// Adds the bands of some pairs to the sums of a tile.
#[inline(always)]
fn add<const N: usize>(
    pairs: &[Pair; N],
    [xs, ys]: [&[f32; TILE]; 2],
    zs: &[f32; RUN],
    sums: &mut [[f32; 8]],
) {
    let bands: [&[[f32; 8]; SAMPLES + 2]; N] =
        std::array::from_fn(|p| pairs[p].bands.as_slice().try_into().expect("all samples"));
    let ends = pairs.each_ref().map(|p| [p.laser, p.sensor].map(|p| [p.x as f32, p.y as f32, p.z as f32]));
    let mut deep = [[[0.0f32; RUN]; 2]; N];
    for (deep, end) in deep.as_flattened_mut().iter_mut().zip(ends.as_flattened()) {
        for z in 0..RUN {
            deep[z] = (zs[z] - end[2]) * (zs[z] - end[2]);
        }
    }
    for (column, sums) in sums.as_chunks_mut::<RUN>().0.iter_mut().enumerate() {
        let [x, y] = [xs[column / TILE], ys[column % TILE]];
        let (mut whole, mut share) = ([[0u32; RUN]; N], [[0.0f32; RUN]; N]);
        for p in 0..N {
            let aside = ends[p].map(|p| (x - p[0]) * (x - p[0]) + (y - p[1]) * (y - p[1]));
            let mut paths = [0.0f32; RUN];
            if ends[p][0] == ends[p][1] {
                for z in 0..RUN {
                    paths[z] = 2.0 * (aside[0] + deep[p][0][z]).sqrt();
                }
            } else {
                for z in 0..RUN {
                    paths[z] = (aside[0] + deep[p][0][z]).sqrt() + (aside[1] + deep[p][1][z]).sqrt();
                }
            }
            for z in 0..RUN {
                let path = paths[z] * (1.0 / STEP) as f32;
                // Beyond the last sample there is nothing.
                let path = if path < (SAMPLES - 1) as f32 { path } else { SAMPLES as f32 };
                // Rounded in the sum, whose last bits are the whole number: faster than a conversion with its checks.
                let rounded = path - 0.5 + WHOLE;
                whole[p][z] = rounded.to_bits() & 0x3ff;
                share[p][z] = path - (rounded - WHOLE);
            }
        }
        for z in 0..RUN {
            let mut sum = sums[z];
            for p in 0..N {
                let i = (whole[p][z] as usize).min(SAMPLES);
                let [a, b] = [bands[p][i], bands[p][i + 1]];
                for k in 0..8 {
                    sum[k] = share[p][z].mul_add(b[k] - a[k], sum[k] + a[k]);
                }
            }
            sums[z] = sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn voxels_have_the_bands_of_their_paths() {
        let mut random = Pcg64::seed_from_u64(0);
        let pair = |laser: DVec3, sensor: DVec3, random: &mut Pcg64| {
            let mut bands = vec![[0.0f32; 8]; SAMPLES + 2];
            for sample in &mut bands[..SAMPLES] {
                sample[..BANDS].iter_mut().for_each(|v| *v = random.random::<f32>() - 0.5);
            }
            Pair { laser, sensor, bands }
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
                let band = |i: usize| p.bands.get(i).map_or(0.0, |v| f64::from(v[band]));
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
