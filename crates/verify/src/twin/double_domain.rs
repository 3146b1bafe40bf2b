use super::shared::{is_set, mask_of};
use super::{Call, Cells};

/// The domain at twice the lateral resolution: a voxel is active if its parent was.
pub fn double_domain(call: &Call, b: &mut [Cells]) {
    bind!(b: coarse_mask u, mask u);
    let (fine, coarse) = (call.twin.grid, call.twin.grid.coarser(2));
    let on = |index: usize| {
        let [x, y, z] = fine.voxel(index);
        fine.contains([x, y, z]) && is_set(coarse_mask, coarse.index([x / 2, y / 2, z]))
    };
    let words = mask_of(fine.storage() / 32, on);
    mask[..words.len()].copy_from_slice(&words);
}
