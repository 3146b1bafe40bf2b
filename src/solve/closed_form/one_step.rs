//! What all closed-form methods share: a volume in one step, without iterations.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use super::image::{self, AlbedoVolume};
use super::options::ImageOptions;
use crate::gpu::{Buffer, Constant};
use crate::maps::Maps;
use crate::solve::plan::{Demand, LeftOut, Level, Needs};
use crate::solve::{
    Accumulation, Common, Doing, Pass, Plan, Progress, Reconstruction, RunsOn, Sharpness, Sizes, TracePoint,
    VolumeMap, Watch,
};
use crate::transport::Grid;
use crate::{Error, Kind, Result};

/// What the options of all methods have, of a host method.
pub(super) fn common(lateral: usize, image: &ImageOptions) -> Common {
    Common {
        lateral,
        iterations: [1, 0],
        reflectance: image.reflectance,
        accumulation: Accumulation::Auto,
        sizes: Sizes::default(),
        min_depth: image.min_depth,
        pixels_per_voxel: 1,
        runs_on: RunsOn::Host,
    }
}

/// Nothing of the device: the plan's levels, bins and pairs are all that a host method has of it.
pub(super) struct NoPasses;

impl Needs for NoPasses {
    fn demand(&self) -> Demand {
        Demand::default()
    }

    fn capacities(&self, _levels: &[Level]) -> [usize; 2] {
        [1; 2]
    }

    fn constants(&self, _plan: &Plan) -> Vec<(Constant, u32)> {
        vec![]
    }

    fn passes(&self) -> Vec<&'static Pass> {
        vec![]
    }

    fn buffers(&self, _plan: &Plan) -> Vec<(Buffer, u64)> {
        vec![]
    }

    fn left_out(&self, _plan: &Plan, _out: &mut LeftOut) {}
}

/// Computes the volume with the chosen sharpness, reports progress before and after, and makes the maps.
/// `step` is the distance of scan points, metres, and `share` that of the mask.
///
/// # Errors
/// The watch cancels ([`Kind::Cancelled`]), or `compute` fails.
pub(super) fn in_one_step(
    plan: &Arc<Plan>,
    grid: &Grid,
    [step, share]: [f64; 2],
    with_volume: bool,
    watch: &mut Watch<'_>,
    compute: impl FnOnce() -> Result<(AlbedoVolume, Option<Sharpness>)>,
) -> Result<Reconstruction> {
    let mut point = first_point(plan, grid);
    let mut reported = |point: &TracePoint, maps| {
        let progress = Progress { doing: Doing::Solve, point: *point, iterations: 1, remaining: None, maps };
        tell(watch, &progress)
    };
    reported(&point, None)?;
    let start = Instant::now();
    let (volume, sharpness) = compute()?;
    // What noise alone would show is no surface.
    let floor = sharpness.and_then(|chosen| chosen.noise).map_or(0.0, |noise| noise.floor);
    let maps = image::maps(grid, &volume, step, |albedo| {
        image::share_of_white(image::level_over_haze(albedo, share)?.max(floor), albedo)
    });
    point.seconds = start.elapsed().as_secs_f64();
    point.iteration = 1;
    reported(&point, Some(maps.clone()))?;
    let volume = with_volume.then_some(VolumeMap { grid: *grid, albedo: volume.albedo });
    Ok(Reconstruction { sharpness, ..solved(plan, grid, maps, volume, vec![point]) })
}

/// The trace before the first iteration.
fn first_point(plan: &Plan, grid: &Grid) -> TracePoint {
    TracePoint {
        iteration: 0,
        seconds: 0.0,
        gpu_seconds: 0.0,
        lateral: grid.n[0],
        pairs: plan.scene.pairs,
        active: grid.voxels(),
        active_ratio: 1.0,
        loss: f64::NAN,
        data_loss: f64::NAN,
    }
}

/// Reports progress to the watch.
///
/// # Errors
/// It cancels ([`Kind::Cancelled`]).
fn tell(watch: &mut Watch<'_>, progress: &Progress) -> Result<()> {
    match (watch.hear)(progress) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Error::new(
            Kind::Cancelled,
            "cancelled by the caller before the volume was there",
            "run it again",
        )),
    }
}

/// A result. The last point of the trace has its seconds.
fn solved(
    plan: &Arc<Plan>,
    grid: &Grid,
    maps: Maps,
    volume: Option<VolumeMap>,
    trace: Vec<TracePoint>,
) -> Reconstruction {
    Reconstruction {
        maps,
        volume,
        notes: vec![],
        warnings: vec![],
        verdict: None,
        empty_loss: 0.0,
        pairs: (plan.scene.pairs * grid.voxels()) as u64,
        solve_seconds: trace.last().map_or(0.0, |point| point.seconds),
        stages: None,
        trace,
        device_bytes: plan.buffers.iter().map(|b| b.bytes).sum(),
        full: false,
        lateral: grid.n[0],
        volume_iterations: 1,
        has_mask: true,
        is_warm: false,
        filled: 0,
        sharpness: None,
        kernels: vec![],
        plan: plan.clone(),
    }
}
