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
    Accumulation, Beside, Common, Doing, Plan, Prepared, Progress, Reconstruction, RunsOn, Sharpness, Sizes,
    TracePoint, VolumeMap, Watch,
};
use crate::advice::{Advice, Remedy, advice};
use crate::capture::Capture;
use crate::gpu::{Abilities, Buffer, BufferPlan, Constant, Exchanged, Gpu, Place};
use crate::maps::Maps;
use crate::transport::{Binning, Gradient, Grid, Model};
use crate::{Error, Kind, Result};

mod backproject;
mod convolution;
mod dlct;
mod fk;
pub mod fourier;
pub mod image;
mod lct;
mod light_cone;
mod options;
mod phasor;
mod resample;
mod scan;
mod sharpness;
mod upsample;

use sharpness::{Ladder, noise, tossed};

pub use backproject::{BpOptions, FbpOptions, Filter, PhasorBpOptions};
pub use convolution::{ConvolutionOptions, Prior};
pub use dlct::DlctOptions;
pub use fk::FkOptions;
pub use image::Volume;
pub use lct::LctOptions;
pub use options::ImageOptions;
pub use phasor::PhasorOptions;
pub use scan::RegularScan;
pub use upsample::Between;

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

    /// These options with a value of the ladder.
    #[must_use]
    fn at(&self, _sharpness: f64) -> Self {
        self.clone()
    }

    /// The volume at the voxels of `grid`. Counts are without background. A sharpness that the options leave open is the
    /// first of the ladder.
    fn volume(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Volume;
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
                capture: &$crate::capture::Capture,
                grid: $crate::transport::Grid,
                abilities: &$crate::gpu::Abilities,
                with_volume: bool,
            ) -> $crate::Result<$crate::solve::Plan> {
                $crate::solve::closed_form::plan(self, capture, grid, abilities, with_volume)
            }

            fn outline(&self, _plan: &$crate::solve::Plan) -> Vec<$crate::solve::Part> {
                vec![]
            }

            fn prepare(
                &self,
                gpu: &$crate::gpu::Gpu,
                capture: &$crate::capture::Capture,
                grid: $crate::transport::Grid,
                memory: Option<u64>,
                with_volume: bool,
            ) -> $crate::Result<Box<dyn $crate::solve::Prepared>> {
                $crate::solve::closed_form::prepare(self, gpu, capture, grid, memory, with_volume)
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
            refined: None,
            smooth: [1.0, 4.0],
            more_taps: [0; 2],
            cosine_volume: false,
            lent: None,
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

/// The plan of a host method: its arrays, and no pass.
///
/// # Errors
/// `Kind::Input`: the capture breaks an assumption of the method.
pub(super) fn plan<M: HostMethod>(
    options: &M,
    capture: &Capture,
    grid: Grid,
    abilities: &Abilities,
    _with_volume: bool,
) -> Result<Plan> {
    let scan = options.scan(capture)?;
    let (model, _) = Model::outline(&capture.outline(), options.image().reflectance, 1.0, false);
    let mut plan = Plan::new(&model, grid, capture.resolution(), &NoPasses, abilities, false)?;
    let shared =
        [(COUNTS, 4 * (capture.pair_count() * capture.bins) as u64), (VOLUME, 4 * grid.voxels() as u64)];
    let fine = upsample::finer(&capture.outline(), &scan, options.image()).into_owned();
    let ladder = options.ladder().filter(|_| capture.integer_counts);
    // The softest may need the most.
    let most = ladder.map_or_else(|| options.clone(), |ladder| options.at(ladder.softest()));
    let own = most.arrays(&fine, &scan.finer(options.image().upsample), &grid);
    let tossed = ladder.map(|_| {
        let counts = 4 * (fine.pair_count() * fine.bins) as u64;
        (TOSSED, counts + 4 * grid.voxels() as u64)
    });
    let between = (options.image().upsample > 1).then(|| (FINER, 4 * (fine.pair_count() * fine.bins) as u64));
    plan.passes.clear();
    plan.left_out.clear();
    plan.buffers = shared
        .into_iter()
        .chain(between)
        .chain(tossed)
        .chain(own)
        .map(|(b, bytes)| BufferPlan::new(b, bytes, Place::Readback))
        .collect();
    Ok(plan)
}

/// Prepares a host method for captures of one scan.
///
/// # Errors
/// As [`plan`], and arrays that do not fit the budget or the host's memory.
pub(super) fn prepare<M: HostMethod>(
    options: &M,
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    memory: Option<u64>,
    with_volume: bool,
) -> Result<Box<dyn Prepared>> {
    options.check_ranges()?;
    let scan = options.scan(capture)?;
    let plan = plan(options, capture, grid, &gpu.abilities(), with_volume)?;
    let asked: u64 = plan.buffers.iter().map(|b| b.bytes).sum();
    check_host_memory(
        asked,
        gpu,
        memory,
        |smaller| advice!["choose " {smaller} ", a larger " Stride ", a narrower " Gate " or more " Memory],
    )?;
    Ok(Box::new(OnHost { options: options.clone(), scan, grid, plan: Arc::new(plan), with_volume }))
}

/// Refuses arrays of `asked` bytes that do not fit the budget or the host's memory. `mend` says what to do, with the smaller
/// job that would fit.
fn check_host_memory<A: Into<Advice>>(
    asked: u64,
    gpu: &Gpu,
    memory: Option<u64>,
    mend: impl FnOnce(Remedy) -> A,
) -> Result<()> {
    let available = memory.unwrap_or(u64::MAX).min(gpu.memory().free[1]);
    if asked <= available {
        return Ok(());
    }
    let smaller = Remedy::SmallerJob { asked: Some(asked), available: Some(available) };
    Err(Error::memory(
        format!("the arrays take {} MiB, and there are {} MiB", asked >> 20, available >> 20),
        mend(smaller),
    ))
}

/// A host method that is prepared for a scan.
struct OnHost<M> {
    options: M,
    scan: RegularScan,
    grid: Grid,
    plan: Arc<Plan>,
    with_volume: bool,
}

impl<M: HostMethod> Prepared for OnHost<M> {
    fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    fn allocate(&mut self) -> Result<()> {
        Ok(())
    }

    fn solve(&mut self, capture: &Capture, beside: Beside<'_, '_>) -> Result<Reconstruction> {
        let OnHost { options, scan, grid, plan, with_volume } = self;
        let step = scan.step[0].min(scan.step[1]);
        let done = in_one_step(plan, grid, [step, M::MASK_SHARE], *with_volume, beside, || {
            let (image, fine) = (options.image(), scan.finer(options.image().upsample));
            let of = |capture: &Capture, with_background: bool| {
                upsample::finer(&scan.light(capture, with_background), scan, image).into_owned()
            };
            let light = of(capture, image.background);
            let Some(ladder) = options.ladder() else {
                return Ok((options.volume(&light, &fine, grid), None));
            };
            if !capture.integer_counts {
                return Ok((options.volume(&light, &fine, grid), Some(ladder.sharpest())));
            }
            let tossed = of(&tossed(capture), false);
            let (chosen, volume) = ladder.choose(|value| {
                let options = options.at(value);
                let [light, tossed] = [&light, &tossed].map(|counts| options.volume(counts, &fine, grid));
                let noise = noise(&light.albedo, &tossed.albedo, grid.n[2], M::MASK_SHARE);
                Ok((noise, light))
            })?;
            Ok((volume, Some(chosen)))
        })?;
        Ok(Reconstruction { filled: scan.gaps.len(), ..done })
    }
}

/// Computes the volume, with the sharpness that was chosen for it, tells the watch before and after, and makes the maps. `step` is the distance of scan points,
/// metres, and `share` that of the mask.
///
/// # Errors
/// The watch cancels ([`Kind::Cancelled`]), or `compute` fails.
fn in_one_step(
    plan: &Arc<Plan>,
    grid: &Grid,
    [step, share]: [f64; 2],
    with_volume: bool,
    beside: Beside<'_, '_>,
    compute: impl FnOnce() -> Result<(Volume, Option<Sharpness>)>,
) -> Result<Reconstruction> {
    let mut point = first_point(plan, grid);
    let mut told = |point: &TracePoint, maps| {
        let progress = Progress { doing: Doing::Solve, point: *point, iterations: 1, remaining: None, maps };
        tell(beside.watch, &progress)
    };
    told(&point, None)?;
    let start = Instant::now();
    let (volume, sharpness) = compute()?;
    // What noise alone would show is no surface.
    let floor = sharpness.and_then(|chosen| chosen.noise).map_or(0.0, |noise| noise.floor);
    let maps = image::maps(grid, &volume, step, |albedo| {
        image::share_of_white(image::level_over_haze(albedo, share)?.max(floor), albedo)
    });
    point.seconds = start.elapsed().as_secs_f64();
    point.iteration = 1;
    told(&point, Some(maps.clone()))?;
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
        pairs: plan.pairs,
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
        empty_loss: 0.0,
        pairs: (plan.pairs * grid.voxels()) as u64,
        solve_seconds: trace.last().map_or(0.0, |point| point.seconds),
        trace,
        device_bytes: plan.buffers.iter().map(|b| b.bytes).sum(),
        full: false,
        lateral: grid.n[0],
        volume_iterations: 1,
        surface_left: false,
        has_mask: true,
        is_warm: false,
        filled: 0,
        sharpness: None,
        beyond: None,
        noise: None,
        exchanged: Exchanged::default(),
        kernels: vec![],
        plan: plan.clone(),
    }
}

/// What the methods' tests against float64 references share.
#[cfg(test)]
mod reference {
    use super::*;
    use crate::transport::Volume as Box;
    use glam::{DVec3, dvec3};

    /// A complex number in float64.
    pub type Wide = rustfft::num_complex::Complex64;

    pub fn wide_turn(angle: f64) -> Wide {
        Wide::new(angle.cos(), angle.sin())
    }

    /// Random counts of a scan of 4 × 3 points whose bins begin late. `spot`: the one point of the laser.
    pub fn random_capture(spot: Option<DVec3>) -> Capture {
        let points: Vec<DVec3> = (0..12)
            .map(|i| dvec3(-0.2 + 0.15 * f64::from(i / 3), 0.1 + 0.12 * f64::from(i % 3), 0.05))
            .collect();
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1u32 << 24) as f32
        };
        let counts = (0..12 * 16).map(|_| random()).collect();
        let laser = spot.map_or(points.clone(), |spot| vec![spot; 12]);
        let mut capture = Capture::new([4, 3], laser, points, 16, 0.05, counts);
        capture.t_start = 0.7;
        capture
    }

    /// A grid whose columns are the points of [`random_capture`].
    pub fn random_grid(scan: &RegularScan) -> Grid {
        let volume = Box { min: dvec3(-0.275, 0.04, 0.45), max: dvec3(0.325, 0.4, 0.8) };
        let grid = Grid::new(volume, 12, 0.03).unwrap();
        // Not square: the values at the points are compared, not those between them.
        assert_eq!(scan.n, [4, 3]);
        grid
    }

    /// The largest difference, over the largest value.
    pub fn error(found: &[f32], wanted: &[f64]) -> f64 {
        let largest = wanted.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        assert!(largest > 0.0 && found.len() == wanted.len());
        found.iter().zip(wanted).map(|(f, w)| (f64::from(*f) - w).abs()).fold(0.0, f64::max) / largest
    }
}
