//! What was undone of an instrument, for the next capture of the rig.

use std::path::Path;

use fixtures::captures::changed;
use fixtures::command::{fail, stderr, succeed, thirdbounce};
use serde_json::{Value, json};
use thirdbounce::capture::{read, write};

#[test]
fn what_is_undone_of_one_capture_is_undone_of_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    for (scene, seed) in [("figure", "31"), ("sphere", "32")] {
        let common =
            ["simulate", scene, "--scan", "24", "--photons", "200", "--dark", "1", "--seed", seed, "--quiet"];
        let files = ["--out", &at(&format!("{scene}.npz")), "--truth", &at(&format!("{scene}-truth.npz"))];
        succeed(&[&common[..], &files].concat());
        let sheared = changed(&read(Path::new(&at(&format!("{scene}.npz")))).unwrap(), |c| {
            c.laser.iter_mut().chain(&mut c.sensor).for_each(|point| point.x -= 0.2 * point.y);
        });
        write(&sheared, Path::new(&at(&format!("{scene}-sheared.npz")))).unwrap();
    }
    let solve = |scene: &str, capture: &str, more: &[&str]| {
        let (out, truth) = (at(&format!("out-{capture}-{}", more.len())), at(&format!("{scene}-truth.npz")));
        let args = ["reconstruct", &at(&format!("{capture}.npz")), "--out", &out, "--lateral", "64"];
        let output = thirdbounce(&[&args[..], &["--truth", &truth], more].concat());
        let said = stderr(&output);
        assert!(output.status.success(), "{said}");
        let report = std::fs::read(Path::new(&out).join("report.json")).unwrap();
        (serde_json::from_slice::<Value>(&report).unwrap(), said, out)
    };
    let iou = |report: &Value| report["metrics"]["iou"].as_f64().expect("an IoU");
    let found = |report: &Value| report["settings"]["calibration_found"].clone();

    let (first, said, out) = solve("figure", "figure-sheared", &[]);
    let correction = &found(&first)["corrections"][0];
    assert_eq!(correction["law"], "shear", "{said}");
    let shear = correction["numbers"][0].as_f64().unwrap();
    assert!((shear - 0.2).abs() < 0.05, "{shear}");

    let file = Path::new(&out).join("report.json").display().to_string();
    let (proper, ..) = solve("sphere", "sphere", &[]);
    assert_eq!(found(&proper), Value::Null);
    let (next, said, _) = solve("sphere", "sphere-sheared", &["--calibrate", &file]);
    assert!(said.contains("undone by the calibration") && said.contains("sheared"), "{said}");
    assert_eq!((&found(&next)["given"], &found(&next)["corrections"][0]), (&json!(1), correction));
    assert!(iou(&next) > iou(&proper) - 0.06, "{} {}", iou(&next), iou(&proper));
    // Of another rig, it is left out.
    let (other, ..) = solve("sphere", "sphere", &["--calibrate", &file]);
    let reasons = other["verdict"]["reasons"].to_string();
    assert!(
        reasons.contains("contradict it")
            && reasons.contains("undone by the calibration")
            && other["verdict"]["grade"] == "fair",
        "{reasons}"
    );
    assert_eq!((iou(&other), &found(&other)["corrections"]), (iou(&proper), &json!([])));

    let capture = at("figure-sheared.npz");
    fail(&["reconstruct", &capture, "--calibrate", &file, "--out", &out], 1, "report.json");
    for (text, what) in [
        ("{}", "holds no calibration"),
        (r#"{"corrections": [{"law": "x", "numbers": [1], "middle": [0, 0], "half": 1}]}"#, "no law \"x\""),
    ] {
        std::fs::write(at("rig.json"), text).unwrap();
        fail(&["reconstruct", &capture, "--calibrate", &at("rig.json"), "--out", &at("x")], 1, what);
    }
    assert!(!Path::new(&at("x")).exists());
}
