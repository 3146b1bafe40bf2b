//! Flat things in dim light: their edges, and print that is darker than the plate.

use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::capture::Reflectance;
use thirdbounce::measure::metrics;
use thirdbounce::{Settings, prepare, reconstruct};
use thirdbounce_simulate::{Dark, Object, RenderOptions, Scene, rectangle, simulate, truth};

/// A plate whose left half has a quarter of the albedo, in the light of a few photons.
fn two_tones() -> Scene {
    let half = |x: f64, albedo: f64| {
        let mesh = rectangle(dvec3(x, 0.0, 0.65), DVec3::Y * 0.28, DVec3::X * 0.16);
        Object { mesh, albedo }
    };
    Scene {
        objects: vec![half(0.16, 0.9), half(-0.16, 0.225)],
        reflectance: Reflectance::Lambertian,
        photons: Some(50.0),
        dark: Dark::Counts(0.5),
        bin_width: 0.01,
        scan: 48,
        seed: 90417,
        ..Scene::named("letter-R").unwrap()
    }
}

#[test]
fn the_darker_half_of_a_plate_is_seen_with_its_albedo() {
    let scene = two_tones();
    let capture = simulate(&scene, &RenderOptions::default()).unwrap().capture;
    let truth = truth(&scene, 128).unwrap();
    let settings = Settings::from_texts([("deterministic", "true")]).unwrap();
    let capture = prepare(capture, &settings).unwrap();
    let maps = reconstruct(&host(), &capture, &settings).unwrap().maps;
    let found = metrics(&maps, &truth, None).unwrap();
    // Without the dark half it is .5.
    assert!(found.iou.unwrap() > 0.85, "{:?}", found.iou);
    assert!(found.albedo_ratio_error.unwrap() < 0.15, "{:?}", found.albedo_ratio_error);
    assert!(found.normal_error_deg.unwrap() < 2.0, "{:?}", found.normal_error_deg);
}
