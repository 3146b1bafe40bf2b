//! A capture of the empty room: simulated, subtracted where held-out pairs do not speak against it, refused if it is of another scan.

use std::path::Path;

use fixtures::command::{fail, succeed};
use serde_json::Value;
use thirdbounce::capture::{Capture, read, write};
use thirdbounce::{Settings, job};

fn report(folder: &str) -> Value {
    serde_json::from_slice(&std::fs::read(Path::new(folder).join("report.json")).unwrap()).unwrap()
}

#[test]
fn the_empty_room_is_subtracted_with_its_gain_and_other_captures_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let scene = ["simulate", "beyond", "--scan", "16", "--bin-width", "0.012", "--photons", "1000"];
    let simulate = |more: &[&str], out: &str| {
        let rest = ["--noise", "0.03", "--quiet", "--out", &at(out), "--truth", &at("truth.npz")];
        succeed(&[&scene[..], &rest, more].concat());
    };
    // The laser is 3 % weaker in the capture.
    simulate(&["--empty-out", &at("empty.npz"), "--empty-drift", "0.0309,0"], "c.npz");
    let solve = |more: &[&str], out: &str| {
        let args =
            ["reconstruct", &at("c.npz"), "--out", &at(out), "--lateral", "32", "--truth", &at("truth.npz")];
        succeed(&[&args[..], more].concat());
        report(&at(out))
    };
    let iou = |report: &Value| report["metrics"]["iou"].as_f64().expect("an IoU");
    let drawn = solve(&[], "drawn");
    let emptied = solve(&["--empty", &at("empty.npz")], "emptied");
    let found = &emptied["settings"]["empty_found"];
    assert!(drawn["settings"]["empty_found"].is_null() && found["is_used"] == true, "{found}");
    let gain = found["gain"][1].as_f64().unwrap();
    // The figure shades a part of the floor.
    assert!((0.85..0.99).contains(&gain), "{gain}");
    assert_eq!(
        (&found["left"][0][0], &found["left"][1][0]),
        (&"none".into(), &"subtracted".into()),
        "{found}"
    );
    let left = |of: usize| found["left"][of][1][0].as_f64().unwrap();
    assert!(left(1) < 0.5 * left(0), "{found}");
    assert!(iou(&emptied) > iou(&drawn) + 0.15, "{} {}", iou(&emptied), iou(&drawn));
    let notes = emptied["settings"]["notes"].to_string();
    assert!(notes.contains("the empty capture is subtracted"), "{notes}");

    let empty = read(Path::new(&at("empty.npz"))).unwrap();
    let changed = |change: &dyn Fn(&mut Capture), name: &str| {
        let mut other = empty.clone();
        change(&mut other);
        write(&other, Path::new(&at(name))).unwrap();
    };
    changed(&|c| *c = c.binned(2).unwrap(), "bins.npz");
    changed(&|c| c.t_start += 0.3, "zero.npz");
    changed(&|c| c.laser.iter_mut().chain(&mut c.sensor).for_each(|p| p.x += 0.2), "rig.npz");
    for (name, why) in [
        ("bins.npz", "bins of 24.0000 mm, the capture"),
        ("zero.npz", "begins at 0.3000 m"),
        ("rig.npz", "of another scan: it holds"),
        ("none.npz", "none.npz"),
    ] {
        fail(&["reconstruct", &at("c.npz"), "--empty", &at(name), "--out", &at("x")], 1, why);
        assert!(!Path::new(&at("x")).exists(), "{name}");
    }
    // Pairs that the empty capture does not hold are left out.
    changed(&|c| *c = c.keep(&(5..256).collect::<Vec<_>>(), [251, 1]), "fewer.npz");
    let settings = Settings { empty: Some(at("fewer.npz").into()), ..Settings::default() };
    let loaded = job::load(Path::new(&at("c.npz")), &settings).unwrap();
    assert_eq!(loaded.capture.pair_count(), 251);
    assert!(
        loaded.notes.iter().any(|note| note.starts_with("5 pairs that the empty capture")),
        "{:?}",
        loaded.notes
    );
    assert_eq!(loaded.capture.empty.map(|e| e.len()), Some(251 * loaded.capture.bins));
}

#[test]
fn a_poor_empty_capture_does_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    succeed(&[
        "simulate",
        "figure",
        "--scan",
        "16",
        "--bin-width",
        "0.012",
        "--photons",
        "300",
        "--dark",
        "3",
        "--noise",
        "0.05",
        "--quiet",
        "--out",
        &at("c.npz"),
        "--empty-out",
        &at("e.npz"),
        "--empty-share",
        "0.002",
    ]);
    succeed(&["reconstruct", &at("c.npz"), "--out", &at("r"), "--lateral", "32", "--empty", &at("e.npz")]);
    let found = report(&at("r"))["settings"]["empty_found"].clone();
    assert_eq!(found["is_used"], false, "{found}");
    fail(&["simulate", "figure", "--out", &at("f.npz"), "--empty-out", &at("g.npz")], 1, "no room");
    assert!(!Path::new(&at("f.npz")).exists());
}

#[test]
fn a_result_of_one_laser_becomes_a_confocal_capture() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    succeed(&[
        "simulate",
        "plane",
        "--scan",
        "16",
        "--pairs",
        "one-laser",
        "--bin-width",
        "0.012",
        "--noise",
        "0.03",
        "--quiet",
        "--out",
        &at("c.npz"),
        "--truth",
        &at("t.npz"),
    ]);
    let solve = |capture: &str, out: &str, more: &[&str]| {
        let args =
            ["reconstruct", &at(capture), "--out", &at(out), "--lateral", "32", "--truth", &at("t.npz")];
        succeed(&[&args[..], more].concat());
        report(&at(out))["metrics"]["iou"].as_f64().unwrap()
    };
    let surface = solve("c.npz", "r", &[]);
    let said = succeed(&["convert", &at("r"), &at("wall.npz"), "--as-confocal", "32x32"]);
    assert!(said.contains("% of the light of") && said.contains("of 1024 pairs are measured"), "{said}");
    let made = read(Path::new(&at("wall.npz"))).unwrap();
    assert!(made.scan == [32, 32] && made.laser == made.sensor && !made.integer_counts);
    // Paths of a report are those of the folder in which the run was: another folder finds the capture beside the result.
    let path = Path::new(&at("r")).join("report.json");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace(&at("c.npz"), "c.npz")).unwrap();
    succeed(&["convert", &at("r"), &at("again.npz"), "--as-confocal", "32x32"]);
    assert!(read(Path::new(&at("again.npz"))).unwrap().histograms == made.histograms);
    let lct = solve("wall.npz", "l", &["--solver", "lct"]);
    assert!(lct > 0.85 * surface, "{lct} {surface}");
    fail(&["convert", &at("r"), &at("w.npz"), "--as-confocal", "32"], 1, "columns x rows");
    fail(&["convert", &at("c.npz"), &at("w.npz"), "--as-confocal", "8x8"], 1, "report.json");
    std::fs::remove_file(at("c.npz")).unwrap();
    fail(&["convert", &at("r"), &at("w.npz"), "--as-confocal", "8x8"], 1, "is not there");
    assert!(!Path::new(&at("w.npz")).exists());
}
