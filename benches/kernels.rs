//! Times the kernels of an iteration on a synthetic scene: every accumulation path in one process, so that the
//! ratios between them mean something on a noisy machine.
//!
//!     cargo bench --bench kernels -- [--device NAME] [--pairs N] [--active N] [--repeats N]
//!
//! A pair is one voxel seen by one laser-sensor pair, in one direction (forward or backward).

use glam::dvec3;
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::solve::Job;
use thirdbounce::solve::{Accumulation, PaperOptions, Plan, Preset, initialise, iteration};
use thirdbounce::transport::{Grid, Model, Volume};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1).cloned()
    };
    let number = |name, default: usize| value(name).map_or(default, |v| v.parse().expect("a whole number"));
    let side = (number("--pairs", 1024) as f64).sqrt().round() as usize;
    let active = number("--active", 20_000);
    let repeats = number("--repeats", 5);
    let gpu = Gpu::open(&GpuOptions { device: value("--device"), validation: false, timings: true })
        .unwrap_or_else(|e| panic!("{e}"));

    let (model, grid) = scene(side, active);
    println!(
        "{} ({}), {} pairs x {} active voxels",
        gpu.info.name,
        gpu.info.driver,
        side * side,
        grid.voxels()
    );
    println!("{:<10} {:>9} {:>14} {:>14} {:>14}", "path", "it/s", "forward", "backward", "rest of it");
    for accumulation in [
        Accumulation::Owned,
        Accumulation::Float,
        Accumulation::Fixed,
        Accumulation::Fixed32,
        Accumulation::Cas,
    ] {
        let options =
            PaperOptions { accumulation, iterations: 64, ..PaperOptions::preset(Preset::Synthetic) };
        let plan = match Plan::new(&model, grid, [side, side], &options, &gpu.abilities(), false) {
            Ok(plan) => plan,
            Err(e) => {
                println!("{accumulation:?}: {e}");
                continue;
            }
        };
        let mut job = Job::new(&gpu, model.clone(), plan, None).unwrap_or_else(|e| panic!("{e}"));
        let mut warm = initialise(&job.plan, job.plan.finest());
        warm.extend(iteration(&job.plan, job.plan.finest(), 0, 1));
        job.executor.run(&warm).expect("the warm-up runs");
        // Per repeat: seconds of forward, of backward, of all.
        let mut seconds: Vec<[f64; 3]> = vec![];
        for i in 1..=repeats as u32 {
            let before = job.executor.times().clone();
            job.executor.run(&iteration(&job.plan, job.plan.finest(), i, i)).expect("an iteration runs");
            let spent = |name: &str| {
                let t = |times: &std::collections::BTreeMap<&str, thirdbounce::gpu::KernelTime>| {
                    times.get(name).map_or(0.0, |t| t.seconds)
                };
                t(job.executor.times()) - t(&before)
            };
            let all: f64 = job.executor.times().keys().map(|k| spent(k)).sum();
            seconds.push([spent("forward"), spent("backward"), all]);
        }
        let median = |k: usize| {
            let mut column: Vec<f64> = seconds.iter().map(|s| s[k]).collect();
            column.sort_by(f64::total_cmp);
            column[column.len() / 2]
        };
        let pairs = (model.pairs() * grid.voxels()) as f64;
        let rate = |s: f64| format!("{:.0} M/s", pairs / s / 1e6);
        println!(
            "{:<10} {:>9.2} {:>14} {:>14} {:>11.1} ms",
            format!("{accumulation:?}").to_lowercase(),
            1.0 / median(2),
            rate(median(0)),
            rate(median(1)),
            1e3 * (median(2) - median(0) - median(1))
        );
    }
}

/// A scan of `side` × `side` points on a 1 m wall, 512 bins of 6 mm, and about `active` voxels at 0.5 to 1 m.
fn scene(side: usize, active: usize) -> (Model, Grid) {
    let at = |i: usize| (i as f64 + 0.5) / side as f64 - 0.5;
    let points: Vec<_> = (0..side * side).map(|i| dvec3(at(i / side), at(i % side), 0.0)).collect();
    let bins = 512;
    let capture = thirdbounce::capture::Capture {
        name: "bench".into(),
        scan: [side, side],
        laser: points.clone(),
        sensor: points,
        laser_normal: None,
        sensor_normal: None,
        bins,
        bin_width: 0.006,
        t_start: 0.0,
        histograms: (0..side * side * bins).map(|i| (i * 7919 % 101) as f32).collect(),
        integer_counts: true,
    };
    let lateral = 32;
    let deep = (active as f64 / (lateral * lateral) as f64).max(1.0);
    let volume = Volume { min: dvec3(-0.5, -0.5, 0.5), max: dvec3(0.5, 0.5, 1.0) };
    let grid = Grid::new(volume, lateral, 0.5 / deep).expect("a plain grid");
    (Model::new(&capture, 10.0), grid)
}
