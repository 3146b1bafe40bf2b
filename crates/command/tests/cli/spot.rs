//! What laser and sensor see of the wall: simulated, kept by formats, part of the model.

use std::ops::ControlFlow;

use fixtures::captures::changed;
use fixtures::command::{fail, succeed};
use fixtures::device::gpu;
use thirdbounce::capture::{Capture, read, write};
use thirdbounce::engine::{Problem, Progress, Watch, default_volume};
use thirdbounce::job::load;
use thirdbounce::measure::metrics;
use thirdbounce::methods::SolverOptions;
use thirdbounce::settings::Settings;
use thirdbounce::surface::SurfaceOptions;
use thirdbounce::transport::Grid;
use thirdbounce_simulate::{Layout, RenderOptions, Scene, simulate, truth};

/// Two steps of a scan of 16 x 16 points.
const WIDE: f64 = 0.125;

/// Pixels of the maps side by side.
const LATERAL: usize = 32;

fn scene(spots: [f64; 2]) -> Scene {
    Scene { scan: 16, bin_width: 0.01, spots, ..Scene::named("figure").unwrap() }
}

fn capture(scene: &Scene) -> Capture {
    simulate(scene, &RenderOptions { noise: 0.06, ..RenderOptions::default() }).unwrap().capture
}

/// Mean and variance of every pair's path, in metres, weighted by light.
fn moments(c: &Capture) -> Vec<[f64; 2]> {
    let of = |h: &[f32]| {
        let total: f64 = h.iter().map(|v| f64::from(*v)).sum();
        let at = |bin: usize| c.t_start + (bin as f64 + 0.5) * c.bin_width;
        let mean = h.iter().enumerate().map(|(b, v)| f64::from(*v) * at(b)).sum::<f64>() / total;
        let square = h.iter().enumerate().map(|(b, v)| f64::from(*v) * (at(b) - mean).powi(2)).sum::<f64>();
        [mean, square / total]
    };
    c.histograms.chunks_exact(c.bins).map(of).collect()
}

/// A small plate, seen from one laser point: its paths spread as the distance to it changes over the spot.
#[test]
fn a_simulated_spot_spreads_paths_as_its_points_do() {
    let plate = |spots| {
        let mut scene = scene(spots);
        scene.objects.truncate(1);
        scene.objects[0].mesh = thirdbounce_simulate::sphere(glam::dvec3(0.3, 0.0, 0.7), 0.01);
        scene.layout = Layout::OneLaser { point: glam::dvec2(-0.1, 0.0) };
        scene
    };
    let (sharp, laser) = (capture(&plate([0.0; 2])), capture(&plate([0.1, 0.0])));
    assert_eq!([laser.laser_spot, laser.sensor_spot], [Some(0.1), None]);
    let sigma = 0.1 / (8.0 * std::f64::consts::LN_2).sqrt();
    let slope: f64 = 0.4 / 0.4f64.hypot(0.7);
    for ([_, before], [_, after]) in moments(&sharp).into_iter().zip(moments(&laser)) {
        let added = (after - before) / (slope * sigma).powi(2);
        assert!((added - 1.0).abs() < 0.15, "{added}");
    }
}

#[test]
#[ignore = "long: make soak"]
fn a_known_spot_makes_depths_and_normals_better() {
    let scene = scene([WIDE; 2]);
    let capture = capture(&scene);
    let truth = truth(&scene, LATERAL).unwrap();
    let gpu = gpu();
    let options = SolverOptions::from(SurfaceOptions::default().with(|o| o.lateral = LATERAL));
    let solve = |capture: &Capture| {
        let grid = Grid::new(default_volume(capture, 0.2).unwrap(), LATERAL, capture.bin_width).unwrap();
        let mut hear = |_: &Progress| ControlFlow::Continue(());
        let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
        let done = options.solve(&gpu, &Problem::new(capture, grid), &mut watch).unwrap();
        let best = metrics(&done.maps, &truth, 0.3).unwrap().at_best.unwrap();
        (best.depth_mae.unwrap(), best.normal_error_deg.unwrap(), done.plan)
    };
    let points = changed(&capture, |c| (c.laser_spot, c.sensor_spot) = (None, None));
    let (with, without) = (solve(&capture), solve(&points));
    assert!(with.2.has_spots() && !without.2.has_spots());
    assert!(without.2.left_out.iter().any(|l| l.contains("spots")));
    assert!(without.2.buffers.iter().all(|b| !b.buffer.to_string().contains("spot_taps") || b.bytes == 0));
    println!("with {:?} without {:?}", (with.0, with.1), (without.0, without.1));
    assert!(with.0 < 0.85 * without.0 && with.1 < 0.85 * without.1);
}

#[test]
fn captures_keep_their_spots_and_options_replace_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let text = |name: &str| file(name).display().to_string();
    let plane = ["simulate", "plane", "--scan", "6", "--noise", "0.3", "--quiet", "--out"];
    succeed(&[&plane[..], &[&text("a.npz"), "--spot", "0.1,0.05"]].concat());
    let spots = |c: &Capture| [c.laser_spot, c.sensor_spot];
    let a = read(&file("a.npz")).unwrap();
    assert_eq!(spots(&a), [Some(0.1), Some(0.05)]);
    succeed(&["convert", &text("a.npz"), &text("b.npz"), "--bin", "2"]);
    assert_eq!(spots(&read(&file("b.npz")).unwrap()), spots(&a));
    let notes = write(&a, &file("c.hdf5")).unwrap();
    assert!(notes.iter().any(|n| n.contains("spots")), "{notes:?}");
    // A spot in the file is scaled with the wall; one that is given is not.
    let load =
        |wall, spot| load(&file("a.npz"), &Settings { wall, spot, ..Settings::default() }).unwrap().capture;
    let twice = load(Some(2.0 * 5.0 / 6.0), None);
    assert!((twice.laser_spot.unwrap() - 0.2).abs() < 1e-9, "{:?}", twice.laser_spot);
    assert_eq!(spots(&load(Some(3.0), Some([0.3, 0.0]))), [Some(0.3), Some(0.0)]);
    let reported = succeed(&["info", &text("a.npz")]);
    assert!(reported.contains("spots     laser 0.1000 m wide, sensor 0.0500 m wide"), "{reported}");
    assert!(!succeed(&["info", &text("a.npz"), "--spot", "none"]).contains("spots     laser"));
    for wrong in ["wide", "0.1,", "-1", "0.1,0.2,0.3"] {
        fail(&["info", &text("a.npz"), &format!("--spot={wrong}")], 1, "--spot is");
    }
    let damaged = changed(&a, |c| c.laser_spot = Some(-0.1));
    assert!(damaged.check().unwrap_err().to_string().contains("laser spot"));
}
