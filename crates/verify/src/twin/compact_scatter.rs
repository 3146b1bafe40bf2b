use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

/// Lists the set voxels in storage order, up to the room, and the slots taken before each word. The rim follows the active
/// voxels.
pub fn compact_scatter(call: &Call, b: &mut [Cells]) {
    bind!(b: mask u, _brick_offsets any, active_voxels u, ranks u, counts u);
    let (mut slot, room) = match call.constant(constant::RIM, 0) {
        0 => (0, call.scene.capacity),
        _ => (counts[COUNT_ACTIVE as usize], call.scene.touched_capacity),
    };
    for at in 0..call.twin.grid.storage() / 32 {
        ranks[at] = slot;
        for i in (0..32).filter(|i| mask[at] >> i & 1 == 1) {
            if slot < room {
                active_voxels[slot as usize] = (32 * at + i) as u32;
            }
            slot += 1;
        }
    }
}
