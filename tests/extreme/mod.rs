//! Stiff and extreme scenes (METHOD, section 7), and how far the device is from the float64 twins on them.
#![allow(dead_code)] // the tests use a part, the bench another

pub mod cases;
pub mod solve;

use glam::DVec3;
use thirdbounce::gpu::{Gpu, Schedule};
use thirdbounce::solve::{Accumulation, OnDevice, VectorOptions};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Sample, Twin};
use thirdbounce::transport::{Grid, Model};

use super::device::vectors::{run_iteration, vector_options};
use super::device::{job, read, read_raw, read_rows, rounded, set_counts, write_samples, zero_histograms};

/// A scene, its domain, and vectors (albedo times normal, by storage index) whose light is measured.
#[derive(Clone)]
pub struct Case {
    pub name: String,
    pub model: Model,
    pub grid: Grid,
    pub active: Vec<u32>,
    pub truth: Vec<DVec3>,
    /// Where the passes are compared: not the truth, so that residuals are no rounding errors.
    pub at: Vec<DVec3>,
}

/// Relative errors of one pass.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Apart {
    /// Largest difference over the largest true value.
    pub largest: f64,
    /// The worst histogram's own largest difference over its own largest value, of those with signal.
    pub histogram: f64,
}

/// Errors of forward, weighted residual and gradient.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Passes {
    pub forward: Apart,
    pub residual: Apart,
    pub gradient: f64,
}

impl Case {
    pub fn twin(&self) -> Twin<'_> {
        Twin { model: &self.model, grid: &self.grid }
    }

    /// The samples that the device is given: rounded to fp32.
    pub fn samples(&self, v: &[DVec3]) -> Vec<Sample> {
        rounded(&twin::extrapolate(&self.twin(), &self.active, v, v, 0.0))
    }

    pub fn options(&self, accumulation: Accumulation) -> VectorOptions {
        VectorOptions { accumulation, ..vector_options(&self.grid) }
    }

    pub fn job<'g>(&self, gpu: &'g Gpu, accumulation: Accumulation) -> OnDevice<'g> {
        job(gpu, &self.model, &self.grid, &self.options(accumulation))
    }

    /// A job whose trace holds so many iterations.
    pub fn long_job<'g>(&self, gpu: &'g Gpu, accumulation: Accumulation, iterations: usize) -> OnDevice<'g> {
        let options = VectorOptions { iterations, ..self.options(accumulation) };
        job(gpu, &self.model, &self.grid, &options)
    }
}

/// Differences of histograms of so many bins. NaN where the device gave one, so no comparison passes.
pub fn apart(got: &[f64], want: &[f64], bins: usize) -> Apart {
    assert_eq!(got.len(), want.len());
    let most = |v: &[f64]| v.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    let off = |g: &[f64], w: &[f64]| {
        g.iter()
            .zip(w)
            .fold(0.0f64, |a, (g, w)| if (g - w).is_finite() { a.max((g - w).abs()) } else { f64::NAN })
    };
    // A histogram that is nothing must be nothing on the device.
    let share = |off: f64, most: f64| if off == 0.0 { 0.0 } else { off / most };
    let each = got.chunks(bins).zip(want.chunks(bins)).map(|(g, w)| share(off(g, w), most(w)));
    Apart {
        largest: share(off(got, want), most(want)),
        histogram: each.fold(0.0, |a, e| if e.is_nan() || e > a { e } else { a }),
    }
}

/// The accumulated histograms as numbers, whatever the path.
pub fn read_histograms(job: &mut OnDevice<'_>) -> Vec<f64> {
    if !job.plan.fixed_point() {
        return read_rows::<f32>(job, buffer::HISTOGRAMS).into_iter().map(f64::from).collect();
    }
    let counts: Vec<u32> = read(job, buffer::COUNTS, COUNTS as usize);
    let bound = job.model.scene(&job.plan.finest().grid).kernel_bound;
    let exponent = fixed_exponent(f32::from_bits(counts[COUNT_PEAK_ALBEDO as usize]), bound, counts[0]);
    let sums: Vec<i64> = read_rows(job, buffer::HISTOGRAMS);
    sums.iter().map(|s| *s as f64 * 2f64.powi(-exponent)).collect()
}

/// The scale of fixed-point accumulation, as `glsl/include/fixed.glsl` has it.
fn fixed_exponent(peak: f32, bound: f32, count: u32) -> i32 {
    let exponent = |v: f32| if v == 0.0 { 0 } else { v.log2().floor() as i32 + 1 };
    let bits = if count == 0 { 0 } else { 32 - count.leading_zeros() as i32 };
    (61 - exponent(peak) - exponent(bound) - bits).clamp(-120, 120)
}

/// The passes of one iteration of the vector solver on the device, against the twins.
pub fn passes(gpu: &Gpu, case: &Case, accumulation: Accumulation) -> Passes {
    passes_of(&mut case.job(gpu, accumulation), case)
}

/// Kernels that place in plain fp32 and add one by one, whatever the scene asks for.
pub fn plain_kernels(job: &mut OnDevice<'_>) {
    (job.plan.fine, job.plan.runs) = (false, false);
    job.plan.add_kernels(&mut job.executor).expect("kernels are made");
}

pub fn passes_of(job: &mut OnDevice<'_>, case: &Case) -> Passes {
    let (twin, bins) = (case.twin(), case.model.bins);
    let samples = case.samples(&case.at);
    let accumulated = twin::forward(&twin, &samples);
    let (residual, _) = twin::residual_weighted(&twin, &accumulated, true);
    let gradient = twin::gradient_vectors(&twin, &samples, &residual);
    write_samples(job, &samples);
    let directed = case.model.reflectance.has_normals();
    let size = |s: &Sample| if directed { s.normal.length() } else { s.albedo };
    let peak = samples.iter().map(size).fold(0.0, f64::max);
    set_counts(job, samples.len(), peak);
    zero_histograms(job);
    run_iteration(job, 0, &["forward"]);
    let forward = apart(&read_histograms(job), &accumulated, bins);
    run_iteration(job, 0, &["pulse", "residual", "pulse_back"]);
    let from = job.plan.residual();
    let got: Vec<f64> = read_rows::<f32>(job, from).into_iter().map(f64::from).collect();
    let residual = apart(&got, &residual, bins);
    let mut s = Schedule::default();
    // Without the last flag the gradient is left in its buffer.
    s.indirect(&vector::passes::STEP, buffer::ARGUMENTS, 12 * u64::from(ARGUMENTS_BACKWARD))
        .bind(buffer::SCENE, job.plan.finest().scene)
        .bind(buffer::RESIDUAL, from)
        .with(Push { last: case.model.pairs() as u32, ..Default::default() });
    job.executor.run(&s).expect("a dispatch runs");
    let got: Vec<f64> = read_raw(job, buffer::GRADIENT, samples.len())
        .iter()
        .flat_map(|g| if directed { [g[1], g[2], g[3]] } else { [0.0, 0.0, -g[0]] })
        .collect();
    let want: Vec<f64> = gradient.iter().flat_map(|g| g.to_array()).collect();
    Passes { forward, residual, gradient: apart(&got, &want, want.len().max(1)).largest }
}
