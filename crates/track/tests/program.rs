//! Positions with their errors: one capture, frames, an empty room, one point, and input that is refused.

use std::path::Path;

use fixtures::command::{fail, stderr, succeed, thirdbounce};
use serde_json::Value;

fn report(folder: &str) -> Value {
    serde_json::from_slice(&std::fs::read(Path::new(folder).join("track.json")).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("numbers").iter().map(|v| v.as_f64().expect("a number")).collect()
}

/// Largest error of a position, in its standard deviations.
fn off(blob: &Value, truth: [f64; 3]) -> f64 {
    let (at, sigma) = (numbers(&blob["position_m"]), numbers(&blob["sigma_m"]));
    (0..3).map(|k| (at[k] - truth[k]).abs() / sigma[k]).fold(0.0, f64::max)
}

#[test]
fn positions_have_the_error_that_they_say() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let simulate = |scene: &str, scan: &str, more: &[&str], out: &str| {
        let args = [
            "simulate",
            scene,
            "--scan",
            scan,
            "--bin-width",
            "0.012",
            "--photons",
            "200",
            "--noise",
            "0.02",
            "--quiet",
        ];
        succeed(&[&args[..], &["--out", &at(out)], more].concat());
    };
    simulate("sphere", "3", &[], "c.npz");
    let said = succeed(&["track", &at("c.npz"), "--out", &at("one")]);
    assert!(said.contains("object 0: x ") && said.contains("wrote "), "{said}");
    let found = report(&at("one"));
    let blobs = found["frames"][0]["blobs"].as_array().unwrap();
    assert!(blobs.len() == 1 && off(&blobs[0], [0.0, 0.0, 0.7]) < 3.0, "{blobs:?}");
    let names = ["track.csv", "track.svg", "track.html", "track.json"];
    assert!(names.iter().all(|name| Path::new(&at("one")).join(name).exists()));
    let table = std::fs::read_to_string(Path::new(&at("one")).join("track.csv")).unwrap();
    assert_eq!(table.lines().count(), 2, "{table}");
    let z = |folder: &str| numbers(&report(folder)["frames"][0]["blobs"][0]["sigma_m"])[2];
    succeed(&["track", &at("c.npz"), "--out", &at("ball"), "--shape", "ball", "--quiet"]);
    assert!(z(&at("ball")) < 0.8 * z(&at("one")), "what is known of the shape makes the error smaller");

    // One point measures a distance.
    simulate("sphere", "1", &["--bins", "240"], "point.npz");
    let output = thirdbounce(&["track", &at("point.npz"), "--out", &at("point")]);
    assert!(
        output.status.success() && stderr(&output).contains("do not measure the direction"),
        "{}",
        stderr(&output)
    );
    let found = report(&at("point"));
    let blob = &found["frames"][0]["blobs"][0];
    let [distance, sigma] = ["distance_m", "distance_sigma_m"].map(|key| blob[key].as_f64().unwrap());
    assert!((distance - 0.7).abs() < 3.0 * sigma && sigma < 0.2, "{blob}");
    assert!(numbers(&blob["sigma_m"])[0] > 0.2 && !blob["unmeasured"].is_null(), "{blob}");

    // An object that moves is one object.
    simulate("sphere", "3", &["--moving", "6", "--step", "0.02"], "frames");
    succeed(&[
        "track",
        &at("frames"),
        "--out",
        &at("moved"),
        "--blobs",
        "1",
        "--frame-time",
        "50ms",
        "--quiet",
    ]);
    let found = report(&at("moved"));
    let frames = found["frames"].as_array().unwrap();
    let tracks: Vec<_> = frames.iter().map(|f| f["blobs"][0]["track"].as_u64()).collect();
    assert_eq!(tracks, [Some(0); 6], "{tracks:?}");
    assert!((frames[5]["time_s"].as_f64().unwrap() - 0.25).abs() < 1e-9);
}

#[test]
fn known_positions_make_a_calibration_by_which_others_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    // A ball on a tilted circle; every second frame calibrates.
    let simulate =
        ["simulate", "sphere", "--fit", "0.2", "--moving", "48", "--step", "0.04", "--circle", "0.3"];
    let more = [
        "--scan",
        "2",
        "--bin-width",
        "0.05",
        "--bins",
        "60",
        "--photons",
        "300",
        "--dark",
        "10",
        "--quiet",
        "--out",
    ];
    let frames = at("frames");
    succeed(&[&simulate[..], &more, &[&frames]].concat());
    let mut frames: Vec<String> =
        std::fs::read_dir(at("frames")).unwrap().map(|f| f.unwrap().path().display().to_string()).collect();
    frames.retain(|name| name.ends_with(".npz") && !name.contains("truth"));
    frames.sort();
    assert_eq!(frames.len(), 48);
    let known: Vec<&str> = frames.iter().step_by(2).map(String::as_str).collect();
    let others: Vec<&str> = frames.iter().skip(1).step_by(2).map(String::as_str).collect();
    let place = |frame: usize| {
        let (sine, cosine) = (0.04 / 0.3 * frame as f64).sin_cos();
        [0.3 * cosine, 0.3 * sine, 0.7 + 0.4 * 0.3 * sine]
    };
    let line = |[x, y, z]: [f64; 3]| format!("{x},{y},{z}\n");
    let lines: String = (0..48).step_by(2).map(|frame| line(place(frame))).collect();
    std::fs::write(at("known.csv"), lines).unwrap();
    let (out, file) = (at("calibration"), at("calibration/calibration.json"));
    let gate = ["--gate", "0:3"];
    let said =
        succeed(&[&["track"], &known[..], &gate, &["--calibrate", &at("known.csv"), "--out", &out]].concat());
    assert!(said.contains("pair 3") && said.contains("error     0.0"), "{said}");
    let found = ["--calibration", &file, "--blobs", "1", "--quiet"];
    succeed(&[&["track"], &others[..], &gate, &found, &["--out", &at("found")]].concat());
    let report = report(&at("found"));
    let frames = report["frames"].as_array().unwrap();
    let error = |k: usize| {
        let (found, truth) = (numbers(&frames[k]["blobs"][0]["position_m"]), place(2 * k + 1));
        (0..3).map(|axis| (found[axis] - truth[axis]).abs()).fold(0.0, f64::max)
    };
    let errors: Vec<f64> = (0..24).map(error).collect();
    assert!(errors.iter().all(|error| *error < 0.05), "{errors:?}");
}

#[test]
fn what_cannot_be_tracked_is_one_error_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    for (scan, out) in [("2", "two.npz"), ("3", "three.npz")] {
        succeed(&[
            "simulate",
            "sphere",
            "--scan",
            scan,
            "--bin-width",
            "0.02",
            "--noise",
            "0.1",
            "--quiet",
            "--out",
            &at(out),
        ]);
    }
    std::fs::create_dir(at("nothing")).unwrap();
    let (two, three, none, empty) = (at("two.npz"), at("three.npz"), at("none.npz"), at("nothing"));
    let (one, letters) = (at("one.csv"), at("letters.csv"));
    std::fs::write(&one, "# x, y, z\n0.1,0.2,0.7\n").unwrap();
    std::fs::write(&letters, "0.1,0.2\n").unwrap();
    let cases: [(&[&str], &str); 11] = [
        (&[&two, "--calibrate", &one], "1 captures and 1 positions make no calibration"),
        (&[&two, &two, "--calibrate", &one], "1 positions of 2 captures"),
        (&[&two, "--calibrate", &letters], "line 1 is \"0.1,0.2\""),
        (&[&two, "--calibration", &one], "one.csv"),
        (&[&two, "--calibration", &one, "--blobs", "2"], "a calibration holds the empty room and one object"),
        (&[&two, &three], "its points differ from those of"),
        (&[&none], "none.npz"),
        (&[&empty], "holds no capture"),
        (&[&two, "--frame-time", "0ms"], "the time between frames is 0"),
        (&[&two, "--volume", "-1:1,-1:1,40:50"], "before the box of the positions"),
        (&[&two, "--empty", &three], "the empty capture"),
    ];
    for (args, why) in cases {
        fail(&[&["track"], args, &["--out", &at("x")]].concat(), 1, why);
        assert!(!Path::new(&at("x")).exists(), "{args:?}");
    }
    fail(&["track", &two, "--blobs", "4", "--out", &at("x")], 2, "possible values");
    fail(&["track", &two, "--edge", "0,1", "--out", &at("x")], 2, "direction of the wall");
    let both = ["track", &two, "--calibration", &one, "--shape", "ball", "--out", &at("x")];
    fail(&both, 2, "cannot be used with");
}
