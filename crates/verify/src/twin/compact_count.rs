use super::{Call, Cells};

/// Counts the voxels of each brick of a mask.
pub fn compact_count(call: &Call, b: &mut [Cells]) {
    bind!(b: mask u, brick_offsets u);
    let bricks = call.twin.grid.bricks().iter().product();
    for (words, count) in mask.chunks(16).zip(brick_offsets).take(bricks) {
        *count = words.iter().map(|w| w.count_ones()).sum();
    }
}
