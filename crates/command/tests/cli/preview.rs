//! What a run shows before it is done: a picture of what it begins with, better ones, and the time that remains.

use std::ops::ControlFlow;

use fixtures::captures::place;
use fixtures::command::{stderr, thirdbounce};
use thirdbounce::Kind;
use thirdbounce::capture::{Capture, write};
use thirdbounce::engine::Doing;
use thirdbounce::job::{Loaded, PREVIEW, Request, load, run};
use thirdbounce::measure::metrics;
use thirdbounce::methods::{PaperOptions, SolverOptions};
use thirdbounce::settings::Settings;
use thirdbounce::surface::SurfaceOptions;
use thirdbounce_simulate::{RenderOptions, Scene, simulate, truth};

/// A letter at 16 x 16 points, bins of 1 cm.
fn scene() -> Scene {
    Scene { scan: 16, bin_width: 0.01, ..Scene::named("letter-z").unwrap() }
}

fn capture() -> Capture {
    simulate(&scene(), &RenderOptions { noise: 0.02, ..RenderOptions::default() }).unwrap().capture
}

fn loaded(capture: &Capture) -> (tempfile::TempDir, Loaded) {
    let (folder, path) = place("c.npz");
    write(capture, &path).unwrap();
    (folder, load(&path, &Settings::default()).unwrap())
}

fn options() -> SolverOptions {
    let options = SurfaceOptions::default().with(|o| {
        o.lateral = 32;
        o.iterations = 40;
        o.grow = false;
    });
    options.into()
}

#[test]
fn a_first_picture_is_shown_before_the_solve() {
    let (folder, loaded) = loaded(&capture());
    let out = folder.path().join("new").join("out");
    let request = Request { preview: true, ..Request::new(options(), &out) };
    let (mut first, mut sizes) = (None, vec![]);
    run(&request, &loaded, &mut |progress| {
        match (&first, progress.doing) {
            (None, Doing::Preview) => first = progress.maps.clone(),
            (Some(_), Doing::Trial | Doing::Solve) => {}
            // A closed form, of which the first picture is.
            (None, Doing::Trial) => return ControlFlow::Continue(()),
            other => panic!("{:?} comes first, or later again", other.1),
        }
        // The picture is there while the run is under way, and whole.
        let picture = image(&out);
        if sizes.last() != Some(&picture) {
            sizes.push(picture);
        }
        ControlFlow::Continue(())
    })
    .unwrap();
    assert!(!sizes.is_empty());
    assert!(!out.join(PREVIEW).exists() && out.join("report.json").exists());
    // The letter is there to be seen, at its depth.
    let shown = first.expect("a preview");
    let truth = truth(&scene(), shown.nx).unwrap();
    let found = metrics(&shown, &truth, 0.3).unwrap();
    let [iou, depth] = [found.best_iou.unwrap(), found.depth_mae.unwrap()];
    assert!(iou > 0.7 && depth < 0.02, "{found:?}");
}

/// The bytes of the picture.
fn image(out: &std::path::Path) -> Vec<u8> {
    let bytes = std::fs::read(out.join(PREVIEW)).expect("a picture");
    let picture = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().expect("a PNG file");
    assert!(picture.info().width > 2 * picture.info().height - 64, "albedo and depth side by side");
    bytes
}

#[test]
fn what_is_broken_off_leaves_no_picture() {
    let (folder, loaded) = loaded(&capture());
    for last in [Doing::Preview, Doing::Solve] {
        let out = folder.path().join("out");
        let request = Request { preview: true, ..Request::new(options(), &out) };
        let broken = run(&request, &loaded, &mut |progress| {
            if progress.doing == last { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(broken.unwrap_err().kind, Kind::Cancelled);
        assert!(!out.exists(), "{last:?}");
    }
}

#[test]
fn the_volume_of_the_paper_is_shown_on_its_way() {
    let paper = PaperOptions::default().with(|o| (o.lateral, o.iterations) = (16, 4));
    let (folder, loaded) = loaded(&capture());
    let out = folder.path().join("out");
    let request = Request { preview: true, ..Request::new(paper, &out) };
    let mut shown = vec![];
    run(&request, &loaded, &mut |progress| {
        assert!(progress.doing == Doing::Solve, "nothing else comes before");
        shown.push(out.join(PREVIEW).exists());
        ControlFlow::Continue(())
    })
    .unwrap();
    assert!(shown.contains(&true), "{shown:?}");
}

#[test]
fn the_rest_is_expected_to_take_as_long_as_it_does() {
    let (folder, loaded) = loaded(&capture());
    let request = Request::new(options(), folder.path().join("out"));
    let mut reported = vec![];
    run(&request, &loaded, &mut |progress| {
        if progress.doing == Doing::Solve {
            reported.push((progress.point.iteration, progress.point.seconds, progress.remaining));
        }
        ControlFlow::Continue(())
    })
    .unwrap();
    let (last, end, _) = *reported.last().unwrap();
    assert_eq!(last, 40);
    assert_eq!(reported.last().unwrap().2, Some(0.0));
    let all: Vec<_> = reported.iter().filter_map(|(i, at, left)| Some((*i, at + (*left)?))).collect();
    assert!(all.iter().any(|(i, _)| *i <= 30), "the volume reports the surface, too: {reported:?}");
    // A machine that others use may be several times as fast at one time as at another.
    assert!(all.iter().all(|(_, expected)| (0.1..10.0).contains(&(expected / end))), "{reported:?}");
}

#[test]
fn the_command_shows_a_preview_unless_told_not_to() {
    let (folder, path) = place("c.npz");
    write(&capture(), &path).unwrap();
    let out = folder.path().join("out");
    let [capture, out_text] = [&path, &out].map(|p| p.display().to_string());
    let mut all = vec!["reconstruct", &capture, "--out", &out_text, "--model", "cosine"];
    all.extend(["--lateral", "32", "--iterations", "20"]);
    let reported = stderr(&thirdbounce(&all));
    assert!(reported.contains("preview.png shows a first picture"), "{reported}");
    assert!(!out.join(PREVIEW).exists());
    all.push("--no-preview");
    let output = thirdbounce(&all);
    assert!(output.status.success() && !stderr(&output).contains("preview"));
}
