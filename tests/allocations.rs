//! What later frames of a session allocate on the host. A binary of its own with one test: all threads are counted. Its harness allocates
//! nothing while the test runs: that of the standard library reports a test that takes more than 60 s.

use std::time::Duration;

use fixtures::allocations::{Counting, allocated_by};
use fixtures::captures::changed;
use glam::dvec3;
use libtest_mimic::{Arguments, Trial};
use thirdbounce::capture::{Capture, Pulse};
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::methods::{PaperOptions, SolverOptions};
use thirdbounce::session::{Session, SessionOptions};
use thirdbounce::surface::{Begin, Follow, SurfaceOptions};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The most allocations of a later frame: lists of the maps' pixels, from the device to the result. It was 125 for a frame of its
/// own that begins with a plane. The closed forms on the host allocate lists for each row of the scan, and are not counted here.
const MOST: u64 = 160;

const SIDE: usize = 12;
const BINS: usize = 96;

fn scan() -> Capture {
    let at = |i: usize| (i as f64 + 0.5) / SIDE as f64 - 0.5;
    let wall: Vec<_> = (0..SIDE * SIDE).map(|p| dvec3(at(p / SIDE), at(p % SIDE), 0.0)).collect();
    let mut scan = Capture::new([SIDE, SIDE], wall.clone(), wall, BINS, 0.03, vec![]);
    scan.integer_counts = true;
    scan
}

/// Photons of a plate that moves from frame to frame.
fn counts(scan: &Capture, frame: usize) -> Vec<f32> {
    let mut counts = vec![1.0; scan.pair_count() * scan.bins];
    for (pair, point) in scan.laser.iter().enumerate() {
        for i in 0..100 {
            let [x, y] = [i / 10, i % 10].map(|k| 0.04 * (k as f64 - 4.5));
            let distance = point.distance(dvec3(x + 0.01 * frame as f64, y, 0.7));
            counts[pair * scan.bins + (2.0 * distance / scan.bin_width) as usize] +=
                (2.0 / distance.powi(4)).round() as f32;
        }
    }
    counts
}

/// The least number of allocations of a later frame: the fourth, the fifth, and up to the twelfth until one has at most `wanted`. An
/// iteration that allocates does so in each of them; how many blocks of iterations there are, with lists of their own, depends on the load
/// of the machine.
fn of_a_later_frame(
    gpu: &Gpu,
    scan: &Capture,
    solver: &SolverOptions,
    follow: Option<Follow>,
    wanted: u64,
) -> u64 {
    let options = SessionOptions { follow, ..SessionOptions::default() };
    let mut session = Session::new(gpu, scan, None, solver, options).expect("a session");
    let mut least = u64::MAX;
    for number in 0..12 {
        if number > 4 && least <= wanted {
            break;
        }
        let counts = counts(scan, number);
        let [allocations, _] = allocated_by(|| {
            session.submit(&counts).expect("a frame");
            session.wait_for(Duration::from_secs(300)).expect("a result").expect("in time");
        });
        let frame = session.last().expect("the frame");
        assert_eq!(frame.result.is_warm, follow.is_some() && frame.id.0 > 1);
        assert!(frame.result.maps.mask.iter().any(|m| *m), "something is there");
        if number > 2 {
            least = least.min(allocations);
        }
    }
    least
}

fn main() -> std::process::ExitCode {
    let test = || {
        a_later_frame_allocates_nothing_for_an_iteration();
        Ok(())
    };
    let all = vec![Trial::test("a_later_frame_allocates_nothing_for_an_iteration", test)];
    libtest_mimic::run(&Arguments::from_args(), all).exit_code()
}

fn a_later_frame_allocates_nothing_for_an_iteration() {
    let gpu = Gpu::open(&GpuOptions::vulkan()).expect("a Vulkan device: `make setup` installs lavapipe");
    let plain = scan();
    let with_pulse = changed(&plain, |c| c.pulse = Pulse::gaussian(0.06).ok());
    let surface = |iterations: usize| -> SolverOptions {
        SurfaceOptions::default()
            .with(|o| (o.lateral, o.iterations, o.grow, o.begin) = (16, iterations, false, Begin::Plane))
            .into()
    };
    let paper = |iterations: usize| -> SolverOptions {
        let options = PaperOptions::default().with(|o| {
            (o.lateral, o.iterations) = (16, iterations);
            (o.domain.reduce_every, o.domain.double_every) = (10, 15);
        });
        options.into()
    };
    let followed = Some(Follow { iterations: Some(11), ..Follow::default() });
    for (kind, scan, [few, many], follow) in [
        ("surface", &plain, [30, 90].map(surface), None),
        ("surface, a pulse", &with_pulse, [30, 90].map(surface), None),
        ("surface, frames that follow", &plain, [30, 90].map(surface), followed),
        ("paper", &plain, [30, 90].map(paper), None),
    ] {
        let few = of_a_later_frame(&gpu, scan, &few, follow, MOST);
        // As many lists, whatever the number of iterations; one may grow once more.
        let many = of_a_later_frame(&gpu, scan, &many, follow, few + 2);
        println!("{kind}: {few} {many}");
        assert!(few <= MOST && many <= few + 2, "{kind}: {few} {many}");
    }
}
