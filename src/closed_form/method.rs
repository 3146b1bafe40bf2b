//! What a closed-form method is to the rest of the engine: a volume in one step, without iterations.

use super::fourier::SpareSpectra;
use super::image::AlbedoVolume;
use super::options::ImageOptions;
use super::scan::RegularScan;
use super::sharpness::Ladder;
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Buffer;
use crate::options::Options;
use crate::transport::Grid;

/// A closed-form method, as its options.
pub trait ClosedForm: Options + Clone + Send + Sync + 'static {
    /// Its name on the command line.
    const NAME: &'static str;

    /// Its share of [`super::image::level_over_haze`], fitted on simulated scenes (benches/NOTES.md).
    const MASK_SHARE: f64;

    /// Where its volumes are made, and what of that is its own.
    const BY: By<Self>;

    /// Lateral pixels of the maps, and what the options of all closed-form methods have.
    fn shared(&self) -> (usize, &ImageOptions);

    /// The latter.
    fn image(&self) -> &ImageOptions {
        self.shared().1
    }

    /// As [`crate::engine::Solver::detail`].
    fn finest_detail(&self) -> Option<f64> {
        None
    }

    /// The candidates of the sharpness and its setting, if the method has one.
    fn sharpness(&mut self) -> Option<(Ladder, &mut Option<f64>)> {
        None
    }

    /// The candidates, if the options leave the sharpness open.
    fn ladder(&self) -> Option<Ladder> {
        self.clone().sharpness().filter(|(_, set)| set.is_none()).map(|(ladder, _)| ladder)
    }

    /// The options with a sharpness.
    fn with_sharpness(&self, value: f64) -> Self {
        let mut options = self.clone();
        options.sharpness().into_iter().for_each(|(_, setting)| *setting = Some(value));
        options
    }
}

/// Where a method works, and what it does there.
pub enum By<M> {
    /// On the host.
    Host(HostMethod<M>),
    /// By back-projections on the device.
    Device(Projection<M>),
}

/// Names and bytes of arrays.
pub type Arrays = Vec<(Buffer, u64)>;

/// What a method that runs on the host has of its own.
pub struct HostMethod<M> {
    /// The scan of a capture; `Kind::Input`: the capture breaks an assumption of the method.
    pub scan: fn(&M, &Capture) -> Result<RegularScan>,
    /// The arrays that it holds at the same time, at most.
    pub arrays: fn(&M, &Capture, &RegularScan, &Grid) -> Arrays,
    /// The volume at the voxels of a grid. Counts are without background. A sharpness that the options leave open is the
    /// first of the ladder. The last argument is its memory from one volume to the next.
    pub volume: fn(&M, &Capture, &RegularScan, &Grid, &mut SpareSpectra) -> AlbedoVolume,
}

/// Numbers of each filter or projection.
pub type Numbers = Vec<Vec<f32>>;

/// What a method that back-projects on the device has of its own.
pub struct Projection<M> {
    /// The filters, one for each projection: words of `filter.comp`. Given: bins, the width of a bin and the distance of scan points,
    /// metres.
    pub filters: fn(&M, usize, f64, f64) -> Numbers,
    /// What it makes of the projections, `[(x * n[1] + y) * n[2] + z]` each, on a grid, with that distance.
    pub join: fn(&M, Numbers, &Grid, f64) -> Vec<f32>,
}
