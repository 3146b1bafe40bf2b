use super::domain::bits_of;
use super::shared::*;
use super::{Call, Cells, Real};

/// Lists the set voxels in storage order, up to the room, and the slots taken before each word. The rim follows the active
/// voxels.
pub fn compact_scatter<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: mask u, _brick_offsets any, active_voxels u, ranks u, counts u);
    let (mut slot, room) = match call.is("RIM") {
        false => (0, call.scene.capacity),
        true => (counts[COUNT_ACTIVE as usize], call.scene.touched_capacity),
    };
    // One write per voxel: as fast as memory without tasks.
    for (at, (word, rank)) in mask[..call.grid::<F>().storage() / 32].iter().zip(ranks).enumerate() {
        *rank = slot;
        for bit in bits_of(*word) {
            if slot < room {
                active_voxels[slot as usize] = (32 * at + bit) as u32;
            }
            slot += 1;
        }
    }
}
