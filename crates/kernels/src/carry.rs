use rayon::prelude::*;

use super::domain::Touched;
use super::shared::*;
use super::{Call, Cells, Real};

/// State after a change of the domain: zero for voxels that were not touched before it. `DOUBLED`: from half the lateral
/// resolution, linear along x and y, cell-centred, clamped at the edges.
pub fn carry<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: counts u, active_voxels u, mask u, ranks u, rim u, rim_ranks u, source v4, carried v4);
    let before = Touched::of_dispatch(call, [mask, ranks, rim, rim_ranks]);
    let state = |index: usize| before.of(index).map_or([F::zero(); 4], |slot| source[slot]);
    let (fine, coarse) = (call.grid::<F>(), call.grid::<F>().coarser());
    let doubled = |index: usize| {
        let c = fine.voxel(index);
        // The parent, and the one on this voxel's side of it.
        let near = |a: usize| {
            let (parent, other) = (c[a] / 2, if c[a].is_multiple_of(2) { (c[a] / 2).saturating_sub(1) } else { c[a] / 2 + 1 });
            [(parent, F::of(0.75)), (other.min(coarse.n[a] - 1), F::of(0.25))]
        };
        let mut sum = [F::zero(); 4];
        for (x, y) in near(0).into_iter().flat_map(|x| near(1).map(|y| (x, y))) {
            let from = state(coarse.index([x.0, y.0, c[2]]));
            (0..4).for_each(|k| sum[k] = sum[k] + x.1 * y.1 * from[k]);
        }
        sum
    };
    let touched = counts[COUNT_TOUCHED as usize] as usize;
    let is_doubled = call.is("DOUBLED");
    let all = carried[..touched].par_iter_mut().zip(&active_voxels[..touched]).with_min_len(1024);
    all.for_each(|(to, index)| *to = if is_doubled { doubled(*index as usize) } else { state(*index as usize) });
}
