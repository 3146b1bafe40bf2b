//! What a solver asks of a plan, as plain data.

use super::tuning::Accumulation;
use crate::transport::{Binning, Gradient};

/// What a solver's options ask of every plan, as plain data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demand {
    /// How rendered values are added up.
    pub accumulation: Accumulation,
    /// Histograms are rendered and compared.
    pub renders: bool,
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

impl Demand {
    /// What a method without iterations asks: one level, and nothing is rendered.
    pub fn of_one_step(pixels_per_voxel: usize) -> Demand {
        Demand { renders: false, pixels_per_voxel, ..Demand::default() }
    }
}

/// One level and exact gradients.
impl Default for Demand {
    fn default() -> Demand {
        Demand {
            accumulation: Accumulation::Auto,
            renders: true,
            general: false,
            coarse_to_fine: false,
            iterations: [1, 0],
            pixels_per_voxel: 1,
            binning: Binning::Linear,
            gradient: Gradient::Exact,
            has_rim: false,
            smooth: None,
            betas: [0.0; 2],
        }
    }
}
