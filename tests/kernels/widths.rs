//! The table of cases at the vector widths of lavapipe: with the width, the size of a subgroup and the order of its sums differ.

use std::process::Command;

/// Each width runs in a process of its own: the driver reads the variable once.
#[test]
#[ignore = "three runs of the table of cases"]
fn kernels_pass_at_every_vector_width_of_lavapipe() {
    let program = std::env::current_exe().expect("a test has a path");
    for bits in ["128", "256", "512"] {
        let begun = std::time::Instant::now();
        let run = Command::new(&program)
            .args(["--exact", "kernels_compute_what_their_reference_computes", "--nocapture"])
            .env("LP_NATIVE_VECTOR_WIDTH", bits)
            .output()
            .expect("a test starts itself");
        let text = [run.stdout, run.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
        assert!(run.status.success() && text.contains("test result: ok. 1 passed"), "{bits} bits: {text}");
        // The name of lavapipe has the width; other devices ignore the variable.
        let device = text.lines().find_map(|line| line.strip_prefix("device ")).expect("the device's name");
        assert!(!device.contains("llvmpipe") || device.contains(&format!("{bits} bits")), "{device}");
        println!("{device}: {:.0} s", begun.elapsed().as_secs_f64());
    }
}
