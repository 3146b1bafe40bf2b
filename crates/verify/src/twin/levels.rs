use super::shared::may_be_active;
use super::{Call, Cells};
use thirdbounce::transport::BRICK_VOXELS;
use thirdbounce::transport::kernels::*;

/// Counts the voxels that may be active by their level below the largest smoothed value. Levels are steps of a
/// thirty-second of an octave, by the upper bits of the float. Values below all count in the lowest.
pub fn levels(call: &Call, b: &mut [Cells]) {
    bind!(b: source f, counts u, levels u, reachable u);
    for (index, value) in source.iter().enumerate().take(call.twin.grid.storage()) {
        if *value > 0.0 && reachable[index / BRICK_VOXELS] != 0 && may_be_active(&call.twin, index) {
            let [peak, key] =
                [counts[COUNT_PEAK_SMOOTH as usize], (*value as f32).to_bits()].map(|b| b >> LEVEL_SHIFT);
            levels[(LEVELS - 1 - (peak - key).min(LEVELS - 1)) as usize] += 1;
        }
    }
}
