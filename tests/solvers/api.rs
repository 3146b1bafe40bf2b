//! The interface for programs: the maps of the command, and errors for settings out of range.

use std::ops::ControlFlow;
use std::path::Path;

use fixtures::captures::{assert_error, changed};
use fixtures::device::*;
use glam::dvec3;
use thirdbounce::job::Request;
use thirdbounce::surface::SurfaceSettings;
use thirdbounce::{
    Capture, Gpu, Kind, Reflectance, ReflectanceSetting, Result, Session, SessionOptions, Settings, Volume,
    evaluate, job, read, read_truth, reconstruct, reconstruct_file, reconstruct_with, session, write,
};
use thirdbounce_simulate::{RenderOptions, Scene, simulate};

/// A small solve of the same bits in every run.
fn small() -> Settings {
    let method = SurfaceSettings { lateral: Some(16), iterations: Some(20), ..SurfaceSettings::default() };
    Settings { deterministic: Some(true), method: method.into(), ..Settings::default() }
}

/// Photons of a plate, in a file that is written into `folder`.
fn simulated(folder: &Path) -> std::path::PathBuf {
    let scene = Scene {
        scan: 8,
        bin_width: 0.02,
        occlusion: false,
        photons: Some(200.0),
        ..Scene::named("plates-front").unwrap()
    };
    let simulated = simulate(&scene, &RenderOptions { noise: 0.05, ..Default::default() }).unwrap();
    let file = folder.join("capture.npz");
    thirdbounce::capture::write(&simulated.capture, &file).unwrap();
    file
}

/// Estimates, solve and mask are those of the command, bit for bit; those of a session, too, on a fixed support.
#[test]
fn reconstruct_returns_the_maps_of_the_command() {
    let gpu = host();
    let folder = tempfile::tempdir().unwrap();
    let path = simulated(folder.path());
    let capture = read(&path, &small()).unwrap();

    let texts = [("lateral", "16"), ("iterations", "20"), ("deterministic", "true")];
    let settings = Settings::from_texts(texts).unwrap();
    assert_eq!(settings, small());
    let loaded = job::load(&path, &settings).unwrap();
    assert_eq!(capture, loaded.capture);
    let request = Request::new(settings, folder.path().join("out"));
    assert!(request.job(&capture).models.len() > 1, "fits choose the model");
    let of_command = job::run(&request, &loaded, &mut |_| ControlFlow::Continue(())).unwrap();
    // No depth is no number, which does not equal itself: as text.
    let want = format!("{:?}", of_command.maps);

    let solved = reconstruct(&gpu, &capture, &small()).unwrap();
    assert!(format!("{:?}", solved.maps) == want);
    assert!(solved.maps.mask.contains(&true) && solved.volume.is_none());
    assert_eq!(solved.verdict.as_deref(), Some(&of_command.verdict));
    // The note on the impulse response ends with seconds. The first one of the command is on the preset.
    let plain = |note: &String| note.split(" tried in ").next().map(str::to_owned);
    assert_eq!(solved.notes.len(), 4, "start, high-pass, model and pulse");
    assert!(solved.notes.iter().map(plain).eq(of_command.notes[1..5].iter().map(plain)));
    let last = solved.trace.last().unwrap();
    assert!(last.seconds > 0.0 && last.seconds <= solved.solve_seconds);
    let written = write(folder.path().join("maps"), &solved.maps).unwrap();
    assert!(written.len() > 3 && written.iter().all(|file| file.is_file()));

    // A session has no candidates and no network: its frames are those of a run whose support is the closed form's.
    let fixed = [texts[0], texts[1], texts[2], ("support", "fixed"), ("begin", "lct")];
    let fixed = Settings::from_texts(fixed).unwrap();
    let want = format!("{:?}", reconstruct(&gpu, &capture, &fixed).unwrap().maps);
    let mut session = session_of(&gpu, &capture, &fixed, SessionOptions::default()).unwrap();
    session.submit(&capture.histograms).unwrap();
    assert!(format!("{:?}", session.wait().unwrap().result.maps) == want);
}

fn session_of(gpu: &Gpu, frame: &Capture, settings: &Settings, options: SessionOptions) -> Result<Session> {
    session(gpu, frame, settings, options).map(|(session, _)| session)
}

/// A session without counts solves in the box, and in the bins, that were asked for.
#[test]
fn a_session_keeps_its_box() {
    let gpu = host();
    let folder = tempfile::tempdir().unwrap();
    let capture = read(simulated(folder.path()), &Settings::default()).unwrap();
    let volume = Volume { min: dvec3(-0.4, -0.3, 0.3), max: dvec3(0.4, 0.3, 0.9) };
    let settings = small().with(|s| {
        s.model = Some(ReflectanceSetting::Known(Reflectance::Lambertian));
        s.set("high_pass", "0.1").unwrap();
        (s.volume, s.keep_volume) = (Some(volume), Some(true));
    });
    let scan = changed(&capture, |c| c.histograms.clear());
    let options = SessionOptions { sum: Some(2), ..Default::default() };
    let mut session = session_of(&gpu, &scan, &settings, options).unwrap();
    session.submit(&capture.histograms).unwrap();
    let result = &session.wait().unwrap().result;
    assert_eq!(result.maps.extent, [-0.4, 0.4, -0.3, 0.3]);
    assert!(result.maps.mask.contains(&true));
    let grid = result.volume.as_ref().unwrap().grid;
    assert!(grid.depth_range()[0] > 0.2 && grid.depth_range()[1] < 1.0, "{grid:?}");
}

/// Points are the scan's, counts the frames': a session takes the former from a calibration.
#[test]
fn a_session_takes_the_points_of_a_calibration() {
    let gpu = host();
    let folder = tempfile::tempdir().unwrap();
    let capture = read(simulated(folder.path()), &Settings::default()).unwrap();
    let calibrated = |law: &str| {
        let file = folder.path().join("rig.json");
        let text = format!(
            r#"{{"corrections": [{{"law": "{law}", "numbers": [0.1], "middle": [0, 0], "half": 1}}]}}"#
        );
        std::fs::write(&file, text).unwrap();
        let settings = small().with(|s| s.set("calibrate", file.to_str().unwrap()).unwrap());
        session_of(&gpu, &capture, &settings, SessionOptions::default())
    };
    let moved = changed(&capture, |c| c.laser.iter_mut().chain(&mut c.sensor).for_each(|p| *p *= 1.1));
    let own = session_of(&gpu, &moved, &small(), SessionOptions::default());
    let [of_file, own] = [calibrated("scale"), own].map(|session| {
        let mut session = session.unwrap();
        session.submit(&capture.histograms).unwrap();
        session.wait().unwrap().result.maps.extent
    });
    assert!(of_file.iter().zip(own).all(|(a, b)| (a - b).abs() < 1e-9), "{of_file:?} {own:?}");
    assert_error(calibrated("walk").map(drop), Kind::Options, &["\"walk\" changes counts"]);
}

#[test]
fn settings_out_of_range_are_refused() {
    let gpu = host();
    let folder = tempfile::tempdir().unwrap();
    let capture = read(simulated(folder.path()), &Settings::default()).unwrap();
    let flat = Volume { min: dvec3(-0.5, -0.5, 0.0), max: dvec3(0.5, 0.5, 0.001) };
    let surface = |change: fn(&mut SurfaceSettings)| {
        let mut method = SurfaceSettings::default();
        change(&mut method);
        Settings { method: method.into(), ..small() }
    };
    let refused: [(Settings, &[&str]); 5] = [
        (surface(|o| o.lateral = Some(0)), &["lateral is 0"]),
        (surface(|o| o.sparsity = Some(f64::NAN)), &["sparsity is NaN"]),
        (small().with(|s| s.mask_fraction = Some(1.5)), &["the mask fraction is 1.5"]),
        (small().with(|s| s.mask_fraction = Some(f64::NAN)), &["the mask fraction is NaN"]),
        (small().with(|s| s.volume = Some(flat)), &["0.001"]),
    ];
    for (settings, words) in refused {
        assert_error(reconstruct(&gpu, &capture, &settings).map(drop), Kind::Options, words);
        let session = session_of(&gpu, &capture, &settings, SessionOptions::default());
        assert_error(session.map(drop), Kind::Options, words);
    }
    let bad = SessionOptions { mask_fraction: Some(-1.0), ..SessionOptions::default() };
    assert_error(session_of(&gpu, &capture, &small(), bad).map(drop), Kind::Options, &["-1"]);
    let broken = reconstruct_with(&gpu, &capture, &small(), &mut |_| ControlFlow::Break(()));
    assert_error(broken.map(drop), Kind::Cancelled, &[]);
    let thinned = small().with(|s| s.stride = Some(2));
    let thinned = session_of(&gpu, &capture, &thinned, SessionOptions::default());
    assert_error(thinned.map(drop), Kind::Options, &["stride applies where a capture is read"]);
    let pulse = small().with(|s| s.set("pulse", "60ps").unwrap());
    let with_pulse = pulse.for_frames(&capture).unwrap();
    assert!((with_pulse.pulse.as_ref().unwrap().fwhm() / 0.018 - 1.0).abs() < 0.02);
    assert!(matches!(pulse.with_instrument(&with_pulse), Ok(std::borrow::Cow::Borrowed(_))));
    let cut = changed(&capture, |c| c.histograms.truncate(9));
    assert_error(reconstruct(&gpu, &cut, &small()).map(drop), Kind::Input, &["counts"]);
    let session = session_of(&gpu, &cut, &small(), SessionOptions::default());
    assert_error(session.map(drop), Kind::Input, &["counts"]);
}

/// From a scene to figures without the command.
#[test]
fn a_program_simulates_reconstructs_and_measures() {
    let gpu = host();
    let folder = tempfile::tempdir().unwrap();
    let scene = Scene { scan: 8, bin_width: 0.02, occlusion: false, ..Scene::named("plates-front").unwrap() };
    let options = RenderOptions { noise: 0.05, ..Default::default() };
    let (capture, truth) = thirdbounce_simulate::with_truth(&scene, &options, 32).unwrap();
    assert!(format!("{capture:?}").len() < 300, "a capture is shown as a summary: {capture:?}");
    let [file, of_truth] = ["capture.npz", "truth.npz"].map(|name| folder.path().join(name));
    thirdbounce::capture::write(&capture, &file).unwrap();
    thirdbounce::export::npz::write_truth(&of_truth, &truth).unwrap();
    let out = folder.path().join("out");
    let go_on = &mut |_: &thirdbounce::engine::Progress| ControlFlow::Continue(());
    let done = reconstruct_file(&gpu, &file, &small(), Some(&of_truth), &out, go_on).unwrap();
    for name in ["report.html", "report.json", "maps.npz"] {
        assert!(done.files.contains(&out.join(name)), "{name}: {:?}", done.files);
    }
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("\"difference\":\"iVBOR"), "the map of differences is a PNG on the page");
    let again = evaluate(&done.maps, &read_truth(&of_truth).unwrap(), None).unwrap();
    assert!(again.iou.unwrap() > 0.3 && done.metrics == Some(again));
    let refused = reconstruct_file(&gpu, folder.path().join("none.npz"), &small(), None, &out, go_on);
    assert_error(refused.map(|r| r.notes), Kind::Input, &["none.npz"]);
}
