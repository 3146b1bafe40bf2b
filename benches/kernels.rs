//! Times the passes over pairs on a synthetic scene by the device's clock, every accumulation path in one process.
//!
//!     cargo bench --bench kernels [-- FILTER]        THIRDBOUNCE_DEVICE names another device
//!
//! Throughput is in pairs: one voxel seen by one laser-sensor pair, in one direction (forward or backward).

mod scene;

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use scene::{ACCUMULATIONS, gpu, job, spent};
use thirdbounce::gpu::Schedule;
use thirdbounce::solve::{Accumulation, Tuning, paper};

fn kernels(c: &mut Criterion) {
    let gpu = gpu(true);
    println!("{} ({})", gpu.info.name, gpu.info.driver);
    let (side, active) = (32, 20_480);
    // Straight to the histograms, or through private columns. Chunks for columns stay below lavapipe's loop limit.
    let ways = |a| [(a, 0), (a, 64)].into_iter().filter(|w| w.1 == 0 || w.0 != Accumulation::Owned);
    for (accumulation, window) in ACCUMULATIONS.into_iter().flat_map(ways) {
        let tuned = |t: &mut Tuning| {
            t.chunk = if window > 0 { t.chunk.min(512) } else { t.chunk };
            (t.window, t.window_span) = (window, u32::MAX);
        };
        let mut job = match job(&gpu, side, active, accumulation, tuned) {
            Ok(job) => job,
            Err(e) => {
                println!("{accumulation:?}: {e}");
                continue;
            }
        };
        let level = *job.plan.finest();
        let start = Schedule::of(|s| paper::initialise(s, &job.plan, &level));
        job.executor.run(&start).expect("the start runs");
        let pairs = (job.plan.scene.pairs * level.grid.voxels()) as u64;
        let kernels: &[&str] = if window == 0 { &["forward", "backward"] } else { &["forward"] };
        for kernel in kernels {
            let mut group = c.benchmark_group(*kernel);
            group.throughput(Throughput::Elements(pairs)).sample_size(10);
            group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
            let mut name = format!("{accumulation:?}").to_lowercase();
            if window > 0 {
                name += &format!("-window-{window}");
            }
            group.bench_function(BenchmarkId::from_parameter(name), |b| {
                b.iter_custom(|count| {
                    let before = spent(&job, kernel);
                    for i in 0..count as u32 {
                        let s = Schedule::of(|s| paper::iteration(s, &job.plan, &level, i % 64, 1));
                        job.executor.run(&s).expect("an iteration runs");
                    }
                    Duration::from_secs_f64(spent(&job, kernel) - before)
                });
            });
            group.finish();
        }
    }
}

criterion_group!(benches, kernels);
criterion_main!(benches);
