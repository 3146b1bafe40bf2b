//! Samples of voxels.

use super::{Call, Real, SceneGrid};

/// Three numbers in [0, 1) from a voxel's storage index, the iteration and a stream: the same bits as in the kernels of a GPU.
/// PCG3D, Jarzynski & Olano 2020, "Hash functions for GPU rendering".
#[inline(always)]
pub fn random3<F: Real>(index: u32, iteration: u32, stream: u32, seed: u32) -> [F; 3] {
    let v = [index, iteration, seed ^ stream.wrapping_mul(0x9e37_79b9)];
    let [mut x, mut y, mut z] = v.map(|a| a.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    [x, y, z] = [x ^ x >> 16, y ^ y >> 16, z ^ z >> 16];
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    // 24 bits are exact in both types.
    [x, y, z].map(|a| F::from32((a >> 8) as f32) * F::of(1.0 / 16_777_216.0))
}

/// The random point of voxel `index` in an iteration, in voxels: within half a voxel of its centre and in the grid.
#[inline(always)]
pub fn sample_point<F: Real>(call: &Call<'_>, grid: &SceneGrid<F>, index: u32) -> [F; 3] {
    let random: [F; 3] = random3(index, call.push.iteration, 1, call.paper.seed);
    let c = grid.voxel(index as usize);
    std::array::from_fn(|a| {
        let point = F::from32(c[a] as f32) + (random[a] - F::of(0.5));
        point.at_least(F::zero()).at_most(F::from32((grid.n[a] - 1) as f32))
    })
}

/// The voxels (up to eight) that are interpolated at a point of the grid, in voxels, with their weights.
#[inline(always)]
pub fn corners<F: Real>(g: [F; 3]) -> impl Iterator<Item = ([usize; 3], F)> {
    let low = g.map(|v| v.wide() as usize);
    let shares: [[F; 2]; 3] = std::array::from_fn(|a| {
        let share = g[a] - F::from32(low[a] as f32);
        [F::one() - share, share]
    });
    (0..8).filter_map(move |corner| {
        let step = [corner & 1, corner >> 1 & 1, corner >> 2];
        let weight = shares[0][step[0]] * shares[1][step[1]] * shares[2][step[2]];
        (weight > F::zero()).then(|| (std::array::from_fn(|a| low[a] + step[a]), weight))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::{Push, SceneData};

    #[test]
    fn samples_stay_within_half_a_voxel_and_cover_it() {
        let [grid_x, grid_y, grid_z, bricks] = [10, 12, 14, 2];
        let (bricks_x, bricks_y, bricks_z) = (bricks, bricks, bricks);
        let scene =
            SceneData { grid_x, grid_y, grid_z, bricks_x, bricks_y, bricks_z, ..SceneData::default() };
        let sample = |iteration: u32, c: [usize; 3]| {
            let mut call = Call::new(&[], [0; 7], |_| None);
            call.scene = scene;
            call.push = Push { iteration, ..Push::default() };
            let grid = call.grid::<f64>();
            sample_point(&call, &grid, grid.index(c) as u32)
        };
        let (mut low, mut high, mut sum) = ([1.0f64; 3], [-1.0f64; 3], [0.0; 3]);
        for i in 0..4000 {
            let at = sample(i, [5, 6, 7]);
            for a in 0..3 {
                let d = at[a] - [5.0, 6.0, 7.0][a];
                (low[a], high[a], sum[a]) = (low[a].min(d), high[a].max(d), sum[a] + d);
            }
        }
        assert!(low.iter().all(|v| (-0.5..-0.49).contains(v)), "{low:?}");
        assert!(high.iter().all(|v| (0.49..0.5).contains(v)), "{high:?}");
        // Four standard errors of the mean of 4000 uniform numbers.
        assert!(sum.iter().all(|s| (s / 4000.0).abs() < 4.0 * (1.0f64 / 12.0 / 4000.0).sqrt()));
        let clamped = |c| {
            (0..20).map(|i| sample(i, c)).all(|g| (0..3).all(|a| g[a] >= 0.0 && g[a] <= [9.0, 11.0, 13.0][a]))
        };
        assert!(clamped([0, 0, 0]) && clamped([9, 11, 13]));
    }

    #[test]
    fn weights_of_corners_sum_to_one_and_to_the_point() {
        for g in [[2.0, 3.0, 4.0], [2.25, 3.5, 4.0], [0.1, 0.2, 0.3]] {
            let all: Vec<_> = corners::<f64>(g).collect();
            assert!((all.iter().map(|c| c.1).sum::<f64>() - 1.0).abs() < 1e-12);
            let sum = |a: usize| all.iter().map(|c| c.0[a] as f64 * c.1).sum::<f64>();
            assert!(g.iter().enumerate().all(|(a, g)| (sum(a) - g).abs() < 1e-12));
        }
        assert_eq!(corners([2.0, 3.0, 4.0]).count(), 1);
    }
}
