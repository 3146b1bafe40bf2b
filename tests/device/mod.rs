//! What kernel tests share: a device, a random scene, buffers written and read by name.
#![allow(dead_code)] // each test binary uses its part

mod buffers;
pub mod surfaces;
pub mod vectors;

use std::ops::ControlFlow;

pub use buffers::*;

use glam::{DVec3, dvec3};
use thirdbounce::capture::PulseTaps;
use thirdbounce::gpu::{BufferPlan, Gpu, GpuOptions, Place, Schedule};
use thirdbounce::solve::Job;
use thirdbounce::solve::{
    Accumulation, NoiseTerm, PaperOptions, Plan, Preset, Progress, Tuning, Wanted, Watch,
};
use thirdbounce::transport::kernels::{RESIDUAL_BINS, WORKGROUP};
use thirdbounce::transport::twin::Raw;
use thirdbounce::transport::{Binning, Geometry, Gradient, Grid, Model, Reflectance, Sampling, Volume, Wall};

/// A device with validation where the layer is installed (it is after `make setup`).
pub fn gpu() -> Gpu {
    let open = |validation| Gpu::open(&GpuOptions { validation, ..Default::default() });
    open(true).or_else(|_| open(false)).expect("a Vulkan device: `make setup` installs lavapipe")
}

/// Fails the test if the validation layer said anything.
pub fn assert_valid(gpu: &Gpu) {
    let messages = gpu.validation_messages();
    assert!(messages.is_empty(), "validation: {}", messages.join("\n"));
}

/// Repeatable numbers for tests: PCG-XSH-RR (O'Neill 2014).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Random {
        Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    pub fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        x.rotate_right((self.0 >> 59) as u32)
    }

    /// Uniform in [a, b), representable in fp32.
    pub fn uniform(&mut self, a: f64, b: f64) -> f64 {
        f64::from((a + (b - a) * f64::from(self.next()) / 4_294_967_296.0) as f32)
    }
}

/// A scan of `n` × `n` confocal points on a 1 m wall and random histograms.
pub fn model(n: usize, bins: usize, seed: u64) -> Model {
    let mut random = Random::new(seed);
    let at = |i: usize| (i as f64 + 0.5) / n as f64 - 0.5;
    let points: Vec<DVec3> = (0..n * n).map(|i| dvec3(at(i / n), at(i % n), 0.0)).collect();
    let measured: Vec<f32> = (0..n * n * bins).map(|_| random.uniform(0.0, 10.0) as f32).collect();
    let bin_width = 2.4 / bins as f64;
    Model {
        elements: n * n * bins,
        wall: Wall::confocal(points),
        is_spread: false,
        pulse: None,
        reflectance: Reflectance::Cosine,
        bins,
        bin_width,
        t_start: 0.3,
        measured,
        peak: 10.0,
        counts_per_unit: 1.0,
        reference: 0.6,
        min_depth: 0.25,
        sampling: Sampling::Continuous,
        binning: Binning::Linear,
        gradient: Gradient::Published,
        l1: 0.01,
        noise: [0.0; 2],
        learning_rate: 1.0,
        decay_over: 0.0,
        betas: [0.9, 0.999],
        epsilon: 1e-8,
        keep_above: 0.05,
        seed: 7,
        cone: 1.5,
        variance: [0.1, 0.02],
        noise_factor: 2.0,
        roughness: 0.9,
    }
}

/// An uneven pulse, with a tail behind the path.
pub fn tail() -> PulseTaps {
    PulseTaps { before: 2, weights: vec![0.05, 0.2, 0.4, 0.2, 0.1, 0.05] }
}

/// The same model for other pairs, another reflectance and maybe a curved wall: 3 x `n` random points for a product
/// of three others, `n` x `n` random pairs for two points.
pub fn variant(base: &Model, geometry: Geometry, reflectance: Reflectance, curved: bool, seed: u64) -> Model {
    let mut random = Random::new(seed);
    let mut point = || {
        let z = if curved { random.uniform(-0.05, 0.05) } else { 0.0 };
        dvec3(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), z)
    };
    let pairs = base.pairs();
    let (scanned, others) = match geometry {
        Geometry::Confocal => (pairs, 0),
        Geometry::TwoPoints => (pairs, pairs),
        // Not a multiple of what a kernel takes at once.
        Geometry::Product => (pairs / 3, 6),
    };
    let scanned: Vec<DVec3> = (0..scanned).map(|_| point()).collect();
    let others: Vec<DVec3> = (0..others).map(|_| point()).collect();
    let count = scanned.len() + others.len();
    let mut normal = || dvec3(random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4), 1.0).normalize();
    let normals = curved.then(|| (0..count).map(|_| normal()).collect());
    let wall = Wall { geometry, scanned, others, normals };
    let elements = wall.pairs() * base.bins;
    let measured = (0..elements).map(|i| base.measured[i % base.measured.len()]).collect();
    Model { elements, wall, reflectance, measured, ..base.clone() }
}

/// Every way that pairs, walls and surfaces can be.
pub fn variants() -> Vec<(Geometry, Reflectance, bool)> {
    let mut all = vec![];
    for geometry in [Geometry::Confocal, Geometry::TwoPoints, Geometry::Product] {
        for reflectance in [
            Reflectance::Cosine,
            Reflectance::Lambertian,
            Reflectance::Retroreflective,
            Reflectance::Isotropic,
        ] {
            all.extend([false, true].map(|curved| (geometry, reflectance, curved)));
        }
    }
    all
}

/// A grid whose last bricks overhang on every axis.
pub fn grid() -> Grid {
    let volume = Volume { min: dvec3(-0.5, -0.5, 0.2), max: dvec3(0.5, 0.5, 1.0) };
    Grid::new(volume, 12, 0.8 / 18.0).expect("a plain grid")
}

/// Random raw variables, fp32-representable, and a random domain of about `share` of the allowed voxels.
pub fn state(model: &Model, grid: &Grid, share: f64, seed: u64) -> (Vec<Raw>, Vec<bool>) {
    let mut random = Random::new(seed);
    let raw = (0..grid.storage()).map(|_| std::array::from_fn(|_| random.uniform(-1.5, 1.5))).collect();
    let near = model.near_z(grid);
    let mut on =
        |i| grid.contains(grid.voxel(i)) && grid.voxel(i)[2] >= near && random.uniform(0.0, 1.0) < share;
    (raw, (0..grid.storage()).map(&mut on).collect())
}

/// Options that plan what `model` says.
pub fn options(model: &Model, grid: &Grid) -> PaperOptions {
    PaperOptions {
        lateral: grid.n[0],
        iterations: 64,
        coarse_to_fine: false,
        min_depth: model.min_depth,
        l1: model.l1,
        sampling: model.sampling,
        binning: model.binning,
        gradient: model.gradient,
        keep_above: model.keep_above,
        noise: if model.noise == [0.0; 2] { NoiseTerm::Off } else { NoiseTerm::Bin },
        seed: model.seed,
        ..PaperOptions::preset(Preset::Synthetic)
    }
}

/// A job whose device buffers are full of NaN bits but for what [`OnDevice::upload`] writes.
pub fn job<'g>(gpu: &'g Gpu, model: &Model, grid: &Grid, options: impl Into<Wanted>) -> OnDevice<'g> {
    job_tuned(gpu, model, grid, options, |_| {})
}

/// The same with other sizes of workgroups and the like than the plan's.
pub fn job_tuned<'g>(
    gpu: &'g Gpu,
    model: &Model,
    grid: &Grid,
    options: impl Into<Wanted>,
    tune: impl FnOnce(&mut Tuning),
) -> OnDevice<'g> {
    let options: Wanted = options.into();
    let scan = [1, model.pairs()];
    let mut plan = Plan::new(model, *grid, scan, options, &gpu.abilities(), false).expect("a plan");
    // Levels by the grid's own resolution, not the scan's: tests choose `coarse_to_fine` by the scan they give.
    if options.coarse_to_fine {
        plan = Plan::new(model, *grid, [1, grid.n[0] / 2], options, &gpu.abilities(), false).expect("a plan");
    }
    tune(&mut plan.tuning);
    // Room for partial sums of smaller groups than the plan's own.
    for b in plan.buffers.iter_mut().filter(|b| b.name.ends_with("_partials") && b.bytes > 0) {
        b.bytes = b.bytes.max(grid.storage() as u64 * 4);
    }
    let largest = plan.buffers.iter().map(|b| b.bytes).max().expect("buffers");
    plan.buffers.push(BufferPlan::new(Buffer::named("back"), largest, Place::Readback));
    if let Some(b) = plan.buffers.iter_mut().find(|b| b.name == "upload") {
        b.bytes = largest;
    }
    let mut job = OnDevice::new(gpu, model.clone(), plan, None).expect("memory for a small scene");
    let mut poison = Schedule::default();
    for b in job.plan.buffers.clone() {
        if b.place == Place::Device {
            poison.fill(name_of(&b.name), b.bytes, 0xffff_ffff);
        }
    }
    job.executor.run(&poison).expect("a fill runs");
    job.upload().expect("uploads run");
    job
}

/// Schedules name buffers for good; tests take them from plans.
fn name_of(name: &str) -> &'static str {
    Box::leak(name.to_string().into_boxed_str())
}

/// Partial losses that the residual kernel leaves.
pub fn losses(model: &Model) -> usize {
    let tile = WORKGROUP as usize * RESIDUAL_BINS as usize;
    model.cells().div_ceil(tile) * WORKGROUP as usize
}

/// A watch that only hears.
pub fn unwatched(hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>) -> Watch<'_> {
    Watch { hear, maps_every: None, maps_at: &[] }
}

/// Largest difference over the largest true value.
pub fn error(got: impl IntoIterator<Item = f64>, want: impl IntoIterator<Item = f64>) -> f64 {
    let (got, want): (Vec<f64>, Vec<f64>) = (got.into_iter().collect(), want.into_iter().collect());
    assert_eq!(got.len(), want.len());
    assert!(got.iter().all(|v| v.is_finite()), "the device gave a NaN or infinity");
    let largest = want.iter().fold(1e-300f64, |a, b| a.max(b.abs()));
    got.iter().zip(&want).fold(0.0f64, |a, (g, w)| a.max((g - w).abs())) / largest
}

pub const ACCUMULATIONS: [Accumulation; 5] =
    [Accumulation::Float, Accumulation::Fixed, Accumulation::Fixed32, Accumulation::Cas, Accumulation::Owned];

/// Central differences of `objective` in random variables, against `gradient`. The step is small beside the
/// distance to the kinks of ELU, the cosine's and the L1 term's zero for nearly all variables; those that
/// cross one are seen by the one-sided differences disagreeing, and skipped.
pub fn assert_gradient(raw: &[Raw], gradient: &[Raw], mut objective: impl FnMut(&[Raw]) -> f64) {
    let mut random = Random::new(99);
    let largest = gradient.concat().iter().fold(0.0f64, |a, b| a.max(b.abs()));
    let (mut tried, mut skipped) = (0, 0);
    while tried < 60 {
        let (i, k) = (random.next() as usize % raw.len(), random.next() as usize % 4);
        if gradient[i][k] == 0.0 {
            continue;
        }
        let h = 1e-5;
        let mut at = |step: f64| {
            let mut moved = raw.to_vec();
            moved[i][k] += step;
            objective(&moved)
        };
        let (low, middle, high) = (at(-h), at(0.0), at(h));
        let (left, right) = ((middle - low) / h, (high - middle) / h);
        if (left - right).abs() > 1e-3 * largest {
            skipped += 1;
            assert!(skipped < 20, "too many kinks: the scene is badly tuned");
            continue;
        }
        let slope = (high - low) / (2.0 * h);
        let e = (slope - gradient[i][k]).abs() / largest;
        assert!(e < 1e-5, "voxel {i}, variable {k}: gradient {} but slope {slope}", gradient[i][k]);
        tried += 1;
    }
}
