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
    assert!(text.contains("paper: ") && text.contains("surface: ") && text.contains("forward"), "{text}");
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
fn a_program_with_a_vulkan_device_of_its_own_gets_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("letter.ppm");
    example("vulkan", &[file.to_str().unwrap()]);
    let all = std::fs::read(&file).unwrap();
    let head = b"P6 32 32 255\n";
    assert!(all.starts_with(head) && all.len() == head.len() + 32 * 32 * 3);
    let is_lit = |x: usize, y: usize| all[head.len() + 3 * (y * 32 + x)..][..3].iter().any(|v| *v > 60);
    let row = |y: usize| (0..32).filter(|x| is_lit(*x, y)).count();
    // A letter T: a bar, and a stem of a third of its width below it.
    assert!((13..=17).contains(&row(10)) && (3..=6).contains(&row(18)), "{} {}", row(10), row(18));
    assert!(is_lit(9, 9) && is_lit(15, 20) && !is_lit(9, 20) && row(4) == 0 && row(28) == 0);
}

#[test]
fn frames_of_a_session_become_places() {
    assert_eq!(places_found(&example("session", &[])), 3);
}
