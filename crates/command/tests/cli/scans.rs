//! The command on every kind of scan.

use fixtures::command::*;
use serde_json::Value;

#[test]
fn every_kind_of_pairs_is_simulated_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let reported = |pairs: &[&str], words: &[&str]| {
        let file = folder.path().join(format!("{}.npz", pairs[1])).display().to_string();
        let usual =
            ["simulate", "plane", "--out", &file, "--scan", "6", "--bin-width", "0.04", "--noise", "0.2"];
        let made = succeed(&[&usual[..], pairs].concat());
        let read = succeed(&["info", &file]);
        for word in words {
            assert!(made.contains(word) && read.contains(word), "{word:?} is not in\n{made}\n{read}");
        }
        file
    };
    reported(
        &["--pairs", "one-laser", "--point", "0.1,-0.2"],
        &["6 x 6 = 36 pairs, one laser point", "flat"],
    );
    reported(&["--pairs", "one-sensor"], &["36 pairs, one sensor point"]);
    let exhaustive = reported(
        &["--pairs", "exhaustive", "--grid", "3"],
        &["9 x 36 = 324 pairs, exhaustive: 9 laser points x 36", "as dense as a lattice of 6 x 6 points"],
    );
    reported(&["--pairs", "irregular"], &["36 x 1 = 36 pairs, irregular", "as dense as a lattice of"]);
    let bump = ["--pairs", "confocal", "--wall-shape", "bump", "--reflectance", "lambertian"];
    reported(&bump, &["36 pairs, confocal", "curved", "normals   known"]);

    let json = |more: &[&str]| -> Value {
        serde_json::from_str(&succeed(&[&["info", "--json"], more].concat())).unwrap()
    };
    let thinned = json(&[&exhaustive, "--stride", "2"]);
    assert_eq!(
        thinned["capture"]["pair_kind"],
        serde_json::json!({"exhaustive": {"lasers": 4, "sensors": 9}})
    );
    let subset =
        |seed: &str| json(&[&exhaustive, "--subset", "50", "--seed", seed])["capture"]["total"].clone();
    assert_eq!(subset("1"), subset("1"));
    assert_ne!(subset("1"), subset("2"), "another seed draws other pairs");
    let box_asked = json(&[&exhaustive, "--volume", "-0.2:0.2,-0.1:0.3,0.4:0.8"])["box"].clone();
    let box_got: Vec<f64> = serde_json::from_value(box_asked).unwrap();
    for (got, asked) in box_got.iter().zip([-0.2, 0.2, -0.1, 0.3, 0.4, 0.8]) {
        assert!((got - asked).abs() < 0.041, "{box_got:?}");
    }
}

#[test]
fn what_a_file_lacks_is_told() {
    use thirdbounce::capture::{read, write};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bump.npz");
    let file = path.display().to_string();
    let bump = ["--wall-shape", "bump", "--scan", "16", "--photons", "5000", "--bin-width", "0.04"];
    succeed(&[&["simulate", "plane", "--out", &file, "--noise", "0.1"], &bump[..]].concat());
    // Unknown normals, and three pairs without counts.
    let mut capture = read(&path).unwrap();
    (capture.laser_normal, capture.sensor_normal) = (None, None);
    for pair in [0, 20, 255] {
        capture.histograms[pair * capture.bins..(pair + 1) * capture.bins].fill(0.0);
    }
    write(&capture, &path).unwrap();
    let text = succeed(&["info", &file]);
    for words in [
        "253 x 1 = 253 pairs, confocal",
        "dropped   3 pairs",
        "as dense as a lattice of 16 x 16",
        "normals   estimated from neighbouring points",
        "note      3 of 256 pairs are left out",
        "note      wall normals were estimated",
    ] {
        assert!(text.contains(words), "{words:?} is not in\n{text}");
    }
    let reported: Value = serde_json::from_str(&succeed(&["info", &file, "--json"])).unwrap();
    assert_eq!(
        (&reported["capture"]["dropped_pairs"], &reported["capture"]["normals_estimated"]),
        (&3.into(), &true.into())
    );
    fail(&["info", &file, "--stride", "2"], 1, "random subset of 64 pairs");
}

#[test]
fn the_schedule_is_printed_for_both_solvers() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("c.npz").display().to_string();
    succeed(&["simulate", "plane", "--out", &file, "--scan", "6", "--bin-width", "0.04", "--noise", "0.2"]);
    let text = succeed(&["schedule", &file, "--lateral", "16"]);
    for words in ["surface, before", "surface, iterations"] {
        assert!(text.contains(words), "{words:?} is not in\n{text}");
    }
    let text = succeed(&["schedule", &file, "--lateral", "16", "--solver", "paper"]);
    let iteration: Vec<_> = text.lines().skip_while(|l| !l.starts_with("volume, iterations")).collect();
    let passes: Vec<_> = iteration[1..].iter().map_while(|l| l.split_whitespace().next()).collect();
    assert_eq!(passes, ["sample", "forward", "residual", "backward", "update", "finish"]);
    assert!(iteration[1].contains("raw") && iteration[1].contains("-> counts sample_points"), "{text}");
}

#[test]
fn a_wall_of_a_millimetre_is_told_like_one_of_a_metre() {
    use thirdbounce::capture::{read, write};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plane.npz");
    let file = path.display().to_string();
    // No bin ends at the near limit.
    let usual = ["simulate", "plane", "--scan", "8", "--bin-width", "0.043", "--noise", "0.2", "--out"];
    succeed(&[&usual[..], &[&file]].concat());
    let metre: Value = serde_json::from_str(&succeed(&["info", &file, "--json"])).unwrap();
    write(&fixtures::captures::scaled(&read(&path).unwrap(), 1e-3), &path).unwrap();
    let small: Value = serde_json::from_str(&succeed(&["info", &file, "--json"])).unwrap();
    for key in ["grid", "problems", "warnings", "plan"] {
        assert_eq!(small[key], metre[key], "{key}");
    }
    let ends = |found: &Value| serde_json::from_value::<Vec<f64>>(found["box"].clone()).unwrap();
    assert!(ends(&small).iter().zip(ends(&metre)).all(|(s, m)| (1e3 * s - m).abs() < 1e-9));
    let text = succeed(&["info", &file]);
    assert!(text.contains("wall      x -0.0005000 to 0.0005000 m"), "{text}");
    assert!(text.contains("of 0.000043000 m"), "{text}");
}

#[test]
fn a_background_that_was_taken_off_is_told() {
    use thirdbounce::capture::{read, write};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plane.npz");
    let file = path.display().to_string();
    let noise = ["--photons", "300", "--dark", "4", "--noise", "0.2", "--bin-width", "0.02"];
    succeed(&[&["simulate", "plane", "--out", &file, "--scan", "8"], &noise[..]].concat());
    let notes = || -> Vec<String> {
        let found: Value = serde_json::from_str(&succeed(&["info", &file, "--json"])).unwrap();
        serde_json::from_value(found["notes"].clone()).unwrap()
    };
    let with = notes();
    let mut capture = read(&path).unwrap();
    capture.histograms.iter_mut().for_each(|v| *v -= 4.0);
    capture.integer_counts = false;
    write(&capture, &path).unwrap();
    let without = notes();
    let reported = |words: &str| without.iter().any(|n| n.contains(words));
    assert!(reported("counts are negative, so the background was taken off"), "{without:?}");
    assert!(reported("some counts are negative: the preset captured is used"), "{without:?}");
    let gates =
        |all: &[String]| -> Vec<String> { all.iter().filter(|n| n.contains("gate")).cloned().collect() };
    assert!(gates(&with).len() == 1 && gates(&with) == gates(&without), "{with:?}, {without:?}");
}
