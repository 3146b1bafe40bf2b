//! Back-projection of the bands into the box of the network.

use glam::DVec3;
use rayon::prelude::*;

use super::sizes::{BANDS, DEEP, NEAR, PITCH, SAMPLES, SIDE, STEP, wide};
use super::tensor::Tensor;

/// Columns of a tile along x and y, and voxels of it along z: what stays in the nearest cache.
const TILE: usize = 4;
const RUN: usize = 24;

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
            wide(
                #[inline(always)]
                || of_tile(pairs, at),
            )
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
#[inline(always)]
fn of_tile(pairs: &[Pair], at: [usize; 3]) -> Vec<[f32; 8]> {
    let lateral = |k: usize, i: usize| (((at[k] + i) as f64 + 0.5) * PITCH - 0.5) as f32;
    let mut sums = vec![[0.0f32; 8]; TILE * TILE * RUN];
    for Pair { laser, sensor, bands } in pairs {
        let bands: &[[f32; 8]; SAMPLES + 2] = bands.as_slice().try_into().expect("all samples");
        let [l, s] = [laser, sensor].map(|p| [p.x as f32, p.y as f32, p.z as f32]);
        let is_one = l == s;
        let depth = |z: usize| (NEAR + ((at[2] + z) as f64 + 0.5) * PITCH) as f32;
        let deep: [[f32; RUN]; 2] = [l, s].map(|p| std::array::from_fn(|z| (depth(z) - p[2]).powi(2)));
        for (column, sums) in sums.chunks_exact_mut(RUN).enumerate() {
            let [x, y] = [lateral(0, column / TILE), lateral(1, column % TILE)];
            let aside = [l, s].map(|p| (x - p[0]).powi(2) + (y - p[1]).powi(2));
            let mut paths = [0.0f32; RUN];
            if is_one {
                for z in 0..RUN {
                    paths[z] = 2.0 * (aside[0] + deep[0][z]).sqrt();
                }
            } else {
                for z in 0..RUN {
                    paths[z] = (aside[0] + deep[0][z]).sqrt() + (aside[1] + deep[1][z]).sqrt();
                }
            }
            let mut whole = [0i32; RUN];
            for z in 0..RUN {
                paths[z] *= (1.0 / STEP) as f32;
                // Beyond the last sample there is nothing.
                paths[z] = if paths[z] < (SAMPLES - 1) as f32 { paths[z] } else { SAMPLES as f32 };
                whole[z] = paths[z] as i32;
                paths[z] -= whole[z] as f32;
            }
            for (z, sum) in sums.iter_mut().enumerate() {
                let i = (whole[z] as usize).min(SAMPLES);
                let [a, b] = [bands[i], bands[i + 1]];
                for k in 0..8 {
                    sum[k] += a[k] + paths[z] * (b[k] - a[k]);
                }
            }
        }
    }
    sums
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
