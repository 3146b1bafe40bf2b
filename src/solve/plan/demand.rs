//! What a solver asks of its plan, as plain data.

use super::{Accumulation, Sizes};
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
    /// Iterations of a volume, and of a surface.
    pub iterations: [usize; 2],
    /// Pixels of the maps side by side in a voxel of the finest grid.
    pub pixels_per_voxel: usize,
    /// How a path is put into bins.
    pub binning: Binning,
    /// Which gradient is gathered.
    pub gradient: Gradient,
    /// Neighbours of active voxels have state, too: random samples read it.
    pub has_rim: bool,
    /// Gaussian of the domain reduction: sigma in voxels, and after how many sigmas it is cut off. `None`: no reduction.
    pub smooth: Option<[f64; 2]>,
    /// Decays of Adam's first and second moment, if the solver runs Adam on the volume.
    pub betas: [f64; 2],
}
