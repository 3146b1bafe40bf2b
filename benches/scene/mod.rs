//! Shared by the benches: a synthetic scene of any size, and a job on it.
#![allow(dead_code)] // each bench uses its part

use glam::dvec3;
use thirdbounce::capture::Capture;
use thirdbounce::engine::{Accumulation, OnDevice, Tuning};
use thirdbounce::gpu::{Gpu, GpuOptions, KernelTime};
use thirdbounce::methods::{PaperOptions, paper};
use thirdbounce::options::Preset;
use thirdbounce::transport::{Grid, Model, Reflectance, Volume};

pub const ACCUMULATIONS: [Accumulation; 3] = [Accumulation::Owned, Accumulation::Float, Accumulation::Fixed];

/// The device that THIRDBOUNCE_DEVICE names, by index or part of its name; otherwise the best one.
pub fn gpu(timings: bool) -> Gpu {
    let device = std::env::var("THIRDBOUNCE_DEVICE").ok();
    Gpu::open(&GpuOptions { device, timings, ..GpuOptions::default() }).unwrap_or_else(|e| panic!("{e}"))
}

/// Histograms of a scan of `side` × `side` points on a 1 m wall, 512 bins of 6 mm.
pub fn capture(side: usize) -> Capture {
    let at = |i: usize| (i as f64 + 0.5) / side as f64 - 0.5;
    let points: Vec<_> = (0..side * side).map(|i| dvec3(at(i / side), at(i % side), 0.0)).collect();
    let bins = 512;
    let histograms = (0..side * side * bins).map(|i| (i * 7919 % 101) as f32).collect();
    let mut made = Capture::new([side, side], points.clone(), points, bins, 0.006, histograms);
    made.integer_counts = true;
    made
}

/// About `active` voxels at 0.5 to 1 m.
pub fn grid(active: usize) -> Grid {
    let mut lateral = 32;
    while lateral * lateral * 256 < active {
        lateral *= 2;
    }
    let deep = (active as f64 / (lateral * lateral) as f64).max(1.0);
    let volume = Volume { min: dvec3(-0.5, -0.5, 0.5), max: dvec3(0.5, 0.5, 1.0) };
    Grid::new(volume, lateral, 0.5 / deep).expect("a plain grid")
}

/// The paper's solver on this scene. Every voxel is active after its start schedule.
pub fn job(
    gpu: &Gpu,
    side: usize,
    active: usize,
    accumulation: Accumulation,
    tune: impl FnOnce(&mut Tuning),
) -> thirdbounce::Result<OnDevice> {
    let options = PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.accumulation = accumulation;
        o.iterations = 64;
    });
    let model = Model::new(&capture(side), Reflectance::Cosine, 10.0, false);
    // The scan is as fine as the grid: one level.
    let grid = grid(active);
    let mut plan = paper::plan(&model, grid, [grid.n[0]; 2], &options, &gpu.abilities(), false)?;
    plan.tune(tune);
    OnDevice::new(gpu, model, plan, None)
}

/// Device seconds of a kernel so far.
pub fn spent(job: &OnDevice, kernel: &str) -> f64 {
    job.executor.times().get(kernel).copied().unwrap_or(KernelTime::default()).seconds
}

pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
