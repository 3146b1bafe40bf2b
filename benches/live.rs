//! What a warm start saves: a letter that moves, each frame solved from the beginning and from the frame before it.
//!
//!     cargo bench --bench live             # both sizes
//!     cargo bench --bench live -- 16       # 16 x 16 points only
//!
//! Errors are against the truth. Work is counted in evaluations of a voxel with a pair. Processor seconds count all threads,
//! the software device's too, so other load does not change them much.

use std::time::Instant;

use thirdbounce::capture::Capture;
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::maps::Truth;
use thirdbounce::measure::{Metrics, metrics};
use thirdbounce::session::{Session, SessionOptions};
use thirdbounce::simulate::{RenderOptions, Scene, simulate, truth};
use thirdbounce::solve::{Follow, Reconstruction, SolverOptions, SurfaceOptions};

const FRAMES: usize = 6;
/// Metres from frame to frame: at 5 frames a second 0, 5 and 10 cm/s.
const STEPS: [f64; 3] = [0.0, 0.01, 0.02];
const LATERAL: usize = 32;

/// A frame with its truth.
struct TimelinePoint {
    capture: Capture,
    truth: Truth,
}

/// Sums over frames.
#[derive(Default)]
struct Sums {
    frames: f64,
    seconds: f64,
    processor: f64,
    iterations: f64,
    work: f64,
    depth: f64,
    normal: f64,
    iou: f64,
    warm: usize,
}

impl Sums {
    fn add(&mut self, done: &Reconstruction, found: &Metrics, [seconds, processor]: [f64; 2]) {
        self.frames += 1.0;
        self.seconds += seconds;
        self.processor += processor;
        self.iterations += done.trace.last().map_or(0.0, |p| p.iteration as f64);
        self.work += done.pairs as f64;
        self.depth += found.depth_rmse.unwrap_or(f64::NAN);
        self.normal += found.normal_error_deg.unwrap_or(f64::NAN);
        self.iou += found.iou.unwrap_or(0.0);
        self.warm += usize::from(done.is_warm);
    }

    fn row(&self, what: &str) -> String {
        let mean = |sum: f64| sum / self.frames;
        format!(
            "| {what} | {} of {} | {:.1} | {:.2} | {:.2} | {:.1} | {:.2} | {:.1} | {:.2} |",
            self.warm,
            self.frames,
            mean(self.iterations),
            1e-6 * mean(self.work),
            1e3 * mean(self.depth),
            mean(self.normal),
            mean(self.iou),
            1.0 / mean(self.seconds),
            mean(self.processor)
        )
    }
}

/// Processor seconds of this process so far, all threads: user and system time of /proc/self/stat, in hundredths.
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = stat.rsplit(')').next().unwrap_or_default();
    let ticks = |field: usize| -> f64 {
        after.split_whitespace().nth(field).and_then(|t| t.parse().ok()).unwrap_or(f64::NAN)
    };
    0.01 * (ticks(11) + ticks(12))
}

fn moments(side: usize, step: f64) -> Vec<TimelinePoint> {
    let scene =
        Scene { scan: side, bin_width: 0.0125, photons: Some(300.0), ..Scene::named("letter:T").unwrap() };
    let moment = |scene: &Scene| TimelinePoint {
        capture: simulate(scene, &RenderOptions { noise: 0.02, ..Default::default() }).unwrap().capture,
        truth: truth(scene, 128).unwrap(),
    };
    scene.moving(FRAMES, step).unwrap().iter().map(moment).collect()
}

fn measured(session: &mut Session, moments: &[TimelinePoint], skip: usize) -> Sums {
    let mut sums = Sums::default();
    for (i, moment) in moments.iter().enumerate() {
        let (begun, before) = (Instant::now(), processor_seconds());
        session.submit(&moment.capture.histograms).expect("a frame");
        let done = session.wait().expect("a result").result.clone();
        let spent = [begun.elapsed().as_secs_f64(), processor_seconds() - before];
        if i >= skip {
            sums.add(&done, &metrics(&done.maps, &moment.truth, None).expect("figures"), spent);
        }
    }
    sums
}

fn main() {
    let wanted: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let sides = if wanted.is_empty() { vec![16, 32] } else { wanted };
    let gpu = Gpu::open(&GpuOptions::default()).expect("a Vulkan device");
    println!("{}, {LATERAL} x {LATERAL} pixels", gpu.info.name.trim());
    for side in sides {
        STEPS.iter().for_each(|step| table(&gpu, side, *step));
    }
}

fn table(gpu: &Gpu, side: usize, step: f64) {
    let moments = moments(side, step);
    let scan = &moments[0].capture;
    println!("\n{side} x {side} points, {} bins, {:.0} mm from frame to frame\n", scan.bins, 1e3 * step);
    println!(
        "| | warm | iterations | 10^6 evaluations | depth error, mm | normal error, deg | IoU | frames/s | \
         processor, s |\n|---|---|---|---|---|---|---|---|---|"
    );
    let options = SurfaceOptions::default().with(|o| o.lateral = LATERAL);
    let make = |options: &SurfaceOptions, follow| {
        let solver: SolverOptions = options.clone().into();
        Session::new(gpu, scan, None, &solver, SessionOptions { follow, ..SessionOptions::default() })
            .expect("a session")
    };
    // The first frame of a warm session begins cold, so it counts for none.
    println!("{}", measured(&mut make(&options, None), &moments, 1).row("cold"));
    let short = options.clone().with(|o| (o.iterations, o.grow) = (20, false));
    println!("{}", measured(&mut make(&short, None), &moments, 1).row("cold, fixed support, 20"));
    for iterations in [10, 20, 40] {
        let follow = Follow { iterations: Some(iterations), ..Follow::default() };
        let name = format!("warm, {iterations}");
        println!("{}", measured(&mut make(&options, Some(follow)), &moments, 1).row(&name));
    }
}
