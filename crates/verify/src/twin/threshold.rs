use super::shared::{mask_of, may_be_active};
use super::{Call, Cells};
use thirdbounce::transport::BRICK_VOXELS;
use thirdbounce::transport::kernels::*;

/// The domain after a reduction: voxels above the share `push.flags` (bits) of the maximum and not below the least that
/// there is room for. Without a maximum above zero the domain stays unchanged if it has at most `push.first` voxels.
pub fn threshold(call: &Call, b: &mut [Cells]) {
    bind!(b: source f, counts u, mask u, reachable u, before u, ranks u, ranks_before u, brick_offsets u);
    let words = call.twin.grid.storage() / 32;
    before[..words].copy_from_slice(&mask[..words]);
    ranks_before[..words].copy_from_slice(&ranks[..words]);
    let of = |bits: u32| f64::from(f32::from_bits(bits));
    let above = of(call.push.flags) * of(counts[COUNT_PEAK_SMOOTH as usize]);
    let least = of(counts[COUNT_LEAST_SMOOTH as usize]);
    let keeps = |i: usize| {
        let may = reachable[i / BRICK_VOXELS] != 0 && may_be_active(&call.twin, i);
        may && source[i] > above && source[i] >= least
    };
    if counts[COUNT_PEAK_SMOOTH as usize] != 0 || counts[COUNT_ACTIVE as usize] > call.push.first {
        mask[..words].copy_from_slice(&mask_of(words, keeps));
    }
    for (brick, count) in mask[..words].chunks(16).zip(brick_offsets) {
        *count = brick.iter().map(|w| w.count_ones()).sum();
    }
}
