use std::f64::consts::PI;

use rayon::prelude::*;

use super::adam::Adam;
use super::domain::{Slots, is_continuous};
use super::sampling::sample_point;
use super::shared::*;
use super::{Call, Cells, SceneGrid, Real, grid};

/// Voxels of a task.
const EACH: usize = 256;

/// One step of Adam on the touched voxels, with the gradient gathered from the samples around each: the adjoint of the
/// interpolation. Its rate is constant, or falls as half a cosine over the solve.
pub fn update<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: counts u, active_voxels u, ranks u, gradient v4, raw v4, first v4, second v4, mask u);
    let paper = &call.paper;
    let over = f64::from(paper.decay_over);
    let done = if over > 0.0 { (f64::from(call.push.iteration) / over).min(1.0) } else { 0.0 };
    let rate = f64::from(paper.learning_rate) * (0.5 + 0.5 * (PI * done).cos());
    let adam = Adam::<F>::of(paper, rate, call.push.step);
    let [active, touched] = [COUNT_ACTIVE, COUNT_TOUCHED].map(|i| counts[i as usize] as usize);
    let slots = Slots { mask, ranks, room: call.scene.capacity };
    let around = is_continuous(call).then(|| Around::of(call, slots, &active_voxels[..active], gradient));
    let state = raw[..touched].par_chunks_mut(EACH).zip(first.par_chunks_mut(EACH));
    let tasks = active_voxels[..touched].par_chunks(EACH).zip(state).zip(second.par_chunks_mut(EACH));
    let all = tasks.enumerate().map(|(task, ((voxels, (raw, first)), second))| {
        // Of centres the active voxels alone are touched, by slot.
        let of = |i: usize| around.as_ref().map_or_else(|| gradient[task * EACH + i], |a| a.gathered(voxels[i]));
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || (0..voxels.len()).fold(true, |is_finite, i| {
                let g = of(i);
                (0..4).for_each(|k| adam.step(g[k], [&mut raw[i][k], &mut first[i][k], &mut second[i][k]]));
                is_finite & raw[i].iter().copied().sum::<F>().is_finite()
            }),
        )
    });
    if !all.reduce(|| true, |a, b| a & b) {
        counts[COUNT_FAULTS as usize] |= FAULT_UPDATE;
    }
}

/// Samples around voxels.
struct Around<'s, F> {
    grid: SceneGrid<F>,
    slots: Slots<'s>,
    gradient: &'s [[F; 4]],
    /// Where the samples are, in voxels, by slot.
    points: Vec<[F; 3]>,
    /// Parts of a storage index by each coordinate, of which it is the sum.
    parts: [Vec<usize>; 3],
}

impl<'s, F: Real> Around<'s, F> {
    fn of(call: &Call<'_>, slots: Slots<'s>, active: &[u32], gradient: &'s [[F; 4]]) -> Around<'s, F> {
        let grid = call.grid();
        let points = active.par_iter().with_min_len(EACH).map(|index| sample_point(call, &grid, *index)).collect();
        let parts = std::array::from_fn(|a| {
            let at = |i| grid::index(grid.bricks, std::array::from_fn(|b| if a == b { i } else { 0 }));
            (0..grid.n[a]).map(at).collect()
        });
        Around { grid, slots, gradient, points, parts }
    }

    /// The gradient of a voxel.
    #[inline(always)]
    fn gathered(&self, index: u32) -> [F; 4] {
        let c = self.grid.voxel(index as usize);
        let beside = |a: usize| c[a].saturating_sub(1)..(c[a] + 2).min(self.grid.n[a]);
        let at = c.map(|c| F::from32(c as f32));
        let mut sum = [F::zero(); 4];
        for z in beside(2) {
            for y in beside(1) {
                let row = self.parts[2][z] + self.parts[1][y];
                for x in beside(0) {
                    let Some(slot) = self.slots.of(row + self.parts[0][x]) else { continue };
                    let point = self.points[slot];
                    let near = |a: usize| (F::one() - (point[a] - at[a]).abs()).at_least(F::zero());
                    let weight = near(0) * near(1) * near(2);
                    let gradient = self.gradient[slot];
                    (0..4).for_each(|k| sum[k] = sum[k] + weight * gradient[k]);
                }
            }
        }
        sum
    }
}
