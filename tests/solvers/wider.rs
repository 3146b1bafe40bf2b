//! Objects that reach beyond the scanned part of the wall.

use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::maps::Maps;
use thirdbounce::{Settings, prepare, reconstruct};
use thirdbounce_simulate::{Object, RenderOptions, Scene, rectangle, simulate};

/// The maps of a plate of .4 x .5 m, whose middle is at x, before a wall of 1 m; and the notes.
fn maps(x: f64) -> (Maps, Vec<String>) {
    let mesh = rectangle(dvec3(x, 0.05, 0.7), DVec3::Y * 0.25, DVec3::X * 0.2);
    let scene = Scene {
        objects: vec![Object { mesh, albedo: 1.0 }],
        photons: Some(200.0),
        scan: 32,
        seed: 7,
        ..Scene::named("letter-R").unwrap()
    };
    let capture = simulate(&scene, &RenderOptions::default()).unwrap().capture;
    let settings = Settings::from_texts([("deterministic", "true")]).unwrap();
    let capture = prepare(capture, &settings).unwrap();
    let result = reconstruct(&host(), &capture, &settings).unwrap();
    (result.maps, result.notes)
}

/// Intersection over union with the plate, over a square of 1.5 m.
fn iou(maps: &Maps, x: f64) -> f64 {
    let [mut both, mut either] = [0.0; 2];
    for i in 0..192 * 192 {
        let at = [i / 192, i % 192].map(|k| ((k as f64 + 0.5) / 192.0 - 0.5) * 1.5);
        let is_true = (at[0] - x).abs() < 0.2 && (at[1] - 0.05).abs() < 0.25;
        let is_found = maps.pixel_at(at[0], at[1]).is_some_and(|pixel| maps.mask[pixel]);
        both += f64::from(u8::from(is_true && is_found));
        either += f64::from(u8::from(is_true || is_found));
    }
    both / either
}

#[test]
fn a_plate_that_reaches_beyond_the_wall_is_seen_whole() {
    let (wide, notes) = maps(0.45);
    assert!(wide.extent[1] > 0.65, "{:?}", wide.extent);
    assert!(notes.iter().any(|note| note.contains("walls wide")), "{notes:?}");
    // On the wall alone it can be .62 at most.
    assert!(iou(&wide, 0.45) > 0.8, "{}", iou(&wide, 0.45));
}

#[test]
fn a_plate_at_the_edge_of_the_wall_needs_no_wider_box() {
    let (usual, notes) = maps(0.28);
    assert!((usual.extent[1] - 0.5).abs() < 0.03, "{:?}", usual.extent);
    assert!(notes.iter().all(|note| !note.contains("walls wide")), "{notes:?}");
    assert!(iou(&usual, 0.28) > 0.85, "{}", iou(&usual, 0.28));
}
