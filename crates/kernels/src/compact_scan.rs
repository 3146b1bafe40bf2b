use super::shared::*;
use super::{Call, Cells, Real, arguments};

/// Sums the counts of the bricks before each, counts active or touched voxels up to the room, and sizes the passes that go
/// by these counts.
pub fn compact_scan<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: brick_offsets u, counts u, arguments u);
    let mut sum = 0;
    for count in &mut brick_offsets[..call.grid::<F>().bricks.iter().product()] {
        sum += std::mem::replace(count, sum);
    }
    let is_rim = call.is("RIM");
    let active = if is_rim { counts[COUNT_ACTIVE as usize] } else { sum.min(call.scene.capacity) };
    let touched = if is_rim { active + sum } else { active };
    counts[COUNT_ACTIVE as usize] = active;
    counts[COUNT_TOUCHED as usize] = touched.min(call.scene.touched_capacity);
    if is_rim && touched > call.scene.touched_capacity {
        // What is left out is reported as too dim.
        let least = &mut counts[COUNT_LEAST_SMOOTH as usize];
        *least = (*least).max(1);
    }
    arguments::write(call, counts, arguments);
}
