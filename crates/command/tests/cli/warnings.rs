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
    let reported = succeed(&[&["info", &capture, "--json"], &half[..], &SHORT[..]].concat());
    let reported: Value = serde_json::from_str(&reported).unwrap();
    assert!(reported["warnings"].to_string().contains(words), "{}", reported["warnings"]);
    assert!(
        succeed(&[&["info", &capture], &half[..], &SHORT[..]].concat()).contains("warning   over the scan")
    );
    let run = [&["reconstruct", &capture, "--out", &out, "--no-preview"], &half[..], &SHORT[..]].concat();
    let done = thirdbounce(&run);
    assert!(done.status.success() && stderr(&done).contains("warning: over the scan"), "{}", stderr(&done));
    let report: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("result/report.json")).unwrap()).unwrap();
    assert!(report["warnings"].to_string().contains(words), "{}", report["warnings"]);
    // The verdict has the same words everywhere, and is the first line.
    let grade = report["verdict"]["grade"].as_str().unwrap();
    assert!(
        grade != "good" && report["verdict"]["reasons"].to_string().contains(words),
        "{}",
        report["verdict"]
    );
    assert!(stdout(&done).starts_with(&format!("verdict   {grade}: ")), "{}", stdout(&done));
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
    fail(&["info", &sound, "--axes", "xyz"], 1, "xyt");
}

#[test]
fn lines_of_a_hint_stay_lines() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(path("counts.npy"), thirdbounce::files::array::Array::from_i64(&[2, 3], &[1; 6]).to_npy())
        .unwrap();
    let text = stderr(&thirdbounce(&["info", &path("counts.npy")]));
    assert!(
        text.contains("\nimport numpy as np;")
            && text.contains("\np = np.loadtxt")
            && !text.contains("u000a"),
        "{text}"
    );
}

#[test]
fn a_truth_of_another_wall_is_refused_and_meshes_keep_their_size() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let small = ["--scan", "8", "--bin-width", "0.03", "--truth-resolution", "16"];
    let (capture, truth, other) = (path("z.npz"), path("truth.npz"), path("other.npz"));
    succeed(&[&["simulate", "letter-Z", "--out", &capture, "--truth", &truth][..], &small].concat());
    let wide = ["--wall", "2m"];
    succeed(
        &[&["simulate", "letter-Z", "--out", &path("wide.npz"), "--truth", &other][..], &small, &wide]
            .concat(),
    );
    succeed(&[&["reconstruct", &capture, "--out", &path("out"), "--no-preview"][..], &SHORT].concat());
    succeed(&["evaluate", &path("out"), "--truth", &truth]);
    fail(&["evaluate", &path("out"), "--truth", &other], 1, "the same wall");
    let square = "v 0 0 0\nv 6 0 0\nv 6 6 0\nv 0 6 0\nf 1 2 3 4\n".replace('6', ".06");
    std::fs::write(path("tiny.obj"), square).unwrap();
    let mesh = ["simulate", &path("tiny.obj"), "--out", &path("tiny.npz"), "--scan", "4", "--noise", "0.3"];
    assert!(succeed(&mesh).contains("scene     0.060 x 0.060 x 0.000 m, not scaled, turned to the wall"));
    assert!(
        succeed(&[&mesh[..], &["--fit", "60cm"]].concat())
            .contains("scene     0.600 x 0.600 x 0.000 m, fitted")
    );
}
