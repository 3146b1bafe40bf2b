use rayon::prelude::*;

use super::domain::{WORDS, inside, words_of};
use super::shared::*;
use super::{BRICK_VOXELS, Call, Cells, Real};

/// The domain after a reduction: voxels above the share `push.flags` (bits) of the maximum and not below the least that
/// there is room for. Without a maximum above zero the domain stays unchanged if it has at most `push.first` voxels.
pub fn threshold<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: source f, counts u, mask u, reachable u, before u, ranks u, ranks_before u, brick_offsets u);
    let grid = call.grid::<F>();
    let words = grid.storage() / 32;
    before[..words].copy_from_slice(&mask[..words]);
    ranks_before[..words].copy_from_slice(&ranks[..words]);
    let of = |bits: u32| F::from32(f32::from_bits(bits));
    let above = of(call.push.flags) * of(counts[COUNT_PEAK_SMOOTH as usize]);
    let least = of(counts[COUNT_LEAST_SMOOTH as usize]);
    let changes = counts[COUNT_PEAK_SMOOTH as usize] != 0 || counts[COUNT_ACTIVE as usize] > call.push.first;
    let bricks = mask[..words].par_chunks_mut(WORDS).zip(brick_offsets).zip(source.par_chunks(BRICK_VOXELS));
    bricks.enumerate().for_each(|(brick, ((mask, count), source))| {
        if changes {
            mask.fill(0);
            if reachable[brick] != 0 {
                let may = inside(&grid, brick, grid.near_z);
                let is_kept = words_of(|i| source[i] > above && source[i] >= least);
                (0..WORDS).for_each(|w| mask[w] = may[w] & is_kept[w]);
            }
        }
        *count = mask.iter().map(|w| w.count_ones()).sum();
    });
}
