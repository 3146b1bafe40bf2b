use rayon::prelude::*;

use super::domain::{Touched, is_continuous};
use super::pixels::has_normals;
use super::sampling::{corners, sample_point};
use super::shared::*;
use super::surface::{elu, safe_length, toward_wall};
use super::{Call, Cells, SceneGrid, Real, V3, larger};

/// The samples of the active voxels: raw variables interpolated at a random point, or those at the centre. Those of a partial
/// sum are one task.
pub fn sample<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    const EACH: usize = WORKGROUP as usize;
    bind!(
        b: counts u, active_voxels u, raw v4, points v4, normals v4, l1_partials f, mask u, ranks u, rim u, rim_ranks u
    );
    let active = counts[COUNT_ACTIVE as usize] as usize;
    let state = RawState {
        call,
        grid: call.grid(),
        raw,
        touched: Touched::of_dispatch(call, [mask, ranks, rim, rim_ranks]),
        continuous: is_continuous(call),
    };
    // Of a scene without normals the buffer is empty.
    let has_normals = has_normals(call);
    let normals = if has_normals { &mut normals[..active] } else { &mut [] };
    let mut normals: Vec<_> = normals.chunks_mut(EACH).collect();
    normals.resize_with(active.div_ceil(EACH), Default::default);
    let outputs = points[..active].par_chunks_mut(EACH).zip(normals).zip(l1_partials);
    let groups = active_voxels[..active].par_chunks(EACH).zip(outputs).enumerate();
    let all = groups.map(|(group, (voxels, ((points, normals), sum)))| {
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || state.write(group * EACH, voxels, points, normals, sum),
        )
    });
    let (peak, is_finite) = all.reduce(|| (F::zero(), true), |a, b| (a.0.at_least(b.0), a.1 & b.1));
    counts[COUNT_PEAK_ALBEDO as usize] = larger(counts[COUNT_PEAK_ALBEDO as usize], peak);
    if !is_finite {
        counts[COUNT_FAULTS as usize] |= FAULT_SAMPLE;
    }
}

/// The raw variables of touched voxels.
struct RawState<'s, F> {
    call: &'s Call<'s>,
    grid: SceneGrid<F>,
    raw: &'s [[F; 4]],
    touched: Touched<'s>,
    continuous: bool,
}

impl<F: Real> RawState<'_, F> {
    /// Writes the samples of `voxels`, whose slots begin at `first`, and the sum of their magnitudes. Returns the largest
    /// one, and whether all raw variables are finite.
    #[inline(always)]
    fn write(
        &self,
        first: usize,
        voxels: &[u32],
        points: &mut [[F; 4]],
        normals: &mut [[F; 4]],
        sum: &mut F,
    ) -> (F, bool) {
        let (mut largest, mut is_finite) = (F::zero(), true);
        *sum = F::zero();
        for (i, (index, point)) in voxels.iter().zip(points).enumerate() {
            let (g, v) = if self.continuous {
                let g = sample_point(self.call, &self.grid, *index);
                (g, self.interpolated(g))
            } else {
                (self.grid.voxel(*index as usize).map(|c| F::from32(c as f32)), self.raw[first + i])
            };
            let (u, albedo) = (toward_wall(v), elu(v[0]));
            *point = self.grid.position(V3 { x: g[0], y: g[1], z: g[2] }).with(albedo);
            if let Some(normal) = normals.get_mut(i) {
                let length = safe_length(u);
                *normal = u.map(|part| part / length).with(length);
            }
            *sum = *sum + albedo.abs();
            largest = largest.at_least(albedo.abs());
            is_finite &= (v[0] + v[1] + v[2] + v[3]).is_finite();
        }
        (largest, is_finite)
    }

    /// Raw variables at a point, zero where voxels have no state.
    #[inline(always)]
    fn interpolated(&self, g: [F; 3]) -> [F; 4] {
        let mut v = [F::zero(); 4];
        for (c, weight) in corners(g) {
            if let Some(slot) = self.touched.of(self.grid.index(c)) {
                let near = self.raw[slot];
                (0..4).for_each(|k| v[k] = v[k] + weight * near[k]);
            }
        }
        v
    }
}
