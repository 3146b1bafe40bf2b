use super::shared::{mask_of, may_be_active};
use super::{Call, Cells};
use thirdbounce::transport::BRICK_VOXELS;

/// The first domain: voxels that are not too near and within reach of a bin.
pub fn initialise(call: &Call, b: &mut [Cells]) {
    bind!(b: mask u, reachable u);
    let on = |index: usize| reachable[index / BRICK_VOXELS] != 0 && may_be_active(&call.twin, index);
    let words = mask_of(call.twin.grid.storage() / 32, on);
    mask[..words.len()].copy_from_slice(&words);
}
