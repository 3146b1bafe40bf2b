use super::shared::*;
use super::{Call, Cells, Real};

/// Sizes the passes over pairs by the counts.
pub fn arguments<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: counts u, arguments u);
    write(call, counts, arguments);
}

pub(super) fn write(call: &Call<'_>, counts: &[u32], arguments: &mut [u32]) {
    let of = |constant, usual| call.constant(constant, usual);
    let [active, touched] = [COUNT_ACTIVE, COUNT_TOUCHED].map(|i| counts[i as usize]);
    let mut put = |triple: u32, x: u32, y: u32| {
        arguments[3 * triple as usize..][..3].copy_from_slice(&[x, y, 1]);
    };
    let (voxels, mut slices, fill) = (of("VOXELS", 64), of("SLICES", 1), of("FILL", u32::MAX));
    let of_group = voxels * slices;
    while slices.is_multiple_of(2) && active >= fill / (slices / 2) {
        slices /= 2;
    }
    for (triple, groups) in [
        (ARGUMENTS_SAMPLE, active.div_ceil(WORKGROUP)),
        (ARGUMENTS_BACKWARD, active.div_ceil(of_group / slices)),
        (ARGUMENTS_UPDATE, touched.div_ceil(WORKGROUP)),
    ] {
        put(triple, groups.min(GROUPS_X), groups.div_ceil(GROUPS_X));
    }
    let [tiles, chunk, of_set] = chunks(call, active);
    let chunks = active.div_ceil(chunk);
    for set in 0..of("FORWARD_SETS", 1) {
        let here = chunks.saturating_sub(set * of_set).min(of_set);
        put(ARGUMENTS_FORWARD + set, if here == 0 { 0 } else { tiles }, here);
    }
}

/// How the forward pass is cut: workgroups for one chunk of samples, samples of a chunk, and most chunks of a dispatch.
pub(super) fn chunks(call: &Call<'_>, active: u32) -> [u32; 3] {
    const LEAST: u32 = 64;
    let of = |constant, usual| call.constant(constant, usual);
    let (lanes, others) = (of("LANES", 64), of("FORWARD_OTHERS", 0));
    let tiles = match others {
        0 => call.scene.pairs.div_ceil(lanes),
        _ => call.scene.scanned.div_ceil(lanes) * call.scene.others.div_ceil(others),
    };
    let of_set = (of("SET_CELLS", 0) / call.scene.pairs.max(1)).max(1);
    let wanted = of("FORWARD_FILL", 0).div_ceil(tiles.max(1) * lanes);
    let mut chunk = of("CHUNK", 256);
    while chunk >= 2 * LEAST
        && active.div_ceil(chunk) < wanted
        && active.div_ceil(chunk / 2) <= of_set.min(0xffff)
    {
        chunk /= 2;
    }
    [tiles, chunk, of_set]
}
