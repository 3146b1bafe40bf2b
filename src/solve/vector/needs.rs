//! What the vector solver needs of a plan, its surface's part included.

use super::{SMOOTH_SIGMA, VectorOptions, passes};
use crate::gpu::{Buffer, Constant};
use crate::solve::plan::pass::Pass;
use crate::solve::plan::{Demand, LeftOut, Level, Needs, mebibytes};
use crate::solve::{Plan, surface};
use crate::transport::kernels::{buffer, constant};
use crate::transport::{Binning, Gradient};

/// Bytes of state of an active voxel, and of a touched one.
const OF_VOXEL: [u64; 2] = [76, 0];

impl Needs for VectorOptions {
    fn demand(&self) -> Demand {
        Demand {
            accumulation: self.accumulation,
            sizes: self.sizes,
            general: self.general,
            coarse_to_fine: self.domain.coarse_to_fine,
            iterations: [self.iterations, self.surface.iterations],
            pairs: self.pairs,
            pixels_per_voxel: self.pixels_per_voxel(),
            binning: Binning::Linear,
            gradient: Gradient::Exact,
            has_rim: false,
            refined: (!self.all_bins).then(|| {
                self.iterations.saturating_sub(self.growth_iterations) / self.domain.coarse_iterations
            }),
            smooth: [SMOOTH_SIGMA, 4.0],
            more_taps: surface::more_taps(&self.surface),
            betas: [0.0; 2],
            cosine_volume: self.cosine_volume && self.surface.iterations > 0,
            lent: None,
        }
    }

    /// A share of the last grid, and half of the first. The first back-projection leaves a tenth of the first grid,
    /// surfaces a hundredth of the last. If there are more voxels, the brightest stay.
    fn capacities(&self, levels: &[Level]) -> [usize; 2] {
        const SMALL: usize = 1 << 18;
        let [first, last] = [levels.first(), levels.last()].map(|l| l.map_or(0, |l| l.grid.storage()));
        let active = match self.domain.room {
            Some(share) => ((share * last as f64).ceil() as usize).clamp(1, last),
            None => SMALL.max(first / 2).max(last / 16).min(last),
        };
        [active; 2]
    }

    fn constants(&self, plan: &Plan) -> Vec<(Constant, u32)> {
        vec![
            (constant::WEIGHTED, 1),
            (constant::ACCELERATED, 1),
            (constant::VECTORS, 1),
            (constant::SUMMED, 0),
            (constant::POINTS, surface::points_per_pixel(&self.surface, plan) as u32),
        ]
    }

    fn passes(&self) -> Vec<&'static Pass> {
        let of_surface = if self.surface.iterations > 0 { surface::passes::ALL } else { &[] };
        [passes::ALL, of_surface].concat()
    }

    fn buffers(&self, plan: &Plan) -> Vec<(Buffer, u64)> {
        let slots = plan.domain.capacity as u64;
        let mut all = vec![
            (buffer::BEFORE, slots * 16),
            (buffer::BOUNDS, slots * 8),
            (buffer::HAT_TAPS, plan.scene.bins as u64 * 4 + 4),
            (buffer::AGAINST_PARTIALS, plan.partials() * 4),
        ];
        all.extend(surface::buffers(plan));
        all
    }

    fn left_out(&self, plan: &Plan, out: &mut LeftOut) {
        let [voxels, slots] = [plan.finest().grid.storage(), plan.domain.capacity].map(|v| v as u64);
        let weights = (plan.scene.pairs * plan.scene.bins) as u64;
        out.add("the noise term: its weights, their moments and its kernel", mebibytes(weights * 12));
        surface::left_out(plan, out);
        out.add("the optimiser's moments: the step comes from a bound", mebibytes(voxels * 32 - slots * 24));
        plan.left_out_of_room(out, OF_VOXEL);
        out.add(
            "random sampling: interpolation, its adjoint, state and masks of the active voxels' neighbours",
            mebibytes(voxels / 2),
        );
    }
}
