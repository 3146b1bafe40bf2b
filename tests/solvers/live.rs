//! Frames that follow each other: what a warm start must keep, find and give up; what becomes of frames that come too fast.

use std::ops::ControlFlow;
use std::sync::mpsc::channel;
use std::time::Duration;

use fixtures::captures::{assert_error, changed};
use fixtures::device::*;
use glam::dvec3;
use thirdbounce::Kind;
use thirdbounce::capture::Capture;
use thirdbounce::engine::Reconstruction;
use thirdbounce::gpu::Gpu;
use thirdbounce::maps::Truth;
use thirdbounce::measure::metrics;
use thirdbounce::methods::{PaperOptions, SolverOptions};
use thirdbounce::options::Preset;
use thirdbounce::session::{Feed, Session, SessionOptions};
use thirdbounce::surface::{Follow, SurfaceOptions};
use thirdbounce_simulate::{RenderOptions, Scene, simulate, truth};

/// A letter of 16 x 16 points, 32 pixels.
fn options() -> SurfaceOptions {
    SurfaceOptions::default().with(|o| o.lateral = 32)
}

fn letter(x: f64) -> Scene {
    let scene = Scene { scan: 16, bin_width: 0.02, bins: Some(192), ..Scene::named("letter:T").unwrap() };
    let mut moved = scene.clone();
    for object in &mut moved.objects {
        object.mesh = object.mesh.clone().translated(dvec3(x, 0.0, 0.0));
    }
    moved
}

fn seen(scene: &Scene) -> (Capture, Truth) {
    let capture = simulate(scene, &RenderOptions { noise: 0.02, ..Default::default() }).unwrap().capture;
    (capture, truth(scene, 96).unwrap())
}

fn session(gpu: &Gpu, scan: &Capture, options: SessionOptions) -> Session {
    Session::new(gpu, scan, None, &self::options().into(), options).unwrap()
}

fn following(gpu: &Gpu, scan: &Capture, follow: Follow) -> Session {
    session(gpu, scan, SessionOptions { follow: Some(follow), ..SessionOptions::default() })
}

fn solved(session: &mut Session, counts: &[f32]) -> Reconstruction {
    session.submit(counts).unwrap();
    session.wait().unwrap().result.clone()
}

/// Depth error in millimetres, and the share of the truth that is found.
fn quality(done: &Reconstruction, truth: &Truth) -> [f64; 2] {
    let found = metrics(&done.maps, truth, None).unwrap();
    [1e3 * found.depth_rmse.unwrap_or(f64::INFINITY), found.iou.unwrap_or(0.0)]
}

#[test]
fn the_same_frame_again_is_as_good_in_a_third_of_the_iterations() {
    let gpu = host();
    let (capture, truth) = seen(&letter(0.0));
    let mut session = following(&gpu, &capture, Follow::default());
    let cold = solved(&mut session, &capture.histograms);
    let iterations = |r: &Reconstruction| r.trace.last().unwrap().iteration;
    let mut warm = cold.clone();
    for _ in 0..2 {
        warm = solved(&mut session, &capture.histograms);
        assert!(warm.is_warm);
    }
    assert!(!cold.is_warm);
    assert!(3 * iterations(&warm) <= iterations(&cold) && 4 * warm.pairs < cold.pairs);
    let [of_cold, of_warm] = [&cold, &warm].map(|r| quality(r, &truth));
    assert!(
        of_warm[0] < 1.15 * of_cold[0] + 0.1 && of_warm[1] > of_cold[1] - 0.02,
        "{of_cold:?} {of_warm:?}"
    );
    assert_valid(&gpu);
}

#[test]
fn a_thing_that_appears_where_nothing_was_is_found_within_two_frames() {
    let gpu = host();
    // A plate far from the other: its place had no surface for two frames.
    let near = Scene { scan: 16, bin_width: 0.02, bins: Some(192), ..Scene::named("plane").unwrap() };
    let [mut alone, mut both] = [near.clone(), near];
    let small = |scene: &mut Scene, at| {
        let mesh = thirdbounce_simulate::rectangle(at, dvec3(0.0, 0.1, 0.0), dvec3(0.1, 0.0, 0.0));
        scene.objects.push(thirdbounce_simulate::Object { mesh, albedo: 1.0 });
    };
    for scene in [&mut alone, &mut both] {
        scene.objects.clear();
        small(scene, dvec3(-0.3, -0.3, 0.6));
    }
    small(&mut both, dvec3(0.28, 0.25, 0.9));
    let ((before, _), (after, truth)) = (seen(&alone), seen(&both));
    let mut session = following(&gpu, &before, Follow { cut_above: 1e9, ..Follow::default() });
    solved(&mut session, &before.histograms);
    solved(&mut session, &before.histograms);
    let lit = |done: &Reconstruction| {
        let maps = &done.maps;
        let at = |i: usize| maps.centre(i / maps.ny, i % maps.ny);
        let there = |i: &usize| at(*i)[0] > 0.1 && at(*i)[1] > 0.1 && maps.mask[*i];
        (0..maps.mask.len()).filter(there).collect::<Vec<_>>()
    };
    assert!(lit(&session.last().unwrap().result).is_empty());
    solved(&mut session, &after.histograms);
    let done = solved(&mut session, &after.histograms);
    assert!(done.is_warm);
    let found = lit(&done);
    assert!(found.len() > 8, "{found:?}");
    let depth: Vec<f32> = found.iter().map(|i| done.maps.depth[*i]).collect();
    let mean = depth.iter().sum::<f32>() / depth.len() as f32;
    assert!((mean - 0.9).abs() < 0.03, "{mean}");
    // And it goes again.
    for _ in 0..4 {
        solved(&mut session, &before.histograms);
    }
    assert!(lit(&session.last().unwrap().result).is_empty());
    assert!(truth.mask.contains(&true));
}

#[test]
fn a_scene_cut_begins_cold_and_gives_the_bits_of_a_frame_of_its_own() {
    let gpu = host();
    let (one, _) = seen(&letter(-0.15));
    let far = Scene { scan: 16, bin_width: 0.02, bins: Some(192), ..Scene::named("plane").unwrap() };
    let (other, _) = seen(&far);
    let repeatable = |follow| {
        let solver: SolverOptions =
            options().with(|o| o.accumulation = thirdbounce::engine::Accumulation::Repeatable).into();
        let options = SessionOptions { follow, ..SessionOptions::default() };
        Session::new(&gpu, &one, None, &solver, options).unwrap()
    };
    let alone = solved(&mut repeatable(None), &other.histograms);
    let mut session = repeatable(Some(Follow::default()));
    solved(&mut session, &one.histograms);
    assert!(solved(&mut session, &one.histograms).is_warm);
    let cut = solved(&mut session, &other.histograms);
    assert!(!cut.is_warm);
    assert!(format!("{:?}", cut.maps) == format!("{:?}", alone.maps), "nothing is left of the scene before");
    assert!(solved(&mut session, &other.histograms).is_warm);
}

#[test]
fn frames_that_change_are_followed_and_others_need_no_closed_form() {
    let gpu = host();
    let sequence: Vec<(Capture, Truth)> =
        [0.0, 0.012, 0.024, 0.036, 0.036].map(|x| seen(&letter(x))).to_vec();
    let mut session = following(&gpu, &sequence[0].0, Follow::default());
    let iterations = |r: &Reconstruction| r.trace.last().unwrap().iteration;
    let wanted = options().iterations / 3;
    let mut last = 0;
    for (i, (capture, truth)) in sequence.iter().enumerate() {
        let done = solved(&mut session, &capture.histograms);
        assert_eq!(done.is_warm, i > 0);
        last = iterations(&done);
        if (1..4).contains(&i) {
            assert!(last > wanted, "a frame that moves has rounds: {last}");
            let fresh =
                solved(&mut self::session(&gpu, capture, SessionOptions::default()), &capture.histograms);
            let [fresh, own] = [&fresh, &done].map(|r| quality(r, truth));
            assert!(
                own[0] < 1.3 * fresh[0] + 0.5 && own[1] > fresh[1] - 0.06,
                "frame {i}: {fresh:?} {own:?}"
            );
        }
    }
    while last > wanted {
        last = iterations(&solved(&mut session, &sequence[4].0.histograms));
        assert!(session.last().unwrap().id.0 < 10, "a scene that rests needs no rounds");
    }
}

#[test]
fn a_fixed_support_follows_in_as_few_iterations_as_there_are() {
    let gpu = host();
    let sequence = [0.0, 0.05].map(|x| seen(&letter(x)).0);
    let solver: SolverOptions = options().with(|o| (o.iterations, o.grow) = (6, false)).into();
    let options = SessionOptions { follow: Some(Follow::default()), ..SessionOptions::default() };
    let mut session = Session::new(&gpu, &sequence[0], None, &solver, options).unwrap();
    solved(&mut session, &sequence[0].histograms);
    let done = solved(&mut session, &sequence[1].histograms);
    assert!(done.is_warm && done.trace.last().unwrap().iteration == 6 && done.maps.mask.contains(&true));
    assert_valid(&gpu);
}

#[test]
fn results_do_not_depend_on_when_frames_come() {
    let gpu = host();
    let sequence = [0.0, 0.012, 0.012, 0.03].map(|x| seen(&letter(x)).0);
    let solver: SolverOptions =
        options().with(|o| o.accumulation = thirdbounce::engine::Accumulation::Repeatable).into();
    let maps = |pause: Duration| -> Vec<String> {
        let options = SessionOptions { follow: Some(Follow::default()), ..SessionOptions::default() };
        let mut session = Session::new(&gpu, &sequence[0], None, &solver, options).unwrap();
        let mut of = |capture: &Capture| {
            std::thread::sleep(pause);
            format!("{:?}", solved(&mut session, &capture.histograms).maps)
        };
        sequence.iter().map(&mut of).collect()
    };
    assert!(maps(Duration::ZERO) == maps(Duration::from_millis(70)));
}

#[test]
fn a_frame_that_was_cancelled_is_followed_by_a_cold_one() {
    let gpu = host();
    let (capture, _) = seen(&letter(0.0));
    let options = SessionOptions {
        follow: Some(Follow::default()),
        hear: Some(Box::new(|id, _| match id.0 {
            2 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        })),
        ..SessionOptions::default()
    };
    let mut session = session(&gpu, &capture, options);
    solved(&mut session, &capture.histograms);
    session.submit(&capture.histograms).unwrap();
    assert_error(session.wait().map(|f| f.id), Kind::Cancelled, &[]);
    assert!(!solved(&mut session, &capture.histograms).is_warm);
    assert!(solved(&mut session, &capture.histograms).is_warm);
}

#[test]
fn a_short_time_still_gives_a_whole_picture() {
    let gpu = host();
    let (capture, truth) = seen(&letter(0.0));
    let budget = Some(Duration::from_millis(1));
    let mut session = following(&gpu, &capture, Follow { budget, ..Follow::default() });
    let first = solved(&mut session, &capture.histograms);
    // The time is over when the closed form is there: blocks in flight have four iterations at most.
    let iterations = |r: &Reconstruction| r.trace.last().unwrap().iteration;
    assert!(iterations(&first) <= 12, "{}", iterations(&first));
    assert_eq!([first.maps.nx, first.maps.ny], [32, 32]);
    // There is time for a few iterations only, and the picture gets better all the same.
    let before = quality(&first, &truth);
    let mut last = first;
    for _ in 0..12 {
        last = solved(&mut session, &capture.histograms);
        assert!(last.is_warm && iterations(&last) <= 12, "{}", iterations(&last));
        assert_eq!(last.maps.nx, 32);
    }
    let after = quality(&last, &truth);
    assert!(after[1] > before[1] && after[1] > 0.7, "{before:?} {after:?}");
}

#[test]
fn frames_that_come_too_fast_are_dropped_queued_or_summed() {
    let gpu = host();
    let (capture, _) = seen(&letter(0.0));
    let of = |feed: Feed| {
        let (reported, heard) = channel();
        let (go_on, stays) = channel::<()>();
        let hear: thirdbounce::session::Hear = Box::new(move |id, _| {
            let _ = reported.send(id.0);
            // Frame 1 stays here until the test has submitted all others.
            let _ = stays.recv();
            ControlFlow::Continue(())
        });
        let mut session =
            session(&gpu, &capture, SessionOptions { feed, hear: Some(hear), ..SessionOptions::default() });
        session.submit(&capture.histograms).unwrap();
        heard.recv().unwrap();
        let submitted: Vec<_> = (2..=4)
            .map(|k| session.submit(&capture.histograms.iter().map(|c| c * k as f32).collect::<Vec<_>>()))
            .collect();
        drop(go_on);
        let mut solved = vec![];
        while let Ok(frame) = session.wait() {
            solved.push((frame.id.0, frame.result.plan.scene.pairs));
        }
        (submitted, solved.into_iter().map(|s| s.0).collect::<Vec<_>>(), session.latency())
    };
    // With one slot, untaken results are replaced.
    let (submitted, solved, reported) = of(Feed::Newest);
    assert!(submitted.iter().all(Result::is_ok) && solved.last() == Some(&4), "{solved:?}");
    assert_eq!((reported.dropped, reported.frames), (2, 2));
    assert!(reported.median > Duration::ZERO && reported.p99 >= reported.median);
    let (submitted, solved, reported) = of(Feed::Every { most: 2 });
    assert_eq!(submitted.iter().map(Result::is_ok).collect::<Vec<_>>(), [true, true, false]);
    assert_error(submitted.into_iter().next_back().unwrap(), Kind::Options, &["2 frames wait"]);
    assert_eq!((solved, reported.dropped, reported.frames), (vec![1, 2, 3], 0, 3));
    let (submitted, solved, reported) = of(Feed::Sum { decay: 0.5 });
    assert!(submitted.iter().all(Result::is_ok) && solved.last() == Some(&4), "{solved:?}");
    assert_eq!((reported.dropped, reported.frames), (0, 2));
}

#[test]
fn dark_frames_are_summed_and_parts_of_a_scan_are_kept() {
    let gpu = host();
    let (capture, truth) = seen(&letter(0.0));
    let dark = vec![0.0; capture.histograms.len()];
    let mut summing = session(
        &gpu,
        &capture,
        SessionOptions { feed: Feed::Sum { decay: 0.9 }, ..SessionOptions::default() },
    );
    assert_error(summing.submit(&dark), Kind::Input, &["no signal"]);
    summing.submit(&capture.histograms).unwrap();
    summing.wait().unwrap();
    summing.submit(&dark).unwrap();
    assert!(quality(&summing.wait().unwrap().result, &truth)[1] > 0.7);
    // Half of the pairs, then the other half: the picture is that of the whole scan.
    let mut parts = session(&gpu, &capture, SessionOptions::default());
    let halves = [0, 1].map(|half| (0..capture.pair_count()).map(|p| p % 2 == half).collect::<Vec<_>>());
    let unused = changed(&capture, |c| {
        for (pair, row) in c.histograms.chunks_exact_mut(c.bins).enumerate() {
            row.iter_mut().for_each(|v| *v = if pair % 2 == 0 { *v } else { 1e6 });
        }
    });
    parts.submit_part(&unused.histograms, &halves[0]).unwrap();
    parts.wait().unwrap();
    parts.submit_part(&capture.histograms, &halves[1]).unwrap();
    let done = parts.wait().unwrap().result.clone();
    let whole = solved(&mut session(&gpu, &capture, SessionOptions::default()), &capture.histograms);
    assert!((quality(&done, &truth)[0] - quality(&whole, &truth)[0]).abs() < 0.05);
    assert!((done.empty_loss - whole.empty_loss).abs() < 1e-6 * whole.empty_loss);
    assert_error(parts.submit_part(&capture.histograms, &[true]), Kind::Input, &["1 values", "256 pairs"]);
    // Wrong counts of a whole frame leave what is kept of the pairs as it was.
    let wrong = changed(&capture, |c| c.histograms[3] = f32::NAN);
    assert_error(parts.submit(&wrong.histograms), Kind::Input, &["pair 0", "bin 3", "NaN"]);
    assert_error(parts.submit(&capture.histograms[1..]), Kind::Input, &["counts for 256 pairs"]);
    parts.submit_part(&capture.histograms, &halves[0]).unwrap();
    assert_eq!(parts.wait().unwrap().result.empty_loss, done.empty_loss);
}

#[test]
fn what_cannot_follow_is_refused() {
    let gpu = host();
    let (capture, _) = seen(&letter(0.0));
    let make = |solver: SolverOptions, follow: Follow, feed: Feed| {
        let options = SessionOptions { follow: Some(follow), feed, ..SessionOptions::default() };
        Session::new(&gpu, &capture, None, &solver, options).map(|s| s.plan().scene.pairs)
    };
    let paper = PaperOptions::preset(Preset::Synthetic).into();
    assert_error(make(paper, Follow::default(), Feed::One), Kind::Options, &["paper", "follow"]);
    let wrong = Follow { cut_above: f64::NAN, ..Follow::default() };
    assert_error(make(options().into(), wrong, Feed::One), Kind::Options, &["cut_above"]);
    let many = Follow { iterations: Some(1000), ..Follow::default() };
    assert_error(make(options().into(), many, Feed::One), Kind::Options, &["1000 iterations"]);
    let sum = Feed::Sum { decay: 2.0 };
    assert_error(make(options().into(), Follow::default(), sum), Kind::Options, &["decay"]);
}

#[test]
fn what_rests_is_subtracted_once_it_is_known() {
    subtracts_what_rests(Some(1000.0));
}

#[test]
fn what_rests_is_subtracted_from_values_without_noise() {
    subtracts_what_rests(None);
}

/// A small plate that moves before one that rests: the frames before the background is known are those of a plain session, of later ones the
/// background is subtracted.
fn subtracts_what_rests(photons: Option<f64>) {
    let gpu = host();
    let plate = |x: f64, z: f64, half: f64| {
        let mesh =
            thirdbounce_simulate::rectangle(dvec3(x, 0.0, z), dvec3(0.0, half, 0.0), dvec3(half, 0.0, 0.0));
        thirdbounce_simulate::Object { mesh, albedo: 1.0 }
    };
    let places: Vec<f64> = (0..8).map(|frame| -0.4 + 0.1 * f64::from(frame)).collect();
    let scene = |x: f64| Scene { objects: vec![plate(x, 0.5, 0.08)], ..letter(0.0) };
    // All frames are measured as long as the first one.
    let mut exposure = None;
    let mut both = |number: usize| {
        let mut scene = Scene { photons, seed: number as u64, ..scene(places[number]) };
        scene.objects.push(plate(0.1, 0.95, 0.3));
        let render = RenderOptions { noise: 0.02, ..Default::default() };
        let made = thirdbounce_simulate::simulate_exposed(&scene, exposure, &render, &|_| {}).unwrap();
        exposure = made.exposure;
        made.capture
    };
    let frames: Vec<Capture> = (0..8).map(&mut both).collect();
    let mut moving =
        session(&gpu, &frames[0], SessionOptions { moving: Some(31), ..SessionOptions::default() });
    let mut plain = session(&gpu, &frames[0], SessionOptions::default());
    assert!(moving.subtracts() && !plain.subtracts());
    for (number, frame) in frames.iter().enumerate() {
        let done = solved(&mut moving, &frame.histograms);
        let warns = done.warnings.iter().any(|warning| warning.contains("what rests is not known yet"));
        assert_eq!([warns, moving.last().unwrap().left.is_none()], [number < 5; 2], "{number}");
        if let Some(left) = &moving.last().unwrap().left {
            let sum = |counts: &[f32]| counts.iter().map(|v| f64::from(*v)).sum::<f64>();
            let share = sum(&left.histograms) / sum(&frame.histograms);
            assert!((0.05..0.6).contains(&share), "{photons:?}, {number}: {share}");
        }
        if number == 0 {
            let same = solved(&mut plain, &frame.histograms);
            assert!(format!("{:?}", done.maps) == format!("{:?}", same.maps));
        }
    }
    // Frames that are all alike leave nothing, and the session lives on.
    for _ in 0..7 {
        let done = solved(&mut moving, &frames[0].histograms);
        assert!(done.maps.albedo.iter().all(|v| v.is_finite()));
    }
    let options = SessionOptions { moving: Some(4), ..SessionOptions::default() };
    let error = Session::new(&gpu, &frames[0], None, &self::options().into(), options).map(drop);
    assert_error(error, Kind::Options, &["4 frames", "5 to 1000"]);
}
