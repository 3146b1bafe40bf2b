use super::shared::{is_set, mask_of, rim as rim_of};
use super::{Call, Cells};

/// The rim: voxels among the 26 neighbours of an active voxel that are not active.
pub fn rim(call: &Call, b: &mut [Cells]) {
    bind!(b: mask u, rim_mask u);
    let active: Vec<bool> = (0..call.twin.grid.storage()).map(|i| is_set(mask, i)).collect();
    let rim = rim_of(call.twin.grid, &active);
    let words = mask_of(rim.len() / 32, |i| rim[i]);
    rim_mask[..words.len()].copy_from_slice(&words);
}
