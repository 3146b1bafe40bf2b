//! What moves in frames: a running background or a capture of the empty room is subtracted, and positions, page and table show the rest.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use fixtures::browser::{browser, look};
use fixtures::command::{fail, program, stderr, stdout, succeed, thirdbounce};
use serde_json::Value;

const FRAMES: usize = 22;
const STEP: f64 = 0.08;

/// A ball that moves on a circle, before two plates that rest.
fn frames(folder: &Path, photons: &str, seed: &str) {
    let at = |name: &str| folder.join(name).display().to_string();
    succeed(&[
        "simulate",
        "sphere",
        "--fit",
        "0.2",
        "--room",
        "plates-back",
        "--wall",
        "2",
        "--moving",
        &FRAMES.to_string(),
        "--step",
        &STEP.to_string(),
        "--scan",
        "16",
        "--bin-width",
        "0.024",
        "--photons",
        photons,
        "--seed",
        seed,
        "--noise",
        "0.05",
        "--quiet",
        "--out",
        &at("frames"),
        "--empty-out",
        &at("empty.npz"),
    ]);
}

/// Where the ball is in a frame: on a circle of 0.12 of the wall's side.
fn place(frame: usize) -> [f64; 3] {
    let radius = 0.12 * 2.0;
    let angle = STEP / radius * frame as f64;
    [radius * angle.cos(), radius * angle.sin(), 0.7 + 0.4 * radius * angle.sin()]
}

/// Median error of the first object's positions, metres, frames with one, and those within three standard deviations.
fn errors(table: &Path, from: usize) -> (f64, usize, usize) {
    let text = std::fs::read_to_string(table).unwrap();
    let (mut all, mut near, mut seen) = (vec![], 0, vec![]);
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let frame: usize = cells[0].trim_start_matches("frame-").parse().unwrap();
        if frame < from || seen.contains(&frame) {
            continue;
        }
        seen.push(frame);
        let number = |k: usize| cells[k].parse::<f64>().unwrap();
        let off: Vec<f64> = (0..3).map(|k| number(3 + k) - place(frame)[k]).collect();
        all.push(off.iter().map(|v| v * v).sum::<f64>().sqrt());
        near += usize::from((0..3).all(|k| off[k].abs() < 3.0 * number(6 + k)));
    }
    all.sort_by(f64::total_cmp);
    (all[all.len() / 2], seen.len(), near)
}

const LIVE: [&str; 11] = [
    "--feed",
    "every",
    "--interval",
    "100ms",
    "--lateral",
    "16",
    "--iterations",
    "20",
    "--model",
    "cosine",
    "--frames",
];

#[test]
fn what_moves_has_positions_that_the_room_hides() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    frames(folder.path(), "200", "81021");
    let scan = at("frames/frame-0000.npz");
    let count = FRAMES.to_string();
    let source = at("frames");
    let live = |more: &[&str], out: &str| {
        let (begin, out) = (["live", &source, "--capture", &scan], at(out));
        thirdbounce(&[&begin[..], &LIVE, &[&count, "--out", &out], more].concat())
    };
    let output = live(&["--moving"], "moving");
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("object 0 at ("), "{text}");
    let lines = std::fs::read_to_string(folder.path().join("moving/frames.jsonl")).unwrap();
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    for (number, line) in lines.iter().enumerate() {
        let warns = line["warnings"].to_string().contains("what rests is not known yet");
        assert_eq!(warns, number < 5, "{line}");
        assert_eq!(line["objects"].is_number(), number >= 5, "{line}");
    }
    // The ball was at few places twice: what rests is known.
    let from = 13;
    let (moving, found, near) = errors(&folder.path().join("moving/track.csv"), from);
    assert!(found == FRAMES - from && near >= found - 3, "{found} {near} {moving}");
    // Without it, the plates are the brightest object.
    let tracked = |more: &[&str], out: &str| {
        let folder_out = at(out);
        let args =
            ["track", &source, "--blobs", "1", "--frame-time", "100ms", "--quiet", "--out", &folder_out];
        succeed(&[&args[..], more].concat());
        errors(&folder.path().join(out).join("track.csv"), from)
    };
    let (with_room, ..) = tracked(&[], "room");
    let (emptied, _, near) = tracked(&["--empty", &at("empty.npz")], "emptied");
    assert!(with_room > 0.2 && moving < 0.3 * with_room, "{moving} {with_room}");
    assert!(emptied < 0.06 && near >= FRAMES - from - 3, "{emptied} {near}");
    let report = std::fs::read_to_string(folder.path().join("emptied/track.json")).unwrap();
    assert!(report.contains("the empty capture is subtracted with a mean gain of "), "{report}");

    // The empty capture in place of the background: from the first frame on, and the same table.
    let output = live(&["--empty", &at("empty.npz")], "empty");
    assert!(output.status.success(), "{}", stderr(&output));
    let (empty, found, _) = errors(&folder.path().join("empty/track.csv"), 0);
    assert!(found == FRAMES && empty < 0.06, "{found} {empty}");
    let head = |table: &str| {
        std::fs::read_to_string(folder.path().join(table)).unwrap().lines().next().unwrap().to_owned()
    };
    assert_eq!(head("empty/track.csv"), head("emptied/track.csv"));

    let refused = |more: &[&str], code: i32, why: &str| {
        fail(&[&["live", &source, "--capture", &scan][..], more].concat(), code, why);
    };
    refused(&["--moving", "4"], 1, "give 5 to 1000 frames");
    refused(&["--moving", "--empty", &at("empty.npz")], 2, "--moving");
    refused(&["--empty", &at("none.npz")], 1, "none.npz");
}

#[test]
#[ignore = "needs chromium: make soak"]
fn a_browser_shows_the_outline_and_the_track() {
    let Some(browser) = browser() else {
        eprintln!("skipped: no chromium is installed");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    frames(folder.path(), "200", "4410");
    let [source, scan] =
        ["frames", "frames/frame-0000.npz"].map(|name| folder.path().join(name).display().to_string());
    let args = ["live", &source, "--capture", &scan, "--moving", "--page", "0"];
    let mut child = Command::new(program())
        .args(args)
        .args(&LIVE[..LIVE.len() - 1])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(|l| l.unwrap());
    let address = lines.next().unwrap().split_whitespace().last().unwrap().to_string();
    let last = format!("frame-{:04} ", FRAMES - 1);
    let is_solved = lines.any(|line| line.starts_with(&last));
    std::thread::sleep(std::time::Duration::from_millis(300));
    let picture =
        std::env::var("THIRDBOUNCE_SCREENSHOT").map(|name| format!("--screenshot={name}-moving.png"));
    if let Ok(picture) = &picture {
        look(browser, &address, "1400,1500", folder.path(), &[picture]);
    }
    let text = stdout(&look(browser, &address, "1400,1500", folder.path(), &["--dump-dom"]));
    let _ = child.kill();
    let _ = child.wait();
    assert!(is_solved, "all frames are solved");
    for words in [
        "Outline of what moves; centres",
        "<th>x (m)</th>",
        " ± ",
        "<ellipse ",
        "stroke-width=\"1.5\"",
        "z (m)</text>",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(text.matches("<circle ").count() > 3 * 10, "positions over time are drawn: {text}");
}
