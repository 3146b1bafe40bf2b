//! Paths that are no text, inputs that are outputs, signals, and memory that is not there.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStringExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use fixtures::command::{fail, program, stderr, stdout, succeed, thirdbounce};

/// Options that make a run short.
const SHORT: [&str; 8] = ["--model", "cosine", "--lateral", "16", "--iterations", "4", "--support", "fixed"];

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
    let [out, by] = ["--out", "--truth"].map(OsString::from);
    let result = odd("result");
    verb("info", &[&c], &short);
    verb("convert", &[&c, &odd("made.hdf5")], &[]);
    verb("reconstruct", &[&c, &out, &result, &by, &t], &short);
    let report = std::fs::read_to_string(Path::new(&result).join("report.json")).unwrap();
    assert!(report.contains("w\u{fffd}\u{fffd}-c.npz"), "the report names the capture");
    verb("evaluate", &[&result, &by, &t], &[]);
    verb("schedule", &[&c], &short);
    let lines = stdout(&verb("batch", &[&c, &out, &odd("batch"), &by, &t], &short));
    assert!(lines.contains("\"status\":\"done\"") && lines.contains("\"summary\":true"), "{lines}");
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
fn a_signal_to_end_ends_a_solve_without_a_result() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, _) = small(folder.path());
    let out = folder.path().join("out");
    for signal in ["-TERM", "-HUP"] {
        let mut command = Command::new(program());
        command.args(["reconstruct", &capture, "--model", "cosine", "--lateral", "16"]);
        command.args(["--iterations", "100000", "--quiet", "--out"]).arg(&out);
        let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        // The solve is under way once there is a preview.
        let preview = out.join(thirdbounce::job::PREVIEW);
        let begun = Instant::now();
        while !preview.is_file() && begun.elapsed() < Duration::from_secs(120) {
            std::thread::sleep(Duration::from_millis(20));
        }
        assert!(preview.is_file(), "no preview");
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
        assert!(!preview.exists() && !out.join("report.json").exists(), "{signal} leaves a result");
    }
}

/// Names of files and in files, and values of options, as a terminal would obey them.
#[test]
fn names_do_nothing_to_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, _) = small(folder.path());
    let odd = folder.path().join("\u{1b}]0;title\u{7}\u{1b}[31m\r\nerror: red\u{9b}.npz");
    std::fs::copy(&capture, &odd).unwrap();
    let odd = odd.to_str().unwrap();
    let member = folder.path().join("member.npz").display().to_string();
    let point = [0u8; 24].to_vec();
    std::fs::write(
        &member,
        fixtures::files::stored_zip(&[("\u{1b}[2J.npy", point.clone()), ("x.npy", point)]),
    )
    .unwrap();
    let out = folder.path().join("out").display().to_string();
    let missing = format!("{odd}.npz");
    for (arguments, code) in [
        (vec!["info", odd, "--lateral", "8"], 0),
        (vec!["info", &missing], 1),
        (vec!["info", &member], 1),
        (vec!["info", odd, "--lateral", "\u{1b}[31m8"], 1),
        (vec!["info", odd, "--\u{1b}[31m"], 2),
        (vec!["reconstruct", &capture, "--gate", "\u{1b}[31m", "--out", &out], 1),
        ([&["batch", odd, &missing, "--out", &out][..], &SHORT].concat(), 1),
        (vec!["convert", odd, odd], 1),
    ] {
        let output = thirdbounce(&arguments);
        let text = stdout(&output) + &stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
        assert!(!text.contains(|c: char| c.is_control() && c != '\n'), "{arguments:?}: {text:?}");
        assert!(stderr(&output).lines().all(|line| !line.starts_with("error: red")), "{text}");
        for line in stdout(&output).lines().filter(|line| line.starts_with('{')) {
            serde_json::from_str::<serde_json::Value>(line).expect("JSON stays JSON");
        }
    }
}

/// Wall points that are all the same, as a file whose points were never filled in has them.
#[test]
fn points_without_aperture_are_not_solved() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, _) = small(folder.path());
    let [same, out] = ["same.npz", "out"].map(|name| folder.path().join(name).display().to_string());
    let whole = thirdbounce::capture::read(Path::new(&capture)).unwrap();
    let written = |one: &mut dyn FnMut(&mut thirdbounce::capture::Capture)| {
        thirdbounce::capture::write(&fixtures::captures::changed(&whole, |c| one(c)), Path::new(&same))
            .unwrap();
        [&["reconstruct", &same, "--out", &out][..], &SHORT].concat()
    };
    let first = vec![whole.laser[0]; whole.pair_count()];
    let none = written(&mut |c| (c.laser, c.sensor) = (first.clone(), first.clone()));
    fail(&none, 1, "the scan has no aperture: all 64 pairs are at");
    fail(
        &[&none[..], &["--volume=-0.5:0.5,-0.5:0.5,0.3:1"]].concat(),
        1,
        "give the wall points of each pair",
    );
    // One laser point and many of the sensor are an aperture.
    succeed(&written(&mut |c| c.laser = first.clone()));
}

/// Hundreds of digits are refused as such, and not shown again.
#[test]
fn numbers_of_many_digits_are_one_short_error() {
    let folder = tempfile::tempdir().unwrap();
    small(folder.path());
    let [large, beyond] = [300, 400].map(|count| "1".repeat(count));
    std::fs::write(folder.path().join("points.csv"), format!("0,0,0\n0.1,{beyond},0\n")).unwrap();
    std::fs::write(folder.path().join("tags.csv"), format!("channel,time\n0,1\n1,{large}\n")).unwrap();
    let tags = "histogram tags.csv --out o.npz --pulses-per-point 1 --zero 0 --scan";
    for (line, code, words) in [
        (format!("reconstruct z.npz --out o --sparsity {large}"), 1, "below 3e38"),
        (format!("reconstruct z.npz --out o --sparsity {beyond}"), 1, "(400 digits)"),
        (format!("reconstruct z.npz --out o --lateral {beyond}"), 1, "(400 digits)"),
        (format!("reconstruct z.npz --out o --depth-pitch {beyond}"), 1, "give a length"),
        (format!("reconstruct z.npz --out o --gate :{beyond}"), 1, "is not a length"),
        (format!("reconstruct z.npz --out o --memory {beyond}"), 1, "(400 digits)"),
        (format!("simulate plane --out o.npz --wall {large}"), 1, "need"),
        (format!("simulate plane --out o.npz --photons {large}"), 1, "(300 digits)"),
        (format!("simulate plane --out o.npz --photons {beyond}"), 2, "beyond all numbers"),
        (format!("{tags} points.csv"), 1, "line 2"),
        (format!("{tags} 2x1 --wall 1m"), 1, "line 3"),
    ] {
        let mut command = Command::new(program());
        let output = command.args(line.split(' ')).current_dir(folder.path()).output().unwrap();
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{line}: {text}");
        assert!(text.contains(words) && text.matches("error:").count() == 1, "{line}: {text}");
        assert!(!text.contains(&"1".repeat(50)), "{line}: {text}");
        assert!(text.split_whitespace().all(|word| word != "inf"), "{line}: {text}");
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
