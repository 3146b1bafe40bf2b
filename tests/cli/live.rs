//! `thirdbounce live`: frames from a folder and from streams, good and broken, and the page in a browser.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use fixtures::captures::assert_error;
use fixtures::command::{fail, program, stderr, stdout, succeed};
use fixtures::tags::{Writer, csv, is_t3};
use thirdbounce::live::write;
use thirdbounce::tags::{self, Asked, Division, Record, Scan};
use thirdbounce::{Kind, capture};

use crate::browser::{browser, image_colours, look};

/// Options that make frames quick.
const QUICK: [&str; 8] =
    ["--lateral", "16", "--iterations", "30", "--coarse-iterations", "5", "--surface-iterations", "12"];

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
    assert!(errors.contains("the model of reflectance: lambertian, by trials"), "{errors}");
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

#[test]
fn a_stream_that_breaks_off_is_one_error_and_its_frames_are_solved() {
    let (folder, frames) = frames();
    let bytes = stream(&frames);
    let scan = frames.join("frame-0000.npz").to_string_lossy().into_owned();
    let file = folder.path().join("stream");
    for (bytes, words, solved) in [
        (bytes.clone(), "", 3),
        (bytes[..bytes.len() - 5].to_vec(), "ends within frame 2", 2),
        ([&bytes[..bytes.len() / 3], &b"lies"[..], &bytes[4..200]].concat(), "begins with", 1),
    ] {
        std::fs::write(&file, bytes).unwrap();
        let source = file.to_string_lossy();
        let more = ["--feed", "every", "--cold"];
        let output = Command::new(program()).args(arguments(&source, &scan, &more)).output().unwrap();
        let (text, errors) = (stdout(&output), stderr(&output));
        assert!(output.status.success(), "{errors}");
        assert_eq!(errors.matches("error:").count(), usize::from(!words.is_empty()), "{errors}");
        assert!(errors.contains(words), "{errors}");
        assert!(text.contains(&format!("{solved} frames of {solved} solved")), "{text}");
    }
}

#[test]
fn the_standard_input_is_a_stream_and_frames_may_be_summed_in_time() {
    let (_folder, frames) = frames();
    let scan = frames.join("frame-0000.npz").to_string_lossy().into_owned();
    let more = ["--feed", "sum:0.5", "--budget", "0.2s", "--min-depth", "20cm", "-q"];
    let mut child = Command::new(program())
        .args(arguments("-", &scan, &more))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(&stream(&frames)).unwrap();
    let output = child.wait_with_output().unwrap();
    let text = stdout(&output);
    assert!(output.status.success() && text.contains("of 3 solved, 0 dropped, 0 wrong"), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
}

#[test]
fn connections_are_taken_one_after_the_other() {
    let (_folder, frames) = frames();
    let (scan, bytes) = (frames.join("frame-0000.npz").to_string_lossy().into_owned(), stream(&frames));
    let address = free_address();
    let more = ["--listen", &address, "--feed", "every", "--cold", "--frames", "4"];
    let options = [&["live", "--capture", &scan, "--model", "cosine"][..], &QUICK, &more].concat();
    let mut child = Running(
        Command::new(program())
            .args(options)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command runs"),
    );
    // The second one breaks off within its second frame; the third goes on.
    let frame = bytes.len() / 3;
    for part in [&bytes[..2 * frame], &bytes[..frame + 9], &bytes[2 * frame..]] {
        connected(&address, &mut child.0).write_all(part).expect("it reads");
    }
    let [mut text, mut errors] = [String::new(), String::new()];
    child.0.stdout.take().unwrap().read_to_string(&mut text).unwrap();
    child.0.stderr.take().unwrap().read_to_string(&mut errors).unwrap();
    assert!(child.0.wait().unwrap().success(), "{errors}");
    assert_eq!(text.lines().filter(|l| l.starts_with("frame ")).count(), 4, "{text}");
    assert!(text.contains("4 frames of 4 solved, 0 dropped, 1 wrong"), "{text}");
    assert!(errors.matches("error:").count() == 1 && errors.contains("9 bytes of a header"), "{errors}");
    // An address that is taken is refused.
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    fail(&["live", "--listen", &address, "--capture", &scan, "--model", "cosine"], 1, &address);
}

/// An address on the loopback that nobody uses.
fn free_address() -> String {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string()
}

/// A connection to `program`, as soon as it listens.
fn connected(address: &str, program: &mut Child) -> TcpStream {
    for _ in 0..600 {
        if let Ok(stream) = TcpStream::connect(address) {
            return stream;
        }
        assert!(program.try_wait().unwrap().is_none(), "it ended");
        std::thread::sleep(Duration::from_millis(100));
    }
    panic!("nobody listens at {address}");
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
    fail(&arguments("-", &scan, &["--min-depth", "3s"]), 2, "give a length");

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

const TICK: f64 = 16e-12;
/// Ticks of a laser period.
const PERIOD: i64 = 6250;

/// Time tags of passes over a letter: marker 1 begins each point and marker 3 each pass, the brightest bin has some ten photons,
/// and direct light forty. Two points of a further pass have begun. T2 holds the laser's pulses, T3 does not.
fn passes(capture: &capture::Capture, count: i64, number: i64) -> Writer {
    let tick_path = TICK * 299_792_458.0;
    let t3 = is_t3(number);
    let mut writer = Writer::new(number);
    let (pulses, side) = (if t3 { 1000 } else { 120 }, capture.scan[1]);
    let brightest = capture.histograms.iter().fold(0.0f32, |a, b| a.max(*b));
    let mut begin = 100;
    for point in 0..count * capture.pair_count() as i64 + 2 {
        let bits = if point % capture.pair_count() as i64 == 0 { 5 } else { 1 };
        writer.marker(bits, if t3 { begin } else { begin * PERIOD });
        // Row by row: pair ix * rows + iy is measured as iy * columns + ix.
        let k = point as usize % capture.pair_count();
        let pair = k % side * side + k / side;
        let leg = 400 + k as u32 % 7;
        let photons = |bin: usize| match bin {
            0 => 40,
            _ => (12.0 * capture.histograms[pair * capture.bins + bin - 1] / brightest).round() as usize,
        };
        let all = (0..=capture.bins).flat_map(|bin| (0..photons(bin)).map(move |i| (bin, i)));
        let delay = |bin: usize, i: usize| {
            let path = if bin == 0 { 0.0 } else { capture.t_start + (bin - 1) as f64 * capture.bin_width };
            // Spread over the bin, direct light over three ticks.
            let within = match bin {
                0 => (i % 3) as f64,
                _ => (i as f64 + 0.5) / 12.0 * capture.bin_width / tick_path,
            };
            leg + (path / tick_path + within) as u32
        };
        // One photon for each laser pulse, the rest for the last.
        let mut delays: Vec<Vec<u32>> = vec![vec![]; pulses as usize];
        all.enumerate().for_each(|(n, (bin, i))| delays[n.min(pulses as usize - 1)].push(delay(bin, i)));
        for (sync, delays) in (begin..).zip(&mut delays) {
            writer.sync(sync * PERIOD);
            delays.sort_unstable();
            for delay in delays {
                writer.photon(1, if t3 { sync } else { sync * PERIOD + i64::from(*delay) }, *delay);
            }
        }
        begin += pulses;
    }
    writer
}

/// Appends bytes to a file, part by part.
fn growing(file: &Path, rest: &[u8]) -> std::thread::JoinHandle<()> {
    let (file, rest) = (file.to_path_buf(), rest.to_vec());
    std::thread::spawn(move || {
        let mut file = std::fs::OpenOptions::new().append(true).open(file).unwrap();
        for part in rest.chunks(rest.len() / 20 + 1) {
            std::thread::sleep(std::time::Duration::from_millis(30));
            file.write_all(part).unwrap();
        }
    })
}

#[test]
fn a_growing_text_with_markers_of_frames_is_followed() {
    let (folder, frames) = frames();
    let letter = capture::read(&frames.join("frame-0000.npz")).unwrap();
    // The text is in picoseconds.
    let finer = |record: &Record| match *record {
        Record::Sync { time } => Record::Sync { time: 16 * time },
        Record::Photon { channel, time, delay } => Record::Photon { channel, time: 16 * time, delay },
        Record::Marker { bits, time } => Record::Marker { bits, time: 16 * time },
    };
    // A marker of several bits is a line for each.
    let split = |record: Record| match record {
        Record::Marker { bits: 5, time } => {
            vec![Record::Marker { bits: 4, time }, Record::Marker { bits: 1, time }]
        }
        other => vec![other],
    };
    let writer = passes(&letter, 3, 0x0001_0207);
    let text = csv(&writer.wanted.iter().map(finer).flat_map(split).collect::<Vec<_>>());
    let file = folder.path().join("scan.csv");
    // Cut within a line.
    let (begun, rest) = text.as_bytes().split_at(text.len() / 7);
    std::fs::write(&file, begun).unwrap();
    let writer = growing(&file, rest);
    let source = file.to_string_lossy().into_owned();
    let scan = ["live", &source, "--scan", "8x8", "--wall", "1m", "--pixels", "1", "--rounds", "3"];
    let more = ["--marker-channels", "100,101,102", "--bin-width", "2cm", "--feed", "every", "--frames", "3"];
    let output = Command::new(program()).args([&scan[..], &more, &QUICK].concat()).output().unwrap();
    writer.join().unwrap();
    let (text, errors) = (stdout(&output), stderr(&output));
    assert!(output.status.success() && !errors.contains("error:"), "{errors}");
    let lines: Vec<&str> = text.lines().filter(|l| l.starts_with("frame ")).collect();
    assert!(lines.len() == 3 && lines.iter().all(|l| !l.contains(" 0 pixels of surface")), "{text}");
}

#[test]
fn passes_of_a_growing_file_of_time_tags_are_frames() {
    let (folder, frames) = frames();
    let letter = capture::read(&frames.join("frame-0000.npz")).unwrap();
    let [file, out] = ["scan.ptu", "out"].map(|name| folder.path().join(name));
    let bytes = passes(&letter, 3, 0x0001_0307).file(TICK, 1e-7, &[]);
    // The instrument has begun to write: the header, and a part of a record.
    let (begun, rest) = bytes.split_at((bytes.len() / 7) | 1);
    std::fs::write(&file, begun).unwrap();
    let writer = growing(&file, rest);
    let [source, out] = [file, out].map(|p| p.to_string_lossy().into_owned());
    let more = [
        "live",
        &source,
        "--scan",
        "8x8",
        "--wall",
        "1m",
        "--pixels",
        "1",
        "--bin-width",
        "2cm",
        "--feed",
        "every",
    ];
    let arguments = [&more[..], &["--frames", "3", "--out", &out], &QUICK].concat();
    let output = Command::new(program()).args(arguments).output().unwrap();
    writer.join().unwrap();
    let (text, errors) = (stdout(&output), stderr(&output));
    assert!(output.status.success(), "{errors}");
    assert!(errors.contains("automatic gate: direct light") && !errors.contains("error:"), "{errors}");
    let lines: Vec<&str> = text.lines().filter(|l| l.starts_with("frame ")).collect();
    assert!(lines.len() == 3 && lines[0].contains(" cold ") && lines[2].contains(" warm "), "{text}");
    assert!(lines.iter().all(|line| !line.contains(" 0 pixels of surface")), "{text}");
    assert!(Path::new(&out).join("maps.npz").exists());
    // Every pass has the counts of the same letter.
    let scan = Scan::grid([8, 8], 1.0, false).unwrap();
    let asked = Asked {
        division: Some(Division::Pixels { marker: 1, frame: None }),
        bin_width: Some(0.02),
        ..Asked::default()
    };
    let mut seen = vec![];
    tags::passes(Path::new(&source), &scan, &asked, &|| ControlFlow::Break(()), &mut |pass| {
        seen.push(pass);
        ControlFlow::Continue(())
    })
    .unwrap();
    assert!(seen.len() == 3 && seen.iter().all(|pass| *pass == seen[0]), "{} passes", seen.len());
    let starts = Asked { division: Some(Division::Starts(vec![])), ..asked };
    let refused = tags::passes(Path::new(&source), &scan, &starts, &|| ControlFlow::Break(()), &mut |_| {
        ControlFlow::Continue(())
    });
    assert_error(refused, Kind::Options, &["second pass"]);
    fail(&["live", &source, "--scan", "8x8"], 1, "--wall");
    fail(&["live", "--listen", "127.0.0.1:0", "--scan", "8x8", "--wall", "1m"], 1, "--listen");
}
