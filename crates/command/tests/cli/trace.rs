//! Traces with figures, and a clock that ignores measuring.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use fixtures::command::succeed;
use fixtures::device::{assert_valid, gpu};
use fixtures::letter::{SHORT, figures, json, small};
use thirdbounce::capture::Capture;
use thirdbounce::engine::{Problem, Progress, Reconstruction, Solver, Watch, default_volume};
use thirdbounce::gpu::Gpu;
use thirdbounce::methods::PaperOptions;
use thirdbounce::options::Preset;
use thirdbounce::transport::Grid;
use thirdbounce_simulate::{RenderOptions, Scene, simulate};

#[test]
fn a_trace_with_figures() {
    let (_, capture, truth) = small();
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let run = |name: &str, more: &[&str]| {
        let all = ["reconstruct", capture, "--out", &at(name).display().to_string(), "--deterministic"];
        succeed(&[&all[..], &["--solver", "paper"], &SHORT, more].concat());
        json(&at(name).join("report.json"))
    };
    let report = run("often", &["--truth", truth, "--trace-every", "4"]);
    let measured: Vec<u64> = report["trace"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|e| e["depth_mae"].is_f64() && e["best_iou"].is_f64() && e["residual"].is_f64())
        .map(|e| e["iteration"].as_u64().unwrap())
        .collect();
    assert_eq!(measured, [4, 8, 12, 16, 20, 24, 28, 30]);
    let maps = |place: &str| std::fs::read(at(place).join("maps.npz")).unwrap();

    // Measuring does not change the result.
    let by_default = run("default", &["--truth", truth]);
    let tens: Vec<_> = figures(&by_default["trace"], "depth_mae");
    assert_eq!(tens.len(), 3);
    let at_the_end = run("end", &["--truth", truth, "--trace-every", "0"]);
    assert_eq!(figures(&at_the_end["trace"], "depth_mae").len(), 1);
    assert!(maps("often") == maps("end") && maps("often") == maps("default"));
    let without = run("without", &["--trace-every", "5"]);
    assert_eq!(figures(&without["trace"], "depth_mae").len(), 0);
    assert!(figures(&without["trace"], "iteration").contains(&25.0));

    let often = at("often").display().to_string();
    succeed(&["evaluate", &often, "--truth", truth, "--no-pictures", "--json"]);
    assert!(!at("often/depth_difference.png").exists());
    let text = succeed(&["evaluate", &often, "--truth", truth]);
    assert!(at("often/depth_difference.png").is_file() && text.contains("depth_difference.png"), "{text}");
}

/// Runs with maps after every Nth iteration and a listener that sleeps; (result, seconds asleep, seconds by the wall clock).
fn sleepy(
    gpu: &Gpu,
    capture: &Capture,
    maps_every: Option<usize>,
    sleep: impl Fn(&Progress) -> f64,
) -> (Reconstruction, f64, f64) {
    let o = PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.lateral = 16;
        o.iterations = 40;
    });
    let o = o.with(|o| {
        o.domain.coarse_to_fine = false;
        o.domain.reduce = false;
    });
    let volume = default_volume(capture, o.domain.min_depth).unwrap();
    let grid = Grid::new(volume, o.lateral, capture.bin_width).unwrap();
    let mut asleep = 0.0;
    let mut hear = |progress: &Progress| {
        let seconds = sleep(progress);
        std::thread::sleep(Duration::from_secs_f64(seconds));
        asleep += seconds;
        ControlFlow::Continue(())
    };
    let mut watch = Watch { hear: &mut hear, maps_every, maps_at: &[] };
    let start = Instant::now();
    let done = o.solve(gpu, &Problem::new(capture, grid), &mut watch).unwrap();
    (done, asleep, start.elapsed().as_secs_f64())
}

/// What `measure` gives as soon as it holds. Other work on the machine only ever adds time, so it holds in a quiet moment or
/// never.
fn in_a_quiet_moment<T>(measure: impl Fn() -> Result<T, String>) -> T {
    let mut tries = (0..5).map(|_| measure());
    tries.find_map(|tried| tried.inspect_err(|e| eprintln!("{e}")).ok()).expect("one of five tries holds")
}

#[test]
#[ignore = "long: make soak"]
fn measuring_does_not_move_the_clock() {
    let gpu = gpu();
    let mut scene = Scene::named("letter-l").unwrap();
    (scene.scan, scene.bin_width) = (8, 0.01);
    let capture = simulate(&scene, &RenderOptions { noise: 0.05, ..Default::default() }).unwrap().capture;
    let run = |maps_every, sleep: f64| {
        sleepy(&gpu, &capture, maps_every, |p| if p.maps.is_some() { sleep } else { 0.0 })
    };
    run(None, 0.0); // The first run compiles the kernels.
    let plain = run(None, 0.0).0;

    // 0.3 s asleep at each of four measured points: the clock counts only the work.
    let (done, asleep, wall) = run(Some(10), 0.3);
    let last = done.trace.last().unwrap();
    assert!(asleep > 1.1 && wall > asleep, "{asleep} {wall}");
    assert!(done.solve_seconds < wall - asleep, "{} of {wall}", done.solve_seconds);
    assert!(last.seconds <= done.solve_seconds && done.trace.is_sorted_by(|a, b| a.seconds <= b.seconds));

    // With every iteration measured the clock shows about the same time. Other work on the machine changes both, so bounds
    // on two runs are wide.
    let (done, asleep, wall) = run(Some(1), 0.03);
    assert_eq!(done.trace.len(), 40);
    assert!(done.solve_seconds < wall - asleep, "{} of {wall}", done.solve_seconds);
    let seconds = |maps_every| run(maps_every, 0.0).0.trace.last().unwrap().seconds;
    in_a_quiet_moment(|| {
        let (without, with) = (seconds(None), seconds(Some(1)));
        if (0.3..3.0).contains(&(with / without)) {
            Ok(())
        } else {
            Err(format!("{with} s with, {without} s without"))
        }
    });

    // A listener beside a working device hides none of its work. The clock runs on through the naps, except those for
    // the last blocks (three at most), when the device is done.
    let done = in_a_quiet_moment(|| {
        let (done, asleep, wall) = sleepy(&gpu, &capture, None, |_| 0.5);
        let beside = done.trace.len() - 3;
        let stood_still = wall - done.solve_seconds;
        let most = asleep - 0.5 * beside as f64 + 0.4;
        if beside > 0 && stood_still < most { Ok(done) } else { Err(format!("{stood_still} s of {asleep}")) }
    });
    let loss = |r: &Reconstruction| r.trace.last().unwrap().data_loss;
    assert!((loss(&done) / loss(&plain) - 1.0).abs() < 0.1 && loss(&plain) < plain.empty_loss);
    let point = plain.trace.last().unwrap();
    assert!(point.data_loss <= point.loss);
    assert_valid(&gpu);
}
