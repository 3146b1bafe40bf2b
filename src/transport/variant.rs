//! Choices of solvers that kernels are specialized by.

use serde::{Deserialize, Serialize};

/// Where the sample of a voxel lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sampling {
    /// A new point within half a voxel of the centre every iteration, interpolated (the paper).
    Continuous,
    /// The voxel's centre (the paper's ablation).
    Fixed,
}

/// Which gradient the backward kernel gathers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Gradient {
    /// Without the distance falloff (the paper): the gradient of the objective weighted by the falloff.
    Published,
    /// The gradient of the objective itself.
    Exact,
}
