//! What the paper's solver needs of a plan.

use super::options::{Decay, NoiseTerm, PaperOptions};
use crate::Result;
use crate::engine::{Demand, LeftOut, Level, Plan, mebibytes};
use crate::gpu::{Abilities, Buffer, Constant};
use crate::methods::paper::passes;
use crate::transport::kernels::{LEVELS, PaperData, WORKGROUP, buffer, constant};
use crate::transport::{BRICK_VOXELS, Grid, Model, Sampling};

/// Numbers per voxel while the domain changes.
const SMOOTH: [Buffer; 2] = [Buffer::named("smooth"), Buffer::named("smooth_spare")];

/// Bytes of state of an active voxel, and of a touched one.
const OF_VOXEL: [u64; 2] = [32, 52];

impl PaperOptions {
    /// The block of the solver at the resolution of `grid`.
    fn block(&self, grid: &Grid) -> PaperData {
        let has_noise = self.noise.term != NoiseTerm::Off;
        let noise = |share: f64| if has_noise { (share * self.peak) as f32 } else { 0.0 };
        let decays = self.learning_rate_decay == Decay::Cosine;
        PaperData {
            seed: self.seed,
            l1_scale: (self.l1 / grid.voxels() as f64) as f32,
            noise_base: noise(self.noise.base),
            noise_span: noise(self.noise.span),
            learning_rate: self.learning_rate as f32,
            decay_over: if decays { self.iterations as f32 } else { 0.0 },
            beta1: self.beta1 as f32,
            beta2: self.beta2 as f32,
            epsilon: self.epsilon as f32,
        }
    }
}

/// The buffer of the solver's block at a level of a plan.
pub(super) fn block_of(plan: &Plan, level: &Level) -> Buffer {
    let at = plan.levels.volume.iter().position(|l| l.scene == level.scene).unwrap_or(0);
    buffer::PAPER.at(at as u16)
}

/// The plan of the solver. With `with_volume` the volume can be read back.
///
/// # Errors
/// As [`Plan::open`] and [`Plan::finish`].
pub fn plan(
    model: &Model,
    grid: Grid,
    scan: [usize; 2],
    options: &PaperOptions,
    device: &Abilities,
    with_volume: bool,
) -> Result<Plan> {
    let mut plan = Plan::open(model, grid, scan, options.demand(), |levels| options.room(levels), device)?;
    plan.blocks = options.blocks(&plan.levels.volume);
    plan.constants.extend(options.constants());
    plan.add_passes(crate::engine::passes::ALL);
    plan.add_passes(passes::ALL);
    let own = options.buffers(&plan);
    let mut plan = plan.finish(model, own, with_volume)?;
    plan.leave_out(|plan, out| options.left_out(plan, out));
    Ok(plan)
}

impl PaperOptions {
    /// What it asks of a plan.
    pub fn demand(&self) -> Demand {
        Demand {
            accumulation: self.accumulation,
            general: self.general,
            coarse_to_fine: self.domain.coarse_to_fine,
            iterations: [self.iterations, 0],
            pixels_per_voxel: 1,
            renders: true,
            binning: self.binning,
            gradient: self.gradient,
            has_rim: self.sampling == Sampling::Continuous,
            smooth: Some([self.domain.smooth_sigma, self.domain.smooth_truncate]),
            betas: [self.beta1, self.beta2],
        }
    }

    /// Voxels that may be active at once, and touched at once: a share of the last grid, and all of the first, where the solver
    /// begins. A reduction by a wide Gaussian leaves up to a tenth of a grid before the last. If there are more voxels, the brightest
    /// stay.
    fn room(&self, levels: &[Level]) -> [usize; 2] {
        const SMALL: usize = 1 << 18;
        let [first, last] = [levels.first(), levels.last()].map(|l| l.map_or(0, |l| l.grid.storage()));
        let reduces = self.domain.reduce && self.domain.double_every.is_multiple_of(self.domain.reduce_every);
        let active = match self.domain.room {
            Some(share) => ((share * last as f64).ceil() as usize).clamp(first, last),
            None if !reduces => last,
            // From half of the grid on, dense state takes no more memory.
            None => Some(SMALL.max(first).max(last / 10)).filter(|most| *most < last / 2).unwrap_or(last),
        };
        [active, if self.sampling == Sampling::Continuous { with_rim(active, last) } else { active }]
    }

    fn constants(&self) -> [(Constant, u32); 5] {
        let term = match self.noise.term {
            NoiseTerm::Off => 0,
            NoiseTerm::Bin => 1,
            NoiseTerm::Histogram => 2,
        };
        [
            (constant::CONTINUOUS, u32::from(self.sampling == Sampling::Continuous)),
            (constant::NOISE, term),
            (constant::PER_HISTOGRAM, u32::from(self.noise.term == NoiseTerm::Histogram)),
            (constant::ALBEDO_SPAN, (self.initial_albedo as f32).to_bits()),
            (constant::SUMMED, WORKGROUP),
        ]
    }

    fn blocks(&self, levels: &[Level]) -> Vec<(Buffer, Vec<u8>)> {
        let of = |(i, level): (u16, &Level)| {
            (buffer::PAPER.at(i), bytemuck::bytes_of(&self.block(&level.grid)).to_vec())
        };
        (0..).zip(levels).map(of).collect()
    }

    fn buffers(&self, plan: &Plan) -> Vec<(Buffer, u64)> {
        let touched = plan.domain.touched_capacity as u64;
        let voxels = plan.finest().grid.storage() as u64;
        let masks = voxels / 8;
        let mut all = vec![
            (buffer::RAW, touched * 16),
            (buffer::LEVELS, u64::from(LEVELS) * 4),
            (buffer::MASK, masks),
            (buffer::RANKS, masks),
            (buffer::MASK_BEFORE, masks),
            (buffer::RANKS_BEFORE, masks),
            (buffer::BRICK_OFFSETS, voxels / BRICK_VOXELS as u64 * 4),
            (buffer::ACTIVE_VOXELS, touched * 4),
            (buffer::TAPS, (plan.domain.taps.len() + 1) as u64 * 4),
            (buffer::NOISE_STATE, self.noise_weights(plan) as u64 * 12),
            (buffer::MOMENT_FIRST, touched * 16),
            (buffer::MOMENT_SECOND, touched * 16),
        ];
        if plan.demand.has_rim {
            let rim = [buffer::RIM_MASK, buffer::RIM_RANKS, buffer::RIM_BEFORE, buffer::RIM_RANKS_BEFORE];
            all.extend(rim.map(|b| (b, masks)));
        }
        // From a quarter of the grid on, buffers that hold nothing between iterations are large enough.
        if plan.domain.capacity < plan.domain.touched_capacity.max(plan.finest().grid.storage() / 4) {
            all.extend([(SMOOTH[0], (touched * 16).max(voxels * 4)), (SMOOTH[1], voxels * 4)]);
        }
        all
    }

    fn left_out(&self, plan: &Plan, out: &mut LeftOut) {
        if self.noise.term == NoiseTerm::Off {
            let weights = (plan.scene.pairs * plan.scene.bins) as u64;
            out.add("the noise term: its weights, their moments and its kernel", mebibytes(weights * 12));
        }
        plan.left_out_of_room(out, OF_VOXEL);
        if !plan.demand.has_rim {
            let voxels = plan.finest().grid.storage();
            let rim = (with_rim(plan.domain.capacity, voxels) - plan.domain.capacity) as u64;
            out.add(
                "random sampling: interpolation, its adjoint, state and masks of the active voxels' neighbours",
                mebibytes(voxels as u64 / 2 + rim * OF_VOXEL[1]),
            );
        }
    }
}

/// Two buffers for a number per voxel while the domain changes; the first has room for four numbers of every touched voxel,
/// too.
pub(super) fn volumes(plan: &Plan) -> [Buffer; 2] {
    if plan.bytes_of(SMOOTH[0]) > 0 { SMOOTH } else { [buffer::GRADIENT, buffer::SAMPLE_POINTS] }
}

impl PaperOptions {
    /// Weights of the noise term.
    pub fn noise_weights(&self, plan: &Plan) -> usize {
        match self.noise.term {
            NoiseTerm::Off => 0,
            NoiseTerm::Bin => plan.scene.pairs * plan.scene.bins,
            NoiseTerm::Histogram => plan.scene.pairs,
        }
    }
}

/// Voxels that may be touched if `active` of `all` may be active. There is room for half as many neighbours as active
/// voxels.
fn with_rim(active: usize, all: usize) -> usize {
    (active + active / 2).min(all)
}
