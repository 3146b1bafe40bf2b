use rayon::prelude::*;

use super::domain::{bits_of, inside};
use super::shared::*;
use super::{BRICK_VOXELS, Call, Cells, Real};

/// Counts the voxels that may be active by their level below the largest smoothed value. Levels are steps of a
/// thirty-second of an octave, by the upper bits of the float. Values below all count in the lowest.
pub fn levels<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    /// Bricks of a task.
    const EACH: usize = 64;
    bind!(b: source f, counts u, levels u, reachable u);
    let grid = call.grid::<F>();
    let peak = counts[COUNT_PEAK_SMOOTH as usize] >> LEVEL_SHIFT;
    let tasks = source[..grid.storage()].par_chunks(EACH * BRICK_VOXELS).enumerate().map(|(task, source)| {
        let mut counted = [0; LEVELS as usize];
        for (i, source) in source.chunks(BRICK_VOXELS).enumerate() {
            let brick = task * EACH + i;
            let may = if reachable[brick] == 0 { [0; _] } else { inside(&grid, brick, grid.near_z) };
            for (source, may) in source.chunks(32).zip(may) {
                for value in bits_of(may).map(|bit| source[bit]).filter(|value| *value > F::zero()) {
                    let below = peak.wrapping_sub((value.wide() as f32).to_bits() >> LEVEL_SHIFT);
                    counted[(LEVELS - 1 - below.min(LEVELS - 1)) as usize] += 1;
                }
            }
        }
        counted
    });
    let sum = |a: [u32; LEVELS as usize], b: [u32; LEVELS as usize]| std::array::from_fn(|i| a[i] + b[i]);
    let all = tasks.reduce(|| [0; LEVELS as usize], sum);
    levels.iter_mut().zip(all).for_each(|(level, more)| *level += more);
}
