use super::shared::{slot_of, toward_wall};
use super::{Call, Cells};

/// The brightest active voxel of every column: albedo, depth, 0, 1, then its normal and 0. All zero if no albedo of the
/// column is above zero.
pub fn extract(call: &Call, b: &mut [Cells]) {
    bind!(b: raw v4, mask u, columns v4, ranks u);
    let grid = call.twin.grid;
    for column in 0..grid.n[0] * grid.n[1] {
        let [x, y] = [column / grid.n[1], column % grid.n[1]];
        let mut best = (0.0, None);
        for z in call.twin.model.near_z(grid)..grid.n[2] {
            let slot = slot_of(mask, ranks, grid.index([x, y, z]), call.scene.capacity);
            if let Some(slot) = slot.filter(|slot| raw[*slot][0] > best.0) {
                best = (raw[slot][0], Some((z, slot)));
            }
        }
        let found = best.1.map(|(z, slot)| {
            let normal = toward_wall(raw[slot]).normalize_or_zero();
            let depth = grid.origin.z + z as f64 * grid.pitch.z;
            [[best.0, depth, 0.0, 1.0], [normal.x, normal.y, normal.z, 0.0]]
        });
        columns[2 * column..][..2].copy_from_slice(&found.unwrap_or_default());
    }
}
