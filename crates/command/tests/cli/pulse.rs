//! The instrument's pulse: simulated, kept by formats, part of the model, estimated if it is unknown.

use fixtures::command;
use std::ops::ControlFlow;
use std::path::Path;

use fixtures::captures::changed;
use fixtures::command::{fail, succeed};
use fixtures::device::gpu;
use serde_json::Value;
use thirdbounce::capture::{Capture, Gate, Pulse, read, write};
use thirdbounce::engine::{Doing, Problem, Watch, default_volume};
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::Array;
use thirdbounce::job::{Request, load, run};
use thirdbounce::measure::metrics;
use thirdbounce::methods::SolverOptions;
use thirdbounce::surface::SurfaceOptions;
use thirdbounce::transport::{Grid, Volume};
use thirdbounce::{ImpulseResponse, Kind, Settings};
use thirdbounce_simulate::{RenderOptions, Scene, simulate, truth};

const FWHM: f64 = 0.04;

/// A figure at 16 x 16 points, bins of 1 cm, sharp or through a Gaussian of four bins.
fn scene(pulse: bool) -> Scene {
    let pulse = pulse.then(|| Pulse::gaussian(FWHM).unwrap());
    Scene { scan: 16, bin_width: 0.01, pulse, ..Scene::named("figure").unwrap() }
}

fn capture(pulse: bool) -> Capture {
    simulate(&scene(pulse), &RenderOptions { noise: 0.02, ..RenderOptions::default() }).unwrap().capture
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("the file is there")).expect("it is JSON")
}

#[test]
fn a_simulated_pulse_spreads_the_light_and_keeps_it() {
    let (sharp, spread) = (capture(false), capture(true));
    assert!(
        spread.bins >= sharp.bins
            && spread.pulse.as_ref().is_some_and(|p| (p.fwhm() / FWHM - 1.0).abs() < 0.01)
    );
    let moments = |c: &Capture| {
        let mean = c.mean_histogram();
        let total: f64 = mean.iter().sum();
        let of = |power: i32, centre: f64| {
            mean.iter().enumerate().map(|(b, v)| v * (b as f64 - centre).powi(power)).sum::<f64>() / total
        };
        let centre = of(1, 0.0);
        [total, centre, of(2, centre)]
    };
    let ([all, middle, wide], [all_too, there, wider]) = (moments(&sharp), moments(&spread));
    assert!((all_too / all - 1.0).abs() < 1e-4 && (there - middle).abs() < 1e-3);
    let sigma = FWHM / 0.01 / (8.0 * std::f64::consts::LN_2).sqrt();
    assert!(((wider - wide) / (sigma * sigma) - 1.0).abs() < 0.05, "{wide} {wider}");
}

#[test]
#[ignore = "long: make soak"]
fn a_known_pulse_makes_depths_and_normals_better() {
    let gpu = gpu();
    let known = capture(true);
    let unknown = changed(&known, |c| c.pulse = None);
    let truth = truth(&scene(true), 32).unwrap();
    let options = SolverOptions::from(SurfaceOptions::default().with(|o| {
        o.lateral = 32;
        o.iterations = 40;
    }));
    let solve = |capture: &Capture| {
        let grid = Grid::new(default_volume(capture, 0.2).unwrap(), 32, capture.bin_width).unwrap();
        let mut hear = |_: &thirdbounce::engine::Progress| ControlFlow::Continue(());
        let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
        let done = options.solve(&gpu, &Problem::new(capture, grid), &mut watch).unwrap();
        let best = metrics(&done.maps, &truth, 0.3).unwrap().at_best.unwrap();
        let spread = done.plan.bytes()["spread"];
        (best.depth_mae.unwrap(), best.normal_error_deg.unwrap(), done.trace.last().unwrap().loss, spread)
    };
    let (with, without) = (solve(&known), solve(&unknown));
    println!("with {with:?} without {without:?}");
    assert!(with.0 < 0.8 * without.0 && with.1 < 0.9 * without.1 && with.2 < 0.6 * without.2);
    assert!(without.3 <= 16 && with.3 > 16, "unused buffers are not allocated");
}

#[test]
fn a_capture_keeps_its_pulse() {
    let (_folder, path) = fixtures::captures::place("pulse.npz");
    let whole = capture(true);
    write(&whole, &path).unwrap();
    let back = read(&path).unwrap();
    assert_eq!(back.pulse, whole.pulse);
    for part in [
        back.stride(2).unwrap(),
        back.subset(9, 1).unwrap(),
        back.binned(3).unwrap(),
        back.summed(2).unwrap(),
        back.gated(Gate::parse("0.5:2").unwrap()).unwrap(),
    ] {
        assert_eq!(part.pulse, whole.pulse, "in metres, whatever the bins");
    }
    let taps = |n| back.binned(n).unwrap().pulse.unwrap().taps(0.01 * n as f64).unwrap().weights.len();
    assert!(taps(1) > taps(2) && taps(2) > taps(4));
    // A note says what another format cannot hold.
    let reported = |name: &str| write(&whole, &path.with_file_name(name)).unwrap();
    assert!(reported("p.npz").is_empty() && reported("p.hdf5")[0].contains("pulse"));
    assert!(reported("p.mat").iter().any(|n| n.contains("pulse")));
    let text = path.display().to_string();
    assert!(succeed(&["info", &text]).contains("pulse     0.03"), "{}", succeed(&["info", &text]));
    assert!(!succeed(&["info", &text, "--pulse", "none"]).contains("pulse     0."));
    let info: Value = serde_json::from_str(&succeed(&["info", &text, "--pulse", "0.1", "--json"])).unwrap();
    assert!((info["capture"]["pulse_fwhm_m"].as_f64().unwrap() - 0.1).abs() < 1e-3);
}

#[test]
fn a_tail_and_pile_up_are_simulated_and_the_pulse_may_be_hidden() {
    let (_folder, path) = fixtures::captures::place("c.npz");
    let text = path.display().to_string();
    let simulated = |more: &[&str]| {
        let usual =
            ["simulate", "beyond", "--out", &text, "--scan", "4", "--bin-width", "0.03", "--noise", "0.2"];
        succeed(&[&usual[..], &["--photons", "200", "--quiet"], more].concat());
        read(&path).unwrap()
    };
    let tailed = simulated(&["--pulse", "0.06:0.1"]);
    let pulse = tailed.pulse.clone().unwrap();
    assert!((pulse.moments()[0] - 0.1).abs() < 1e-3 && tailed.integer_counts);
    let hidden = simulated(&["--pulse", "0.06:0.1", "--hide-pulse"]);
    assert_eq!(hidden, changed(&tailed, |c| c.pulse = None));
    let total = |c: &Capture| c.histograms.iter().map(|v| f64::from(*v)).sum::<f64>();
    let piled = simulated(&["--pulse", "0.06:0.1", "--pile-up", "1"]);
    assert!(total(&piled) < 0.9 * total(&tailed));
    // The number of laser pulses goes with it.
    assert!(piled.cycles.is_some_and(|n| n > 0.0) && tailed.cycles.is_none());
    let notes = write(&piled, &path.with_file_name("piled.hdf5")).unwrap();
    assert!(notes.iter().any(|note| note.contains("laser pulses")));
    // A solve takes the same pulse from an option.
    let reported = |more: &[&str]| -> Value {
        serde_json::from_str(&succeed(&[&["info", &text, "--json"], more].concat())).unwrap()
    };
    let width = reported(&["--pulse", "0.06:0.1"])["capture"]["pulse_fwhm_m"].as_f64().unwrap();
    assert!((width / pulse.fwhm() - 1.0).abs() < 1e-9);
    fail(&["simulate", "beyond", "--out", &text, "--hide-pulse"], 2, "--pulse");
}

#[test]
fn a_pulse_that_is_none_is_refused() {
    let (_folder, path) = fixtures::captures::place("c.npz");
    let place = |name: &str| path.with_file_name(name);
    write(&capture(false), &path).unwrap();
    let text = path.display().to_string();
    let out = place("out").display().to_string();
    let pulse = |name: &str, arrays: &[(&'static str, Array)]| {
        std::fs::write(place(name), npz_bytes(arrays).unwrap()).unwrap();
        place(name).display().to_string()
    };
    let samples = |values: &[f64]| ("pulse", Array::from_f64(&[values.len()], values));
    let width = |value: f64| ("pulse_delta_t", Array::from_f64(&[], &[value]));
    let start = |value: f64| ("pulse_t_start", Array::from_f64(&[], &[value]));
    let cases = [
        ("0".to_string(), "0 m wide"),
        ("-0.01".to_string(), "wide"),
        ("nan".to_string(), "wide"),
        ("1000".to_string(), "for picoseconds give 1000ps"),
        ("nowhere.npz".to_string(), "cannot be read"),
        (pulse("none.npz", &[width(0.01)]), "no array pulse"),
        (pulse("unsaid.npz", &[samples(&[1.0, 2.0])]), "pulse_delta_t"),
        (pulse("negative.npz", &[samples(&[1.0, -2.0]), width(0.01)]), "sample 1 of the pulse is -2"),
        (pulse("dark.npz", &[samples(&[0.0, 0.0]), width(0.01)]), "add up to 0"),
        (pulse("empty.npz", &[samples(&[]), width(0.01)]), "0 samples"),
        (pulse("long.npz", &[samples(&vec![1.0; 5000]), width(0.01)]), "5000 samples"),
        (pulse("wide.npz", &[samples(&[1.0]), width(f64::INFINITY)]), "inf m wide"),
        (pulse("far.npz", &[samples(&[1.0]), width(0.01), start(1e9)]), "bins around its path"),
    ];
    for (given, words) in &cases {
        let given = format!("--pulse={given}");
        fail(&["reconstruct", &text, "--out", &out, "--lateral", "8", "--quiet", &given], 1, words);
        assert!(!Path::new(&out).join("report.json").exists());
    }
    // A bad pulse is refused in a capture as it is on the command line.
    let mut bad = capture(true);
    bad.pulse.as_mut().unwrap().samples[3] = f64::NAN;
    let e = write(&bad, &place("bad.npz")).unwrap_err();
    assert!(e.what.contains("sample 3 of the pulse"), "{e}");
    fail(&["simulate", "plane", "--out", &out, "--pulse", "x"], 1, "cannot be read");
}

#[test]
fn trials_are_heard_and_may_be_broken_off() {
    let (_folder, path) = fixtures::captures::place("c.npz");
    write(&changed(&capture(true), |c| c.pulse = None), &path).unwrap();
    let loaded = load(&path, &Settings::default()).unwrap();
    let out = path.with_file_name("out");
    let auto = |s: &mut Settings| s.pulse = Some(ImpulseResponse::Auto);
    let request = Request::new(Settings::from(SurfaceOptions::default()).with(auto), &out);
    let mut heard = 0;
    let broken = run(&request, &loaded, &mut |progress| {
        assert!(progress.doing == Doing::Trial, "nothing comes before the trials");
        heard += 1;
        if heard < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    assert_eq!(broken.unwrap_err().kind, Kind::Cancelled);
    assert!(heard == 3 && !out.exists());
    // A trial that cannot run is noted and does not stop the solve: here nothing is far enough to be reconstructed.
    let far = SurfaceOptions::default().with(|o| {
        o.min_depth = 1e3;
        o.lateral = 16;
        o.iterations = 1;
    });
    let volume = Volume { min: glam::dvec3(-0.5, -0.5, 1e3), max: glam::dvec3(0.5, 0.5, 1e3 + 0.1) };
    let settings = Settings::from(far).with(auto).with(|s| s.volume = Some(volume));
    let request = Request::new(settings, &out);
    let done = run(&request, &loaded, &mut |_| ControlFlow::Continue(())).unwrap();
    assert!(
        done.notes.iter().any(|note| note.contains("pulse is not known") && note.contains("surface")),
        "{:?}",
        done.notes
    );
}

#[test]
#[ignore = "long: make soak"]
fn the_tail_of_a_detector_is_found_and_told() {
    let (_folder, path) = fixtures::captures::place("c.npz");
    let file = path.display().to_string();
    for (tail, apart) in [(0.03, 0.75), (0.0, 1.0)] {
        let gaussian = Pulse::gaussian(0.03).unwrap();
        let pulse = if tail > 0.0 { gaussian.with_tail(tail).unwrap() } else { gaussian };
        let scene =
            Scene { scan: 24, bin_width: 0.008, pulse: Some(pulse), ..Scene::named("figure").unwrap() };
        let spread = simulate(&scene, &RenderOptions { noise: 0.02, ..RenderOptions::default() }).unwrap();
        write(&changed(&spread.capture, |c| c.pulse = None), &path).unwrap();
        let out = path.with_file_name("tailed").display().to_string();
        let short = ["--model", "lambertian", "--lateral", "64", "--iterations", "2", "--no-preview"];
        let ask = ["reconstruct", &file, "--out", &out, "--pulse", "auto", "--support", "fixed"];
        let said = command::thirdbounce(&[&ask[..], &short[..]].concat());
        assert_eq!(said.status.code(), Some(0), "{}", command::stderr(&said));
        let said = command::stderr(&said);
        let found = json(&Path::new(&out).join("report.json"))["settings"]["pulse_found"].clone();
        let [width, of_tail] = ["fwhm", "tail"].map(|key| found[key].as_f64().unwrap());
        assert!((width / 0.03 - 1.0).abs() < 0.4, "{found}");
        assert!((of_tail - tail).abs() <= apart * tail, "{found}");
        assert_eq!(said.contains(&format!(" and a tail of {of_tail} m ")), tail > 0.0, "{said}");
    }
}

#[test]
fn its_width_is_found_and_told() {
    let (_folder, path) = fixtures::captures::place("c.npz");
    let place = |name: &str| path.with_file_name(name).display().to_string();
    let [spread, sharp] = [true, false].map(|pulse| {
        let file = path.with_file_name(format!("{pulse}.npz"));
        write(&changed(&capture(pulse), |c| c.pulse = None), &file).unwrap();
        file.display().to_string()
    });
    // Of so few pairs, fast light alone shows a pulse of a bin where there is none.
    let plain = ["--model", "cosine", "--lateral", "64", "--iterations", "15", "--support", "fixed"];
    let short = [&plain[..], &["--high-pass", "0"]].concat();
    let solve = |from: &str, name: &str, more: &[&str]| {
        let out = place(name);
        let said = command::thirdbounce(&[&["reconstruct", from, "--out", &out], &short[..], more].concat());
        assert_eq!(said.status.code(), Some(0), "{}", command::stderr(&said));
        (json(&Path::new(&out).join("report.json")), command::stderr(&said))
    };
    // It is estimated only on request, or if a detector counted.
    assert!(solve(&spread, "plain", &[]).0["settings"]["pulse_found"].is_null());
    let (report, said) = solve(&spread, "found", &["--pulse", "auto", "--deterministic"]);
    let found = &report["settings"]["pulse_found"];
    let fwhm = found["fwhm"].as_f64().unwrap();
    assert!((fwhm / FWHM - 1.0).abs() < 0.25, "{found}");
    assert!(said.contains("pulse: of ") && said.contains(&format!(" {fwhm} m ")), "{said}");
    let seconds = found["seconds"].as_f64().unwrap();
    let trace = report["trace"].as_array().unwrap();
    assert!(
        seconds > 0.0 && trace.iter().all(|p| p["seconds"].as_f64().unwrap() > seconds),
        "it is part of the time"
    );
    assert!(report["totals"]["solve_s"].as_f64().unwrap() > seconds);
    // A plan made before the pulse is found holds, but for the number of its taps.
    let info =
        succeed(&[&["info", &spread, "--pulse", "auto", "--deterministic", "--json"], &short[..]].concat());
    let info: Value = serde_json::from_str(&info).unwrap();
    let but_taps = |of: &Value| {
        let mut buffers = of["plan"]["buffers"].clone();
        buffers.as_object_mut().expect("sizes by name").remove("pulse_taps");
        buffers
    };
    assert_eq!(but_taps(&info), but_taps(&report));
    assert!(info["notes"].to_string().contains("finds its width first"));
    let (without, said) = solve(&sharp, "sharp", &["--pulse", "auto"]);
    // At most that of a bin.
    let none = without["settings"]["pulse_found"]["fwhm"].as_f64().unwrap();
    assert!(none < 0.0125, "{said}");
}
