//! The surface without a volume before it: what it finds from a closed-form method and from a plane, and what it refuses.

use std::ops::ControlFlow;
use std::sync::OnceLock;

use fixtures::device::*;
use thirdbounce::Kind;
use thirdbounce::capture::Capture;
use thirdbounce::gpu::Gpu;
use thirdbounce::maps::Truth;
use thirdbounce::measure::{Metrics, metrics};
use thirdbounce::simulate::{Layout, RenderOptions, Scene, simulate, truth};
use thirdbounce::solve::option::OptionValue;
use thirdbounce::solve::{Problem, Reconstruction, SolverOptions, Suit, Watch, default_volume};
use thirdbounce::transport::Grid;

const LATERAL: usize = 32;

fn scene() -> Scene {
    Scene { scan: 16, bin_width: 0.01, ..Scene::named("sphere").unwrap() }
}

fn rendered(scene: &Scene) -> Capture {
    simulate(scene, &RenderOptions { noise: 0.05, ..Default::default() }).unwrap().capture
}

/// A sphere, and its truth.
fn sphere() -> &'static (Capture, Truth) {
    static SPHERE: OnceLock<(Capture, Truth)> = OnceLock::new();
    SPHERE.get_or_init(|| (rendered(&scene()), truth(&scene(), LATERAL).unwrap()))
}

fn options(capture: &Capture, name: &str, begin: &str) -> SolverOptions {
    let mut options = SolverOptions::suited_to(name, &Suit::of(capture)).unwrap();
    options.set("lateral", &OptionValue::Count(LATERAL));
    options.set("begin", &OptionValue::Word(begin.into()));
    options.set("surface_iterations", &OptionValue::Count(40));
    options
}

fn grid(capture: &Capture) -> Grid {
    Grid::new(default_volume(capture, 0.2).unwrap(), LATERAL, 0.015).unwrap()
}

fn solve(gpu: &Gpu, capture: &Capture, options: &SolverOptions) -> Reconstruction {
    let mut hear = |_: &_| ControlFlow::Continue(());
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    options.solve(gpu, &Problem::new(capture, grid(capture)).and_volume(), &mut watch).unwrap()
}

/// Figures against the truth.
fn figures(done: &Reconstruction, truth: &Truth) -> Metrics {
    metrics(&done.maps, truth, None).unwrap()
}

#[test]
fn it_betters_what_it_begins_with_and_comes_near_from_a_plane() {
    let gpu = gpu();
    let (capture, truth) = sphere();
    let figures_of = |name: &str, begin: &str| {
        let done = solve(&gpu, capture, &options(capture, name, begin));
        done.maps.check().unwrap();
        let m = figures(&done, truth);
        // Errors within the maps' own mask: the best one of the truth is smaller where errors are large.
        (m.best_iou.unwrap(), m.depth_mae.unwrap(), m.normal_error_deg.unwrap(), done)
    };
    let [lct, fbp] = ["lct", "fbp"].map(|name| figures_of(name, "auto"));
    let [of_lct, of_fbp, of_plane] = ["lct", "fbp", "plane"].map(|begin| figures_of("surface", begin));
    for (before, after) in [(&lct, &of_lct), (&fbp, &of_fbp)] {
        assert!(after.1 < 0.8 * before.1 && after.2 < 0.6 * before.2);
    }
    // The plane itself is 0.07 m off on average. Pixels beside the sphere share its light.
    assert!(of_plane.0 > 0.4 && of_plane.1 < 0.025);
    // Its volume is its surface.
    let volume = of_lct.3.volume.as_ref().unwrap();
    let lit = volume.albedo.iter().filter(|v| **v > 0.0).count();
    assert_eq!(lit, of_lct.3.maps.albedo.iter().filter(|a| **a > 0.0).count());
    assert_eq!((of_lct.3.volume_iterations, of_lct.3.trace.last().unwrap().iteration), (0, 40));
    assert_valid(&gpu);
}

#[test]
fn it_begins_with_what_the_capture_allows() {
    let gpu = gpu();
    let spot = Layout::OneLaser { point: glam::dvec2(0.1, -0.1) };
    let capture = rendered(&Scene { scan: 12, layout: spot, ..scene() });
    let error = options(&capture, "surface", "lct").prepare(&gpu, &Problem::new(&capture, grid(&capture)));
    let error = error.err().expect("a scan that is not confocal");
    assert_eq!(error.kind, Kind::Input);
    assert!(error.what.contains("confocal") && error.mend.to_string().contains("auto"), "{error}");
    assert!(options(&capture, "surface", "lct").takes(&capture).is_err());
    let [auto, fbp] = ["auto", "fbp"].map(|b| solve(&gpu, &capture, &options(&capture, "surface", b)).maps);
    assert_eq!(
        auto.depth.iter().map(|z| z.to_bits()).collect::<Vec<_>>(),
        fbp.depth.iter().map(|z| z.to_bits()).collect::<Vec<_>>()
    );
    // Of a confocal one it begins with another method.
    let (capture, _) = sphere();
    let [auto, fbp] = ["auto", "fbp"].map(|b| solve(&gpu, capture, &options(capture, "surface", b)).maps);
    assert_ne!(auto.albedo, fbp.albedo);
    assert_valid(&gpu);
}

#[test]
fn frames_and_captures_without_light_leave_nothing_behind() {
    let gpu = gpu();
    let (capture, _) = sphere();
    let mut dark = capture.clone();
    dark.histograms.fill(0.0);
    for begin in ["lct", "plane"] {
        let options = options(capture, "surface", begin);
        let mut prepared = options.prepare(&gpu, &Problem::new(capture, grid(capture))).unwrap();
        prepared.allocate().unwrap();
        let mut hear = |_: &_| ControlFlow::Continue(());
        let mut solve = |capture: &Capture| {
            let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
            prepared.solve(capture, (&mut watch).into()).unwrap().maps
        };
        let first = solve(capture);
        let nothing = solve(&dark);
        assert!(nothing.albedo.iter().all(|a| *a == 0.0), "{begin}");
        nothing.check().unwrap();
        let again = solve(capture);
        assert_eq!(first.albedo, again.albedo, "{begin}");
    }
    let mut stop = |_: &_| ControlFlow::Break(());
    let mut watch = Watch { hear: &mut stop, maps_every: None, maps_at: &[] };
    let options = options(capture, "surface", "auto");
    let error = options.solve(&gpu, &Problem::new(capture, grid(capture)), &mut watch).unwrap_err();
    assert_eq!(error.kind, Kind::Cancelled);
    assert_valid(&gpu);
}
