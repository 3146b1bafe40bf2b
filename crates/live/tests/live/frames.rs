//! `thirdbounce live`: frames from a folder and from the standard input, good and broken, and the page in a browser.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use fixtures::command::{fail, program, stderr, stdout, succeed};
use serde_json::Value;
use thirdbounce::capture;
use thirdbounce::export::npz;
use thirdbounce_live::write;

use fixtures::browser::{browser, image_colours, look};

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
    let truth = folder.path().join("truth/frame-0001.npz");
    std::fs::copy(&truth, frames.join("frame-0001b.npz")).unwrap();
    // Nobody names the model.
    let more = ["live", &source, "--capture", &scan, "--feed", "every", "--frames", "3", "--out", &out];
    let output = Command::new(program()).args(more).args(QUICK).output().unwrap();
    let (text, errors) = (stdout(&output), stderr(&output));
    assert_eq!(output.status.code(), Some(1), "{errors}");
    let lines: Vec<&str> = text.lines().filter(|l| l.starts_with("frame-")).collect();
    assert!(lines.len() == 3 && lines[0].contains(" cold ") && lines[2].contains(" warm "), "{text}");
    assert!(errors.contains("the model of reflectance: ") && errors.contains(", by trials"), "{errors}");
    assert!(errors.matches("error:").count() == 1 && errors.contains("frame-0001b.npz"), "{errors}");
    assert!(text.contains("4 frames: 3 solved, 0 dropped, 1 failed; latency: median"), "{text}");
    assert!(Path::new(&out).join("maps.npz").exists());
    let lines = kept(&out);
    let names: Vec<_> =
        lines.iter().map(|l| (l["frame"].as_str().unwrap(), l["status"].as_str().unwrap())).collect();
    let solved = |name| (name, "solved");
    let mut sorted = names.clone();
    sorted.sort_unstable();
    assert_eq!(
        sorted,
        [solved("frame-0000"), solved("frame-0001"), ("frame-0001b", "failed"), solved("frame-0002")]
    );
    for line in lines.iter().filter(|l| l["status"] == "solved") {
        let maps = npz::read_maps(&Path::new(&out).join(line["maps"].as_str().unwrap())).unwrap();
        assert_eq!(maps.mask.iter().filter(|m| **m).count() as u64, line["pixels"].as_u64().unwrap());
        assert!(
            (0.0..1.0).contains(&line["residual"].as_f64().unwrap()) && line["depth_error"].is_number(),
            "{line}"
        );
    }
    let failed = lines.iter().find(|l| l["status"] == "failed").unwrap();
    assert!(failed["error"].as_str().unwrap().contains("frame-0001b.npz: ") && failed["hint"].is_string());
}

/// A script copies files into the folder: bad ones fail at once and block nothing, a cut one is corrected later, another format is a
/// frame, the wall moves, files that are no frames are named, and the numbers of the summary add up.
#[test]
fn bad_files_block_nothing_and_are_read_again_when_they_change() {
    let (folder, frames) = frames();
    let [source, scan, out] =
        [folder.path().join("in"), frames.join("frame-0000.npz"), folder.path().join("out")]
            .map(|p| p.to_string_lossy().into_owned());
    std::fs::create_dir(&source).unwrap();
    let place = |name: &str| Path::new(&source).join(name);
    let copy = |from: &str, to: &str| std::fs::copy(folder.path().join(from), place(to)).unwrap();
    copy("frames/frame-0000.npz", "a-old.npz");
    std::fs::write(place("notes.txt"), "Tuesday").unwrap();
    let more = ["--feed", "every", "--frames", "4", "--new-only", "--out", &out];
    let mut command = Command::new(program());
    let child = command.args(arguments(&source, &scan, &more)).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = Running(child.spawn().unwrap());
    let mut errors = BufReader::new(child.0.stderr.take().unwrap()).lines().map(|l| l.unwrap());
    let mut heard = vec![errors.next().expect("notes of the first capture")];
    let whole = std::fs::read(frames.join("frame-0001.npz")).unwrap();
    std::fs::write(place("b-cut.npz"), &whole[..whole.len() / 2]).unwrap();
    for i in 0..3 {
        copy("truth/frame-0000.npz", &format!("c-bad{i}.npz"));
    }
    copy("frames/frame-0000.npz", "d-good.npz");
    let mut moved = capture::read(&frames.join("frame-0002.npz")).unwrap();
    capture::write(&moved, &place("e-good.hdf5")).unwrap();
    moved.laser.iter_mut().chain(&mut moved.sensor).for_each(|point| point.x += 0.05);
    capture::write(&moved, &place("f-moved.npz")).unwrap();
    heard.extend(errors.by_ref().take_while(|line| !line.contains("b-cut.npz")));
    std::fs::write(place("b-cut.npz"), &whole).unwrap();
    heard.extend(errors);
    let mut text = String::new();
    child.0.stdout.take().unwrap().read_to_string(&mut text).unwrap();
    let heard = heard.join("\n");
    assert!(
        text.contains("9 frames: 4 solved, 0 dropped, 4 failed, 1 skipped by --new-only; "),
        "{text}{heard}"
    );
    assert!(text.contains("frames/s; 1 file is no frame: notes.txt"), "{text}");
    assert!(heard.contains("note: 1 file is no frame: notes.txt"), "{heard}");
    let warning = "f-moved: its wall points are up to 50.0 mm from those of the scan";
    assert_eq!(heard.matches(warning).count(), 1, "{heard}");
    let lines = kept(&out);
    let of = |name: &str, status: &str| {
        let line = lines.iter().position(|l| l["frame"] == name && l["status"] == status);
        line.unwrap_or_else(|| panic!("{name} {status}: {text}{heard}"))
    };
    let times = [0, 1, 2].map(|i| lines[of(&format!("c-bad{i}"), "failed")]["unix_time"].as_f64().unwrap());
    assert!(times[2] - times[0] < 1.0, "three bad files fail at once: {times:?}");
    let good = ["d-good", "e-good", "f-moved"].map(|name| of(name, "solved"));
    assert!(
        good.into_iter().all(|line| line < of("b-cut", "failed")),
        "the cut file blocks no other: {lines:?}"
    );
    assert!(of("b-cut", "failed") < of("b-cut", "solved"));
    assert!(lines[good[2]]["warnings"][0].as_str().unwrap().contains("50.0 mm"), "{lines:?}");
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
    assert!(text.contains("2 frames: 2 solved, 0 dropped, 0 failed"), "{text}{}", stderr(&output));
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
    // It may end before it has read everything.
    let _ = child.stdin.take().unwrap().write_all(bytes);
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
        (bytes[..100].to_vec(), "ends within frame 0", 0),
        // A frame of another scan.
        ([&bytes[..16], &[1, 0, 0, 0], &bytes[20..]].concat(), "frame 0 has 1 pairs", 0),
    ] {
        let output = piped(&bytes, &scan, &["--feed", "every", "--cold"]);
        let (text, errors) = (stdout(&output), stderr(&output));
        assert_eq!(output.status.code(), Some(i32::from(!words.is_empty())), "{errors}");
        assert_eq!(errors.matches("error:").count(), usize::from(!words.is_empty()), "{errors}");
        assert!(errors.contains(words), "{errors}");
        let failed = usize::from(!words.is_empty());
        let all = format!("{} frames: {solved} solved, 0 dropped, {failed} failed", solved + failed);
        assert!(text.contains(&all), "{text}");
    }
}

#[test]
fn a_stream_without_a_frame_is_an_error() {
    let (_folder, frames) = frames();
    let scan = frames.join("frame-0000.npz").to_string_lossy().into_owned();
    let output = piped(&[], &scan, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("ended before its first frame"), "{}", stderr(&output));
}

/// A second run into one folder, which is killed: every line and its maps remain, with those of the first run.
#[test]
fn a_kill_loses_no_frame() {
    let (folder, frames) = frames();
    let [source, scan, out] = [frames.clone(), frames.join("frame-0000.npz"), folder.path().join("out")]
        .map(|p| p.to_string_lossy().into_owned());
    for (run, keep) in ["2", "1"].into_iter().enumerate() {
        let more = ["--feed", "every", "--out", &out, "--keep", keep];
        let mut command = Command::new(program());
        command.args(arguments(&source, &scan, &more)).stdout(Stdio::piped());
        let mut child = Running(command.spawn().unwrap());
        let mut lines = BufReader::new(child.0.stdout.take().unwrap()).lines().map(|l| l.unwrap());
        assert!(lines.any(|l| l.starts_with("frame-0002 ")), "three frames are solved");
        // The line of the last frame follows what is printed.
        let whole = 3 * (run + 1);
        (0..200).find(|_| {
            std::thread::sleep(Duration::from_millis(20));
            kept(&out).len() == whole
        });
        drop(child);
        assert_eq!(kept(&out).len(), whole);
    }
    let maps: Vec<_> = kept(&out).into_iter().map(|l| l["maps"].as_str().map(String::from)).collect();
    let places = [
        Some("frame-0000"),
        None,
        Some("frame-0002"),
        Some("frame-0000-2"),
        Some("frame-0001"),
        Some("frame-0002-2"),
    ];
    assert_eq!(maps, places.map(|p| p.map(|p| format!("frames/{p}.npz"))));
    for file in maps.into_iter().flatten() {
        npz::read_maps(&Path::new(&out).join(file)).unwrap();
    }
}

#[test]
fn frames_may_be_summed_in_time() {
    let (_folder, frames) = frames();
    let scan = frames.join("frame-0000.npz").to_string_lossy().into_owned();
    let more = ["--feed", "sum:0.5", "--budget", "0.2s", "--min-depth", "20cm", "-q"];
    let output = piped(&stream(&frames), &scan, &more);
    let text = stdout(&output);
    assert!(
        output.status.success() && text.contains("3 frames: ") && text.contains(" summed, 0 failed; "),
        "{text}"
    );
    assert_eq!(text.lines().count(), 1, "{text}");
}

#[test]
fn what_makes_no_sense_is_refused() {
    let (_folder, frames) = frames();
    let scan = frames.join("frame-0000.npz").to_string_lossy().into_owned();
    fail(&arguments("no-such-pipe", &scan, &[]), 1, "no-such-pipe");
    fail(&arguments("-", &scan, &["--feed", "some"]), 1, "--feed");
    fail(&arguments("-", &scan, &["--new-only"]), 1, "--new-only");
    fail(&arguments("-", &scan, &["--feed", "one"]), 1, "--feed");
    fail(&arguments("-", &scan, &["--budget", "-3"]), 1, "--budget");
    fail(&arguments("-", &scan, &["--budget", "3m"]), 2, "milliseconds");
    fail(&arguments("-", &scan, &["--page", "rig:8080"]), 2, "IP address and a port");
    fail(&arguments("-", &scan, &["--page", "203.0.113.1:8080"]), 1, "an address of this machine");
    fail(&arguments("-", &scan, &["--page", "0", "--page-depths", "2m:50cm"]), 2, "50cm:1.5m");
    fail(&arguments("-", &scan, &["--keep", "3"]), 2, "--out");
    fail(&arguments("-", &scan, &["--min-depth", "3s"]), 1, "length in metres");

    fail(&["live", "-", "--capture", &scan, "--solver", "paper"], 1, "follow");
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
#[ignore = "needs chromium: make soak"]
fn a_browser_shows_the_newest_maps() {
    let Some(browser) = browser() else {
        eprintln!("skipped: no chromium is installed");
        return;
    };
    let (folder, frames) = frames();
    let [source, scan] =
        [frames.clone(), frames.join("frame-0000.npz")].map(|p| p.to_string_lossy().into_owned());
    std::fs::copy(folder.path().join("truth/frame-0001.npz"), frames.join("frame-0001b.npz")).unwrap();
    let more = ["--feed", "every", "--page", "0", "--page-depths", "20cm:1.2", "--interval", "100ms"];
    let child = Command::new(program())
        .args(arguments(&source, &scan, &more))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut child = Running(child);
    let mut notes = BufReader::new(child.0.stderr.take().unwrap()).lines().map(|l| l.unwrap());
    let mut lines = BufReader::new(child.0.stdout.take().unwrap()).lines().map(|l| l.unwrap());
    let address = lines.next().unwrap().split_whitespace().last().unwrap().to_string();
    let port = address.trim_end_matches('/').rsplit(':').next().unwrap();
    let note = notes.next().unwrap();
    assert!(note.contains(&format!("ssh -N -L {port}:localhost:{port} ")), "{note}");
    assert!(lines.any(|l| l.starts_with("frame-0002 ")), "three frames are solved");
    std::thread::sleep(Duration::from_millis(500));
    // The screenshot is taken after five seconds of the page's own time.
    let looked = |size: &str, more: &[&str]| look(browser, &address, size, folder.path(), more);
    for width in ["1400", "420"] {
        let kept =
            std::env::var("THIRDBOUNCE_SCREENSHOT").map(|name| PathBuf::from(format!("{name}-{width}.png")));
        let picture = kept.unwrap_or_else(|_| folder.path().join("page.png"));
        looked(&format!("{width},1000"), &[&format!("--screenshot={}", picture.display())]);
        let shown = image_colours(&picture);
        assert!(shown > 40, "albedo, depth and normals are drawn: {shown} colours");
    }
    let text = stdout(&looked("1400,1000", &["--dump-dom"]));
    for words in [
        "<dd>frame-0002</dd>",
        "<dt>Solved</dt><dd class=\"\">3</dd>",
        "<dt>Failed</dt><dd class=\"some\">1</dd>",
        "<dt>Residual</dt>",
        "<dt>Expected depth error</dt>",
        "frame frame-0001b: ",
        "The pictures are old: the last result came ",
        "one is expected every 100 ms",
        "Depth, 0.200 to 1.20 m in all frames",
        "albedo.png?3",
        "depth.png?3",
        "normal.png?3",
    ] {
        assert!(text.replace("<dd class=\"\">frame", "<dd>frame").contains(words), "{words}: {text}");
    }
}

/// The lines of a run with `--out`.
fn kept(out: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(Path::new(out).join("frames.jsonl")).unwrap_or_default();
    text.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect()
}
