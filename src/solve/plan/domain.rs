//! Room for active voxels.

use super::{Demand, Level, Needs};
use crate::transport::twin;

/// Room for active voxels or points.
#[derive(Debug, Clone, PartialEq)]
pub struct Domain {
    /// Voxels or points that may be active at once.
    pub capacity: usize,
    /// Voxels that may be touched at once: active ones and, where they have state, their neighbours.
    pub touched_capacity: usize,
    /// Weights of the reduction's Gaussian, 0..=radius; none where the domain is not reduced.
    pub taps: Vec<f64>,
}

impl Domain {
    /// The domain of a volume with these levels.
    pub(super) fn of(levels: &[Level], needs: &dyn Needs, demand: &Demand) -> Domain {
        let [capacity, touched_capacity] = needs.capacities(levels);
        let taps = demand.smooth.map_or(vec![], |[sigma, cut]| twin::taps(sigma, cut));
        Domain { capacity, touched_capacity, taps }
    }
}
