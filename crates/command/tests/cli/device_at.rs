//! The light of a device near the wall: simulated, divided where held-out pairs prove it.

use std::path::Path;

use fixtures::command::{fail, succeed};
use serde_json::Value;

fn report(folder: &str) -> Value {
    serde_json::from_slice(&std::fs::read(Path::new(folder).join("report.json")).unwrap()).unwrap()
}

#[test]
fn the_light_of_a_near_device_is_divided_only_where_it_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let sphere =
        ["simulate", "sphere", "--model", "lambertian", "--scan", "16", "--noise", "0.03", "--quiet"];
    let simulate = |more: &[&str], out: &str, truth: &str| {
        succeed(&[&sphere[..], more, &["--out", &at(out), "--truth", &at(truth)]].concat());
    };
    simulate(&["--device-at=-0.5,0,0.25"], "near.npz", "truth.npz");
    simulate(&[], "proper.npz", "truth.npz");
    let solve = |capture: &str, more: &[&str], out: &str| {
        let args =
            ["reconstruct", &at(capture), "--out", &at(out), "--lateral", "32", "--truth", &at("truth.npz")];
        let said = succeed(&[&args[..], more].concat());
        (report(&at(out)), said)
    };
    let iou = |report: &Value| report["metrics"]["iou"].as_f64().expect("an IoU");
    let law = |report: &Value| report["settings"]["device_found"]["law"].as_str().map(str::to_owned);

    let (named, said) = solve("near.npz", &[], "named");
    assert_eq!(law(&named).as_deref(), Some("laser"), "{said}");
    assert_eq!(named["settings"]["device_found"]["at"][0], serde_json::json!([-0.5, 0.0, 0.25]));
    let (unused, _) = solve("near.npz", &["--device-at", "none"], "unused");
    assert!(unused["settings"]["device_found"].is_null());
    assert!(iou(&named) > iou(&unused) + 0.1, "{} {}", iou(&named), iou(&unused));

    // A position that held-out pairs contradict is not used, and the verdict says so.
    let (proper, _) = solve("proper.npz", &[], "proper");
    assert!(proper["settings"]["device_found"].is_null());
    let (forced, _) = solve("proper.npz", &["--device-at=-0.5,0,0.25"], "forced");
    assert_eq!(
        (law(&forced), &forced["settings"]["device_found"]["is_used"]),
        (None, &serde_json::json!(false))
    );
    let reasons = forced["verdict"]["reasons"].to_string();
    assert!(
        forced["verdict"]["grade"] == "fair"
            && reasons.contains("contradict it")
            && reasons.contains("device at"),
        "{reasons}"
    );
    assert_eq!(iou(&forced), iou(&proper));

    fail(&["reconstruct", &at("proper.npz"), "--out", &at("x"), "--device-at=0,0,-1"], 1, "z > 0");
}
