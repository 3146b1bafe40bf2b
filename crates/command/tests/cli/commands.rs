//! The built command, as people run it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use fixtures::command::*;
use serde_json::Value;
use thirdbounce::export::npz;

struct Small {
    folder: tempfile::TempDir,
}

impl Small {
    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }
}

/// A small capture and its truth, simulated once.
fn small() -> &'static Small {
    static SMALL: OnceLock<Small> = OnceLock::new();
    SMALL.get_or_init(|| {
        let small = Small { folder: tempfile::tempdir().expect("a temporary folder") };
        let (capture, truth) = (small.path("z.npz"), small.path("truth.npz"));
        let text = succeed(&[
            "simulate",
            "letter-Z",
            "--out",
            &capture,
            "--truth",
            &truth,
            "--scan",
            "16",
            "--bin-width",
            "0.02",
            "--noise",
            "0.05",
            "--truth-resolution",
            "64",
        ]);
        assert!(text.contains("16 x 16 = 256 pairs, confocal") && text.contains(&truth), "{text}");
        small
    })
}

/// What a user waits for is in the stages of the report: the device's opening, too.
#[test]
fn stages_and_the_clock_agree() {
    let small = small();
    let out = small.path("stages");
    let clock = std::time::Instant::now();
    succeed(&["reconstruct", &small.path("z.npz"), "--lateral", "64", "--out", &out]);
    let waited = clock.elapsed().as_secs_f64();
    let report: Value =
        serde_json::from_str(&std::fs::read_to_string(format!("{out}/report.json")).unwrap()).unwrap();
    let stages = report["totals"]["stages"].as_array().unwrap();
    let sum: f64 = stages.iter().map(|stage| stage["seconds"].as_f64().unwrap()).sum();
    // The start and the end of a process take a few hundredths of a second.
    assert!(sum < waited && waited - sum < 0.05 * waited + 0.05, "{sum} of {waited} s: {stages:?}");
}

/// Options that make a run short.
const SHORT: [&str; 10] = [
    "--solver",
    "paper",
    "--lateral",
    "32",
    "--iterations",
    "30",
    "--double-every",
    "15",
    "--reduce-every",
    "10",
];

fn reconstruct(capture: &str, out: &Path, more: &[&str]) -> Output {
    let out = out.display().to_string();
    let mut arguments = vec!["reconstruct", capture, "--out", &out];
    arguments.extend(SHORT);
    arguments.extend(more);
    thirdbounce(&arguments)
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let read = std::fs::read_dir(folder).map(|all| all.filter_map(|e| e.ok().map(|e| e.path())).collect());
    read.unwrap_or_default()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("the file is there")).expect("it is JSON")
}

#[test]
fn from_a_simulated_capture_to_measured_maps() {
    let small = small();
    let (capture, truth) = (small.path("z.npz"), small.path("truth.npz"));
    let out = tempfile::tempdir().unwrap();
    let result = out.path().join("deep/result");
    let volume = out.path().join("volume.npz");
    let volume_text = volume.display().to_string();
    let done = reconstruct(
        &capture,
        &result,
        &[
            &["--truth", &truth, "--volume-file", &volume_text, "--timings", "--seed", "3"],
            &["--volume", "-0.5:0.5,-0.5:0.5,0.3:1.1"][..],
        ]
        .concat(),
    );
    let (text, progress) = (stdout(&done), stderr(&done));
    assert_eq!(done.status.code(), Some(0), "{progress}");
    assert!(text.contains("IoU") && text.contains("backward"), "{text}");
    assert!(progress.contains("preset synthetic") && progress.contains("iteration 30/30"), "{progress}");

    let names = [
        "maps.npz",
        "maps.mat",
        "maps.exr",
        "maps.svg",
        "albedo.png",
        "depth.png",
        "normal.png",
        "depth_error.png",
        "points.ply",
        "mesh.ply",
        "report.html",
        "report.json",
    ];
    for name in names {
        assert!(std::fs::metadata(result.join(name)).is_ok_and(|m| m.len() > 0), "{name}");
    }
    assert_eq!(entries(&result).len(), names.len(), "{:?}", entries(&result));
    assert!(volume.is_file());

    let maps = npz::read_maps(&result.join("maps.npz")).unwrap();
    let reported = maps.depth_error.expect("a depth_error");
    assert!(
        reported.iter().zip(&maps.depth).all(|(c, z)| c.is_nan() == z.is_nan() && (c.is_nan() || *c > 0.0))
    );

    let report = json(&result.join("report.json"));
    for key in ["version", "device", "settings", "capture", "plan", "trace", "totals", "metrics"] {
        assert!(!report[key].is_null(), "{key}");
    }
    let settings = &report["settings"];
    assert_eq!(settings["preset"], "synthetic");
    assert_eq!((&settings["seed"], &settings["lateral"]), (&3.into(), &32.into()));
    assert_eq!(settings["depth_pitch"], 0.02);
    assert_eq!(settings["reduce_every"], 10);
    for key in ["load_s", "solve_s", "export_s", "pairs", "pairs_per_s", "peak_device_bytes"] {
        assert!(report["totals"][key].as_f64().is_some_and(|v| v > 0.0), "{key}");
    }
    let trace = report["trace"].as_array().unwrap();
    let last = trace.last().unwrap();
    assert_eq!((&last["iteration"], &last["lateral"]), (&30.into(), &32.into()));
    assert!(last["iou"].as_f64().is_some() && last["seconds"].as_f64().is_some());
    assert!(report["plan"]["buffers"]["raw"].as_u64().is_some_and(|b| b > 0));
    assert!(report["metrics"]["best_iou"].as_f64().is_some_and(|iou| iou > 0.4), "{}", report["metrics"]);

    let again = succeed(&["evaluate", &result.display().to_string(), "--truth", &truth, "--json"]);
    let again: Value = serde_json::from_str(&again).unwrap();
    for key in ["iou", "within_depth_error", "calibration"] {
        assert!(!again[key].is_null() && again[key] == report["metrics"][key], "{key}");
    }
    let text = succeed(&["evaluate", &result.display().to_string(), "--truth", &truth]);
    assert!(["IoU", "certain", "solved in"].iter().all(|word| text.contains(word)), "{text}");
    fail(&["evaluate", &out.path().display().to_string(), "--truth", &truth], 1, "maps.npz");
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    let capture = small().path("z.npz");
    let out = tempfile::tempdir().unwrap();
    let maps = |name: &str, seed: &str| {
        let result = out.path().join(name);
        // Every fourth pair is enough.
        let quick = ["--stride", "2", "--deterministic", "--quiet", "--seed", seed];
        let done = reconstruct(&capture, &result, &quick);
        assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
        assert_eq!(stderr(&done), "", "--quiet says nothing");
        let settings = &json(&result.join("report.json"))["settings"];
        assert_eq!(settings["accumulation"], "repeatable");
        let used = settings["accumulation_used"].as_str().unwrap();
        assert!(["owned", "fixed"].contains(&used), "{used}");
        std::fs::read(result.join("maps.npz")).unwrap()
    };
    let first = maps("first", "7");
    assert!(first == maps("second", "7"), "the same seed gave other bits");
    assert!(first != maps("third", "8"), "another seed gave the same bits");
}

#[test]
fn info_and_devices_tell_people_and_programs() {
    let capture = small().path("z.npz");
    let short = ["info", &capture, "--solver", "paper", "--lateral", "32", "--stride", "2"];
    let [short, long] = [succeed(&short), succeed(&[&short[..], &["--plan"]].concat())];
    for words in ["8 x 8 = 64 pairs", "every 2nd", "solver    paper", "32 x 32 x", "memory"] {
        assert!(short.contains(words), "{words:?} is not in\n{short}");
    }
    let rest = long.strip_prefix(&short).expect("the plan stands behind what everybody reads");
    for words in ["adding", "left out", "buffers", "moment_first"] {
        assert!(rest.contains(words) && !short.contains(words), "{words:?} is not only in\n{rest}");
    }
    let reported: Value =
        serde_json::from_str(&succeed(&["info", &capture, "--lateral", "32", "--json"])).unwrap();
    assert_eq!(reported["grid"][0], 32);
    assert_eq!(reported["plan"]["levels"], serde_json::json!([32]));
    assert!(reported["plan"]["total_bytes"].as_u64().is_some_and(|b| b > 1000));
    assert_eq!(reported["capture"]["pairs"], 256);
    let devices: Value = serde_json::from_str(&succeed(&["devices", "--json"])).unwrap();
    assert!(!devices.as_array().unwrap().is_empty());
    assert!(succeed(&["devices"]).starts_with("0: "));
}

/// Without a Vulkan driver the host is the device of every verb, with the threads that are asked for.
#[test]
fn the_host_needs_no_driver() {
    let capture = small().path("z.npz");
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("z").display().to_string();
    let run = |arguments: &[&str]| {
        Command::new(program())
            .args(arguments)
            .args(["--threads", "3"])
            .env("VK_ICD_FILENAMES", "/nonexistent/icd.json")
            .env("VK_DRIVER_FILES", "/nonexistent/icd.json")
            .output()
            .unwrap()
    };
    let succeed = |arguments: &[&str]| {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        stdout(&output)
    };
    let devices: Value = serde_json::from_str(&succeed(&["devices", "--json"])).unwrap();
    assert_eq!((devices.as_array().unwrap().len(), &devices[0]["kind"]), (1, &"host".into()));
    let named = devices[0]["name"].as_str().unwrap();
    for text in [succeed(&["devices"]), succeed(&["info", &capture])] {
        assert!(text.contains(named) && text.contains(", 3 threads"), "{text}");
    }
    let text = succeed(&["reconstruct", &capture, "--lateral", "16", "--iterations", "8", "--out", &out]);
    assert!(text.contains(named) && text.contains(", 3 threads"), "{text}");
    let report: Value =
        serde_json::from_str(&std::fs::read_to_string(format!("{out}/report.json")).unwrap()).unwrap();
    assert_eq!(report["device"]["kind"], "host");
    assert!(report["device"]["driver"].as_str().unwrap().ends_with(", 3 threads"), "{}", report["device"]);
    // Schedulers set the threads of their workers; the option is stronger.
    for (more, threads) in [(&[][..], ", 1 thread"), (&["--threads", "2"], ", 2 threads")] {
        let mut command = Command::new(program());
        let output = command.arg("devices").args(more).env("OMP_NUM_THREADS", "1,2").output().unwrap();
        assert!(stdout(&output).contains(threads), "{}", stdout(&output));
    }
    let refused = run(&["info", &capture, "--device", "vulkan"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(stderr(&refused).contains("Vulkan"), "{}", stderr(&refused));
    fail(&["devices", "--threads", "0"], 2, "0 is not in 1..=1024");
}

#[test]
fn photon_counts_bring_the_captured_set_and_its_gate() {
    let folder = tempfile::tempdir().unwrap();
    let counts = folder.path().join("counts.npz").display().to_string();
    succeed(&["simulate", "plane", "--out", &counts, "--scan", "8", "--photons", "50", "--dark", "0.1"]);
    let reported = |more: &[&str]| -> Value {
        let all = [&["info", &counts, "--solver", "paper", "--lateral", "16", "--json"], more].concat();
        serde_json::from_str(&succeed(&all)).unwrap()
    };
    let all_bins = reported(&["--no-auto-gate"]);
    assert_eq!((&all_bins["preset"], &all_bins["options"]["noise"]), (&"captured".into(), &"bin".into()));
    let gated = reported(&[]);
    assert!(gated["notes"][0].as_str().is_some_and(|n| n.contains("half of the bins")), "{}", gated["notes"]);
    assert_eq!(gated["capture"]["bins"].as_u64(), all_bins["capture"]["bins"].as_u64().map(|b| b / 2));
    let synthetic = reported(&["--preset", "synthetic"]);
    assert_eq!(synthetic["capture"]["bins"], all_bins["capture"]["bins"]);
    assert_eq!(synthetic["options"]["noise"], "off");
}

#[test]
fn convert_keeps_the_capture() {
    let capture = small().path("z.npz");
    let out = tempfile::tempdir().unwrap();
    let there = out.path().join("z.hdf5").display().to_string();
    let back = out.path().join("z.npz").display().to_string();
    succeed(&["convert", &capture, &there]);
    succeed(&["convert", &there, &back]);
    let peak = |path: &str| {
        let reported: Value = serde_json::from_str(&succeed(&["info", path, "--json"])).unwrap();
        (
            reported["capture"]["peak"].clone(),
            reported["capture"]["total"].clone(),
            reported["capture"]["scan"].clone(),
        )
    };
    assert_eq!(peak(&back), peak(&capture));
    fail(&["convert", &capture, &out.path().join("z.txt").display().to_string()], 1, "z.txt");
}

#[test]
fn what_is_wrong_is_said_before_anything_is_written() {
    let small = small();
    let (capture, truth) = (small.path("z.npz"), small.path("truth.npz"));
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result").display().to_string();
    let inside_a_file = format!("{capture}/result");
    let cases: &[(&[&str], i32, &str)] = &[
        (&["/nonexistent/z.npz"], 1, "no such file"),
        (&["/"], 1, "is a folder"),
        (&[&capture, "--gate", "nonsense"], 1, "no colon"),
        (&[&capture, "--gate", "2:1"], 1, "ends before it begins"),
        (&[&capture, "--gate", "50:60"], 1, "outside the recorded paths"),
        (&[&capture, "--stride", "0"], 1, "--stride is 0"),
        (&[&capture, "--stride", "-1"], 1, "--stride is -1"),
        (&[&capture, "--subset", "0"], 1, "--subset is 0"),
        (&[&capture, "--subset", "257"], 1, "from 1 to 256"),
        (&[&capture, "--wall", "NaN"], 1, "wall of NaN"),
        (&[&capture, "--device", "no such device"], 1, "no device is called"),
        (&[&capture, "--device", "0,0"], 1, "a batch one device for each capture"),
        (&[&capture, "--solver", "lct", "--sparsity", "1"], 1, "no option of the solver lct"),
        (&[&capture, "--solver", "surface", "--iterations", "0"], 1, "--iterations is 0"),
        (&[&capture, "--solver", "surface", "--begin", "middle"], 2, "middle"),
        (&[&capture, "--solver", "lct", "--snr", "0"], 1, "--snr is 0"),
        (&[&capture, "--solver", "fk", "--memory", "1M"], 1, "the arrays take"),
        (&[&capture, "--solver", "magic"], 1, "not known"),
        (&[&capture, "--model", "mirror"], 1, "--model is mirror"),
        (&[&capture, "--preset", "best"], 2, "--preset"),
        (&[&capture, "--learning-rate", "NaN"], 1, "--learning-rate is NaN"),
        (&[&capture, "--learning-rate", "-1"], 1, "--learning-rate is -1"),
        (&[&capture, "--l1", "-0.5"], 1, "--l1 is -0.5"),
        (&[&capture, "--beta1", "1"], 1, "--beta1 is 1"),
        (&[&capture, "--lateral", "0"], 1, "--lateral is 0"),
        (&[&capture, "--iterations", "99999999999"], 1, "--iterations"),
        (&[&capture, "--lateral", "4096", "--depth-pitch", "1e-9"], 1, "exceeds 2^30"),
        (&[&capture, "--depth-pitch", "NaN"], 1, "depth pitch of NaN"),
        (&[&capture, "--depth-pitch", "0"], 1, "depth pitch of 0"),
        (&[&capture, "--volume", "1,2,3"], 1, "--volume"),
        (&[&capture, "--volume", "0:0,0:0,0:0"], 1, "hidden volume is empty"),
        (&[&capture, "--volume", "-1:1,-1:1,-3:-1"], 1, "the volume ends at a depth of -1 m"),
        (&[&capture, "--volume", "-1:1,-1:1"], 1, "three ranges"),
        (&[&capture, "--volume", "-1:1,-1:1,0.3:x"], 1, "three ranges"),
        (&[&capture, "--volume", "a.npz"], 1, "--volume-file"),
        (&[&capture, "--depth-pitch", "100"], 1, "no voxel of 100 m"),
        (&[&capture, "--mask-fraction", "2"], 1, "the mask fraction is 2"),
        (&[&capture, "--memory", "1M"], 1, "the memory budget is 1 MiB"),
        (&[&capture, "--memory", "much"], 1, "--memory is much"),
        (&[&capture, "--truth", "/nonexistent/truth.npz"], 1, "/nonexistent/truth.npz"),
        (&[&capture, "--truth", &capture], 1, "gt_depth"),
        (&[&capture, "--volume-file", "volume.txt"], 1, "volume.txt"),
        (&[&truth], 1, "truth.npz"),
        (&[&capture, "--deterministic", "--accumulation", "repeatable"], 2, "--deterministic"),
    ];
    for (arguments, code, words) in cases {
        let mut all = vec!["reconstruct", "--out", &out, "--quiet"];
        if !arguments.contains(&"--solver") {
            all.extend(["--solver", "paper"]);
        }
        all.extend(*arguments);
        fail(&all, *code, words);
    }
    fail(&["reconstruct", &capture, "--out", &inside_a_file, "--quiet"], 1, "no folder");
    fail(&["simulate", "nowhere", "--out", &out], 1, "no scene named");
    let file = folder.path().join("new.npz").display().to_string();
    for (option, value, words) in [
        ("--scan", "0", "scan points"),
        ("--wall", "-1", "wall size is -1"),
        ("--photons", "NaN", "NaN"),
        ("--bin-width", "0", "bin width is 0"),
        ("--albedo", "-1", "albedo -1"),
        ("--noise", "NaN", "NaN"),
        ("--pile-up", "0", "photons per laser pulse"),
        ("--pulse", "0.02:-1", "the tail of the pulse"),
        ("--point", "0,0", "--pairs one-laser"),
        ("--grid", "4", "--pairs exhaustive"),
    ] {
        fail(&["simulate", "plane", "--out", &file, option, value], 1, words);
    }
    let one_laser = ["simulate", "plane", "--out", &file, "--pairs", "one-laser", "--point"];
    fail(&[&one_laser[..], &["here"]].concat(), 1, "--point is \"here\"");
    fail(&[&one_laser[..], &["0,NaN"]].concat(), 1, "NaN");
    fail(&["info", &capture, "--volume", "v.npz"], 1, "three ranges");
    fail(&["frobnicate"], 2, "frobnicate");
    assert_eq!(entries(folder.path()), Vec::<PathBuf>::new(), "something was written");
}

#[test]
fn a_failed_run_keeps_an_older_result_whole() {
    let capture = small().path("z.npz");
    let folder = tempfile::tempdir().unwrap();
    let done = reconstruct(&capture, folder.path(), &["--quiet"]);
    assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
    let before = std::fs::read(folder.path().join("report.json")).unwrap();
    let done = reconstruct(&capture, folder.path(), &["--quiet", "--memory", "1M"]);
    assert_eq!(done.status.code(), Some(1));
    assert_eq!(std::fs::read(folder.path().join("report.json")).unwrap(), before);
    // A peak whose square is beyond single precision gives a loss that is not finite, which is found while solving.
    let done = reconstruct(&capture, folder.path(), &["--quiet", "--peak", "1e38"]);
    assert_eq!(done.status.code(), Some(1), "{}", stderr(&done));
    assert!(stderr(&done).contains("the loss is"), "{}", stderr(&done));
    assert_eq!(std::fs::read(folder.path().join("report.json")).unwrap(), before);
}

#[test]
fn paths_without_a_folder_mean_this_folder() {
    let folder = tempfile::tempdir().unwrap();
    let here = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_thirdbounce"));
        let output = command.args(arguments).current_dir(folder.path()).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    };
    here(&["simulate", "plane", "--out", "p.hdf5", "--scan", "8", "--bin-width", "0.04", "--noise", "0.1"]);
    let short = ["--model", "cosine", "--lateral", "8", "--iterations", "2", "--quiet"];
    here(&[&["reconstruct", "p.hdf5", "--out", "result", "--volume-file", "v.npz"], &short[..]].concat());
    here(&[&["reconstruct", "p.hdf5", "--out", "."], &short[..]].concat());
    for name in ["result/report.json", "v.npz", "report.json", "maps.npz"] {
        assert!(folder.path().join(name).is_file(), "{name}");
    }
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_thirdbounce"))
        .args(["info", &small().path("z.npz")])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), stderr(&output)), (Some(0), String::new()));
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_the_run_without_a_result() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result").display().to_string();
    let capture = small().path("z.npz");
    let mut child = Command::new(env!("CARGO_BIN_EXE_thirdbounce"))
        .args(["reconstruct", &capture, "--out", &out, "--model", "cosine", "--iterations", "1000000"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Once it prints progress, it is solving.
    let mut said = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("iteration ") {
        line.clear();
        assert!(std::io::BufRead::read_line(&mut said, &mut line).unwrap() > 0, "it ended early");
    }
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let mut rest = String::new();
    std::io::Read::read_to_string(&mut said, &mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest}");
    assert!(rest.contains("cancelled after"), "{rest}");
    assert_eq!(entries(folder.path()), Vec::<PathBuf>::new());
}

#[test]
fn help_and_version_are_there() {
    assert!(succeed(&["--version"]).starts_with("thirdbounce "));
    let help = succeed(&["--help"]);
    assert!(help.contains("Examples:") && help.contains("reconstruct"), "{help}");
    let help = succeed(&["reconstruct", "--help"]);
    assert!(help.contains("--deterministic") && !help.contains("--learning-rate"), "{help}");
    assert!(help.lines().count() < 100, "{} lines", help.lines().count());
    let help = succeed(&["help", "paper"]);
    for option in ["--learning-rate", "--noise-span", "--smooth-truncate", "--no-reduce"] {
        assert!(help.contains(option), "{option}");
    }
    assert!(succeed(&["help", "capture"]).contains("--no-auto-gate"));
    assert!(succeed(&["help", "info"]).contains("--png"));
    assert!(succeed(&["help", "wall"]).starts_with("--wall: "));
    assert!(succeed(&["help", "bin width"]).starts_with("--bin-width: "));
    fail(&["help", "nothing"], 1, "phasor-bp");
    let verbs = [
        "demo",
        "info",
        "reconstruct",
        "batch",
        "simulate",
        "evaluate",
        "convert",
        "profile",
        "schedule",
        "devices",
        "help",
        // Programs of their own.
        "track",
        "live",
        "histogram",
        "benchmark",
    ];
    for verb in verbs {
        // What every verb has is last, below the verb's own.
        let help = succeed(&[verb, "--help"]);
        let behind = help.split("\nHost:\n").nth(1).expect("a section");
        let options: Vec<&str> = behind.lines().filter(|line| line.starts_with("      --")).collect();
        let [memory, threads] = options[..] else { panic!("{verb}: {help}") };
        assert!(memory.contains("--host-memory") && threads.contains("--threads"), "{verb}: {help}");
    }
    // A reader that stops early, as head does, is no error.
    for arguments in [&["help", "paper"][..], &["help"]] {
        let mut child = Command::new(program())
            .args(arguments)
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let done = child.wait_with_output().unwrap();
        assert!(done.status.success() && done.stderr.is_empty(), "{arguments:?}: {}", stderr(&done));
    }
    assert!(succeed(&["simulate", "--help"]).contains("letter-X"));
}

/// A copy of the command alone, where nothing is beside it and in PATH.
#[test]
fn a_program_that_is_absent_is_named_with_its_package() {
    let folder = tempfile::tempdir().unwrap();
    let alone = folder.path().join("thirdbounce");
    std::fs::copy(program(), &alone).unwrap();
    std::fs::write(folder.path().join("scan.ptu"), b"PQTTTR\0\0").unwrap();
    for (arguments, package) in [
        (&["live", "-"][..], "thirdbounce-live"),
        (&["track", "a.npz"], "thirdbounce-track"),
        (&["histogram", "--help"], "thirdbounce-tags"),
        (&["help", "histogram"], "thirdbounce-tags"),
        (&["info", "scan.ptu"], "thirdbounce-tags"),
        (&["benchmark"], "thirdbounce-benchmark"),
    ] {
        let output = Command::new(&alone).args(arguments).env("PATH", "").current_dir(folder.path()).output();
        let (text, code) = output.map(|output| (stderr(&output), output.status.code())).unwrap();
        assert_eq!(code, Some(1), "{arguments:?}: {text}");
        assert!(
            text.contains(&format!("cargo build --release --package {package}")),
            "{arguments:?}: {text}"
        );
    }
}

#[test]
fn the_default_solver_repeats_and_knows_both_models() {
    let capture = small().path("z.npz");
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, more: &[&str]| {
        let out = folder.path().join(name).display().to_string();
        let short = ["--lateral", "32", "--iterations", "20", "--quiet"];
        succeed(&[&["reconstruct", &capture, "--stride", "2", "--out", &out], &short[..], more].concat());
        (
            std::fs::read(folder.path().join(name).join("maps.npz")).unwrap(),
            json(&Path::new(&out).join("report.json")),
        )
    };
    let cosine = ["--deterministic", "--model", "cosine"];
    let (first, report) = run("first", &cosine);
    assert_eq!(report["settings"]["solver"], "surface");
    assert_eq!(report["trace"].as_array().unwrap().last().unwrap()["lateral"], 32);
    assert!(first == run("second", &cosine).0, "the same bits");
    let (lambertian, report) = run("third", &["--deterministic", "--model", "lambertian"]);
    assert!(first != lambertian, "another model, another result");
    assert_eq!(report["settings"]["reflectance"], "lambertian");
    let out = folder.path().join("none").display().to_string();
    let refused = ["reconstruct", &capture, "--out", &out, "--solver", "paper", "--sparsity", "1"];
    fail(&refused, 1, "no option of the solver paper");
}
