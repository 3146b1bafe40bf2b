//! The convolutional approximation (Ahn, Dave, Veeraraghavan, Gkioulekas, Sankaranarayanan: *Convolutional approximations to
//! the general non-line-of-sight imaging operator*, ICCV 2019), of any pairs and any wall.
//!
//! With the measurement operator A, the least squares of a measurement h are at AᵀA x = Aᵀh. Aᵀh is a back-projection, here
//! on the device. The Gram operator AᵀA is nearly a convolution, once its diagonal is divided out on both sides
//! (`gram.rs`), which is also the preconditioner of the descent. A convolution takes two Fourier transforms (`operator.rs`),
//! so many iterations with a prior are cheap (`descent.rs`).
//!
//! Differences from the publication: one kernel, of places about the middle of the volume, where theirs is the response of
//! one point; not cut by the grid; proximal gradient in place of ADMM.

use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::backproject::{self, BpOptions, Projecting};
use super::image::{self, Volume, on_grid};
use super::on_host::check_host_memory;
use super::options::ImageOptions;
use super::sharpness;
use super::{RegularScan, first_point, solved, tell};
use crate::Result;
use crate::advice::advice;
use crate::capture::Capture;
use crate::gpu::{Abilities, Buffer, BufferPlan, Gpu, Place};
use crate::maps::Maps;
use crate::solve::option::{Options, options};
use crate::solve::{
    Beside, Common, Doing, ImageNoise, Plan, Prepared, Problem, Progress, Reconstruction, Sharpness, Solver,
    TimedSchedule, TracePoint, VolumeMap, Watch,
};
use crate::transport::Grid;

mod descent;
mod gram;
mod operator;

use descent::Descent;
pub use descent::Prior;
use gram::SomePairs;
use operator::Convolution;

options! {
    /// Options of the convolutional approximation.
    pub struct ConvolutionOptions(suit) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions,
        }
        "Solver" {
            /// Lateral pixels of the maps; from 128 on, a voxel is two pixels wide
            lateral: usize = 128, Range::Count(1, 4096);
        }
        "Convolutional approximation" {
            /// What is known of the volume: nothing (none), that no albedo is negative (positive), that most are zero
            /// as well (sparse), or that there are few edges (variation)
            prior: Prior = Prior::Sparse, Range::Words(&["none", "positive", "sparse", "variation"]);
            /// Weight of sparse and variation, as a share of the brightest back-projected voxel [default: 0.1; for photon
            /// counts, chosen by their noise, 0.1 to 0.5]
            prior_weight: Option<f64> = None, Range::NotNegative;
            /// Iterations of the convolutional approximation
            conv_iterations: usize = 60, Range::Count(1, 1_000_000);
        }
    }
}

/// The least and the largest weight of a prior that are chosen.
const WEIGHTS: [f64; 2] = [0.1, 0.5];

/// A prior's weight is so many times the noise of the back-projection ([`ImageNoise::floor`]): undoing the Gram
/// operator raises it. Fitted on simulated scenes (benches/studies/closed-forms.md).
const OF_NOISE: f64 = 3.0;

/// The kernel and its spectrum, or the spectrum and what one convolution needs.
const CONVOLUTION: Buffer = Buffer::named("convolution");
/// Volumes: the back-projection, its scale, the iterate, the one before, the place of the gradient, the gradient.
const ITERATES: Buffer = Buffer::named("iterates");

impl ConvolutionOptions {
    /// Its name on the command line.
    pub const NAME: &'static str = "conv";

    /// The back-projection of the measurement.
    fn projection(&self) -> BpOptions {
        BpOptions { image: self.image.clone(), lateral: self.lateral }
    }
}

impl Solver for ConvolutionOptions {
    fn common(&self) -> Common {
        Common { iterations: [self.conv_iterations, 0], ..self.projection().common() }
    }

    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        self.projection().check()
    }

    fn takes(&self, capture: &Capture) -> Result<()> {
        self.projection().takes(capture)
    }

    fn plan(&self, problem: &Problem<'_>, abilities: &Abilities) -> Result<Plan> {
        Ok(with_own(self.projection().plan(problem, abilities)?))
    }

    fn outline(&self, plan: &Plan) -> Vec<TimedSchedule> {
        self.projection().outline(plan)
    }

    fn prepare(&self, gpu: &Gpu, problem: &Problem<'_>) -> Result<Box<dyn Prepared>> {
        self.check()?;
        let projecting = backproject::projecting(&self.projection(), gpu, problem)?;
        let plan = with_own((**projecting.plan()).clone());
        let asked = own_arrays(&plan).iter().map(|(_, bytes)| bytes).sum();
        check_host_memory(
            asked,
            gpu,
            problem.memory,
            |smaller| advice!["choose " {smaller} " or more " Memory],
        )?;
        let made = Approximation {
            options: self.clone(),
            projecting,
            grid: problem.grid,
            plan: Arc::new(plan),
            with_volume: problem.with_volume,
            gram: None,
        };
        Ok(Box::new(made))
    }
}

/// A plan of the back-projection, with the arrays on the host beside it.
fn with_own(mut plan: Plan) -> Plan {
    let all = own_arrays(&plan);
    plan.buffers.extend(all.map(|(buffer, bytes)| BufferPlan::new(buffer, bytes, Place::Readback)));
    plan
}

/// The arrays on the host for the volume of a plan, with their bytes.
fn own_arrays(plan: &Plan) -> [(Buffer, u64); 2] {
    let grid = &plan.finest().grid;
    [(CONVOLUTION, Convolution::bytes(grid)), (ITERATES, 6 * 4 * grid.voxels() as u64)]
}

/// The approximation, prepared for a scan.
struct Approximation {
    options: ConvolutionOptions,
    projecting: Projecting<BpOptions>,
    /// The maps' grid.
    grid: Grid,
    plan: Arc<Plan>,
    with_volume: bool,
    /// The Gram operator: the convolution, and the roots of the diagonal. Made for the first capture.
    gram: Option<(Convolution, Vec<f32>)>,
}

impl Prepared for Approximation {
    fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    fn allocate(&mut self) -> Result<()> {
        self.projecting.allocate()
    }

    fn solve(&mut self, capture: &Capture, beside: Beside<'_, '_>) -> Result<Reconstruction> {
        // Kernels and buffers are made before the time begins.
        self.projecting.make(capture)?;
        let last = self.options.conv_iterations;
        let mut told = Watched::begin(beside.watch, &self.plan, &self.grid, last);
        told.iteration(None)?;
        let (grid, projected) = self.projecting.sums(capture)?;
        let is_open = self.options.prior.has_weight() && self.options.prior_weight.is_none();
        let noise = match is_open && capture.integer_counts {
            true => Some(self.projecting.sums_of_noise(capture)?),
            false => None,
        };
        let Approximation { options, gram, grid: of_maps, with_volume, .. } = &mut *self;
        let (kernel, scale) = gram.get_or_insert_with(|| {
            let pairs = SomePairs::of(capture, options.image.reflectance.has_normals());
            (Convolution::gram(&pairs, &grid), gram::scale(&pairs, &grid))
        });
        let projected = divided(&projected, scale);
        let noise = noise.map(|noise| sharpness::noise(&projected, &divided(&noise, scale), grid.n[2], 1.0));
        let chosen = is_open.then(|| weight(noise, projected.iter().copied().fold(0.0, f32::max)));
        let prior_weight = options.prior_weight.or(chosen.map(|c| c.value)).unwrap_or_default();
        let mut descent = Descent::new(kernel, grid.n, options.prior, prior_weight, projected);
        let step = capture.spacing().unwrap_or(of_maps.pitch.x);
        let volume = |descent: &Descent<'_>| {
            let albedo = divided(&descent.volume, scale);
            Volume { albedo: on_grid(&RegularScan::of_columns(&grid), &albedo, of_maps), normal: None }
        };
        let maps = |volume: &Volume| image::maps(of_maps, volume, step, image::fraction_by_roots);
        for iteration in 1..last {
            descent.step();
            let asked = told.asks_for_maps(iteration);
            told.iteration(asked.then_some(&|| maps(&volume(&descent))))?;
        }
        descent.step();
        let volume = volume(&descent);
        let maps = maps(&volume);
        let trace = told.end(&maps)?;
        let volume = with_volume.then_some(VolumeMap { grid: *of_maps, albedo: volume.albedo });
        let done = solved(&self.plan, &self.grid, maps, volume, trace);
        Ok(Reconstruction { volume_iterations: last, sharpness: chosen, ..done })
    }
}

/// The weight of a prior for the noise of a back-projection, whose brightest voxel is `brightest`.
fn weight(noise: Option<ImageNoise>, brightest: f32) -> Sharpness {
    let [sharpest, most] = WEIGHTS;
    let least = noise.map_or(0.0, |noise| OF_NOISE * noise.floor / f64::from(brightest));
    // NaN without light.
    Sharpness { setting: "prior_weight", value: least.min(most).max(sharpest), sharpest, noise }
}

/// Values over their scale; zero where that is zero.
fn divided(values: &[f32], scale: &[f32]) -> Vec<f32> {
    let of = |(value, by): (&f32, &f32)| if *by > 0.0 { value / by } else { 0.0 };
    values.par_iter().zip(scale).map(of).collect()
}

/// What the watch was told of a solve.
struct Watched<'b, 'w> {
    watch: &'b mut Watch<'w>,
    point: TracePoint,
    iterations: usize,
    start: Instant,
    /// Time in making maps and in the watch, which does not count.
    apart: Duration,
    trace: Vec<TracePoint>,
}

impl<'b, 'w> Watched<'b, 'w> {
    fn begin(watch: &'b mut Watch<'w>, plan: &Plan, grid: &Grid, iterations: usize) -> Watched<'b, 'w> {
        let (start, apart) = (Instant::now(), Duration::ZERO);
        Watched { watch, point: first_point(plan, grid), iterations, start, apart, trace: vec![] }
    }

    fn asks_for_maps(&self, iteration: usize) -> bool {
        self.watch.maps_every.is_some_and(|n| iteration.is_multiple_of(n))
            || self.watch.maps_at.contains(&iteration)
    }

    /// Tells of the iteration that is done, the first time of the beginning.
    ///
    /// # Errors
    /// The watch cancels (`Kind::Cancelled`).
    fn iteration(&mut self, maps: Option<&dyn Fn() -> Maps>) -> Result<()> {
        let since = Instant::now();
        self.point.seconds = (self.start.elapsed() - self.apart).as_secs_f64();
        let (point, rest) = (self.point, self.iterations - self.point.iteration);
        let each = |done: usize| point.seconds / done as f64;
        let remaining = (point.iteration > 0).then(|| rest as f64 * each(point.iteration));
        let maps = maps.map(|make| make());
        tell(
            self.watch,
            &Progress { doing: Doing::Solve, point, iterations: self.iterations, remaining, maps },
        )?;
        if point.iteration > 0 {
            self.trace.push(point);
        }
        self.point.iteration += 1;
        self.apart += since.elapsed();
        Ok(())
    }

    /// Tells of the last iteration. Its maps are the result.
    fn end(mut self, maps: &Maps) -> Result<Vec<TracePoint>> {
        self.iteration(Some(&|| maps.clone()))?;
        Ok(self.trace)
    }
}
