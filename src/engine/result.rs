//! What a solve yields.

use std::sync::Arc;

use serde::Serialize;

use super::drive::Driven;
use super::on_device::{OnDevice, VolumeMap, read_volume, trace_rows};
use super::plan::Plan;
use crate::engine::drive::TracePoint;
use crate::engine::plan::{MASK_HOST, RAW_HOST};
use crate::gpu::KernelTime;
use crate::maps::Maps;
use crate::transport::Model;
use crate::transport::kernels::{TRACE_LEAST, buffer};
use crate::{Result, Verdict};

/// The sharpness that a closed-form method chose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sharpness {
    /// The key of the option.
    pub setting: &'static str,
    /// Its value.
    pub value: f64,
    /// The sharpest value that there was to choose.
    pub sharpest: f64,
    /// The noise of its image. `None`: the values are no photon counts, so their noise is not known.
    pub noise: Option<ImageNoise>,
}

/// What noise alone shows, by the brightest voxel of every column.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ImageNoise {
    /// One column of ten is brighter than this, as a share of the albedo from which on a pixel is surface.
    pub share: f64,
    /// One column of a hundred is brighter than this, as albedo.
    pub floor: f64,
}

/// What is known of every pixel after a fit: the channels of the network that has the last word (`learn/README.md`), what they refer to,
/// and what it says.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// `[channel][x][y]`.
    pub channels: Vec<Vec<f32>>,
    /// Depth of every pixel: of the fit, else of the start; walls from the wall's mean depth.
    pub depth: Vec<f32>,
    /// The mask of the maps by the rules of the support.
    pub mask: Vec<bool>,
    /// The share of the union of the mask and the true surface that both have, as the network expects.
    pub expected_iou: f64,
    /// Mean depth of the wall, and its width, metres.
    pub wall: [f64; 2],
}

/// What a solve yields.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Reconstruction {
    /// Albedo, depth, normal and mask by pixel.
    pub maps: Maps,
    /// The volume, if it was asked for.
    pub volume: Option<VolumeMap>,
    /// Estimates, as sentences; none for a frame of a session, which returns its own when it is made.
    pub notes: Vec<String>,
    /// What looks wrong with the capture or the result, as sentences.
    pub warnings: Vec<String>,
    /// The verdict, once it is given.
    pub verdict: Option<Arc<Verdict>>,
    /// One point for each iteration.
    pub trace: Vec<TracePoint>,
    /// The data loss of an empty volume: the mean over the bins of the squared measurement, as the solver takes it.
    #[doc(hidden)]
    pub empty_loss: f64,
    /// The plan that was run.
    #[doc(hidden)]
    pub plan: Arc<Plan>,
    /// Pair evaluations, forward and backward together counted once.
    #[doc(hidden)]
    pub pairs: u64,
    /// Solve time without measuring, seconds.
    pub solve_seconds: f64,
    /// Seconds of the surface's start, of rounds of its support, and of its last fit; `None` for other methods.
    #[doc(hidden)]
    pub stages: Option<[f64; 3]>,
    /// Bytes of all buffers.
    #[doc(hidden)]
    pub device_bytes: u64,
    /// The domain was larger than the room at some time: its dimmest voxels were left out.
    #[doc(hidden)]
    pub full: bool,
    /// Lateral voxels of the level that the volume reached.
    #[doc(hidden)]
    pub lateral: usize,
    /// Iterations of the volume that were done; later ones in the trace are the surface's.
    #[doc(hidden)]
    pub volume_iterations: usize,
    /// The method's own mask of its maps, as a share of the brightest albedo.
    #[doc(hidden)]
    pub has_mask: bool,
    /// It began with the surface of the frame before ([`crate::surface::Follow`]).
    pub is_warm: bool,
    /// Places of the scan's lattice without a pair, which a Fourier method filled from the pairs around them.
    #[doc(hidden)]
    pub filled: usize,
    /// How sharp a closed-form method made its image, where its options left that open.
    #[doc(hidden)]
    pub sharpness: Option<Sharpness>,
    /// What is known of every pixel, where a network had the last word.
    #[doc(hidden)]
    pub evidence: Option<Arc<Evidence>>,
    /// Per kernel, if the device was opened with timings.
    #[doc(hidden)]
    pub kernels: Vec<(&'static str, KernelTime)>,
}

impl Reconstruction {
    /// Share of the light that maps with this data loss leave: ‖Av − h‖ / ‖h‖. `None` for closed forms, and without light.
    #[doc(hidden)]
    pub fn residual(&self, data_loss: f64) -> Option<f64> {
        (self.empty_loss > 0.0).then(|| (data_loss / self.empty_loss).sqrt())
    }
}

/// Makes the result from what the driver left.
///
/// `volume` computes the albedo of a voxel from its state, if the volume is read back.
///
/// # Errors
/// The device fails.
pub(crate) fn finish(
    job: &mut OnDevice,
    driven: Driven,
    volume: Option<fn([f32; 4]) -> f32>,
) -> Result<Reconstruction> {
    let volume = if let Some(albedo) = volume {
        let storage = driven.level.grid.storage() as u64;
        job.run(|s, plan| {
            s.copy(buffer::RAW, RAW_HOST, plan.domain.capacity as u64 * 16);
            s.copy(buffer::MASK, MASK_HOST, storage / 8);
        })?;
        Some(read_volume(&job.executor, &driven.level.grid, albedo))
    } else {
        None
    };
    let done = driven.trace.last().map_or(0, |p| p.iteration);
    let full = trace_rows(job, 0..done).iter().any(|r| r[TRACE_LEAST as usize] != 0);
    Ok(Reconstruction {
        maps: driven.maps,
        volume,
        notes: vec![],
        warnings: vec![],
        verdict: None,
        trace: driven.trace,
        empty_loss: empty_loss(&job.model),
        pairs: driven.pairs,
        solve_seconds: driven.seconds,
        stages: None,
        device_bytes: job.executor.bytes(),
        full,
        has_mask: false,
        is_warm: false,
        filled: 0,
        sharpness: None,
        evidence: None,
        lateral: driven.level.grid.n[0],
        volume_iterations: done,
        kernels: job.executor.take_times().into_iter().collect(),
        plan: job.plan.clone(),
    })
}

fn empty_loss(model: &Model) -> f64 {
    let squares: f64 = model.measured.iter().map(|v| f64::from(*v).powi(2)).sum();
    squares / model.elements as f64
}
