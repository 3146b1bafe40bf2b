//! Frames of a session against fresh solves of the same counts: error, processor time, latency and host allocations, for sequences
//! that rest, move, and in which an object appears or vanishes.
//!
//!     cargo bench --bench live                 # 16 x 16 points to 64 pixels, 32 x 32 to 128
//!     cargo bench --bench live -- 16           # the first only
//!     cargo bench --bench live -- 16 kernels   # and device time by kernel
//!     cargo bench --bench live -- 16 only moving following   # rows whose names contain every word after `only`
//!
//! Errors are against the truth. Processor time is that of all threads, those of a software device included, so load of other
//! programs changes it little; latency is the least and the percentiles of wall time.

use std::time::Instant;

use fixtures::allocations::{Counting, allocated_by};
use thirdbounce::capture::Capture;
use thirdbounce::engine::Reconstruction;
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::maps::Truth;
use thirdbounce::measure::{Metrics, metrics};
use thirdbounce::methods::SolverOptions;
use thirdbounce::session::{Session, SessionOptions};
use thirdbounce::surface::{Follow, SurfaceOptions};
use thirdbounce_simulate::{Motion, RenderOptions, Scene, simulate, truth};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const FRAMES: usize = 10;
/// The frame in which an object appears or vanishes.
const CHANGE: usize = 4;
/// Sequences: name, scene, metres from frame to frame, whether the last object appears or vanishes.
const SEQUENCES: [(&str, &str, f64, [bool; 2]); 5] = [
    ("resting", "figure", 0.0, [false, false]),
    ("moving, 1 cm", "figure", 0.01, [false, false]),
    ("moving, 3 cm", "figure", 0.03, [false, false]),
    ("appearing", "spheres", 0.0, [true, false]),
    ("vanishing", "spheres", 0.0, [false, true]),
];

/// A frame with its truth.
struct FrameWithTruth {
    capture: Capture,
    truth: Truth,
}

/// Sums over frames.
#[derive(Default)]
struct Sums {
    seconds: Vec<f64>,
    processor: Vec<f64>,
    iterations: f64,
    allocations: f64,
    depth: f64,
    normal: f64,
    iou: f64,
    warm: usize,
    kernels: std::collections::BTreeMap<&'static str, (u64, f64)>,
}

impl Sums {
    fn add(&mut self, done: &Reconstruction, found: &Metrics, [seconds, processor]: [f64; 2]) {
        self.seconds.push(1e3 * seconds);
        self.processor.push(1e3 * processor);
        self.iterations += done.trace.last().map_or(0.0, |p| p.iteration as f64);
        self.depth += found.depth_rmse.unwrap_or(f64::NAN);
        self.normal += found.normal_error_deg.unwrap_or(f64::NAN);
        self.iou += found.iou.unwrap_or(0.0);
        self.warm += usize::from(done.is_warm);
        for (name, time) in &done.kernels {
            let of = self.kernels.entry(name).or_default();
            *of = (of.0 + time.calls, of.1 + 1e3 * time.seconds);
        }
    }

    fn row(mut self, what: &str) -> String {
        let frames = self.seconds.len() as f64;
        [&mut self.seconds, &mut self.processor].iter_mut().for_each(|all| all.sort_by(f64::total_cmp));
        let at = |all: &[f64], percent: usize| all[((percent * all.len()).div_ceil(100)).max(1) - 1];
        format!(
            "| {what} | {} of {frames} | {:.0} | {:.1} | {:.1} | {:.2} | {:.0} / {:.0} | {:.0} / {:.0} / {:.0} / {:.0} | {:.0} |",
            self.warm,
            self.iterations / frames,
            1e3 * self.depth / frames,
            self.normal / frames,
            self.iou / frames,
            at(&self.processor, 0),
            at(&self.processor, 50),
            at(&self.seconds, 0),
            at(&self.seconds, 50),
            at(&self.seconds, 90),
            at(&self.seconds, 99),
            self.allocations / frames,
        )
    }
}

/// Processor seconds of this process so far, all threads.
fn processor_seconds() -> f64 {
    let of_thread = |entry: std::io::Result<std::fs::DirEntry>| -> Option<f64> {
        let text = std::fs::read_to_string(entry.ok()?.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    };
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten();
    1e-9 * threads.filter_map(of_thread).sum::<f64>()
}

fn moments(
    side: usize,
    (_, name, step, [appears, vanishes]): (&str, &str, f64, [bool; 2]),
) -> Vec<FrameWithTruth> {
    let scene = Scene { scan: side, photons: Some(300.0), ..Scene::named(name).unwrap() };
    let at = |changes: bool| changes.then_some(CHANGE);
    let motion = Motion { frames: FRAMES, step, circle: None, appears: at(appears), vanishes: at(vanishes) };
    let moment = |scene: &Scene| FrameWithTruth {
        capture: simulate(scene, &RenderOptions { noise: 0.03, ..Default::default() }).unwrap().capture,
        truth: truth(scene, 128).unwrap(),
    };
    scene.sequence(&motion).unwrap().iter().map(moment).collect()
}

/// Solves all frames; the first does not count.
fn measured(session: &mut Session, moments: &[FrameWithTruth]) -> Sums {
    let mut sums = Sums::default();
    for (i, moment) in moments.iter().enumerate() {
        let (begun, before) = (Instant::now(), processor_seconds());
        let [allocations, _] = allocated_by(|| {
            session.submit(&moment.capture.histograms).expect("a frame");
            session.wait().expect("a result");
        });
        let spent = [begun.elapsed().as_secs_f64(), processor_seconds() - before];
        let done = &session.last().expect("the frame").result;
        let found = metrics(&done.maps, &moment.truth, None).expect("figures");
        if std::env::args().any(|a| a == "frames") {
            println!(
                "  {i}: {} {} iterations, {:.1} mm, {:.1} deg, IoU {:.2}, {:.0} ms",
                if done.is_warm { "warm" } else { "cold" },
                done.trace.last().map_or(0, |p| p.iteration),
                1e3 * found.depth_rmse.unwrap_or(f64::NAN),
                found.normal_error_deg.unwrap_or(f64::NAN),
                found.iou.unwrap_or(0.0),
                1e3 * spent[1]
            );
        }
        if i > 0 {
            sums.allocations += allocations as f64;
            sums.add(done, &found, spent);
        }
    }
    sums
}

/// Words that the name of a row has to contain.
fn words() -> impl Iterator<Item = String> {
    std::env::args().skip_while(|a| a != "only").skip(1).filter(|a| !a.starts_with('-'))
}

/// Whether a sequence of this name has rows that are wanted.
fn is_wanted(sequence: &str) -> bool {
    words()
        .filter(|w| !["fresh", "following", "high-pass"].contains(&w.as_str()))
        .all(|w| sequence.contains(&w))
}

fn main() {
    let sides: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let kernels = std::env::args().any(|a| a == "kernels");
    let gpu =
        Gpu::open(&GpuOptions { timings: kernels, ..GpuOptions::default() }).expect("the host at least");
    for side in if sides.is_empty() { vec![16, 32] } else { sides } {
        println!("\n{}: {side} x {side} points, {} pixels\n", gpu.info.name.trim(), 4 * side);
        println!(
            "| | warm | iterations | depth error, mm | normal error, deg | IoU | processor, ms: least / median | \
             latency, ms: least / 50 / 90 / 99 % | allocations |\n|---|---|---|---|---|---|---|---|---|"
        );
        for sequence in SEQUENCES.into_iter().filter(|s| is_wanted(s.0)) {
            let moments = moments(side, sequence);
            for high_pass in [None, Some(0.1)] {
                let options =
                    SurfaceOptions::default().with(|o| (o.lateral, o.high_pass) = (4 * side, high_pass));
                let solver: SolverOptions = options.into();
                let filtered = if high_pass.is_some() { ", high-pass" } else { "" };
                for (how, follow) in [("fresh", None), ("following", Some(Follow::default()))] {
                    let name = format!("{}{filtered}, {how}", sequence.0);
                    if !words().all(|word| name.contains(&word)) {
                        continue;
                    }
                    let options = SessionOptions { follow, ..SessionOptions::default() };
                    let mut session =
                        Session::new(&gpu, &moments[0].capture, None, &solver, options).expect("a session");
                    let sums = measured(&mut session, &moments);
                    let times = sums.kernels.clone();
                    println!("{}", sums.row(&name));
                    let frames = (FRAMES - 1) as f64;
                    for (name, (dispatches, ms)) in times {
                        println!(
                            "    {name}: {:.1} dispatches, {:.2} ms",
                            dispatches as f64 / frames,
                            ms / frames
                        );
                    }
                }
            }
        }
    }
}
