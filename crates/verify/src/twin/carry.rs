use super::shared::slot_of;
use super::{Call, Cells};
use thirdbounce::transport::kernels::*;

/// State after a change of the domain: zero for voxels that were not touched before it. `DOUBLED`: from half the lateral
/// resolution, linear along x and y, cell-centred, clamped at the edges.
pub fn carry(call: &Call, b: &mut [Cells]) {
    bind!(b: counts u, active_voxels u, mask u, ranks u, rim u, rim_ranks u, source v4, carried v4);
    let [room, touched_room] = [call.scene.capacity, call.scene.touched_capacity];
    let continuous = call.constant(constant::CONTINUOUS, 1) != 0;
    let doubled = call.constant(constant::DOUBLED, 0) != 0;
    let state = |index: usize| {
        let of_rim = || continuous.then(|| slot_of(rim, rim_ranks, index, touched_room)).flatten();
        slot_of(mask, ranks, index, room).or_else(of_rim).map_or([0.0; 4], |slot| source[slot])
    };
    let fine = call.twin.grid;
    let coarse = if doubled { fine.coarser(2) } else { *fine };
    for slot in 0..counts[COUNT_TOUCHED as usize] as usize {
        let index = active_voxels[slot] as usize;
        if !doubled {
            carried[slot] = state(index);
            continue;
        }
        let c = fine.voxel(index);
        let [xs, ys] = [0, 1].map(|a| {
            let at = ((c[a] as f64 + 0.5) / 2.0 - 0.5).clamp(0.0, coarse.n[a] as f64 - 1.0);
            let low = at.floor() as usize;
            [(low, 1.0 - at.fract()), ((low + 1).min(coarse.n[a] - 1), at.fract())]
        });
        carried[slot] = [0.0; 4];
        for (x, y) in xs.into_iter().flat_map(|x| ys.map(|y| (x, y))) {
            let from = state(coarse.index([x.0, y.0, c[2]]));
            (0..4).for_each(|k| carried[slot][k] += x.1 * y.1 * from[k]);
        }
    }
}
