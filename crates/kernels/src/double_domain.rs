use rayon::prelude::*;

use super::domain::{WORDS, is_set, words_of};
use super::{BRICK_VOXELS, Call, Cells, Real};

/// The domain at twice the lateral resolution: a voxel is active if its parent was.
pub fn double_domain<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: coarse_mask u, mask u);
    let (fine, coarse) = (call.grid::<F>(), call.grid::<F>().coarser());
    let is_on = |index: usize| {
        let [x, y, z] = fine.voxel(index);
        fine.contains([x, y, z]) && is_set(coarse_mask, coarse.index([x / 2, y / 2, z]))
    };
    mask[..fine.storage() / 32].par_chunks_mut(WORDS).enumerate().for_each(|(brick, words)| {
        words.copy_from_slice(&words_of(|i| is_on(brick * BRICK_VOXELS + i)));
    });
}
