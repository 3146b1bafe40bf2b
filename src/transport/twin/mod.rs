//! The kernels in float64 on the CPU: one function per kernel, with its name. The kernels are tested against them.
//! They are written for clarity, not speed.
//!
//! State is in the grid's storage order ([`Grid::index`]); lists hold storage indices in that order.

mod backproject;
mod domain;
mod optimise;
mod pulse;
mod random;
mod render;
mod surface;

pub use backproject::{backproject, filter};
pub use domain::{
    Column, carry, carry_doubled, compact, double_domain, extract, gaussian, initialise, initialise_raw,
    levels, rim, room, taps, threshold, threshold_raw, touched,
};
pub use optimise::{learning_rate, noise, update};
pub use pulse::{Way, instrument, pulse, spot};
pub use random::random3;
pub use render::{
    Sample, backward, finish, forward, forward_pair, objective, places, residual, residual_weighted, sample,
    sample_point, weighted_objective,
};
pub use surface::{
    Bond, Combined, Height, Pull, SurfaceWeights, surface_bonds, surface_combine, surface_extract,
    surface_gather, surface_gradient, surface_objective, surface_points, surface_pull, surface_step,
};

use super::{Grid, Model};

/// A scene at one lateral resolution.
#[derive(Debug, Clone, Copy)]
pub struct Twin<'a> {
    /// The capture and the numbers of its reconstruction.
    pub model: &'a Model,
    /// The voxels.
    pub grid: &'a Grid,
}

/// Raw variables of a voxel: albedo a and normal q, before ELU and tanh.
pub type Raw = [f64; 4];
