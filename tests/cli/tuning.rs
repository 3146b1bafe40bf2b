//! Sizes of workgroups, chunks and columns: asked for, found by trial, kept for later runs.

use fixtures::command;
use std::path::Path;
use std::process::Command;

use fixtures::command::{fail, stderr};
use serde_json::Value;

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("the file is there")).expect("it is JSON")
}

/// Runs the command with a folder of its own for caches.
#[track_caller]
fn run(cache: &Path, arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_thirdbounce"));
    let output = command.env("XDG_CACHE_HOME", cache).args(arguments).output().expect("the binary runs");
    assert_eq!(output.status.code(), Some(0), "{arguments:?}\n{}", stderr(&output));
    command::stdout(&output)
}

fn variants(report: &Value) -> String {
    report["plan"]["variants"].to_string()
}

#[test]
fn sizes_are_obeyed_found_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (cache, capture) = (folder.path().join("cache"), path("z.npz"));
    let scan = ["--scan", "8", "--bin-width", "0.02", "--noise", "0.2"];
    run(&cache, &[&["simulate", "letter-Z", "--out", &capture], &scan[..]].concat());
    let short =
        ["--model", "cosine", "--lateral", "16", "--iterations", "12", "--support", "fixed", "--quiet"];
    let solve = |out: &str, more: &[&str]| {
        let out = path(out);
        run(&cache, &[&["reconstruct", &capture, "--out", &out], &short[..], more].concat());
        json(&Path::new(&out).join("report.json"))
    };

    // Other sizes, with private columns: the same result but for the order of sums.
    let own = solve("own", &["--accumulation", "cas"]);
    let sizes = "lanes=16,chunk=512,window=32,voxels=8,slices=2";
    let other = solve("other", &["--accumulation", "cas", "--sizes", sizes]);
    assert!(variants(&own).contains("WINDOW=0") && variants(&own).contains("LANES=8"), "{own}");
    for part in ["WINDOW=32", "LANES=16", "CHUNK=512", "VOXELS=8", "SLICES=2"] {
        assert!(variants(&other).contains(part), "{part} is not in {other}");
    }
    // Rounding moves points of a surface that lie near a bin's centre: the result is as good, not the same.
    let losses = |r: &Value| -> Vec<(u64, f64)> {
        let rows = r["trace"].as_array().unwrap().iter();
        rows.map(|row| (row["iteration"].as_u64().unwrap(), row["loss"].as_f64().unwrap())).collect()
    };
    for (own_row, other_row) in losses(&own).into_iter().zip(losses(&other)) {
        let off = (other_row.1 / own_row.1 - 1.0).abs();
        assert!(own_row.0 == other_row.0 && own_row.1 > 0.0 && off < 0.02, "{own_row:?} {other_row:?}");
    }

    // Trials write what they find to a file, and later runs use it.
    let found = path("tuned.json");
    run(&cache, &[&["profile", &capture, "--tune", "--json", &found], &short[..]].concat());
    let found = json(Path::new(&found));
    let tried = found["tried"].as_array().unwrap();
    assert!(tried.len() >= 6 && tried.iter().all(|t| t["forward_s"].as_f64() > Some(0.0)), "{found}");
    assert!(found["ratio"].as_f64().is_some_and(|r| r > 0.0 && r <= 1.0), "{found}");
    let kept = cache.join("thirdbounce/sizes.json");
    assert_eq!(kept.exists(), found["best"] != serde_json::json!({}), "{found}");
    let class = found["class"].as_str().unwrap();
    let mine = serde_json::json!({ class: { "voxels": 24 }, "another device": { "voxels": 1 } });
    std::fs::create_dir_all(kept.parent().unwrap()).unwrap();
    std::fs::write(&kept, mine.to_string()).unwrap();
    assert!(variants(&solve("kept", &[])).contains("VOXELS=24"));
    // But not with --deterministic, not over --sizes, not from a damaged file.
    assert!(!variants(&solve("fixed", &["--deterministic"])).contains("VOXELS=24"));
    assert!(variants(&solve("asked", &["--sizes", "voxels=40"])).contains("VOXELS=40"));
    std::fs::write(&kept, "{").unwrap();
    assert!(variants(&solve("damaged", &[])).contains("VOXELS=64"));
}

#[test]
fn sizes_that_no_device_takes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (capture, out) = (path("z.npz"), path("out"));
    let scan = ["--scan", "4", "--bin-width", "0.05", "--noise", "0.5", "--quiet"];
    command::succeed(&[&["simulate", "plane", "--out", &capture], &scan[..]].concat());
    for (sizes, code, words) in [
        ("lanes", 1, "no size"),
        ("width=3", 1, "no size"),
        ("lanes=0", 1, "lanes is 0"),
        ("voxels=65536,slices=65537", 1, "voxels times slices"),
        ("lanes=1000000", 1, "more invocations"),
        ("chunk=50000", 1, "too long"),
        ("lanes=64,window=100000", 1, "shared memory"),
        ("chunk=32768,window=64", 1, "loops longer"),
    ] {
        let short =
            ["--model", "cosine", "--lateral", "8", "--iterations", "1", "--accumulation", "cas", "--quiet"];
        fail(
            &[&["reconstruct", &capture, "--out", &out, "--sizes", sizes], &short[..]].concat(),
            code,
            words,
        );
        assert!(!Path::new(&out).join("report.json").exists());
    }
}
