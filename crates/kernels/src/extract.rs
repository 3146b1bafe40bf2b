use rayon::prelude::*;

use super::domain::Slots;
use super::surface::{safe_length, toward_wall};
use super::{Call, Cells, Real};

/// The brightest active voxel of every column: albedo, depth, 0, 1, then its normal and 0. All zero if no albedo of the
/// column is above zero.
pub fn extract<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: raw v4, mask u, columns v4, ranks u);
    let grid = call.grid::<F>();
    let slots = Slots { mask, ranks, room: call.scene.capacity };
    let (columns, _) = columns.as_chunks_mut::<2>();
    let columns = columns[..grid.n[0] * grid.n[1]].par_iter_mut().with_min_len(64);
    columns.enumerate().for_each(|(column, out)| {
        let (mut best, mut found) = (F::zero(), None);
        for z in grid.near_z..grid.n[2] {
            let slot = slots.of(grid.index([column / grid.n[1], column % grid.n[1], z]));
            if let Some(slot) = slot.filter(|slot| raw[*slot][0] > best) {
                (best, found) = (raw[slot][0], Some((z, slot)));
            }
        }
        *out = found.map_or([[F::zero(); 4]; 2], |(z, slot)| {
            let normal = toward_wall(raw[slot]);
            let depth = grid.origin.z + F::from32(z as f32) * grid.pitch.z;
            let unit = normal.map(|part| part / safe_length(normal));
            [[best, depth, F::zero(), F::one()], unit.with(F::zero())]
        });
    });
}
