//! `thirdbounce live`: frames from a folder and from the standard input, good and broken, and the page in a browser.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use fixtures::command::{fail, program, stderr, stdout, succeed};
use thirdbounce::capture;
use thirdbounce::live::write;

use crate::browser::{browser, image_colours, look};

/// Options that make frames quick.
const QUICK: [&str; 4] = ["--lateral", "16", "--iterations", "30"];

/// Three frames of a letter that moves.
fn frames() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let frames = folder.path().join("frames");
    let [to, truth] = [frames.clone(), folder.path().join("truth")].map(|p| p.to_string_lossy().into_owned());
    let text = succeed(&[
        "simulate",
        "letter:T",
        "--moving",
        "3",
        "--step",
        "0.02",
        "--scan",
        "8",
        "--bin-width",
        "0.02",
        "--noise",
        "0.05",
        "--out",
        &to,
        "--truth",
        &truth,
        "--truth-resolution",
        "32",
    ]);
    assert_eq!(text.lines().count(), 3, "{text}");
    assert!(folder.path().join("truth/frame-0002.npz").exists());
    (folder, frames)
}

fn arguments<'a>(source: &'a str, scan: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["live", source, "--capture", scan, "--model", "cosine"][..], &QUICK, more].concat()
}

/// The frames as a stream.
fn stream(frames: &Path) -> Vec<u8> {
    let mut bytes = vec![];
    for i in 0..3 {
        let capture = capture::read(&frames.join(format!("frame-000{i}.npz"))).unwrap();
        write(&mut bytes, i, capture.bins, &capture.histograms).unwrap();
    }
    bytes
}

#[test]
fn frames_of_a_folder_are_solved_in_order() {
    let (folder, frames) = frames();
    let [source, scan, out] = [frames.clone(), frames.join("frame-0000.npz"), folder.path().join("out")]
        .map(|p| p.to_string_lossy().into_owned());
    // A file that is no capture is one error.
    std::fs::write(frames.join("frame-0001b.npz"), b"no capture").unwrap();
    // Nobody names the model.
    let more = ["live", &source, "--capture", &scan, "--feed", "every", "--frames", "3", "--out", &out];
    let output = Command::new(program()).args(more).args(QUICK).output().unwrap();
    let (text, errors) = (stdout(&output), stderr(&output));
    assert!(output.status.success(), "{errors}");
    let lines: Vec<&str> = text.lines().filter(|l| l.starts_with("frame ")).collect();
    assert!(lines.len() == 3 && lines[0].contains(" cold ") && lines[2].contains(" warm "), "{text}");
    assert!(errors.contains("the model of reflectance: ") && errors.contains(", by trials"), "{errors}");
    assert!(errors.matches("error:").count() == 1 && errors.contains("frame-0001b.npz"), "{errors}");
    assert!(text.contains("3 frames of 3 solved, 0 dropped, 1 wrong; latency: median"), "{text}");
    assert!(Path::new(&out).join("maps.npz").exists());
}

/// A writer that pauses, as one over a network does.
#[test]
fn a_frame_that_is_written_for_seconds_is_waited_for() {
    let (folder, frames) = frames();
    let [source, scan] =
        [folder.path().join("slow"), frames.join("frame-0000.npz")].map(|p| p.to_string_lossy().into_owned());
    std::fs::create_dir(&source).unwrap();
    let options =
        ["live", &source, "--capture", &scan, "--model", "cosine", "--feed", "every", "--frames", "2"];
    let mut command = Command::new(program());
    command.args(options).args(QUICK).stdout(Stdio::piped()).stderr(Stdio::piped());
    let child = command.spawn().unwrap();
    let place = |name: &str| Path::new(&source).join(name);
    let bytes = std::fs::read(frames.join("frame-0001.npz")).unwrap();
    let mut file = std::fs::File::create(place("frame-0001.npz")).unwrap();
    for part in bytes.chunks(bytes.len().div_ceil(4)) {
        std::thread::sleep(Duration::from_millis(800));
        file.write_all(part).unwrap();
    }
    std::fs::copy(frames.join("frame-0002.npz"), place("frame-0002.npz")).unwrap();
    let output = child.wait_with_output().unwrap();
    let text = stdout(&output);
    assert!(text.contains("2 frames of 2 solved, 0 dropped, 0 wrong"), "{text}{}", stderr(&output));
}

/// The output of `live -` with these bytes on its standard input.
fn piped(bytes: &[u8], scan: &str, more: &[&str]) -> std::process::Output {
    let mut child = Command::new(program())
        .args(arguments("-", scan, more))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(bytes).unwrap();
    child.wait_with_output().unwrap()
}

#[test]
fn a_stream_that_breaks_off_is_one_error_and_its_frames_are_solved() {
    let (_folder, frames) = frames();
    let bytes = stream(&frames);
    let scan = frames.join("frame-0000.npz").to_string_lossy().into_owned();
    for (bytes, words, solved) in [
        (bytes.clone(), "", 3),
        (bytes[..bytes.len() - 5].to_vec(), "ends within frame 2", 2),
        ([&bytes[..bytes.len() / 3], &b"lies"[..], &bytes[4..200]].concat(), "begins with", 1),
    ] {
        let output = piped(&bytes, &scan, &["--feed", "every", "--cold"]);
        let (text, errors) = (stdout(&output), stderr(&output));
        assert!(output.status.success(), "{errors}");
        assert_eq!(errors.matches("error:").count(), usize::from(!words.is_empty()), "{errors}");
        assert!(errors.contains(words), "{errors}");
        assert!(text.contains(&format!("{solved} frames of {solved} solved")), "{text}");
    }
}

#[test]
fn frames_may_be_summed_in_time() {
    let (_folder, frames) = frames();
    let scan = frames.join("frame-0000.npz").to_string_lossy().into_owned();
    let more = ["--feed", "sum:0.5", "--budget", "0.2s", "--min-depth", "20cm", "-q"];
    let output = piped(&stream(&frames), &scan, &more);
    let text = stdout(&output);
    assert!(output.status.success() && text.contains("of 3 solved, 0 dropped, 0 wrong"), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
}

#[test]
fn what_makes_no_sense_is_refused() {
    let (_folder, frames) = frames();
    let scan = frames.join("frame-0000.npz").to_string_lossy().into_owned();
    fail(&arguments("no-such-pipe", &scan, &[]), 1, "no-such-pipe");
    fail(&arguments("-", &scan, &["--feed", "some"]), 1, "--feed");
    fail(&arguments("-", &scan, &["--feed", "one"]), 1, "--feed");
    fail(&arguments("-", &scan, &["--budget", "-3"]), 1, "--budget");
    fail(&arguments("-", &scan, &["--budget", "3m"]), 2, "milliseconds");
    fail(&arguments("-", &scan, &["--min-depth", "3s"]), 1, "length in metres");

    fail(&["live", "-", "--capture", &scan, "--solver", "paper"], 1, "follow");
    fail(&["live", "--listen", "127.0.0.1:0", "--capture", &scan], 2, "`thirdbounce live -`");
    fail(&["live", "scan.ptu", "--scan=8x8"], 2, "`thirdbounce histogram`");
}

/// A program that is ended with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_browser_shows_the_newest_maps() {
    let Some(browser) = browser() else {
        eprintln!("skipped: no chromium is installed");
        return;
    };
    let (folder, frames) = frames();
    let [source, scan] =
        [frames.clone(), frames.join("frame-0000.npz")].map(|p| p.to_string_lossy().into_owned());
    let more = ["--feed", "every", "--page", "0"];
    let child = Command::new(program())
        .args(arguments(&source, &scan, &more))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut child = Running(child);
    let mut lines = BufReader::new(child.0.stdout.take().unwrap()).lines().map(|l| l.unwrap());
    let address = lines.next().unwrap().split_whitespace().last().unwrap().to_string();
    assert!(lines.any(|l| l.starts_with("frame 3 ")), "three frames are solved");
    // The screenshot is taken after five seconds of the page's own time.
    let picture = std::env::var("THIRDBOUNCE_SCREENSHOT").map(PathBuf::from);
    let picture = picture.unwrap_or_else(|_| folder.path().join("page.png"));
    let looked = |more: &[&str]| look(browser, &address, "1240,560", folder.path(), more);
    looked(&[&format!("--screenshot={}", picture.display())]);
    let shown = image_colours(&picture);
    assert!(shown > 40, "albedo, depth and normals are drawn: {shown} colours");
    let text = stdout(&looked(&["--dump-dom"]));
    for words in ["frame 3, warm", "latency: median", "albedo.png?3", "depth.png?3", "normal.png?3"] {
        assert!(text.contains(words), "{words}: {text}");
    }
}
