//! Sizes of workgroups, chunks and columns that are asked for.

use fixtures::command;
use std::path::Path;

use fixtures::command::fail;
use serde_json::Value;

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("the file is there")).expect("it is JSON")
}

fn variants(report: &Value) -> String {
    report["plan"]["variants"].to_string()
}

#[test]
fn sizes_are_obeyed() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let capture = path("z.npz");
    let scan = ["--scan", "8", "--bin-width", "0.02", "--noise", "0.2"];
    command::succeed(&[&["simulate", "letter-Z", "--out", &capture], &scan[..]].concat());
    let short =
        ["--model", "cosine", "--lateral", "16", "--iterations", "12", "--support", "fixed", "--quiet"];
    let solve = |out: &str, more: &[&str]| {
        let out = path(out);
        command::succeed(&[&["reconstruct", &capture, "--out", &out], &short[..], more].concat());
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
    // Where lanes own histograms, they divide these.
    let short =
        ["reconstruct", &capture, "--out", &out, "--model", "cosine", "--sizes", "lanes=0", "--quiet"];
    fail(&short, 1, "lanes is 0");
}
