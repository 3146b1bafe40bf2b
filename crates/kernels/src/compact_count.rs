use rayon::prelude::*;

use super::domain::WORDS;
use super::{Call, Cells, Real};

/// Counts the voxels of each brick of a mask.
pub fn compact_count<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: mask u, brick_offsets u);
    let words = call.grid::<F>().storage() / 32;
    let bricks = mask[..words].par_chunks(WORDS).zip(brick_offsets).with_min_len(256);
    bricks.for_each(|(words, count)| *count = words.iter().map(|w| w.count_ones()).sum());
}
