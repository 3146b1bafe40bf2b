//! Warnings reach the terminal, the report, the page and the lines of a batch; what cannot be ends with 1.

use fixtures::command::{fail, stderr, stdout, succeed, thirdbounce};
use serde_json::Value;
use thirdbounce::capture::{read, write};

const SHORT: [&str; 8] = ["--model", "cosine", "--lateral", "16", "--iterations", "8", "--support", "fixed"];

#[test]
fn warnings_reach_every_output() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (capture, out) = (path("spheres.npz"), path("result"));
    succeed(&["simulate", "spheres", "--out", &capture, "--scan", "16", "--bin-width", "0.03"]);
    let half = ["--wall", "0.45"];
    let words = "half its width";
    let told = succeed(&[&["info", &capture, "--json"], &half[..], &SHORT[..]].concat());
    let told: Value = serde_json::from_str(&told).unwrap();
    assert!(told["warnings"].to_string().contains(words), "{}", told["warnings"]);
    assert!(
        succeed(&[&["info", &capture], &half[..], &SHORT[..]].concat()).contains("warning   over the scan")
    );
    let run = [&["reconstruct", &capture, "--out", &out, "--no-preview"], &half[..], &SHORT[..]].concat();
    let done = thirdbounce(&run);
    assert!(done.status.success() && stderr(&done).contains("warning: over the scan"), "{}", stderr(&done));
    let report: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("result/report.json")).unwrap()).unwrap();
    assert!(report["warnings"].to_string().contains(words), "{}", report["warnings"]);
    assert!(std::fs::read_to_string(folder.path().join("result/report.html")).unwrap().contains(words));
    let all = path("batch");
    let batch = [&["batch", &capture, "--out", &all], &half[..], &SHORT[..]].concat();
    let done = thirdbounce(&batch);
    let line: Value = serde_json::from_str(stdout(&done).lines().next().unwrap()).unwrap();
    assert!(line["status"] == "done" && line["warnings"].to_string().contains(words), "{line}");
    assert!(stderr(&done).contains(": over the scan"), "{}", stderr(&done));
    let quiet = thirdbounce(&[&run[..], &["--quiet"]].concat());
    assert_eq!(stderr(&quiet), "");
}

#[test]
fn what_cannot_be_ends_with_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (sound, wrong) = (path("sound.npz"), path("picoseconds.npz"));
    succeed(&["simulate", "plane", "--out", &sound, "--scan", "8", "--bin-width", "0.03"]);
    let mut capture = read(folder.path().join("sound.npz").as_path()).unwrap();
    capture.bin_width /= 0.000_299_792_458;
    capture.t_start /= 0.000_299_792_458;
    write(&capture, folder.path().join("picoseconds.npz").as_path()).unwrap();
    for verb in ["info", "reconstruct"] {
        let out = path("none");
        let more: &[&str] = if verb == "info" { &[] } else { &["--out", &out] };
        fail(&[&[verb, &wrong], more].concat(), 1, "looks like picoseconds");
        assert!(!folder.path().join("none").exists());
    }
    // A method that does not take these pairs is a problem.
    let pairs = path("pairs.npz");
    succeed(&[
        "simulate",
        "plane",
        "--out",
        &pairs,
        "--scan",
        "8",
        "--bin-width",
        "0.03",
        "--pairs",
        "one-laser",
    ]);
    let done = thirdbounce(&["info", &pairs, "--solver", "lct"]);
    assert_eq!(done.status.code(), Some(1), "{}", stderr(&done));
    assert!(stdout(&done).contains("problem "), "{}", stdout(&done));
    succeed(&["info", &sound, "--solver", "lct"]);
    // Settings of files.
    fail(&["info", &sound, "--axes", "xyz"], 2, "xyt");
}
