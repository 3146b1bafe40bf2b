//! Times the passes over pairs on a synthetic scene by the device's clock, every accumulation path in one process.
//!
//!     cargo bench --bench kernels        THIRDBOUNCE_DEVICE names another device
//!
//! Prints pairs per second: one voxel seen by one laser-sensor pair, in one direction (forward or backward).

mod scene;

use scene::{ACCUMULATIONS, gpu, job, median, spent};
use thirdbounce::engine::{Accumulation, Tuning};
use thirdbounce::gpu::Schedule;
use thirdbounce::methods::paper;

/// Iterations of which the median is reported.
const SAMPLES: u32 = 15;

fn main() {
    let gpu = gpu(true);
    println!("{} ({}): pairs per second, median (least to most)", gpu.info.name, gpu.info.driver);
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
        let pairs = (job.plan.scene.pairs * level.grid.voxels()) as f64;
        let kernels: &[&str] = if window == 0 { &["forward", "backward"] } else { &["forward"] };
        for kernel in kernels {
            let mut rate = |i: u32| {
                let before = spent(&job, kernel);
                let s = Schedule::of(|s| paper::iteration(s, &job.plan, &level, i, 1));
                job.executor.run(&s).expect("an iteration runs");
                pairs / (spent(&job, kernel) - before)
            };
            // The first one compiles, on some drivers.
            rate(0);
            let rates: Vec<f64> = (1..=SAMPLES).map(rate).collect();
            let [least, most] =
                [f64::min, f64::max].map(|of| rates.iter().copied().reduce(of).unwrap_or(0.0));
            let columns = if window > 0 { format!(", columns of {window} bins") } else { String::new() };
            println!(
                "{kernel:<9} {:<28} {:.2e} ({least:.2e} to {most:.2e})",
                format!("{accumulation:?}{columns}").to_lowercase(),
                median(rates),
            );
        }
    }
}
