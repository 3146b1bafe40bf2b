//! The door: `reconstruct` gives what the command gives, and refuses what makes no sense.

use std::ops::ControlFlow;
use std::path::Path;

use fixtures::captures::{assert_error, changed};
use fixtures::device::*;
use glam::dvec3;
use thirdbounce::job::{self, Choice, Input, Request};
use thirdbounce::simulate::{RenderOptions, Scene, simulate};
use thirdbounce::{Kind, OptionValue, Options, SessionOptions, Volume, read, reconstruct, write};

/// A small solve of the same bits in every run.
const SMALL: [(&str, usize); 2] = [("lateral", 16), ("iterations", 20)];

fn small() -> Options {
    let small = SMALL.into_iter().fold(Options::default(), |options, (name, value)| options.set(name, value));
    small.set("accumulation", "repeatable")
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

/// Trials, solve and mask are those of the job that the command runs, bit for bit; those of a session, too.
#[test]
fn the_door_gives_the_maps_of_the_command() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let path = simulated(folder.path());
    let capture = read(&path).unwrap();

    let loaded = job::load(&Input { path, ..Input::default() }).unwrap();
    assert_eq!(capture, loaded.capture);
    let mut options: Vec<(&str, OptionValue)> = SMALL.map(|(name, value)| (name, value.into())).into();
    options.push(("accumulation", "repeatable".into()));
    let choice = Choice { options, ..Choice::default() };
    let out = folder.path().join("out");
    let request = Request { out, ..choice.resolve(&capture).request() };
    assert!(request.models.len() > 1, "trials choose the model");
    let of_command = job::run(&request, &loaded, &mut |_| ControlFlow::Continue(())).unwrap();
    // No depth is no number, which does not equal itself: as text.
    let want = format!("{:?}", of_command.maps);

    let solved = reconstruct(&gpu, &capture, &small()).unwrap();
    assert!(format!("{:?}", solved.maps) == want);
    assert!(solved.maps.mask.contains(&true) && solved.volume.is_none());
    // The note on the pulse goes on with seconds.
    let plain = |note: &String| note.split(" tried in ").next().map(str::to_owned);
    assert_eq!(solved.notes.len(), 3, "high-pass, model and pulse");
    assert!(solved.notes.iter().map(plain).eq(of_command.notes[..3].iter().map(plain)));
    let last = solved.trace.last().unwrap();
    assert!(last.seconds > 0.0 && last.seconds <= solved.seconds);
    let written = write(folder.path().join("door"), &solved.maps).unwrap();
    assert!(written.len() > 3 && written.iter().all(|file| file.is_file()));

    let mut session = small().session(&gpu, &capture, SessionOptions::default()).unwrap();
    session.submit(&capture.histograms).unwrap();
    assert!(format!("{:?}", session.wait().unwrap().result.maps) == want);
}

/// A session without counts solves in the box, and in the bins, that were asked for.
#[test]
fn a_session_of_the_door_keeps_its_box() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let capture = read(simulated(folder.path())).unwrap();
    let volume = Volume { min: dvec3(-0.4, -0.3, 0.3), max: dvec3(0.4, 0.3, 0.9) };
    let options = small().model("lambertian").set("high_pass", 0.1).volume(volume).with_volume();
    let scan = changed(&capture, |c| c.histograms.clear());
    let mut session =
        options.session(&gpu, &scan, SessionOptions { sum: Some(2), ..Default::default() }).unwrap();
    session.submit(&capture.histograms).unwrap();
    let result = &session.wait().unwrap().result;
    assert_eq!(result.maps.extent, [-0.4, 0.4, -0.3, 0.3]);
    assert!(result.maps.mask.contains(&true));
    let grid = result.volume.as_ref().unwrap().grid;
    assert!(grid.depth_range()[0] > 0.2 && grid.depth_range()[1] < 1.0, "{grid:?}");
}

#[test]
fn the_door_refuses_what_makes_no_sense() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let capture = read(simulated(folder.path())).unwrap();
    let flat = Volume { min: dvec3(-0.5, -0.5, 0.0), max: dvec3(0.5, 0.5, 0.001) };
    let refused: [(Options, &[&str]); 9] = [
        (small().set("nonsense", 1), &["surface has no option nonsense"]),
        (Options::default().method("lct").set("iterations", 5), &["lct has no option iterations"]),
        (small().set("lateral", "wide"), &["lateral cannot be", "wide"]),
        (small().set("lateral", 0), &["--lateral is 0"]),
        (small().method("magic"), &["magic"]),
        (small().model("velvet"), &["velvet"]),
        (small().mask_fraction(1.5), &["the mask fraction is 1.5"]),
        (small().mask_fraction(f64::NAN), &["the mask fraction is NaN"]),
        (small().volume(flat), &["0.001"]),
    ];
    for (options, words) in refused {
        assert_error(reconstruct(&gpu, &capture, &options).map(drop), Kind::Options, words);
        let session = options.session(&gpu, &capture, SessionOptions::default());
        assert_error(session.map(drop), Kind::Options, words);
    }
    let bad = SessionOptions { mask_fraction: Some(-1.0), ..SessionOptions::default() };
    assert_error(small().session(&gpu, &capture, bad).map(drop), Kind::Options, &["-1"]);
    // The last value of an option counts.
    let options = small().set("lateral", "wide").set("lateral", 16).watch(|_| ControlFlow::Break(()));
    assert_error(reconstruct(&gpu, &capture, &options).map(drop), Kind::Cancelled, &[]);
    let cut = changed(&capture, |c| c.histograms.truncate(9));
    assert_error(reconstruct(&gpu, &cut, &small()).map(drop), Kind::Input, &["counts"]);
    assert_error(small().session(&gpu, &cut, SessionOptions::default()).map(drop), Kind::Input, &["counts"]);
}
