//! Room for active voxels, and what the domain changes with.

use super::{Demand, Level, Needs};
use crate::gpu::Buffer;
use crate::transport::twin;

/// Room for active voxels, and what the domain changes with.
#[derive(Debug, Clone, PartialEq)]
pub struct Domain {
    /// Voxels that may be active at once.
    pub capacity: usize,
    /// Voxels that may be touched at once: active ones and, where they have state, their neighbours.
    pub touched_capacity: usize,
    /// Weights of the reduction's Gaussian, 0..=radius.
    pub taps: Vec<f64>,
    /// Two buffers for a number per voxel while the domain changes.
    pub volumes: [Buffer; 2],
}

impl Domain {
    /// The domain of a volume with these levels.
    pub(super) fn of(levels: &[Level], needs: &dyn Needs, demand: &Demand) -> Domain {
        let [capacity, touched_capacity] = needs.capacities(levels);
        let [sigma, cut] = demand.smooth;
        let volumes = needs.volumes(levels, [capacity, touched_capacity]);
        Domain { capacity, touched_capacity, taps: twin::taps(sigma, cut), volumes }
    }
}
