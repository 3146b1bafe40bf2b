use rayon::prelude::*;

use super::domain::{WORDS, inside};
use super::{Call, Cells, Real};

/// The first domain: voxels that are not too near and within reach of a bin.
pub fn initialise<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: mask u, reachable u);
    let grid = call.grid::<F>();
    mask[..grid.storage() / 32].par_chunks_mut(WORDS).enumerate().for_each(|(brick, words)| {
        let all = if reachable[brick] == 0 { [0; WORDS] } else { inside(&grid, brick, grid.near_z) };
        words.copy_from_slice(&all);
    });
}
