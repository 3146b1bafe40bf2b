//! What a solver says that it needs of a plan.

use super::pass::Pass;
use super::{Accumulation, LeftOut, Level, Plan, SMOOTH, SMOOTH_SPARE, Sizes};
use crate::gpu::{Buffer, Constant};
use crate::transport::{Binning, Gradient};

/// What a solver's options ask of every plan, as plain data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demand {
    /// How rendered values are added up.
    pub accumulation: Accumulation,
    /// Workgroup sizes that were asked for.
    pub sizes: Sizes,
    /// Leave nothing out.
    pub general: bool,
    /// Start at the scan's resolution and double.
    pub coarse_to_fine: bool,
    /// Iterations of the volume, and of what follows it.
    pub iterations: [usize; 2],
    /// Pairs that volumes of up to 64 lateral voxels end with, where pairs are spread.
    pub pairs: usize,
    /// Pixels of the maps side by side in a voxel of the finest grid.
    pub pixels_per_voxel: usize,
    /// How a path is put into bins.
    pub binning: Binning,
    /// Which gradient is gathered.
    pub gradient: Gradient,
    /// Neighbours of active voxels have state, too: random samples read it.
    pub has_rim: bool,
    /// Gaussian of the domain reduction: sigma in voxels, and after how many sigmas it is cut off.
    pub smooth: [f64; 2],
    /// Coarser grids have deeper voxels, too, and levels sum bins that are finer than their voxels. The grid can be refined
    /// so often before the last iterations. `None`: the depth of voxels and the bins are the same at all levels.
    pub refined: Option<usize>,
    /// Sets of taps for residuals beside the pulse's own, and bins that they add to it.
    pub more_taps: [usize; 2],
    /// Solve the volume of a Lambertian scene with one cosine.
    pub cosine_volume: bool,
    /// Rows of counts that may lie in a caller's buffer.
    pub lent: Option<LentRows>,
}

/// Rows of counts in a caller's buffer, one for each pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LentRows {
    /// Counts of a row.
    pub counts: usize,
    /// How many neighbouring counts are one bin; those missing from the last are 0.
    pub sum: usize,
}

/// What a solver needs of a plan. Its options implement this.
pub trait Needs {
    /// The plain part.
    fn demand(&self) -> Demand;

    /// Voxels that may be active at once, and touched at once, over these levels.
    fn capacities(&self, levels: &[Level]) -> [usize; 2];

    /// Values of the constants that its passes share.
    fn constants(&self, plan: &Plan) -> Vec<(Constant, u32)>;

    /// Its passes. The plan adds those that all solvers have, and leaves out those it does not need ([`Pass::when`]).
    fn passes(&self) -> Vec<&'static Pass>;

    /// Its device buffers with their bytes. The plan adds those that all solvers have.
    fn buffers(&self, plan: &Plan) -> Vec<(Buffer, u64)>;

    /// Decays of Adam's first and second moment, if it runs Adam on the volume.
    fn betas(&self) -> [f64; 2] {
        [0.0; 2]
    }

    /// Two buffers for a number per voxel while the domain changes. The first has room for four numbers of every
    /// touched voxel, too.
    fn volumes(&self, _plan: &Plan) -> [Buffer; 2] {
        [SMOOTH, SMOOTH_SPARE]
    }

    /// Lists what it does not need, and what that saves.
    fn left_out(&self, plan: &Plan, out: &mut LeftOut);
}
