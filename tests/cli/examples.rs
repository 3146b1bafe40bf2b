//! The programs in `examples/` run.

use std::process::Command;

use fixtures::command::{program, succeed};

/// Runs an example that cargo built beside the command; its output.
fn example(name: &str, arguments: &[&str]) -> String {
    let path = program().with_file_name("examples").join(name);
    let output = Command::new(&path)
        .args(arguments)
        .output()
        .expect("`cargo test` or `cargo build --examples` builds the examples");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}: {errors}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn a_file_becomes_maps() {
    let folder = tempfile::tempdir().unwrap();
    let [file, result] = ["c.npz", "result"].map(|n| folder.path().join(n).display().to_string());
    succeed(&["simulate", "sphere", "--out", &file, "--scan", "8", "--bin-width", "0.03", "--noise", "0.2"]);
    let text = example("reconstruct", &[&file, &result]);
    assert!(text.contains("8 x 8 = 64 pairs") && text.contains("maps.npz"), "{text}");
    assert!(folder.path().join("result/maps.npz").is_file());
    let text = example("plan", &[&file]);
    assert!(text.contains("paper: ") && text.contains("vector: ") && text.contains("forward"), "{text}");
}

/// Asserts that every place is found, and returns how many there are.
fn places_found(text: &str) -> usize {
    let places = |begin: &str| -> Vec<Vec<f64>> {
        let lines = text.lines().filter(|l| l.starts_with(begin));
        lines.map(|l| l.split_whitespace().filter_map(|word| word.parse().ok()).take(3).collect()).collect()
    };
    let (hidden, found) = (places("hidden"), places("found"));
    assert_eq!(hidden.len(), found.len(), "{text}");
    let off = hidden.concat().iter().zip(found.concat()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 0.04, "{text}");
    hidden.len()
}

#[test]
fn arrays_in_memory_become_a_place() {
    assert_eq!(places_found(&example("from_arrays", &[])), 1);
}

#[test]
fn frames_of_a_session_become_places() {
    assert_eq!(places_found(&example("session", &[])), 3);
}
