//! The accelerated solver: falloff-weighted least squares in the vector albedo v = albedo * normal.
//!
//! minimise  Σ w(t) (A v - h)² / (P T)  +  Σ λ_i |v_i|   over v_z <= 0, |v_xy| <= cone |v_z|
//!
//! by accelerated proximal gradient with adaptive restart. Weighting the squares by the inverse falloff makes near
//! and far surfaces weigh alike. Three things come from the data, not from the user: the step of every voxel from
//! a bound of the operator on the domain at hand (De Pierro's separable surrogate, exact while no cosine changes
//! its sign), λ_i from the photon noise that reaches the voxel's gradient, and the background from the quietest
//! stretch behind the signal. The first domain comes from a filtered back-projection, so no iteration is dense.

use serde::{Deserialize, Serialize};

use super::drive::{Steps, Watch, drive};
use super::job::{Job, upload};
use super::paper::finish;
use super::plan::Wanted;
use super::schedule::groups;
use super::{Accumulation, Level, NoiseTerm, Plan, Reconstruction, domain};
use crate::capture::Capture;
use crate::gpu::{Command, Gpu, Schedule};
use crate::transport::kernels::*;
use crate::transport::{Binning, Gradient, Grid, Model, Sampling};
use crate::{Error, Result};

/// Everything the vector solver can be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VectorOptions {
    /// Lateral voxels of the final grid (N of N × N × Z).
    pub lateral: usize,
    pub iterations: usize,
    /// Start at the scan's resolution and double, or start at `lateral`.
    pub coarse_to_fine: bool,
    /// Iterations at each resolution below the last.
    pub coarse_iterations: usize,
    pub reduce_every: usize,
    /// Renew the bounds that steps come from after so many iterations; between, the domain may only shrink.
    pub bound_every: usize,
    /// Share of the bound that the first step divides by. 1 cannot overshoot; less goes faster, and grows where the
    /// objective rises.
    pub step_share: f64,
    /// Keep voxels above this share of the smoothed albedo's maximum.
    pub keep_above: f64,
    /// The same for the back-projection that the first domain is taken from.
    pub start_above: f64,
    /// λ in standard deviations of the photon noise in a voxel's gradient.
    pub noise_factor: f64,
    /// Largest |v_xy| / |v_z| of a surface.
    pub cone: f64,
    /// Surfaces shine with both cosines and the wall's, not with one.
    pub lambertian: bool,
    /// Subtract the background estimated behind the signal.
    pub background: bool,
    /// Stop once what is left of the data is no more than its noise.
    pub stop: bool,
    /// Nothing nearer than this is ever active, metres.
    pub min_depth: f64,
    /// The measurement is scaled so that this is its largest value.
    pub peak: f64,
    pub accumulation: Accumulation,
}

impl Default for VectorOptions {
    fn default() -> VectorOptions {
        VectorOptions {
            lateral: 128,
            iterations: 60,
            coarse_to_fine: true,
            coarse_iterations: 15,
            reduce_every: 5,
            bound_every: 15,
            step_share: 0.25,
            keep_above: 0.05,
            start_above: 0.02,
            noise_factor: 3.0,
            cone: 2.0,
            lambertian: false,
            background: true,
            stop: true,
            min_depth: 0.2,
            peak: 10.0,
            accumulation: Accumulation::Auto,
        }
    }
}

impl From<&VectorOptions> for Wanted {
    fn from(o: &VectorOptions) -> Wanted {
        Wanted {
            accumulation: o.accumulation,
            coarse_to_fine: o.coarse_to_fine,
            iterations: o.iterations,
            sampling: Sampling::Fixed,
            binning: Binning::Linear,
            gradient: Gradient::Exact,
            noise: NoiseTerm::Off,
            initial_albedo: 0.0,
            smooth_sigma: SMOOTH_SIGMA,
            smooth_truncate: 4.0,
            vectors: true,
            lambertian: o.lambertian,
        }
    }
}

/// Gaussian of the domain's reduction and of the back-projection, in voxels.
const SMOOTH_SIGMA: f64 = 1.0;

/// The Mexican hat of the back-projection, in lateral voxels of path.
pub const HAT_SIGMA: f64 = 1.5;

impl VectorOptions {
    /// Errors: the first option that makes no sense, by its name on the command line.
    pub fn check(&self) -> Result<()> {
        let bad = |option: &str, value: String, want: &str| {
            Err(Error::options(format!("--{option} is {value}"), format!("give {want}")))
        };
        for (name, value, most) in [
            ("lateral", self.lateral, 4096),
            ("iterations", self.iterations, 1_000_000),
            ("coarse-iterations", self.coarse_iterations, 1_000_000),
            ("reduce-every", self.reduce_every, 1_000_000),
            ("bound-every", self.bound_every, 1_000_000),
        ] {
            if value == 0 || value > most {
                return bad(name, value.to_string(), &format!("a whole number from 1 to {most}"));
            }
        }
        for (name, value) in [("cone", self.cone), ("peak", self.peak), ("step-share", self.step_share)] {
            if !(value.is_finite() && value > 0.0) {
                return bad(name, value.to_string(), "a positive number");
            }
        }
        if self.step_share > 1.0 {
            return bad("step-share", self.step_share.to_string(), "a positive number up to 1");
        }
        for (name, value) in [("noise-factor", self.noise_factor), ("min-depth", self.min_depth)] {
            if !(value.is_finite() && value >= 0.0) {
                return bad(name, value.to_string(), "zero or a positive number");
            }
        }
        for (name, value) in [("keep-above", self.keep_above), ("start-above", self.start_above)] {
            if !(0.0..1.0).contains(&value) {
                return bad(name, value.to_string(), "a number from 0 to below 1");
            }
        }
        Ok(())
    }
}

/// Runs the solver.
///
/// Errors: as [`super::paper::reconstruct`].
pub fn reconstruct(
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    options: &VectorOptions,
    memory: Option<u64>,
    with_volume: bool,
    watch: &mut Watch<'_>,
) -> Result<Reconstruction> {
    options.check()?;
    let model = model(capture, options)?;
    let plan = Plan::new(&model, grid, capture.scan, options, &gpu.abilities(), with_volume)?;
    let mut job = Job::new(gpu, model, plan, memory)?;
    let lateral = job.plan.levels[0].grid.pitch.x;
    let hat = hat(HAT_SIGMA * lateral / capture.bin_width, capture.bins);
    upload(&mut job.executor, "hat_taps", bytemuck::cast_slice(&hat))?;
    let steps = Steps {
        start: start(&job.plan, &job.plan.levels[0], options),
        iteration: &|plan, level, i| iteration(plan, level, i as u32),
        due: &|plan, level, done| due(plan, options, level, done),
        extract: &domain::extract,
        l1_weight: &|_| 1.0,
        stop_below: options.stop.then(|| expected_noise(&job.model)),
    };
    let driven = drive(gpu, &mut job, options.iterations, steps, watch)?;
    finish(job, driven, with_volume)
}

/// The model that `options` make of a confocal capture: scaled, the background taken off, its noise estimated.
pub fn model(capture: &Capture, options: &VectorOptions) -> Result<Model> {
    if !capture.is_confocal() {
        return Err(Error::input(
            "the vector solver is for confocal captures, and here laser and sensor points differ",
            "give a confocal capture",
        ));
    }
    if options.lambertian && !capture.is_planar() {
        return Err(Error::input(
            "--model lambertian is for a flat relay wall, and this one is not flat",
            "use --model cosine",
        ));
    }
    let mut model = Model {
        min_depth: options.min_depth,
        sampling: Sampling::Fixed,
        binning: Binning::Linear,
        gradient: Gradient::Exact,
        cone: options.cone,
        noise_factor: options.noise_factor,
        ..Model::new(capture, options.peak)
    };
    let level = if options.background { background(capture) } else { 0.0 };
    let per_count = variance_per_count(capture);
    let scale = 1.0 / model.counts_per_unit;
    for m in &mut model.measured {
        *m -= (level * scale) as f32;
    }
    model.variance = [per_count * scale, per_count * level * scale * scale];
    Ok(model)
}

/// The weighted data term that photon noise alone leaves: below it a solver fits noise (discrepancy principle,
/// Morozov 1966).
pub fn expected_noise(model: &Model) -> f64 {
    let [per_value, floor] = model.variance;
    let weight = |bin: usize| {
        let t = model.t_start + (bin as f64 + 0.5) * model.bin_width;
        (t / (2.0 * model.reference)).powi(4)
    };
    // A count is its own unbiased variance; `measured` is the count less the background.
    let noise = |(i, m): (usize, &f32)| weight(i % model.bins) * (per_value * f64::from(*m) + floor);
    model.measured.iter().enumerate().map(noise).sum::<f64>() / model.measured.len() as f64
}

/// Counts per bin that are there without light: the lowest mean over all pairs of any sixteenth of the bins
/// behind the strongest one; none if there are fewer bins behind it.
pub fn background(capture: &Capture) -> f64 {
    let bins = capture.bins;
    let mut mean = vec![0.0f64; bins];
    for histogram in capture.histograms.chunks_exact(bins) {
        for (m, v) in mean.iter_mut().zip(histogram) {
            *m += f64::from(*v) / capture.pair_count() as f64;
        }
    }
    let peak = (0..bins).max_by(|a, b| mean[*a].total_cmp(&mean[*b])).unwrap_or(0);
    let window = (bins / 16).max(1);
    let behind = mean[peak + 1..].windows(window).map(|w| w.iter().sum::<f64>() / window as f64);
    behind.reduce(f64::min).unwrap_or(0.0)
}

/// Variance of a bin over its mean count, 1 for photons: from the second differences along time, whose square
/// is on average 1.5 variances where the signal is smooth; the median over bins, so that edges do not count.
pub fn variance_per_count(capture: &Capture) -> f64 {
    // Median of a squared standard normal.
    const MEDIAN: f64 = 0.4549;
    if capture.integer_counts {
        return 1.0;
    }
    let mut ratios: Vec<f64> = capture
        .histograms
        .chunks_exact(capture.bins)
        .flat_map(|h| h.windows(3))
        .filter(|w| w.iter().all(|v| *v > 0.0))
        .map(|w| {
            let [a, b, c] = [w[0], w[1], w[2]].map(f64::from);
            (b - 0.5 * (a + c)).powi(2) / (0.25 * a + b + 0.25 * c)
        })
        .collect();
    if ratios.is_empty() {
        return 0.0;
    }
    let middle = ratios.len() / 2;
    *ratios.select_nth_unstable_by(middle, f64::total_cmp).1 / MEDIAN
}

/// A Mexican hat of `sigma` bins for `filter.comp`: [radius, weights 0..=radius], of zero sum over both sides.
pub fn hat(sigma: f64, bins: usize) -> Vec<f32> {
    let sigma = sigma.max(0.7);
    let radius = ((4.0 * sigma).ceil() as usize).min(bins - 1);
    let weight = |i: usize| {
        let x = (i as f64 / sigma).powi(2);
        (1.0 - x) * (-0.5 * x).exp()
    };
    let sum = weight(0) + 2.0 * (1..=radius).map(weight).sum::<f64>();
    let mean = sum / (2 * radius + 1) as f64;
    std::iter::once(radius as f32).chain((0..=radius).map(|i| (weight(i) - mean) as f32)).collect()
}

/// Sums at zero, the first domain from a filtered back-projection, nothing in it, its bounds.
pub fn start(plan: &Plan, level: &Level, options: &VectorOptions) -> Schedule {
    let mut s = Schedule::default();
    let bytes = |name: &str| plan.buffers.iter().find(|b| b.name == name).map_or(0, |b| b.bytes);
    for buffer in ["counts", "histograms", "momentum"] {
        s.fill(buffer, bytes(buffer), 0);
    }
    s.fill("raw", level.grid.storage() as u64 * 16, 0);
    s.commands.push(Command::Fill {
        buffer: "momentum",
        offset: 4 * u64::from(MOMENTUM_SHARE),
        bytes: 4,
        value: (options.step_share as f32).to_bits(),
    });
    s.dispatch("filter", groups(plan.pairs * plan.bins, WORKGROUP)).bind("scene", level.scene);
    for push in pair_chunks(plan) {
        s.dispatch("backproject", groups(level.grid.storage(), WORKGROUP))
            .bind("scene", level.scene)
            .bind("target", "sample_points")
            .with(push);
    }
    s.extend(domain::smooth(level, "gaussian_x_volume"));
    s.extend(domain::keep(level, options.start_above));
    s.extend(settle(plan, level));
    s.extend(bounds(plan, level));
    s
}

/// One iteration: extrapolate, forward, weighted residual, step, finish.
pub fn iteration(plan: &Plan, level: &Level, iteration: u32) -> Schedule {
    let mut s = Schedule::default();
    let push = Push { iteration, ..Default::default() };
    s.indirect("extrapolate", "arguments", 12 * u64::from(ARGUMENTS_SAMPLE))
        .bind("scene", level.scene)
        .with(push);
    s.extend(forward(plan, level, "forward"));
    s.dispatch("residual", groups(plan.pairs * plan.bins, WORKGROUP)).bind("scene", level.scene).with(push);
    for chunk in pair_chunks(plan) {
        s.indirect("step", "arguments", 12 * u64::from(ARGUMENTS_BACKWARD))
            .bind("scene", level.scene)
            .with(chunk);
    }
    s.dispatch("finish", [1, 1, 1]).bind("scene", level.scene).with(push);
    s
}

/// What is due after `done` iterations: doubling (the level moves on) or reduction.
pub fn due(plan: &Plan, options: &VectorOptions, level: &mut usize, done: usize) -> Schedule {
    let mut s = Schedule::default();
    let here = &plan.levels[*level];
    if done.is_multiple_of(options.coarse_iterations) && *level + 1 < plan.levels.len() {
        s.extend(reduce(plan, here, options));
        let fine = &plan.levels[*level + 1];
        s.extend(domain::double_volume(plan, here, fine));
        s.extend(settle(plan, fine));
        s.extend(bounds(plan, fine));
        *level += 1;
    } else if done.is_multiple_of(options.reduce_every) {
        s.extend(reduce(plan, here, options));
        s.extend(settle(plan, here));
        if done.is_multiple_of(options.bound_every) {
            s.extend(bounds(plan, here));
        }
    }
    s
}

fn reduce(_: &Plan, level: &Level, options: &VectorOptions) -> Schedule {
    let mut s = domain::smooth(level, "gaussian_x");
    s.extend(domain::keep(level, options.keep_above));
    s
}

/// After a new mask: what is inactive holds nothing, lists, points.
fn settle(plan: &Plan, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    s.dispatch("settle", groups(level.grid.storage(), WORKGROUP)).bind("scene", level.scene);
    s.extend(domain::compact(plan, level));
    s.indirect("points", "arguments", 12 * u64::from(ARGUMENTS_SAMPLE)).bind("scene", level.scene);
    s
}

/// D and lambda of the active voxels. What becomes active later has no bound, and stays zero until the next time:
/// so the bounds of the others hold in between.
fn bounds(plan: &Plan, level: &Level) -> Schedule {
    let mut s = Schedule::default();
    let scene = level.scene;
    let elements = plan.pairs * plan.bins;
    let sample = 12 * u64::from(ARGUMENTS_SAMPLE);
    s.fill("bounds", level.grid.storage() as u64 * 8, 0);
    // The largest albedo of the rendering that bounds: one.
    s.commands.push(peak(1.0));
    s.extend(forward(plan, level, "forward_bound"));
    s.dispatch("residual_bound", groups(elements, WORKGROUP)).bind("scene", scene);
    s.commands.push(peak(0.0));
    for chunk in pair_chunks(plan) {
        s.indirect("bound_step", "arguments", sample).bind("scene", scene).with(chunk);
    }
    s.dispatch("variance", groups(elements, WORKGROUP)).bind("scene", scene);
    for chunk in pair_chunks(plan) {
        s.indirect("bound_noise", "arguments", sample).bind("scene", scene).with(chunk);
    }
    s
}

fn peak(value: f32) -> Command {
    Command::Fill {
        buffer: "counts",
        offset: 4 * u64::from(COUNT_PEAK_ALBEDO),
        bytes: 4,
        value: value.to_bits(),
    }
}

fn forward(plan: &Plan, level: &Level, kernel: &'static str) -> Schedule {
    let mut s = Schedule::default();
    for set in 0..plan.forward_sets(level) {
        s.indirect(kernel, "arguments", 12 * u64::from(ARGUMENTS_FORWARD + set))
            .bind("scene", level.scene)
            .with(Push { first: set, ..Default::default() });
    }
    s
}

/// Push constants of a gather over all pairs, in as many dispatches as the loop limit asks for.
fn pair_chunks(plan: &Plan) -> Vec<Push> {
    let pairs = plan.pairs as u32;
    let chunk = |first: u32| {
        let more = if first > 0 { BACKWARD_CONTINUE } else { 0 };
        let end = if pairs - first <= PAIR_CHUNK { BACKWARD_FINISH } else { 0 };
        Push { first, flags: more | end, ..Default::default() }
    };
    (0..pairs).step_by(PAIR_CHUNK as usize).map(chunk).collect()
}
