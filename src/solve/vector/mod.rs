//! The accelerated solver: falloff-weighted least squares in the vector albedo v = albedo * normal.
//!
//! minimise  Σ w(t) (A v - h)² / (P T)  +  Σ λ_i |v_i|  +  Σ μ_ij |v_i - v_j|² / 2   over v_z <= 0, |v_xy| <= cone |v_z|
//!
//! by accelerated proximal gradient with adaptive restart. The weights are the inverse falloff, so near and far
//! surfaces weigh alike. Three things come from the data, not from the user. The step of every voxel comes from a
//! bound of the operator on the current domain (De Pierro's separable surrogate, exact while no cosine changes its
//! sign). λ_i comes from the photon noise in the voxel's gradient, and μ_ij, which holds neighbours together where
//! photons are few, comes from λ_i. The background comes from the quietest stretch behind the signal. The first domain
//! comes from a filtered back-projection, so no iteration is dense. The maps of the volume then begin a surface
//! ([`surface`]).

use std::time::Instant;

use super::drive::{Beside, Driven, Steps, Watch, drive};
use super::estimate::{LEAST_PAIRS, expected_noise, variances};
use super::on_device::{OnDevice, upload};
use super::outline::{self, TimedSchedule};
use super::plan::{first_of, pairs_for};
use super::prepared::Prepared;
use super::problem::Problem;
use super::result::Reconstruction;
use super::{Level, Plan, domain, surface};
use crate::Result;
use crate::capture::{Background, Capture};
use crate::gpu::Gpu;
use crate::transport::kernels::buffer;
use crate::transport::{Binning, Gradient, Grid, Model, Rows, Sampling};

pub mod follow;
mod frames;
mod hat;
mod left;
mod needs;
mod options;
pub mod passes;
mod prepared;
mod schedule;
mod spread;
mod trial;

pub use follow::Follow;
pub use frames::{ForFrames, Frames};
pub use hat::hat;
pub use left::Left;
pub use options::{Domain, LEAST_FLOOR, VectorOptions};
pub use prepared::{prepare, prepare_for_frames};
pub(in crate::solve) use schedule::gather_filtered;
pub use schedule::{due, iteration, start};
pub use trial::{Own, PAIRS, Start, Trial};

/// Gaussian of the domain's reduction and of the back-projection, in voxels.
const SMOOTH_SIGMA: f64 = 1.0;

/// The length of the high-pass that trials try, metres of path: a tenth of the wall's width, and two bins at least.
pub fn usual_high_pass(capture: &Capture) -> f64 {
    let [x0, x1, y0, y1] = capture.wall_extent();
    (0.1 * (x1 - x0).max(y1 - y0)).max(2.0 * capture.bin_width)
}

/// The Mexican hat of the back-projection, in lateral voxels of path.
pub const HAT_SIGMA: f64 = 1.5;

/// Runs the solver. Takes the arguments of [`super::paper::reconstruct`].
///
/// # Errors
/// As [`super::paper::reconstruct`].
pub fn reconstruct<'b, 'w: 'b>(
    gpu: &Gpu,
    problem: &Problem<'_>,
    options: &VectorOptions,
    beside: impl Into<Beside<'b, 'w>>,
) -> Result<Reconstruction> {
    options.check()?;
    problem.capture.check()?;
    prepare(gpu, problem, options)?.solve(problem.capture, beside.into())
}

/// Solves the volume of a job that [`make_ready`] has made ready.
fn solve_volume(
    gpu: &Gpu,
    job: &mut OnDevice,
    options: &VectorOptions,
    watch: &mut Watch<'_>,
    until: Option<Instant>,
) -> Result<Driven> {
    let steps = Steps { stop_below: stop_below(options), until, ..steps(&job.plan, options) };
    drive(gpu, job, options.iterations, steps, watch, None)
}

/// See [`Steps::stop_below`].
fn stop_below(options: &VectorOptions) -> Option<fn(&OnDevice) -> f64> {
    options.stop.then_some(|job| expected_noise(job.model_of(job.plan.finest())))
}

/// Uploads what every solve of a volume begins with.
fn make_ready(job: &mut OnDevice) -> Result<()> {
    let first = job.plan.levels.volume[0];
    upload_hat(job, &first)
}

/// Uploads the Mexican hat that filters the measurement for a back-projection at `level`.
fn upload_hat(job: &mut OnDevice, level: &Level) -> Result<()> {
    let hat = hat(hat::sigma_of(level), level.bins);
    upload(&mut job.executor, buffer::HAT_TAPS, bytemuck::cast_slice(&hat))
}

/// The steps that the driver runs, up to the last iteration.
fn steps<'o>(plan: &Plan, options: &'o VectorOptions) -> Steps<'o> {
    Steps {
        levels: plan.levels.volume.clone(),
        start: Box::new(|s, plan| start(s, plan, &plan.levels.volume[0], options)),
        iteration: Box::new(|s, plan, level, i| iteration(s, plan, level, i as u32)),
        due: Box::new(|s, plan, level, done| due(s, plan, options, level, done)),
        extract: Box::new(domain::extract),
        passes: [super::passes::ALL, passes::ALL],
        l1_weight: Box::new(|_| 1.0),
        of: options.iterations + options.surface.iterations,
        after: surface::ahead(plan, options.surface.iterations),
        stop_below: None,
        shrinks: true,
        until: None,
    }
}

/// The schedules of a whole solve: the volume, then the surface.
pub fn outline(plan: &Plan, options: &VectorOptions) -> Vec<TimedSchedule> {
    let mut parts = outline::of("volume", plan, &steps(plan, options), 0..options.iterations);
    parts.extend(surface::outline(plan, &options.surface));
    parts
}

/// The model that `options` make of a capture for `grid`: scaled, background subtracted, noise estimated.
pub fn model(capture: &Capture, grid: &Grid, options: &VectorOptions) -> Model {
    let (mut model, rows) = outline_of(capture, grid, options);
    if !capture.histograms.is_empty() {
        take(capture, options, &rows, &mut model, None);
    }
    model
}

/// The same without measured values, and the rows that they are taken by.
pub(super) fn outline_of(capture: &Capture, grid: &Grid, options: &VectorOptions) -> (Model, Rows) {
    let (model, mut rows) = Model::outline(capture, options.reflectance, options.peak, options.general);
    let mut model = Model {
        min_depth: options.domain.min_depth,
        sampling: Sampling::Fixed,
        binning: Binning::Linear,
        gradient: Gradient::Exact,
        cone: options.cone,
        noise_factor: options.noise_factor,
        roughness: options.roughness,
        high_pass: options.filter(),
        ..model
    };
    if !options.general && !options.all_pairs && model.pairs() > first_of(LEAST_PAIRS) {
        rows.reorder(&model.spread());
        let used = model.enough(pairs_for(grid.n[0] / options.pixels_per_voxel(), options.pairs));
        model.use_first(used);
        rows.keep_first(used);
    }
    if !options.general {
        rows.crop(model.trim(grid));
    }
    (model, rows)
}

/// Takes the counts of a capture, less their background, and estimates their noise. `scale`: of the counts, if it is not
/// to be that of these.
pub(super) fn take(
    capture: &Capture,
    options: &VectorOptions,
    rows: &Rows,
    model: &mut Model,
    scale: Option<f64>,
) {
    let background = Background::of(capture, options.background);
    let [per_count, empty] = variances(capture, background.level);
    match scale {
        Some(scale) => model.take_times(rows, capture, &background, scale),
        None => model.take(rows, capture, &background),
    }
    let scale = 1.0 / model.counts_per_unit;
    model.variance = [per_count * scale, empty * scale * scale];
}

/// Albedo of a voxel from its vector.
fn albedo_of([x, y, z, _]: [f32; 4]) -> f32 {
    (x * x + y * y + z * z).sqrt()
}
