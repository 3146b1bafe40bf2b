//! Paths that are no text, inputs that are outputs, signals, and memory that is not there.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStringExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use fixtures::command::{fail, program, stderr, stdout, succeed};

/// Options that make a run short.
const SHORT: [&str; 8] =
    ["--model", "cosine", "--lateral", "16", "--iterations", "4", "--surface-iterations", "4"];

fn small(folder: &Path) -> (String, String) {
    let [capture, truth] = ["z.npz", "truth.npz"].map(|name| folder.join(name).display().to_string());
    let sizes = ["--scan", "8", "--bin-width", "0.03", "--truth-resolution", "16"];
    succeed(&[&["simulate", "letter-Z", "--out", &capture, "--truth", &truth][..], &sizes].concat());
    (capture, truth)
}

/// Runs a verb whose arguments may be no text.
#[track_caller]
fn well(arguments: &[&OsStr]) -> Output {
    let output = Command::new(program()).args(arguments).output().expect("the command runs");
    assert!(output.status.success(), "{arguments:?}\n{}", stderr(&output));
    output
}

#[test]
fn every_verb_takes_paths_that_are_no_text() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, truth) = small(folder.path());
    let odd = |name: &str| -> OsString {
        folder.path().join(OsString::from_vec([b"w\xff\xfe-", name.as_bytes()].concat())).into_os_string()
    };
    let (c, t) = (odd("c.npz"), odd("t.npz"));
    std::fs::copy(&capture, &c).unwrap();
    std::fs::copy(&truth, &t).unwrap();
    let words = |all: &[&str]| all.iter().map(OsString::from).collect::<Vec<_>>();
    let short = words(&SHORT);
    let verb = |name: &str, paths: &[&OsString], more: &[OsString]| {
        let name = OsString::from(name);
        let all: Vec<&OsStr> = std::iter::once(&name)
            .chain(paths.iter().copied())
            .chain(more)
            .map(OsString::as_os_str)
            .collect();
        well(&all)
    };
    let [out, by, with] = ["--out", "--truth", "--checkpoint"].map(OsString::from);
    let result = odd("result");
    verb("info", &[&c], &short);
    verb("convert", &[&c, &odd("made.hdf5")], &[]);
    verb("reconstruct", &[&c, &out, &result, &by, &t, &with, &odd("state")], &short);
    let report = std::fs::read_to_string(Path::new(&result).join("report.json")).unwrap();
    assert!(report.contains("w\u{fffd}\u{fffd}-c.npz"), "the report names the capture");
    verb("evaluate", &[&result, &by, &t], &[]);
    verb("schedule", &[&c], &short);
    let lines = stdout(&verb("batch", &[&c, &out, &odd("batch"), &by, &t], &short));
    assert!(lines.contains("\"status\":\"done\"") && lines.contains("\"summary\":true"), "{lines}");
    verb(
        "compare",
        &[&c, &out, &odd("compared"), &by, &t],
        &words(&["--method", "vector", "--lateral", "16", "--iterations", "4"]),
    );
    verb("profile", &[&c, &OsString::from("--json"), &odd("profile.json")], &short);
    verb("simulate", &[&OsString::from("plane"), &out, &odd("made.npz")], &words(&["--scan", "8"]));
}

#[test]
fn what_is_read_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, truth) = small(folder.path());
    let before = std::fs::read(&capture).unwrap();
    fail(&["convert", &capture, &capture], 1, "would be written over");
    let around = folder.path().join(".").join("z.npz").display().to_string();
    fail(&["convert", &capture, &around], 1, "would be written over");
    fail(&["calibrate", &capture, "--out", &capture], 1, "would be written over");
    let own = folder.path().display().to_string();
    for name in ["maps.npz", "depth.png"] {
        let place = folder.path().join(name).display().to_string();
        std::fs::copy(&capture, &place).unwrap();
        fail(&[&["reconstruct", &place, "--out", &own][..], &SHORT].concat(), 1, "would be written over");
        assert_eq!(std::fs::read(&place).unwrap(), before);
        std::fs::remove_file(&place).unwrap();
    }
    let maps = folder.path().join("maps.npz").display().to_string();
    std::fs::copy(&truth, &maps).unwrap();
    fail(
        &[&["reconstruct", &capture, "--truth", &maps, "--out", &own][..], &SHORT].concat(),
        1,
        "written over",
    );
}

#[test]
fn a_batch_makes_a_result_anew_when_a_file_beside_it_changes() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, truth) = small(folder.path());
    let out = folder.path().join("results").display().to_string();
    let named = folder.path().join("truth-{}.npz").display().to_string();
    let own = folder.path().join("truth-z.npz");
    std::fs::copy(&truth, &own).unwrap();
    let run = || {
        let text = succeed(&[&["batch", &capture, "--out", &out, "--truth", &named][..], &SHORT].concat());
        text.lines().next().unwrap_or_default().to_string()
    };
    assert!(run().contains("\"done\""));
    assert!(run().contains("\"skipped\""));
    // The same truth at another time.
    let at = std::time::SystemTime::now() + Duration::from_secs(5);
    std::fs::File::options().write(true).open(&own).unwrap().set_modified(at).unwrap();
    assert!(run().contains("\"done\""));
    assert!(run().contains("\"skipped\""));
}

#[test]
fn a_signal_to_end_keeps_the_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, _) = small(folder.path());
    let state = folder.path().join("state");
    for signal in ["-TERM", "-HUP"] {
        let _ = std::fs::remove_file(&state);
        let mut command = Command::new(program());
        command.args([
            "reconstruct",
            &capture,
            "--model",
            "cosine",
            "--lateral",
            "16",
            "--iterations",
            "100000",
        ]);
        command.args(["--stop", "never", "--checkpoint-every", "200", "--quiet", "--checkpoint"]).arg(&state);
        command.arg("--out").arg(folder.path().join("out")).stdout(Stdio::null()).stderr(Stdio::piped());
        let child = command.spawn().unwrap();
        // The solve is under way once there is a checkpoint; the signal must leave another.
        let begun = Instant::now();
        while !state.is_file() && begun.elapsed() < Duration::from_secs(120) {
            std::thread::sleep(Duration::from_millis(20));
        }
        std::fs::remove_file(&state).expect("a checkpoint on the way");
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
        assert!(state.is_file(), "{signal} leaves no checkpoint");
    }
}

#[test]
fn memory_that_is_not_there_is_an_error_and_no_abort() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, _) = small(folder.path());
    let large = folder.path().join("large.npz").display().to_string();
    let out = folder.path().join("copy.npz").display().to_string();
    let sizes = ["--scan", "64", "--bins", "3000", "--bin-width", "0.001"];
    succeed(&[&["simulate", "plane", "--out", &large][..], &sizes].concat());
    fail(&["convert", &large, &out, "--host-memory", "100"], 1, "MiB are free");
    succeed(&["convert", &capture, &out, "--host-memory", "1G"]);
}
