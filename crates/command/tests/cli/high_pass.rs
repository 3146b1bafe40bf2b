//! How much light counts that changes slowly along time.

use std::path::Path;

use fixtures::command::{stderr, succeed, thirdbounce};
use serde_json::Value;

/// Reconstructs a figure that was simulated with these options; what was said, and the report's settings.
fn solved(folder: &Path, simulated: &[&str], more: &[&str]) -> (String, Value) {
    let path = |name: &str| folder.join(name).display().to_string();
    let (capture, out) = (path("c.npz"), path("out"));
    let usual = ["simulate", "figure", "--scan", "16", "--bin-width", "0.02", "--quiet", "--out", &capture];
    succeed(&[&usual[..], simulated].concat());
    let quick = ["--model", "cosine", "--pulse", "none", "--lateral", "32", "--iterations", "6"];
    let quick = [&quick[..], &["--support", "fixed", "--no-preview"]].concat();
    let output = thirdbounce(&[&["reconstruct", &capture, "--out", &out], &quick[..], more].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let report = std::fs::read(folder.join("out").join("report.json")).expect("a report");
    let report: Value = serde_json::from_slice(&report).expect("JSON");
    (stderr(&output), report["settings"].clone())
}

#[test]
#[ignore = "long: make soak"]
fn slow_light_counts_by_what_a_fit_leaves_of_it_over_noise() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // Little noise: most of what is left is what the model does not explain.
    let (said, exact) = solved(folder.path(), &[], &[]);
    let found = &exact["high_pass_found"];
    // A tenth of the wall's width, from the first wall point to the last.
    let length = found["length"].as_f64().expect("a length");
    let floor = found["floor"].as_f64().expect("a floor");
    assert!((length / 0.094 - 1.0).abs() < 0.1 && (0.1..0.5).contains(&floor), "{found}");
    assert!(said.contains(&format!("m of path, are weighed {floor:.2}, as they fit badly")), "{said}");
    assert_eq!((&exact["high_pass"], &exact["high_pass_floor"]), (&found["length"], &found["floor"]));
    // Few photons: noise is most of what is left.
    let (said, noisy) = solved(folder.path(), &["--photons", "3", "--dark", "0.1"], &[]);
    assert_eq!(noisy["high_pass_found"]["length"], 0.0, "{said}");
    assert!(said.contains("no high-pass: slow parts"), "{said}");
    // Whoever gives the length skips the trial.
    let (said, given) = solved(folder.path(), &[], &["--high-pass", "0.2"]);
    assert!(given["high_pass_found"].is_null() && given["trials_s"] == 0.0, "{said}");
    assert_eq!(given["high_pass"], 0.2);
}
