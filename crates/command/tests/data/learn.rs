//! Training: scenes, two steps, weights, and what the engine says with them.

use std::path::Path;
use std::process::Command;

use fixtures::command::succeed;
use thirdbounce::learned::logits;

/// Bands as `learn/export.py` makes them.
fn bands() -> Vec<f32> {
    let value = |i: usize| {
        let [z, y, x, b] = [i % 96, i / 96 % 64, i / (96 * 64) % 64, i / (96 * 64 * 64)].map(|v| v as f64);
        let is_inside = (x - 32.0).abs() < 16.0 && (y - 30.0).abs() < 12.0;
        let plate = if is_inside { 6.0 / (1.0 + (z - (40.0 + 0.25 * x)).powi(2)) } else { 0.0 };
        let haze = (i * 2_654_435_761 % 1000) as f64 / 5000.0 - 0.1;
        (plate * (1.0 - 0.3 * b) + haze) as f32
    };
    (0..5 * 64 * 64 * 96).map(value).collect()
}

pub fn two_steps_train_what_the_engine_reads(python: &Path) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (scenes, out, weights) = (at("scenes"), at("out"), at("weights.safetensors"));
    succeed(&[
        "simulate",
        "--family",
        "100000..100002",
        "--scan",
        "4",
        "--coarse",
        "--inputs",
        "--out",
        &scenes,
    ]);
    let learn = |script: &str, arguments: &[&str]| {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../learn").join(script);
        let said = Command::new(python).arg("-B").arg(&script).args(arguments).output().expect("Python");
        let errors = String::from_utf8_lossy(&said.stderr);
        assert!(said.status.success(), "{}: {errors}", script.display());
        String::from_utf8(said.stdout).expect("text")
    };
    let few = ["--batch", "1", "--full", "--widths", "4", "4", "8", "8"];
    let train = |more: &[&str]| learn("train.py", &[&[&*scenes, "--out", &out], &few[..], more].concat());
    assert!(train(&["--steps", "1"]).contains("from step 0"));
    assert!(train(&["--steps", "2"]).contains("from step 1"));
    let said = learn("export.py", &[&at("out/checkpoint.pt"), &weights]);
    let kept = std::fs::read(&weights).expect("weights");
    let numbers = |text: &str| -> Vec<f32> {
        text.split(|c: char| !(c.is_ascii_digit() || ".-".contains(c)))
            .filter_map(|n| n.parse().ok())
            .collect()
    };
    // A line of every kind of pairs: the kind, six pixels of the mask, and three columns of depth.
    assert_eq!(said.lines().count(), 2, "{said}");
    for line in said.lines().map(numbers) {
        let [depth, mask] = logits(Some(&kept), &bands(), line[0] as usize);
        for pixel in line[1..19].chunks(3) {
            let found = mask[128 * pixel[0] as usize + pixel[1] as usize];
            assert!((found - pixel[2]).abs() < 2e-3, "mask at {pixel:?}: {found}");
        }
        for column in line[19..31].chunks(4) {
            let from = (64 * column[0] as usize + column[1] as usize) * 96;
            let found = depth[from..from + 96].iter().copied().fold(f32::MIN, f32::max);
            assert!((found - column[3]).abs() < 2e-3, "depth at {column:?}: {found}");
        }
    }
    // At half resolution, on quarters of the box, then on weights that a file has; scenes that were used twice leave, but for the last ones.
    let (half, more, shared) = (at("half"), at("more"), format!("{scenes}:2"));
    let few = ["--batch", "1", "--uses", "2", "--widths", "4", "4", "8"];
    learn("train.py", &[&[&*shared, "--out", &half, "--crop", "1", "--steps", "2"], &few[..]].concat());
    let weights = at("half/weights.safetensors");
    let on = [&*scenes, "--out", &more, "--from", &weights, "--steps", "3", "--unseen", &scenes];
    let said = learn("train.py", &[&on[..], &few[..]].concat());
    assert!(said.contains("from step 2") && said.contains("step 3: ") && said.contains("own IoU"), "{said}");
    let measured = learn("evaluate.py", &[&at("more/weights.safetensors"), &scenes]);
    assert!(measured.contains("100001") && measured.contains("reliability"), "{measured}");
}

pub fn weights_are_ranked_by_the_light_that_they_leave(python: &Path) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (capture, page, none) = (at("capture.npz"), at("rank.html"), at("none.npz"));
    succeed(&["simulate", "figure", "--scan", "8", "--bin-width", "0.02", "--out", &capture]);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../learn/rank.py");
    let program = env!("CARGO_BIN_EXE_thirdbounce");
    let (old, new) = (format!("old={program}"), format!("new={program}"));
    let small = ["--option=--lateral=32", "--option=--deterministic"];
    let arguments = [&[&*old, &new, &capture, &none, "--page", &page], &small[..]].concat();
    let said = Command::new(python).arg("-B").arg(&script).args(arguments).output().expect("Python");
    let (text, errors) = (String::from_utf8_lossy(&said.stdout), String::from_utf8_lossy(&said.stderr));
    assert!(said.status.success(), "{errors}");
    assert!(
        text.contains("new leaves 1.000 times as much as old") && text.contains("of 1 captures"),
        "{text}"
    );
    let page = std::fs::read_to_string(page).expect("a page");
    assert!(page.matches("<img ").count() >= 4 && page.contains("cannot be read"), "{}", page.len());
}
