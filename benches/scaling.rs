//! The cost of a pair by the size of the scene: active voxels by laser-sensor pairs. On a full device the cost should
//! be constant; the last line prints by how much it changes.
//!
//!     cargo bench --bench scaling [-- --most PAIRS]      leaves out scenes of more voxel-pairs than this
//!                                                        [default: 3e7 on a CPU, 1e11 elsewhere]
//!     cargo bench --bench scaling -- start               the learned start on the host instead

mod scene;

use std::time::Instant;

use scene::{gpu, job, median, spent};
use thirdbounce::engine::Accumulation;
use thirdbounce::gpu::{DeviceKind, Schedule};
use thirdbounce::learned::LearnedStart;
use thirdbounce::methods::paper;
use thirdbounce_simulate::{RenderOptions, Scene, simulate};

const SIDES: [usize; 6] = [8, 16, 32, 64, 128, 256];
const ACTIVE: [usize; 5] = [10_000, 30_000, 100_000, 300_000, 1_000_000];

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if arguments.iter().any(|a| a == "start") {
        return [32, 64].into_iter().for_each(start);
    }
    let gpu = gpu(true);
    let usual = if gpu.info.kind == DeviceKind::Cpu { 3e7 } else { 1e11 };
    let at = arguments.iter().position(|a| a == "--most");
    let most: f64 = at.map_or(usual, |i| {
        arguments.get(i + 1).and_then(|v| v.parse().ok()).expect("--most takes a number, as 1e9")
    });
    println!("{} ({}): ps per voxel-pair, forward / backward", gpu.info.name, gpu.info.driver);
    print!("{:>9}", "active");
    SIDES.iter().for_each(|side| print!("{:>16}", format!("{} pairs", side * side)));
    println!();
    let mut all: Vec<(f64, [f64; 2])> = vec![];
    for active in ACTIVE {
        print!("{active:>9}");
        for side in SIDES {
            let measured =
                if (side * side * active) as f64 <= most { measure(&gpu, side, active) } else { None };
            match measured {
                Some((pairs, cost)) => {
                    print!("{:>16}", format!("{:.0} / {:.0}", 1e12 * cost[0], 1e12 * cost[1]));
                    all.push((pairs, cost));
                }
                None => print!("{:>16}", "-"),
            }
        }
        println!();
    }
    // A device counts as full at a tenth of the largest scene's work.
    let largest = all.iter().fold(0.0f64, |m, a| m.max(a.0));
    for (k, name) in ["forward", "backward"].into_iter().enumerate() {
        let full: Vec<f64> = all.iter().filter(|a| a.0 >= 0.1 * largest).map(|a| a.1[k]).collect();
        let (low, high) = full.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        println!(
            "{name}: {} scenes of at least {:.0e} pairs differ by {:.0} % of the least",
            full.len(),
            0.1 * largest,
            100.0 * (high / low - 1.0)
        );
    }
}

/// Number of pairs, and seconds per pair forward and backward; `None` if the scene does not fit.
fn measure(gpu: &thirdbounce::gpu::Gpu, side: usize, active: usize) -> Option<(f64, [f64; 2])> {
    let mut job = job(gpu, side, active, Accumulation::Auto, |_| {}).ok()?;
    let level = *job.plan.finest();
    let mut warm = Schedule::of(|s| paper::initialise(s, &job.plan, &level));
    paper::iteration(&mut warm, &job.plan, &level, 0, 1);
    job.executor.run(&warm).expect("the warm-up runs");
    let pairs = (job.plan.scene.pairs * level.grid.voxels()) as f64;
    let mut cost = [vec![], vec![]];
    for i in 1..=3 {
        let kernels = ["forward", "backward"];
        let before = kernels.map(|k| spent(&job, k));
        let s = Schedule::of(|s| paper::iteration(s, &job.plan, &level, i, i));
        job.executor.run(&s).expect("an iteration runs");
        for (k, kernel) in kernels.iter().enumerate() {
            cost[k].push((spent(&job, kernel) - before[k]) / pairs);
        }
    }
    Some((pairs, cost.map(median)))
}

/// The least time from a capture in memory to the network's answer on the host, for a scan of side x side points.
fn start(side: usize) {
    let scene = Scene { scan: side, photons: Some(300.0), ..Scene::named("figure").expect("a scene") };
    let capture = simulate(&scene, &RenderOptions::default()).expect("the scene renders").capture;
    let time = || {
        let begun = Instant::now();
        LearnedStart::on_host(&capture, None).expect("pairs can be chosen").expect("enough pairs");
        1e3 * begun.elapsed().as_secs_f64()
    };
    let least = (0..15).map(|_| time()).fold(f64::INFINITY, f64::min);
    println!("learned start of {} pairs: {least:.0} ms", capture.pair_count());
}
