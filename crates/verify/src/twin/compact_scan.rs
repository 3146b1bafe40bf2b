use super::{Call, Cells, arguments};
use thirdbounce::transport::kernels::*;

/// Sums the counts of the bricks before each, counts active or touched voxels up to the room, and sizes the passes that go
/// by these counts.
pub fn compact_scan(call: &Call, b: &mut [Cells]) {
    bind!(b: brick_offsets u, counts u, arguments u);
    let mut sum = 0;
    for count in &mut brick_offsets[..call.twin.grid.bricks().iter().product()] {
        sum += std::mem::replace(count, sum);
    }
    let active = match call.constant(constant::RIM, 0) {
        0 => sum.min(call.scene.capacity),
        _ => counts[COUNT_ACTIVE as usize],
    };
    let touched = if call.constant(constant::RIM, 0) == 0 { active } else { active + sum };
    counts[COUNT_ACTIVE as usize] = active;
    counts[COUNT_TOUCHED as usize] = touched.min(call.scene.touched_capacity);
    if call.constant(constant::RIM, 0) != 0 && touched > call.scene.touched_capacity {
        // What is left out is reported as too dim.
        let least = &mut counts[COUNT_LEAST_SMOOTH as usize];
        *least = (*least).max(1);
    }
    arguments::write(call, counts, arguments);
}
