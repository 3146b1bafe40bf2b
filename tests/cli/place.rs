//! Scenes that are not in front of the scanned part of the wall.

use std::path::Path;

use fixtures::command::{stderr, thirdbounce};
use glam::{DVec3, dvec3};
use serde_json::Value;
use thirdbounce::capture::write;
use thirdbounce::export::npz;
use thirdbounce::simulate::{Object, RenderOptions, Scene, rectangle, simulate};
use thirdbounce::transport::Reflectance;

/// Writes what 16 x 16 points see of a scene, with 500 photons in the brightest bin.
fn seen(mut scene: Scene, path: &Path) -> String {
    (scene.scan, scene.bin_width, scene.photons) = (16, 0.01, Some(500.0));
    scene.reflectance = Reflectance::Lambertian;
    let capture = simulate(&scene, &RenderOptions::default()).expect("light").capture;
    write(&capture, path).expect("it is written");
    path.display().to_string()
}

/// Reconstructs a capture. Returns the report and what was said.
fn solved(capture: &str, out: &Path, more: &[&str]) -> (Value, String) {
    let out = out.to_str().expect("a path");
    let short =
        ["--lateral", "32", "--iterations", "20", "--surface-iterations", "20", "--model", "lambertian"];
    let output = thirdbounce(&[&["reconstruct", capture, "--out", out], &short[..], more].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report = std::fs::read(Path::new(out).join("report.json")).expect("a report");
    (serde_json::from_slice(&report).expect("it is JSON"), stderr(&output))
}

#[test]
fn a_scene_beside_the_scan_gets_a_box_of_its_own() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // A plate of 0.47 by 0.4 m whose face is turned to the wall's middle.
    let plate = rectangle(dvec3(0.75, 0.0, 0.575), DVec3::Y * 0.2, dvec3(0.2, 0.0, -0.125));
    let scene = Scene::new("plate", vec![Object { mesh: plate, albedo: 1.0 }]);
    let capture = seen(scene, &folder.path().join("plate.npz"));
    let state = folder.path().join("state").display().to_string();

    let out = folder.path().join("found");
    let keep = ["--checkpoint", &state, "--checkpoint-every", "10"];
    let (report, said) = solved(&capture, &out, &keep);
    assert!(said.contains("the scene is not in front of the scanned part of the wall"), "{said}");
    let found = &report["settings"]["place_found"];
    let extent: Vec<f64> = serde_json::from_value(found["extent"].clone()).expect("six numbers");
    assert!(extent[0] < 0.55 && extent[1] > 0.95 && extent[2] < -0.2 && extent[3] > 0.2, "{extent:?}");
    assert!(extent[1] - extent[0] < 1.6, "{extent:?}");
    assert!(found["beyond"].as_f64().expect("a share") > 0.8, "{found}");
    let boxed: Vec<f64> = serde_json::from_value(report["settings"]["box"].clone()).expect("six numbers");
    assert!((0..4).all(|i| (boxed[i] - extent[i]).abs() < 1e-6), "{boxed:?} {extent:?}");
    assert!(report["settings"]["trials_s"].as_f64().expect("seconds") > 0.0);

    // The plate is there, at its depth.
    let maps = npz::read_maps(&out.join("maps.npz")).expect("maps");
    let shown: Vec<usize> = (0..maps.mask.len()).filter(|p| maps.mask[*p]).collect();
    let off = |p: &usize| {
        let x = extent[0] + (extent[1] - extent[0]) * ((p / maps.ny) as f64 + 0.5) / maps.nx as f64;
        (f64::from(maps.depth[*p]) - (0.7 - 0.25 * (x - 0.55) / 0.4)).abs()
    };
    let mean = shown.iter().map(off).sum::<f64>() / shown.len() as f64;
    assert!(shown.len() > 40 && mean < 0.03, "{} pixels, {mean} m", shown.len());

    // A resumed run knows the box; one that is given keeps its place.
    let (resumed, _) = solved(&capture, &folder.path().join("resumed"), &["--resume", &state]);
    assert_eq!(resumed["settings"]["place_found"], *found);
    let given = ["--volume", "-0.5:0.5,-0.5:0.5,0.3:1.0"];
    let (report, said) = solved(&capture, &folder.path().join("given"), &given);
    assert!(report["settings"]["place_found"].is_null() && !said.contains("not in front"), "{said}");
}

#[test]
fn a_scene_in_front_of_the_scan_keeps_the_usual_box() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let capture = seen(Scene::named("figure").expect("a scene"), &folder.path().join("figure.npz"));
    let (report, said) = solved(&capture, &folder.path().join("out"), &[]);
    assert!(report["settings"]["place_found"].is_null(), "{said}");
    assert!(report["settings"]["trials_s"].as_f64().expect("seconds") > 0.0, "it was looked for");
}
