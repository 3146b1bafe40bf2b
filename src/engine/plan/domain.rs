//! Room for active voxels.

use super::demand::Demand;

/// Room for active voxels or points.
#[derive(Debug, Clone, PartialEq)]
pub struct DomainCapacity {
    /// Voxels or points that may be active at once.
    pub capacity: usize,
    /// Voxels that may be touched at once: active ones and, where they have state, their neighbours.
    pub touched_capacity: usize,
    /// Weights of the reduction's Gaussian, 0..=radius; none where the domain is not reduced.
    pub taps: Vec<f64>,
}

impl DomainCapacity {
    /// The domain with this room for active and for touched voxels.
    pub(crate) fn of([capacity, touched_capacity]: [usize; 2], demand: &Demand) -> DomainCapacity {
        let taps = demand.smooth.map_or(vec![], |[sigma, cut]| gaussian_weights(sigma, cut));
        DomainCapacity { capacity, touched_capacity, taps }
    }
}

/// Weights 0..=radius of a Gaussian of `sigma` voxels, cut off at `truncate` sigmas. They sum to 1 over both sides.
pub fn gaussian_weights(sigma: f64, truncate: f64) -> Vec<f64> {
    let radius = (truncate * sigma + 0.5) as usize;
    let half: Vec<f64> = (0..=radius).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    half.into_iter().map(|w| w / sum).collect()
}
