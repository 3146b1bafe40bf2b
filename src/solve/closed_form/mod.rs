//! Closed-form methods: a volume in one step, without iterations. docs/methods.md tells what each assumes.
//!
//! Each has a folder with its options and its mathematics. Fourier methods run on the cores of the host. They take a
//! regular scan of a flat wall ([`RegularScan`]) and refuse others. Their plan lists the arrays that they hold at once.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use super::option::Options;
use super::plan::{Demand, LeftOut, Level, Needs};
use super::{
    Accumulation, Common, Doing, Plan, Progress, Reconstruction, RunsOn, Sharpness, Sizes, TracePoint,
    VolumeMap, Watch,
};
use crate::capture::Capture;
use crate::gpu::{Buffer, Constant};
use crate::maps::Maps;
use crate::transport::{Binning, Gradient, Grid};
use crate::{Error, Kind, Result};

mod backproject;
mod dlct;
mod fk;
pub mod fourier;
pub mod image;
mod lct;
mod light_cone;
mod on_host;
mod options;
mod phasor;
#[cfg(test)]
mod reference;
mod resample;
mod scan;
mod sharpness;
mod upsample;

use sharpness::Ladder;

pub use backproject::{
    BpOptions, BpSettings, FbpOptions, FbpSettings, Filter, OfProjection, PhasorBpOptions, PhasorBpSettings,
    hat, passes,
};
pub use dlct::{DlctOptions, DlctSettings};
pub use fk::{FkOptions, FkSettings};
pub use image::AlbedoVolume;
pub use lct::{LctOptions, LctSettings};
pub use options::{Between, ImageOptions, ImageSettings};
pub use phasor::{PhasorOptions, PhasorSettings};
pub use scan::RegularScan;

/// A method that runs on the host.
pub trait HostMethod: Options + Clone + Send + Sync + 'static {
    /// What the options of all closed-form methods have.
    fn image(&self) -> &ImageOptions;

    /// Its share of [`image::level_over_haze`], fitted on simulated scenes (benches/NOTES.md).
    const MASK_SHARE: f64;

    /// The scan of a capture.
    ///
    /// # Errors
    /// `Kind::Input`: the capture breaks an assumption of the method.
    fn scan(&self, capture: &Capture) -> Result<RegularScan>;

    /// Names and bytes of the arrays that it holds at the same time, at most.
    fn arrays(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Vec<(Buffer, u64)>;

    /// What there is to choose from where the options leave its sharpness open; `None` if they do not.
    fn ladder(&self) -> Option<Ladder> {
        None
    }

    /// The setting of the ladder.
    fn sharpness(&mut self) -> Option<&mut Option<f64>> {
        None
    }

    /// The volume at the voxels of `grid`. Counts are without background. A sharpness that the options leave open is the
    /// first of the ladder.
    fn volume(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> AlbedoVolume;
}

/// The volume at the voxels of a grid.
pub(super) const VOLUME: Buffer = Buffer::named("volume");
/// The measured histograms, less their background.
pub(super) const COUNTS: Buffer = Buffer::named("counts");
/// The same with points between the measured ones.
const FINER: Buffer = Buffer::named("finer_counts");
/// Counts with a sign for every photon, and their volume.
const TOSSED: Buffer = Buffer::named("tossed_counts_and_volume");

/// Writes what every host method is to the rest of the engine.
macro_rules! host_method {
    ($options:ident, $name:literal) => {
        impl $options {
            /// Its name on the command line.
            pub const NAME: &'static str = $name;
        }

        impl $crate::solve::Solver for $options {
            fn common(&self) -> $crate::solve::Common {
                $crate::solve::closed_form::common(self.lateral, self.image())
            }

            fn check(&self) -> $crate::Result<()> {
                $crate::solve::option::Options::check_ranges(self)
            }

            fn takes(&self, capture: &$crate::capture::Capture) -> $crate::Result<()> {
                self.scan(capture).map(|_| ())
            }

            fn plan(
                &self,
                problem: &$crate::solve::Problem<'_>,
                abilities: &$crate::gpu::Abilities,
            ) -> $crate::Result<$crate::solve::Plan> {
                $crate::solve::closed_form::on_host::plan(self, problem, abilities)
            }

            fn outline(&self, _plan: &$crate::solve::Plan) -> Vec<$crate::solve::TimedSchedule> {
                vec![]
            }

            fn prepare(
                &self,
                gpu: &$crate::gpu::Gpu,
                problem: &$crate::solve::Problem<'_>,
            ) -> $crate::Result<Box<dyn $crate::solve::Prepared>> {
                $crate::solve::closed_form::on_host::prepare(self, gpu, problem, false)
            }
        }
    };
}

use host_method;

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
struct NoPasses;

impl Needs for NoPasses {
    fn demand(&self) -> Demand {
        Demand {
            accumulation: Accumulation::Auto,
            sizes: Sizes::default(),
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

    fn capacities(&self, _levels: &[Level]) -> [usize; 2] {
        [1; 2]
    }

    fn constants(&self, _plan: &Plan) -> Vec<(Constant, u32)> {
        vec![]
    }

    fn passes(&self) -> Vec<&'static super::Pass> {
        vec![]
    }

    fn buffers(&self, _plan: &Plan) -> Vec<(Buffer, u64)> {
        vec![]
    }

    fn left_out(&self, _plan: &Plan, _out: &mut LeftOut) {}
}

/// Computes the volume, with the sharpness that was chosen for it, tells the watch before and after, and makes the maps.
/// `step` is the distance of scan points, metres, and `share` that of the mask.
///
/// # Errors
/// The watch cancels ([`Kind::Cancelled`]), or `compute` fails.
fn in_one_step(
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

/// Tells the watch.
///
/// # Errors
/// It cancels ([`Kind::Cancelled`]).
fn tell(watch: &mut Watch<'_>, progress: &Progress) -> Result<()> {
    match (watch.hear)(progress) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => {
            Err(Error::new(Kind::Cancelled, "cancelled before the volume was there", "run it again"))
        }
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
        warnings: vec![],
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
