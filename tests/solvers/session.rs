//! Sessions: frames of one scan one after the other give the bits of solves of their own, whatever happened before.

use std::ops::ControlFlow;
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use fixtures::captures::{assert_error, changed};
use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::Kind;
use thirdbounce::capture::{Capture, Pulse};
use thirdbounce::engine::{Accumulation, Bins, Problem, Progress, Reconstruction};
use thirdbounce::gpu::{Gpu, GpuOptions, Point};
use thirdbounce::job::Request;
use thirdbounce::methods::{PaperOptions, SolverOptions};
use thirdbounce::options::{Preset, SceneTraits};
use thirdbounce::session::{Session, SessionOptions, default_grid};
use thirdbounce::settings::Settings;
use thirdbounce::surface::{Begin, SurfaceOptions};
use thirdbounce::transport::Reflectance;
use thirdbounce_simulate::{RenderOptions, Scene, simulate};

/// A scan of `side` × `side` confocal points on a 1 m wall, with bins of this width and without counts.
pub fn scan(side: usize, bin_width: f64) -> Capture {
    let at = |i: usize| (i as f64 + 0.5) / side as f64 - 0.5;
    let wall: Vec<DVec3> = (0..side * side).map(|p| dvec3(at(p / side), at(p % side), 0.0)).collect();
    let bins = (2.4 / bin_width) as usize;
    changed(&Capture::new([side, side], wall.clone(), wall, bins, bin_width, vec![]), |c| c.t_start = 0.4)
}

/// What `scan` sees of a plate of 0.4 m around `centre`, over a background.
fn frame(scan: &Capture, centre: DVec3) -> Vec<f32> {
    let mut random = Random::new(5);
    let points: Vec<DVec3> = (0..100)
        .map(|i| {
            let [x, y] = [i / 10, i % 10].map(|k| 0.04 * (k as f64 - 4.5));
            centre + dvec3(x, y, 0.3 * x)
        })
        .collect();
    let mut counts: Vec<f32> =
        (0..scan.pair_count() * scan.bins).map(|_| random.uniform(0.0, 2.0) as f32).collect();
    for (pair, point) in scan.laser.iter().enumerate() {
        for hidden in &points {
            let distance = point.distance(*hidden);
            let bin = ((2.0 * distance - scan.t_start) / scan.bin_width) as usize;
            if bin < scan.bins {
                counts[pair * scan.bins + bin] += (10.0 / distance.powi(4)) as f32;
            }
        }
    }
    counts
}

/// Two frames: a plate, and two others behind each other, with a third beside the box.
pub fn frames(scan: &Capture) -> [Vec<f32>; 2] {
    let [near, far, beside] =
        [dvec3(-0.15, 0.1, 0.6), dvec3(-0.1, 0.1, 0.95), dvec3(1.0, 0.0, 0.5)].map(|at| frame(scan, at));
    let three = near.iter().zip(&far).zip(&beside).map(|((n, f), b)| n + 4.0 * f + 4.0 * b).collect();
    [frame(scan, dvec3(0.1, -0.05, 0.6)), three]
}

/// A short fit of a fixed support, to the same bits in every run.
pub fn surface(change: impl FnOnce(&mut SurfaceOptions)) -> SolverOptions {
    let options = SurfaceOptions::default().with(|o| {
        (o.lateral, o.iterations, o.grow) = (24, 9, false);
        o.accumulation = Accumulation::Repeatable;
    });
    options.with(change).into()
}

fn paper() -> SolverOptions {
    let options = PaperOptions::preset(Preset::Synthetic).with(|o| {
        (o.lateral, o.iterations) = (16, 24);
        (o.domain.reduce_every, o.domain.double_every, o.restart_every) = (6, 6, 12);
        o.accumulation = Accumulation::Repeatable;
    });
    options.into()
}

fn session(gpu: &Gpu, scan: &Capture, solver: &SolverOptions) -> Session {
    let options = SessionOptions { with_volume: true, ..SessionOptions::default() };
    Session::new(gpu, scan, None, solver, options).unwrap()
}

/// The bits of everything that a solve finds.
pub fn bits(done: &Reconstruction) -> Vec<u32> {
    let maps = &done.maps;
    let of_map = [&maps.albedo[..], &maps.depth, maps.normal.as_flattened()].concat();
    let behind = maps.behind.iter().flat_map(|l| l.albedo.iter().chain(&l.depth));
    let volume = done.volume.iter().flat_map(|v| &v.albedo);
    let mut all: Vec<u32> = of_map.iter().chain(behind).chain(volume).map(|v| v.to_bits()).collect();
    all.extend(
        done.trace.iter().flat_map(|p| [p.iteration as u32, p.active as u32, (p.loss as f32).to_bits()]),
    );
    all.push((done.empty_loss as f32).to_bits());
    all
}

fn solved(session: &mut Session, counts: &[f32]) -> Vec<u32> {
    session.submit(counts).unwrap();
    bits(&session.wait().unwrap().result)
}

/// The bits of a solve of its own, in the bins that a session takes.
fn alone(gpu: &Gpu, scan: &Capture, solver: &SolverOptions, counts: &[f32]) -> Vec<u32> {
    let grid = default_grid(scan, solver).unwrap();
    let capture = changed(scan, |c| c.histograms = counts.to_vec());
    let capture = capture.binned(solver.usual_sum(scan, None)).unwrap();
    let mut hear = |_: &Progress| ControlFlow::Continue(());
    bits(&solver.solve(gpu, &Problem::new(&capture, grid).and_volume(), &mut unwatched(&mut hear)).unwrap())
}

#[test]
fn narrow_bins_are_summed_as_the_command_sums_them() {
    let gpu = host();
    let scan = scan(12, 0.0125);
    let [counts, _] = frames(&scan);
    let solver = surface(|o| o.lateral = 16);
    let sum = solver.usual_sum(&scan, None);
    assert_eq!(sum, 3, "a pixel is 62.5 mm wide");
    let summed = changed(&scan, |c| c.histograms = counts.clone()).binned(sum).unwrap();
    let mut session = session(&gpu, &scan, &solver);
    assert_eq!(session.plan().scene.all_bins, summed.bins);
    let want = alone(&gpu, &summed, &solver, &summed.histograms);
    assert_eq!(solved(&mut session, &counts), want);
    assert_eq!(solved(&mut session, &counts), want);
    let own = SessionOptions { sum: Some(1), ..SessionOptions::default() };
    assert_eq!(Session::new(&gpu, &scan, None, &solver, own).unwrap().plan().scene.all_bins, scan.bins);
}

/// Solvers and scans that take different ways through the engine.
fn kinds() -> Vec<(&'static str, SolverOptions, Capture)> {
    let plain = scan(8, 0.03);
    let surface = |change: fn(&mut SurfaceOptions)| surface(|o| (o.lateral = 16, change(o)).1);
    let with_pulse = changed(&plain, |c| c.pulse = Some(Pulse::gaussian(0.06).unwrap()));
    let one_laser = changed(&plain, |c| c.laser = vec![DVec3::ZERO; c.pair_count()]);
    let lambertian = |o: &mut SurfaceOptions| o.reflectance = Reflectance::Lambertian;
    let lct = SolverOptions::defaults_for("lct", &SceneTraits::of(&plain)).unwrap().with_lateral(16);
    vec![
        ("surface", surface(|_| ()), plain.clone()),
        ("surface, a support that grows", surface(|o| o.grow = true), plain.clone()),
        ("surface, coarse pixels first", surface(|o| (o.grow, o.lateral) = (true, 128)), scan(8, 0.06)),
        ("surface, a plane", surface(|o| o.begin = Begin::Plane), plain.clone()),
        ("lct", lct, plain.clone()),
        ("paper", paper(), plain.clone()),
        ("paper, a pulse", paper(), with_pulse.clone()),
        ("surface, a pulse, two cosines", surface(lambertian), with_pulse),
        ("surface, a high-pass", surface(|o| o.high_pass = Some(0.2)), plain),
        ("surface, one laser point", surface(|_| ()), one_laser),
        ("surface, parts of the pairs", surface(|o| o.pairs = 512), scan(34, 0.06)),
    ]
}

#[test]
fn a_frame_gives_the_bits_of_a_solve_of_its_own_whatever_was_solved_before() {
    let gpu = host();
    for (kind, solver, scan) in kinds() {
        in_turns(&gpu, kind, &solver, &scan, &frames(&scan));
    }
    assert_valid(&gpu);
}

/// Solves frames A, B and A on one session, and asserts that each gives the bits of a solve of its own.
fn in_turns(
    gpu: &Gpu,
    kind: &str,
    solver: &SolverOptions,
    scan: &Capture,
    [a, b]: &[Vec<f32>; 2],
) -> [Reconstruction; 3] {
    let [of_a, of_b] = [a, b].map(|counts| alone(gpu, scan, solver, counts));
    assert!(of_a != of_b, "{kind}");
    let mut session = session(gpu, scan, solver);
    [(a, &of_a), (b, &of_b), (a, &of_a)].map(|(counts, want)| {
        assert!(solved(&mut session, counts) == *want, "{kind}");
        session.last().unwrap().result.clone()
    })
}

/// A session ends a frame as the command ends a run whose start is not chosen by pairs that are held out: the same grid, mask and
/// expected depth error, of both layers.
#[test]
fn a_session_gives_the_maps_of_the_command() {
    let gpu = host();
    let scene = Scene { scan: 16, bin_width: 0.02, occlusion: false, ..Scene::named("plates").unwrap() };
    let capture = simulate(&scene, &RenderOptions { noise: 0.02, ..Default::default() }).unwrap().capture;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plates.npz");
    thirdbounce::capture::write(&capture, &file).unwrap();
    let whole = Settings { auto_gate: Some(false), ..Settings::default() };
    let loaded = thirdbounce::job::load(&file, &whole).unwrap();
    // A session estimates nothing that is not given.
    let solver = surface(|o| (o.lateral, o.iterations, o.grow, o.high_pass) = (32, 40, false, Some(0.1)));
    let settings = Settings::from(solver.clone()).with(|s| s.bins = Some(Bins::Sum(1)));
    let request = Request::new(settings, folder.path().join("out"));
    let mut hear = |_: &Progress| ControlFlow::Continue(());
    let of_command = thirdbounce::job::run(&request, &loaded, &mut hear).unwrap().maps;
    let mut session = session(&gpu, &loaded.capture, &solver);
    session.submit(&loaded.capture.histograms).unwrap();
    let maps = &session.wait().unwrap().result.maps;
    // No depth is no number, which does not equal itself: as text.
    assert!(format!("{maps:?}") == format!("{of_command:?}"));
    assert!(maps.behind.is_some() && maps.depth_error.is_some());
}

#[test]
fn a_second_layer_comes_and_goes() {
    let gpu = host();
    let of = |name: &str| {
        let scene = Scene { scan: 16, bin_width: 0.02, occlusion: false, ..Scene::named(name).unwrap() };
        simulate(&scene, &RenderOptions { noise: 0.02, ..Default::default() }).unwrap().capture
    };
    let [mut one, two] = ["plates-front", "plates"].map(of);
    assert_eq!((one.t_start, one.bin_width), (two.t_start, two.bin_width));
    let padded = |h: &[f32]| (0..two.bins).map(|bin| h.get(bin).copied().unwrap_or(0.0)).collect::<Vec<_>>();
    one.histograms = one.histograms.chunks_exact(one.bins).flat_map(padded).collect();
    let solver = surface(|o| (o.lateral, o.iterations, o.grow) = (32, 40, true));
    let scan = changed(&two, |c| c.histograms.clear());
    let done = in_turns(&gpu, "plates", &solver, &scan, &[one.histograms, two.histograms]);
    assert_eq!(done.map(|r| r.maps.behind.is_some()), [false, true, false]);
}

/// The mean path of light through spots is that of the counts that a session is made with, so a solve of its own is
/// another session.
#[test]
fn frames_of_wide_spots_leave_nothing_behind() {
    let gpu = host();
    // Through the wide ones of wide bins, fewer pairs are rendered than are measured.
    for (side, bin, spot, are_fewer) in [(12, 0.03, 0.08, false), (32, 0.3, 0.3, true)] {
        let scan = changed(&scan(side, bin), |c| (c.laser_spot, c.sensor_spot) = (Some(spot), Some(spot)));
        let solver = surface(|_| ());
        let [a, b] = frames(&scan);
        let [of_a, of_b] = [&a, &b].map(|counts| solved(&mut session(&gpu, &scan, &solver), counts));
        let mut session = session(&gpu, &scan, &solver);
        let plan = session.plan();
        assert!(plan.levels.spots.is_some());
        let [rendered, measured] = [plan.finest().rendered.count, plan.scene.pairs];
        assert_eq!(rendered < measured, are_fewer, "{rendered} {measured}");
        for (counts, want) in [(&a, &of_a), (&b, &of_b), (&a, &of_a)] {
            assert!(solved(&mut session, counts) == *want);
        }
    }
}

#[test]
fn later_frames_make_nothing_on_the_device() {
    let gpu = gpu();
    let scan = scan(12, 0.03);
    let [a, b] = frames(&scan);
    for solver in [surface(|o| o.high_pass = Some(0.2)), paper()] {
        let mut session = session(&gpu, &scan, &solver);
        let made = || [Point::Allocation, Point::Object].map(|point| gpu.reached(point));
        let before = made();
        solved(&mut session, &a);
        let after_first = made();
        assert_eq!(before[0], after_first[0], "everything is allocated when a session is made");
        for counts in [&b, &a, &b] {
            solved(&mut session, counts);
        }
        assert_eq!(made(), after_first, "{}", solver.name());
        assert!(before[0] > 0 && before[1] > 0, "the calls are counted");
    }
}

#[test]
fn two_threads_with_a_session_each_give_the_bits_of_one_after_the_other() {
    let gpu = host();
    let scan = scan(12, 0.03);
    let frames = frames(&scan);
    let solvers = [surface(|_| ()), paper()];
    let want = solvers.each_ref().map(|s| frames.each_ref().map(|counts| alone(&gpu, &scan, s, counts)));
    let mut sessions = solvers.each_ref().map(|solver| session(&gpu, &scan, solver));
    thread::scope(|scope| {
        for (session, want) in sessions.iter_mut().zip(&want) {
            let frames = &frames;
            scope.spawn(move || {
                for i in [0, 1, 0, 1] {
                    assert!(solved(session, &frames[i]) == want[i]);
                }
            });
        }
    });
    assert_valid(&gpu);
}

#[test]
fn a_cancelled_frame_leaves_the_session_usable() {
    let gpu = host();
    let scan = scan(12, 0.03);
    let [a, b] = frames(&scan);
    for solver in [surface(|_| ()), paper()] {
        let want = alone(&gpu, &scan, &solver, &b);
        let (reported, heard) = channel();
        let (go_on, stays) = channel::<()>();
        let hear = move |id, progress: &Progress| {
            reported.send((id, progress.point.iteration)).expect("the test listens");
            // The first frame stays here until the test has cancelled it.
            let _ = stays.recv();
            ControlFlow::Continue(())
        };
        let hear: thirdbounce::session::Hear = Box::new(hear);
        let options = SessionOptions { with_volume: true, hear: Some(hear), ..SessionOptions::default() };
        let mut session = Session::new(&gpu, &scan, None, &solver, options).unwrap();
        // With nothing to cancel, the next frame is not meant.
        session.cancel();
        let first = session.submit(&a).unwrap();
        assert_eq!(heard.recv().unwrap().0, first);
        assert_error(session.submit(&b), Kind::Options, &["still being solved", "cancel it"]);
        let canceller = session.canceller();
        thread::spawn(move || canceller.cancel()).join().unwrap();
        drop(go_on);
        assert_error(session.wait().map(|f| f.id), Kind::Cancelled, &["cancelled"]);
        assert!(session.last().is_none() && session.poll().unwrap().is_none());
        assert!(solved(&mut session, &b) == want, "{}", solver.name());
        assert_eq!(session.last().unwrap().id.0, first.0 + 1);
        // A frame that is cancelled before it begins.
        session.submit(&a).unwrap();
        session.cancel();
        assert_error(session.wait().map(|f| f.id), Kind::Cancelled, &[]);
        assert!(solved(&mut session, &b) == want);
    }
    assert_valid(&gpu);
}

#[test]
fn a_frame_ends_at_its_time_limit_and_when_the_caller_says_so() {
    let gpu = host();
    let scan = scan(8, 0.04);
    let [a, _] = frames(&scan);
    let limit = Some(Duration::ZERO);
    let options = SessionOptions { time_limit: limit, ..SessionOptions::default() };
    let mut late = Session::new(&gpu, &scan, None, &surface(|_| ()), options).unwrap();
    for _ in 0..2 {
        late.submit(&a).unwrap();
        assert_error(late.wait().map(|f| f.id), Kind::Cancelled, &["longer than its limit", "fewer"]);
    }
    let hear: thirdbounce::session::Hear = Box::new(|id, _| match id.0 {
        1 => ControlFlow::Break(()),
        2 => panic!("a caller's own"),
        _ => ControlFlow::Continue(()),
    });
    let options = SessionOptions { hear: Some(hear), ..SessionOptions::default() };
    let mut stopped = Session::new(&gpu, &scan, None, &surface(|_| ()), options).unwrap();
    stopped.submit(&a).unwrap();
    assert_error(stopped.wait().map(|f| f.id), Kind::Cancelled, &["cancelled"]);
    stopped.submit(&a).unwrap();
    assert_error(stopped.wait().map(|f| f.id), Kind::Device, &["frame 2", "a caller's own", "new session"]);
    assert_error(stopped.submit(&a), Kind::Device, &["a caller's own"]);
}

#[test]
fn frames_that_are_no_counts_are_refused_and_the_session_goes_on() {
    let gpu = host();
    let scan = scan(8, 0.04);
    let [a, b] = frames(&scan);
    let mut session = session(&gpu, &scan, &surface(|_| ()));
    assert_error(session.wait().map(|f| f.id), Kind::Options, &["nothing to wait for"]);
    let want = solved(&mut session, &a);
    let not_finite = |value: f32| {
        let mut counts = a.clone();
        counts[2 * scan.bins + 3] = value;
        counts
    };
    for (counts, words) in [
        (a[1..].to_vec(), &["counts for 64 pairs"][..]),
        (vec![], &["0 counts"]),
        (not_finite(f32::NAN), &["pair 2", "bin 3", "NaN"]),
        (not_finite(f32::INFINITY), &["pair 2", "inf"]),
        (vec![0.0; a.len()], &["no signal"]),
        (a.iter().map(|v| -v).collect(), &["no signal"]),
    ] {
        assert_error(session.submit(&counts), Kind::Input, words);
        assert!(bits(&session.last().unwrap().result) == want, "the last result stays");
    }
    let of_b = solved(&mut session, &b);
    assert!(of_b != want && solved(&mut session, &a) == want);
}

#[test]
fn another_thread_submits_while_one_waits() {
    let gpu = host();
    let scan = scan(8, 0.04);
    let [counts, _] = frames(&scan);
    let mut session = session(&gpu, &scan, &surface(|_| ()));
    let submitter = session.submitter();
    let camera = std::thread::spawn({
        let submitter = submitter.clone();
        move || {
            // By now the other one waits, most likely.
            std::thread::sleep(Duration::from_millis(20));
            submitter.submit(&counts).map(|id| (id, counts))
        }
    });
    let id = session.wait_for(Duration::from_secs(300)).unwrap().expect("a frame comes").id;
    let (submitted, counts) = camera.join().unwrap().unwrap();
    assert_eq!(submitted, id);
    assert!(session.wait_for(Duration::from_millis(1)).unwrap().is_none());
    assert_eq!(submitter.latency().frames, 1);
    drop(session);
    let error = submitter.submit(&counts).unwrap_err();
    assert!(error.kind == Kind::Options && error.what.contains("closed"), "{error}");
}

#[test]
fn sessions_that_are_dropped_leave_no_memory_behind() {
    let gpu = Gpu::open(&GpuOptions::vulkan()).expect("a Vulkan device: `make setup` installs lavapipe");
    let scan = scan(4, 0.1);
    let [a, _] = frames(&scan);
    let small = surface(|o| (o.lateral, o.iterations) = (4, 4));
    for i in 0..40 {
        let mut session = session(&gpu, &scan, &small);
        assert!(gpu.allocated() > 0);
        // Some are dropped with a frame under way, some after one.
        if i % 10 < 2 {
            session.submit(&a).unwrap();
        }
        if i % 10 == 1 {
            session.wait().unwrap();
        }
    }
    assert_eq!(gpu.allocated(), 0);
}

#[test]
fn a_session_refuses_what_a_solve_refuses() {
    let gpu = host();
    let scan = scan(4, 0.1);
    let make = |scan: &Capture, solver: &SolverOptions| {
        Session::new(&gpu, scan, None, solver, SessionOptions::default()).map(|s| s.plan().scene.pairs)
    };
    assert_error(make(&changed(&scan, |c| c.bins = 0), &surface(|_| ())), Kind::Input, &["no bin"]);
    assert_error(make(&changed(&scan, |c| c.histograms = vec![1.0]), &paper()), Kind::Input, &["1 counts"]);
    assert_error(make(&scan, &surface(|o| o.iterations = 0)), Kind::Options, &["iterations"]);
    // Bins in picoseconds, with counts and without.
    let picoseconds = changed(&scan, |c| c.bin_width /= 0.000_299_792_458);
    for scan in [picoseconds.outline(), picoseconds.clone()] {
        assert_error(
            make(&scan, &surface(|_| ())),
            Kind::Input,
            &["wider than the wall", "looks like picoseconds"],
        );
    }
    let through_api =
        thirdbounce::session(&gpu, &picoseconds, &Settings::default(), SessionOptions::default());
    assert_error(through_api.map(|s| s.1), Kind::Input, &["looks like picoseconds"]);
    let few = SessionOptions { memory: Some(1000), ..SessionOptions::default() };
    let refused = Session::new(&gpu, &scan, None, &surface(|_| ()), few).map(|s| s.plan().scene.pairs);
    assert_error(refused, Kind::Memory, &["budget"]);
    assert_eq!(gpu.allocated(), 0);
}
