//! What tests of the vector solver's kernels share beside the rest.

use glam::{DVec3, dvec3};
use thirdbounce::gpu::Schedule;
use thirdbounce::solve::{OnDevice, VectorOptions, vector};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::Momentum;
use thirdbounce::transport::{Geometry, Gradient, Grid, Model, Reflectance, Sampling, Volume};

use super::{Random, model, read, read_raw, variant, write, write_raw};

/// What the vector solver makes of the tests' random scene.
pub fn scene(n: usize, bins: usize, seed: u64) -> Model {
    Model { sampling: Sampling::Fixed, gradient: Gradient::Exact, ..model(n, bins, seed) }
}

/// A grid, and models with more pairs than one dispatch may walk, each with how many it takes. A product is split between rows
/// of scanned points, or within one that is too long.
pub fn more_pairs_than_a_dispatch_takes() -> (Grid, [(Model, usize); 3]) {
    let volume = Volume { min: dvec3(-0.5, -0.5, 0.25), max: dvec3(0.5, 0.5, 0.9) };
    let grid = Grid::new(volume, 4, 0.1).unwrap();
    let confocal = scene(182, 8, 14);
    let rows = variant(&confocal, Geometry::Product, Reflectance::Cosine, false, 22);
    let mut long = variant(&scene(346, 8, 14), Geometry::Product, Reflectance::Lambertian, false, 23);
    long.wall.others.truncate(2);
    long.measured.truncate(long.pairs() * long.bins);
    assert!(long.wall.scanned.len() > PAIR_CHUNK as usize);
    (grid, [(confocal, 2), (rows, 3), (long, 4)])
}

pub fn vector_options(grid: &Grid) -> VectorOptions {
    VectorOptions {
        lateral: grid.n[0],
        iterations: 64,
        coarse_to_fine: false,
        // Tests may have every voxel active.
        room: Some(1.0),
        ..Default::default()
    }
}

/// Runs those of the schedule's commands whose kernel is among `names`.
pub fn run(job: &mut OnDevice<'_>, mut schedule: Schedule, names: &[&str]) {
    schedule.commands.retain(|c| names.contains(&c.name()));
    assert!(!schedule.commands.is_empty());
    job.executor.run(&schedule).expect("the schedule runs");
}

pub fn run_iteration(job: &mut OnDevice<'_>, number: u32, names: &[&str]) {
    let s = vector::iteration(&job.plan, job.plan.finest(), number);
    run(job, s, names);
}

pub fn run_start(job: &mut OnDevice<'_>, names: &[&str]) {
    let s = vector::start(&job.plan, &job.plan.levels[0], &vector_options(&job.plan.finest().grid));
    run(job, s, names);
}

/// Random vectors, some zero, some outside the cone.
pub fn vectors(count: usize, seed: u64) -> Vec<DVec3> {
    let mut random = Random::new(seed);
    let mut one = || {
        let v = dvec3(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(-1.5, 0.3));
        if random.uniform(0.0, 1.0) < 0.15 { DVec3::ZERO } else { v }
    };
    (0..count).map(|_| one()).collect()
}

/// Writes those of the active voxels, from all by storage index.
pub fn write_vectors(job: &mut OnDevice<'_>, buffer: &'static str, active: &[u32], v: &[DVec3]) {
    let raw = |i: &u32| [v[*i as usize].x, v[*i as usize].y, v[*i as usize].z, 0.0];
    write_raw(job, buffer, &active.iter().map(raw).collect::<Vec<_>>());
}

/// Vectors by storage index, nothing where no voxel is active.
pub fn read_vectors(
    job: &mut OnDevice<'_>,
    buffer: &'static str,
    active: &[u32],
    count: usize,
) -> Vec<DVec3> {
    let by_slot = read_raw(job, buffer, active.len()).into_iter().map(|r| dvec3(r[0], r[1], r[2])).collect();
    by_voxel(by_slot, active, count, DVec3::ZERO)
}

/// What lies by slot, by storage index.
pub fn by_voxel<T: Clone>(by_slot: Vec<T>, active: &[u32], count: usize, none: T) -> Vec<T> {
    let mut all = vec![none; count];
    active.iter().zip(by_slot).for_each(|(i, value)| all[*i as usize] = value);
    all
}

/// Writes the bounds of the active voxels, from all by storage index.
pub fn write_bounds(job: &mut OnDevice<'_>, active: &[u32], bounds: &[[f64; 2]]) {
    let of = |i: &u32| bounds[*i as usize].map(|b| b as f32);
    write(job, buffer::BOUNDS, &active.iter().map(of).collect::<Vec<[f32; 2]>>());
}

/// Bounds by storage index, zero where no voxel is active.
pub fn read_bounds(job: &mut OnDevice<'_>, active: &[u32], count: usize) -> Vec<[f64; 2]> {
    let by_slot =
        read::<[f32; 2]>(job, buffer::BOUNDS, active.len()).into_iter().map(|b| b.map(f64::from)).collect();
    by_voxel(by_slot, active, count, [0.0; 2])
}

/// Everything but the active vectors taken away.
pub fn within(mut v: Vec<DVec3>, domain: &[bool]) -> Vec<DVec3> {
    v.iter_mut().zip(domain).filter(|(_, on)| !**on).for_each(|(v, _)| *v = DVec3::ZERO);
    v
}

pub fn read_floats(job: &mut OnDevice<'_>, buffer: &'static str, count: usize) -> Vec<f64> {
    read::<f32>(job, buffer, count).into_iter().map(f64::from).collect()
}

pub fn flat(v: &[DVec3]) -> Vec<f64> {
    v.iter().flat_map(|v| v.to_array()).collect()
}

pub fn write_momentum(job: &mut OnDevice<'_>, m: Momentum) {
    write(job, buffer::MOMENTUM, &[m.t, m.beta, m.objective, m.restarts, m.share].map(|v| v as f32));
}

pub fn read_momentum(job: &mut OnDevice<'_>) -> Momentum {
    let m = read_floats(job, buffer::MOMENTUM, MOMENTUM as usize);
    let at = |i: u32| m[i as usize];
    Momentum {
        t: at(MOMENTUM_T),
        beta: at(MOMENTUM_BETA),
        objective: at(MOMENTUM_OBJECTIVE),
        restarts: at(MOMENTUM_RESTARTS),
        share: at(MOMENTUM_SHARE),
    }
}

pub const REST: Momentum =
    Momentum { t: 1.0, beta: 0.0, objective: f64::INFINITY, restarts: 0.0, share: 0.25 };
