//! What a session's frames cost: the time of each, the host's work before the first dispatch, and what the host allocates.
//!
//!     cargo bench --bench session

mod scene;

use std::time::Instant;

use fixtures::allocations::{Counting, allocated_by};
use glam::{DVec3, dvec3};
use thirdbounce::capture::Capture;
use thirdbounce::gpu::{Gpu, GpuOptions, HostSpan};
use thirdbounce::session::{Session, SessionOptions};
use thirdbounce::solve::{SolverOptions, SurfaceOptions};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const SIDE: usize = 32;
const BINS: usize = 512;
const FRAMES: usize = 10;

fn main() {
    let at = |i: usize| (i as f64 + 0.5) / SIDE as f64 - 0.5;
    let wall: Vec<DVec3> = (0..SIDE * SIDE).map(|p| dvec3(at(p / SIDE), at(p % SIDE), 0.0)).collect();
    let mut scan = Capture::new([SIDE, SIDE], wall.clone(), wall, BINS, 0.006, vec![]);
    scan.integer_counts = true;
    let open =
        |timings| Gpu::open(&GpuOptions { timings, ..GpuOptions::default() }).expect("a Vulkan device");
    // The timeline tells when the first dispatch was submitted, and allocates itself.
    let (gpu, timed) = (open(false), open(true));
    println!("{}, {SIDE} x {SIDE} points, {BINS} bins", gpu.info.name.trim());
    println!("| frame | whole, ms | host before the first dispatch, ms | allocations on the host | MB |");
    println!("|---|---|---|---|---|");
    for high_pass in [0.0, 0.1] {
        let options = SurfaceOptions::default().with(|o| (o.lateral, o.high_pass) = (32, Some(high_pass)));
        let solver: SolverOptions = options.into();
        let make =
            |gpu| Session::new(gpu, &scan, None, &solver, SessionOptions::default()).expect("a session");
        let begun = Instant::now();
        let mut session = make(&gpu);
        println!(
            "| session{} | {:.0} | | | |",
            if high_pass > 0.0 { " with a high-pass" } else { "" },
            1e3 * begun.elapsed().as_secs_f64()
        );
        let mut of_timeline = make(&timed);
        let mut later = vec![];
        for frame in 0..FRAMES {
            let counts = counts(&scan, frame);
            timed.take_recording();
            let at = timed.now();
            of_timeline.submit(&counts).expect("a frame");
            of_timeline.wait().expect("a result");
            let host = host_before(&timed.take_recording().host, at);
            let begun = Instant::now();
            let [count, bytes] = allocated_by(|| {
                session.submit(&counts).expect("a frame");
                session.wait().expect("a result");
            });
            let seconds = begun.elapsed().as_secs_f64();
            if frame > 0 {
                later.push(1e3 * host);
            }
            println!(
                "| {} | {:.1} | {:.2} | {} | {:.1} |",
                frame + 1,
                1e3 * seconds,
                1e3 * host,
                count,
                bytes as f64 * 1e-6
            );
        }
        println!("| median of later frames | | {:.2} | | |", scene::median(later));
    }
}

/// Seconds from `at` to the end of the second submission: the first only uploads.
fn host_before(spans: &[HostSpan], at: f64) -> f64 {
    let submitted = spans.iter().filter(|s| s.what == "submit" && s.from >= at).nth(1);
    submitted.map_or(f64::NAN, |s| s.to - at)
}

/// Whole counts of a plate that moves, over a few counts of background.
fn counts(scan: &Capture, frame: usize) -> Vec<f32> {
    let centre = dvec3(0.05 * frame as f64 - 0.15, 0.1, 0.7);
    let mut counts: Vec<f32> =
        (0..scan.pair_count() * BINS).map(|i| ((i * 7919 + frame) % 11 / 9) as f32).collect();
    for (pair, point) in scan.laser.iter().enumerate() {
        for i in 0..144 {
            let [x, y] = [i / 12, i % 12].map(|k| 0.03 * (k as f64 - 5.5));
            let distance = point.distance(centre + dvec3(x, y, 0.2 * x));
            let bin = (2.0 * distance / scan.bin_width) as usize;
            counts[pair * BINS + bin.min(BINS - 1)] += (3.0 / distance.powi(4)).round() as f32;
        }
    }
    counts
}
