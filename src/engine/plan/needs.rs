//! What a plan asks a solver.

use super::left_out::LeftOut;
use super::level::Level;
use super::pass::Pass;
use super::tuning::Accumulation;
use crate::engine::plan::Plan;
use crate::gpu::{Buffer, Constant};
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

/// What a solver needs of a plan. Its options implement this.
pub trait Needs {
    /// The plain part.
    fn demand(&self) -> Demand;

    /// Voxels that may be active at once, and touched at once, over these levels.
    fn capacities(&self, _levels: &[Level]) -> [usize; 2] {
        [1; 2]
    }

    /// Values of the constants that its passes share.
    fn constants(&self, _plan: &Plan) -> Vec<(Constant, u32)> {
        vec![]
    }

    /// The content of its own uniform blocks over these levels: numbers that the scene does not have.
    fn blocks(&self, _levels: &[Level]) -> Vec<(Buffer, Vec<u8>)> {
        vec![]
    }

    /// Its passes. The plan adds those that all solvers have, and leaves out those it does not need ([`Pass::when`]).
    fn passes(&self) -> Vec<&'static Pass> {
        vec![]
    }

    /// Its device buffers with their bytes. The plan adds those that all solvers have.
    fn buffers(&self, _plan: &Plan) -> Vec<(Buffer, u64)> {
        vec![]
    }

    /// Lists what it does not need, and what that saves.
    fn left_out(&self, _plan: &Plan, _out: &mut LeftOut) {}
}

/// What a method without iterations asks: one level, and nothing is rendered.
pub struct OneLevel {
    /// As [`Demand::pixels_per_voxel`].
    pub pixels_per_voxel: usize,
}

impl Needs for OneLevel {
    fn demand(&self) -> Demand {
        Demand { renders: false, pixels_per_voxel: self.pixels_per_voxel, ..Demand::default() }
    }
}
