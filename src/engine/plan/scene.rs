//! What a plan has of the model: its pairs, its bins, and how light goes between them.

use crate::gpu::DeviceKind;
use crate::transport::{Geometry, Grid, Model, Reflectance};

/// What a plan has of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelSizes {
    /// Pairs of the model.
    pub pairs: usize,
    /// Pairs of the capture that it leaves out.
    pub unused: usize,
    /// Wall points of the scanned side.
    pub scanned: usize,
    /// Wall points of the other side.
    pub others: usize,
    /// How pairs are made of wall points.
    pub geometry: Geometry,
    /// Normals of the wall are used.
    pub curved: bool,
    /// Bins of a histogram.
    pub bins: usize,
    /// Bins of the capture, whether or not a voxel reaches them.
    pub all_bins: usize,
    /// Metres of path.
    pub bin_width: f64,
    /// How surfaces reflect.
    pub reflectance: Reflectance,
    /// Bin positions are computed in parts: paths span more bins than fp32 resolves.
    pub fine: bool,
    /// Distances take a step of Newton: the device's inverse roots may be too inaccurate for this number of bins.
    pub polished: bool,
    /// Taps of the instrument's pulse; 0 if no pulse is known.
    pub pulse: usize,
    /// Standard deviation of the pulse, metres of path; 0 if no pulse is known.
    pub pulse_deviation: f64,
    /// The objective takes down what changes slowly along time: [`Model::high_pass`].
    pub high_pass: bool,
}

impl ModelSizes {
    /// What `model` on `grid` is on a device of this kind.
    pub(crate) fn of(model: &Model, grid: &Grid, device: DeviceKind) -> ModelSizes {
        ModelSizes {
            pairs: model.pairs(),
            unused: model.unused,
            scanned: model.wall.scanned.len(),
            others: model.wall.others.len(),
            geometry: model.wall.geometry,
            curved: model.wall.normals.is_some(),
            bins: model.bins,
            all_bins: model.elements / model.pairs().max(1),
            bin_width: model.bin_width,
            reflectance: model.reflectance,
            fine: model.is_fine(grid),
            polished: !matches!(device, DeviceKind::Host | DeviceKind::Cpu) && model.is_polished(grid),
            pulse: model.pulse.as_ref().map_or(0, |p| p.weights.len()),
            pulse_deviation: model.pulse.as_ref().map_or(0.0, |p| p.deviation() * model.bin_width),
            high_pass: model.high_pass.is_some(),
        }
    }

    /// Pairs of the capture, those that are left out included.
    pub fn pairs_of_capture(&self) -> usize {
        self.pairs + self.unused
    }

    /// Bytes of a wall point with its normal, if normals are used.
    pub(crate) fn bytes_of_point(&self) -> u64 {
        if self.curved { 32 } else { 16 }
    }
}
