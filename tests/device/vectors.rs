//! What tests of the vector solver's kernels share beside the rest.

use glam::{DVec3, dvec3};
use thirdbounce::gpu::Schedule;
use thirdbounce::solve::{Job, VectorOptions, vector};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::Momentum;
use thirdbounce::transport::{Gradient, Grid, Model, Sampling};

use super::{Random, model, read, read_raw, write, write_raw};

/// What the vector solver makes of the tests' random scene.
pub fn scene(n: usize, bins: usize, seed: u64) -> Model {
    Model { sampling: Sampling::Fixed, gradient: Gradient::Exact, ..model(n, bins, seed) }
}

pub fn vector_options(grid: &Grid) -> VectorOptions {
    VectorOptions { lateral: grid.n[0], iterations: 64, coarse_to_fine: false, ..Default::default() }
}

/// Runs those of the schedule's commands whose kernel is among `names`.
pub fn run(job: &mut Job<'_>, mut schedule: Schedule, names: &[&str]) {
    schedule.commands.retain(|c| names.contains(&c.name()));
    assert!(!schedule.commands.is_empty());
    job.executor.run(&schedule).expect("the schedule runs");
}

pub fn run_iteration(job: &mut Job<'_>, number: u32, names: &[&str]) {
    let s = vector::iteration(&job.plan, job.plan.finest(), number);
    run(job, s, names);
}

pub fn run_start(job: &mut Job<'_>, names: &[&str]) {
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

pub fn write_vectors(job: &mut Job<'_>, buffer: &'static str, v: &[DVec3]) {
    write_raw(job, buffer, &v.iter().map(|v| [v.x, v.y, v.z, 0.0]).collect::<Vec<_>>());
}

pub fn read_vectors(job: &mut Job<'_>, buffer: &'static str, count: usize) -> Vec<DVec3> {
    read_raw(job, buffer, count).iter().map(|r| dvec3(r[0], r[1], r[2])).collect()
}

pub fn read_floats(job: &mut Job<'_>, buffer: &'static str, count: usize) -> Vec<f64> {
    read::<f32>(job, buffer, count).into_iter().map(f64::from).collect()
}

pub fn flat(v: &[DVec3]) -> Vec<f64> {
    v.iter().flat_map(|v| v.to_array()).collect()
}

pub fn zero_histograms(job: &mut Job<'_>) {
    let bytes = job.plan.bytes()["histograms"];
    let mut s = Schedule::default();
    s.fill("histograms", bytes, 0);
    job.executor.run(&s).unwrap();
}

pub fn write_momentum(job: &mut Job<'_>, m: Momentum) {
    write(job, "momentum", &[m.t, m.beta, m.objective, m.restarts, m.share].map(|v| v as f32));
}

pub fn read_momentum(job: &mut Job<'_>) -> Momentum {
    let m = read_floats(job, "momentum", MOMENTUM as usize);
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
