//! The surface solver in whole solves: results against truth for every kind of scan, what it begins with, what it refuses.

use std::ops::ControlFlow;
use std::sync::OnceLock;

use fixtures::device::*;
use glam::dvec2;
use thirdbounce::Kind;
use thirdbounce::capture::{Capture, Pulse};
use thirdbounce::engine::{Accumulation, Problem, Reconstruction, default_volume};
use thirdbounce::gpu::Gpu;
use thirdbounce::maps::{Maps, Truth};
use thirdbounce::measure::{Metrics, metrics};
use thirdbounce::methods::SolverOptions;
use thirdbounce::options::SceneTraits;
use thirdbounce::surface::{Begin, Pixels, SurfaceOptions};
use thirdbounce::transport::{Grid, Reflectance};
use thirdbounce_simulate::{Layout, RenderOptions, Scene, WallShape, simulate, truth};

fn maps(albedo: Vec<f32>, depth: Vec<f32>) -> Maps {
    let count = albedo.len();
    Maps {
        albedo,
        depth,
        normal: vec![[0.0, 0.0, -1.0]; count],
        mask: vec![true; count],
        mask_fraction: Some(0.3),
        ..Maps::empty([1, count], [0.0, 1.0, 0.0, 1.0])
    }
}

#[test]
fn pixels_are_the_lit_ones_with_a_depth() {
    let all =
        maps(vec![1.0, 0.0, 0.9, 0.0, 0.11, 2.0, 0.8], vec![0.5, 0.6, f32::NAN, f32::NAN, 0.7, 0.8, 0.9]);
    let pixels = Pixels::of(std::slice::from_ref(&all), 7);
    assert_eq!(pixels.columns, [0, 4, 5, 6]);
    assert_eq!(pixels.depth, [0.5, 0.7, 0.8, 0.9]);
    assert_eq!(pixels.albedo, [1.0, 0.11, 2.0, 0.8]);
    // Room for two: the brightest two, in the order of the maps.
    let two = Pixels::of(std::slice::from_ref(&all), 2);
    assert_eq!((two.columns, two.albedo), (vec![0, 5], vec![1.0, 2.0]));
    assert!(Pixels::of(std::slice::from_ref(&all), 0).is_empty());
    assert!(Pixels::of(&[maps(vec![0.0; 5], vec![f32::NAN; 5])], 5).is_empty());
    assert!(Pixels::of(&[maps(vec![1.0; 5], vec![f32::NAN; 5])], 5).is_empty());
}

#[test]
fn pixels_lie_along_a_morton_curve_layer_by_layer() {
    let square = Maps { nx: 4, ny: 4, ..maps(vec![1.0; 16], vec![0.5; 16]) };
    let pixels = Pixels::of(&[square.clone(), square], usize::MAX);
    let first = [0, 1, 4, 5, 2, 3, 6, 7, 8, 9, 12, 13, 10, 11, 14, 15];
    let both: Vec<u32> = first.into_iter().chain(first.map(|c| c + 16)).collect();
    assert_eq!((pixels.of_layers(16), &pixels.columns), ([16, 16], &both));
    let places = pixels.places(16);
    assert!((0..32).all(|pixel| places[pixels.columns[pixel] as usize] == pixel as u32), "{places:?}");
    // A side that is no power of two: the same order among those that there are.
    let narrow = Maps { nx: 2, ny: 3, ..maps(vec![1.0; 6], vec![0.5; 6]) };
    assert_eq!(Pixels::of(&[narrow], usize::MAX).columns, [0, 1, 3, 4, 2, 5]);
}

#[test]
fn finer_maps_bridge_no_edges() {
    let mut coarse = Maps { nx: 2, ny: 3, extent: [0.0, 2.0, 0.0, 3.0], ..maps(vec![1.0; 6], vec![0.5; 6]) };
    assert_eq!(coarse.finer(1), coarse);
    let fine = coarse.finer(3);
    assert_eq!((fine.nx, fine.ny, fine.extent), (6, 9, coarse.extent));
    assert!(fine.albedo.iter().all(|a| (a - 1.0).abs() < 1e-6));
    assert!(fine.depth.iter().all(|z| (z - 0.5).abs() < 1e-6) && fine.normal.iter().all(|n| n[2] == -1.0));
    // Between the centres of the first two along y, a slope of two pixels, then an edge of three, then nothing.
    coarse.depth = vec![1.0, 3.0, 6.0, 1.0, 3.0, f32::NAN];
    coarse.albedo = vec![1.0, 3.0, 1.0, 1.0, 3.0, 0.0];
    let fine = coarse.finer(2);
    let row = |v: &[f32], x: usize| v[6 * x..6 * x + 6].to_vec();
    assert_eq!(row(&fine.albedo, 0), [1.0, 1.5, 2.5, 2.5, 1.5, 1.0]);
    let depth = |light: [f32; 2], z: [f32; 2]| (light[0] * z[0] + light[1] * z[1]) / (light[0] + light[1]);
    let near = |a: &[f32], b: [f32; 6]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    let sloping = [depth([0.75, 0.75], [1.0, 3.0]), depth([0.25, 2.25], [1.0, 3.0])];
    // A quarter and three quarters of the way: 2.25 of three's light against 0.25 of six's, then 0.75 and 0.75.
    let edge = row(&fine.depth, 0);
    assert!(near(&edge[..4], [1.0, sloping[0], sloping[1], 3.0, 0.0, 0.0]), "{edge:?}");
    assert!(edge[4] == 3.0 || edge[4] == 6.0, "no mean of both sides: {edge:?}");
    assert_eq!(edge[5], 6.0);
    // A dark pixel without depth does not count for its neighbours, and keeps no depth.
    let other = row(&fine.depth, 3);
    assert!(
        near(&other[..5], [1.0, sloping[0], sloping[1], 3.0, 3.0, 0.0]) && other[5].is_nan(),
        "{other:?}"
    );
    assert_eq!(row(&fine.albedo, 3), [1.0, 1.5, 2.5, 2.25, 0.75, 0.0]);
    assert!(fine.normal[6 * 3 + 5][2].is_nan() && fine.mask[6 * 3 + 2] && !fine.mask[6 * 3 + 5]);
    coarse.check().and(fine.check()).unwrap();
}

#[test]
fn pixels_as_buffers() {
    let pixels = Pixels { columns: vec![1, 4], albedo: vec![0.5, 2.0], depth: vec![0.75, 1.5] };
    assert_eq!(pixels.places(6), [u32::MAX, 0, u32::MAX, u32::MAX, 1, u32::MAX]);
}

const LATERAL: usize = 32;

fn scene(name: &str) -> Scene {
    Scene { scan: 16, bin_width: 0.01, ..Scene::named(name).unwrap() }
}

fn rendered(scene: &Scene) -> Capture {
    simulate(scene, &RenderOptions { noise: 0.05, ..Default::default() }).unwrap().capture
}

/// A sphere, and its truth.
fn sphere() -> &'static (Capture, Truth) {
    static SPHERE: OnceLock<(Capture, Truth)> = OnceLock::new();
    SPHERE.get_or_init(|| (rendered(&scene("sphere")), truth(&scene("sphere"), LATERAL).unwrap()))
}

fn options(capture: &Capture) -> SurfaceOptions {
    SurfaceOptions::defaults_for(&SceneTraits::of(capture)).with(|o| {
        o.lateral = LATERAL;
        o.iterations = 40;
    })
}

/// A dozen iterations on few pixels, with the same bits in every run.
fn short(capture: &Capture) -> SurfaceOptions {
    options(capture).with(|o| {
        o.lateral = 16;
        o.iterations = 12;
        o.accumulation = Accumulation::Repeatable;
    })
}

fn grid(capture: &Capture, lateral: usize) -> Grid {
    Grid::new(default_volume(capture, 0.2).unwrap(), lateral, 0.015).unwrap()
}

fn solve(gpu: &Gpu, capture: &Capture, options: impl Into<SolverOptions>) -> Reconstruction {
    let options = options.into();
    let grid = grid(capture, options.common().lateral);
    let mut hear = |_: &_| ControlFlow::Continue(());
    let done =
        options.solve(gpu, &Problem::new(capture, grid).and_volume(), &mut unwatched(&mut hear)).unwrap();
    done.maps.check().unwrap();
    // Closed forms have no loss.
    let is_finite = done.trace.iter().all(|p| p.loss.is_finite() && p.data_loss.is_finite());
    assert!(is_finite || options.is_closed_form());
    done
}

fn figures(done: &Reconstruction, truth: &Truth) -> Metrics {
    metrics(&done.maps, truth, None).unwrap()
}

/// The bits of the maps, including NaN.
fn bits(maps: &Maps) -> Vec<u32> {
    let all = maps.albedo.iter().chain(&maps.depth).chain(maps.normal.iter().flatten());
    all.map(|v| v.to_bits()).collect()
}

#[test]
fn the_fit_betters_what_it_begins_with_and_comes_near_from_a_plane() {
    let gpu = host();
    let (capture, truth) = sphere();
    let of = |done: &Reconstruction| {
        let m = figures(done, truth);
        // Errors within the maps' own mask: the best one of the truth is smaller where errors are large.
        (m.best_iou.unwrap(), m.depth_mae.unwrap(), m.normal_error_deg.unwrap())
    };
    let closed = |name: &str| {
        let suited = SolverOptions::defaults_for(name, &SceneTraits::of(capture)).unwrap();
        of(&solve(&gpu, capture, suited.with_lateral(LATERAL)))
    };
    let [of_lct, of_fbp, of_plane] = [Begin::Lct, Begin::Fbp, Begin::Plane]
        .map(|begin| solve(&gpu, capture, options(capture).with(|o| o.begin = begin)));
    for (before, after) in [(closed("lct"), of(&of_lct)), (closed("fbp"), of(&of_fbp))] {
        println!("{before:?} {after:?}");
        assert!(after.1 < 0.8 * before.1 && after.2 < 0.6 * before.2);
    }
    let plane = of(&of_plane);
    println!("{plane:?}");
    // The plane itself is 0.07 m off on average. Pixels beside the sphere share its light.
    assert!(plane.0 > 0.4 && plane.1 < 0.025);
    // Its volume is its surface.
    let lit = |v: &[f32]| v.iter().filter(|v| **v > 0.0).count();
    assert_eq!(lit(&of_lct.volume.as_ref().unwrap().albedo), lit(&of_lct.maps.albedo));
    assert_valid(&gpu);
}

#[test]
fn it_begins_with_what_the_capture_allows() {
    let gpu = host();
    let spot = Layout::OneLaser { point: dvec2(0.1, -0.1) };
    let capture = rendered(&Scene { scan: 12, layout: spot, ..scene("sphere") });
    let of = |capture: &Capture, begin| short(capture).with(|o| o.begin = begin);
    let lct = SolverOptions::from(of(&capture, Begin::Lct));
    let error = lct.prepare(&gpu, &Problem::new(&capture, grid(&capture, 16)));
    let error = error.err().expect("a scan that is not confocal");
    assert_eq!(error.kind, Kind::Input);
    assert!(error.what.contains("confocal") && error.hint.to_string().contains("auto"), "{error}");
    assert!(lct.takes(&capture).is_err());
    let same = |capture: &Capture| {
        let [auto, fbp] = [Begin::Auto, Begin::Fbp].map(|b| bits(&solve(&gpu, capture, of(capture, b)).maps));
        auto == fbp
    };
    assert!(same(&capture) && !same(&sphere().0));
    assert_valid(&gpu);
}

/// Every kind of pairs on flat and curved walls: overlap with the true mask, and depth errors in metres.
#[test]
fn every_kind_of_pairs_finds_the_scene() {
    let gpu = host();
    let point = dvec2(0.1, -0.1);
    let figure = || Scene { scan: 12, bin_width: 0.015, ..Scene::named("figure").unwrap() };
    let of = |layout| Scene { layout, ..figure() };
    let bump = || Scene { wall_shape: WallShape::Bump, reflectance: Reflectance::Lambertian, ..figure() };
    let truth = truth(&figure(), LATERAL).unwrap();
    for (name, scene) in [
        ("confocal", figure()),
        ("one laser point", of(Layout::OneLaser { point })),
        ("one sensor point", of(Layout::OneSensor { point })),
        ("exhaustive", Scene { scan: 8, ..of(Layout::Exhaustive { lasers: 3 }) }),
        ("irregular", of(Layout::Irregular { seed: 3 })),
        ("confocal, a curved wall", bump()),
        ("irregular, a curved wall", Scene { layout: Layout::Irregular { seed: 4 }, ..bump() }),
    ] {
        let capture = rendered(&scene);
        let o = options(&capture).with(|o| o.reflectance = scene.reflectance);
        let m = figures(&solve(&gpu, &capture, o), &truth);
        assert!(m.iou > Some(0.6) && m.depth_mae < Some(0.01), "{name}: {m:?}");
    }
    assert_valid(&gpu);
}

/// A support that grows finds what the closed form misses.
#[test]
fn the_support_follows_the_evidence() {
    let gpu = host();
    let torus = scene("torus");
    let (capture, truth) = (rendered(&torus), truth(&torus, LATERAL).unwrap());
    let [fixed, auto] =
        [false, true].map(|grow| solve(&gpu, &capture, options(&capture).with(|o| o.grow = grow)));
    assert_eq!(fixed.trace.last().unwrap().iteration, 40);
    assert!(auto.trace.last().unwrap().iteration > 40, "rounds of short fits come first");
    let [fixed, auto] = [&fixed, &auto].map(|r| figures(r, &truth));
    assert!(auto.iou > Some(0.8) && auto.iou.unwrap() > fixed.iou.unwrap() - 0.02, "{fixed:?} {auto:?}");
    assert!(auto.depth_mae.unwrap() < 0.005, "{auto:?}");
    assert_valid(&gpu);
}

/// Rounds on pixels of twice the width come before those of the maps.
#[test]
fn many_pixels_begin_with_coarse_ones() {
    let gpu = host();
    let (capture, _) = sphere();
    let o = short(capture).with(|o| o.lateral = 128);
    let done = solve(&gpu, capture, o);
    let laterals: Vec<usize> = done.trace.iter().map(|p| p.lateral).collect();
    assert!(laterals.is_sorted() && laterals[0] == 64 && laterals[laterals.len() - 1] == 128, "{laterals:?}");
    let truth = truth(&scene("sphere"), 128).unwrap();
    let m = figures(&done, &truth);
    assert!(m.iou > Some(0.75) && m.depth_mae < Some(0.01), "{m:?}");
    assert_valid(&gpu);
}

#[test]
fn repeatable_sums_give_the_same_bits_twice() {
    let gpu = gpu();
    let (capture, _) = sphere();
    for accumulation in [Accumulation::Fixed, Accumulation::Owned] {
        let o = short(capture).with(|o| o.accumulation = accumulation);
        let [one, two] = [(); 2].map(|()| solve(&gpu, capture, o.clone()));
        assert!(one.maps.mask.iter().filter(|m| **m).count() > 10);
        assert_eq!(bits(&one.maps), bits(&two.maps));
        assert_eq!(one.trace.last().unwrap().loss, two.trace.last().unwrap().loss);
    }
    assert_valid(&gpu);
}

#[test]
fn captures_without_light_leave_nothing_behind() {
    let gpu = host();
    let (capture, _) = sphere();
    let mut dark = capture.clone();
    dark.histograms.fill(0.0);
    // Light that is earlier than any place of the box returns it.
    let mut early = dark.clone();
    early.histograms.iter_mut().step_by(capture.bins).for_each(|h| *h = 1.0);
    let problem = Problem::new(capture, grid(capture, 16));
    for begin in [Begin::Lct, Begin::Plane] {
        let o = SolverOptions::from(short(capture).with(|o| o.begin = begin));
        let mut prepared = o.prepare(&gpu, &problem).unwrap();
        prepared.allocate().unwrap();
        let mut hear = |_: &_| ControlFlow::Continue(());
        let mut solve = |capture: &Capture| prepared.solve(capture, &mut unwatched(&mut hear)).unwrap().maps;
        let first = solve(capture);
        for none in [&dark, &early] {
            let nothing = solve(none);
            nothing.check().unwrap();
            assert!(nothing.albedo.iter().all(|a| *a == 0.0), "{begin:?}");
            assert!(nothing.mask.iter().all(|m| !m) && nothing.depth.iter().all(|z| z.is_nan()), "{begin:?}");
        }
        assert_eq!(bits(&first), bits(&solve(capture)), "{begin:?}");
    }
    let mut stop = |_: &_| ControlFlow::Break(());
    let error = SolverOptions::from(short(capture)).solve(&gpu, &problem, &mut unwatched(&mut stop));
    assert_eq!(error.unwrap_err().kind, Kind::Cancelled);
    assert_valid(&gpu);
}

/// Few pairs, few bins, few pixels: every solve ends with maps that hold.
#[test]
fn a_fixed_support_has_the_resolution_of_the_maps() {
    let (capture, _) = sphere();
    let volume = default_volume(capture, 0.2).unwrap();
    for lateral in [64, 128] {
        let o = SolverOptions::from(short(capture).with(|o| (o.lateral, o.grow) = (lateral, false)));
        let grid = Grid::new(volume, lateral, 0.015).unwrap();
        let mut hear = |_: &_| ControlFlow::Continue(());
        let done = o.solve(&host(), &Problem::new(capture, grid), &mut unwatched(&mut hear)).unwrap();
        assert!(done.maps.nx == lateral && done.maps.mask.contains(&true));
    }
}

#[test]
fn small_and_odd_inputs_end_well() {
    let gpu = host();
    let (capture, _) = sphere();
    let one_bin = {
        let sum: Vec<f32> = capture.histograms.chunks(capture.bins).map(|h| h.iter().sum()).collect();
        let width = capture.bin_width * capture.bins as f64;
        let mut one =
            Capture::new(capture.scan, capture.laser.clone(), capture.sensor.clone(), 1, width, sum);
        one.t_start = capture.t_start;
        one
    };
    let one_pair = capture.subset(1, 0).unwrap();
    let two = capture.subset(2, 0).unwrap();
    let mut photon = capture.clone();
    photon.histograms.fill(0.0);
    photon.histograms[capture.bins * 100 + capture.bins / 2] = 1.0;
    photon.integer_counts = true;
    let negative = {
        let mut c = capture.clone();
        let most = c.histograms.iter().copied().fold(0.0, f32::max);
        c.histograms.iter_mut().for_each(|h| *h -= 0.1 * most);
        c
    };
    // Their walls may have no extent.
    let volume = default_volume(capture, 0.2).unwrap();
    for (name, capture) in [
        ("one bin", &one_bin),
        ("one pair", &one_pair),
        ("two pairs", &two),
        ("one photon", &photon),
        ("negative counts", &negative),
    ] {
        for (lateral, begin) in [(1, Begin::Auto), (7, Begin::Auto), (16, Begin::Plane), (65, Begin::Auto)] {
            let o = SolverOptions::from(short(capture).with(|o| {
                (o.lateral, o.begin) = (lateral, begin);
            }));
            let grid = Grid::new(volume, lateral, 0.015).unwrap();
            let mut hear = |_: &_| ControlFlow::Continue(());
            let done = o.solve(&gpu, &Problem::new(capture, grid), &mut unwatched(&mut hear));
            match done {
                Ok(done) => {
                    let what = format!("{name}, lateral {lateral}");
                    done.maps.check().unwrap_or_else(|e| panic!("{what}: {e}"));
                    assert!(done.trace.iter().all(|p| p.loss.is_finite()), "{what}");
                    assert!(done.maps.albedo.iter().all(|a| a.is_finite() && *a >= 0.0), "{what}");
                }
                Err(e) => assert!(matches!(e.kind, Kind::Input | Kind::Options), "{name}, {lateral}: {e}"),
            }
        }
    }
    assert_valid(&gpu);
}

/// More than 256 pairs are spread over the wall and taken in batches.
#[test]
fn a_large_scan_is_fitted_in_batches() {
    let gpu = host();
    let large = Scene { scan: 32, bin_width: 0.02, ..scene("sphere") };
    let capture = rendered(&large);
    let done = solve(&gpu, &capture, short(&capture));
    let batches = &done.plan.levels.batches;
    let level = done.plan.levels.pixels.as_ref().unwrap();
    assert!(batches.len() > 1, "{}", batches.len());
    assert_eq!(batches.iter().map(|b| b.pairs).sum::<usize>(), level.pairs);
    assert!(batches.windows(2).all(|two| two[0].first + two[0].pairs == two[1].first));
    let some = solve(&gpu, &capture, short(&capture).with(|o| o.pairs = 256));
    let used = some.plan.levels.pixels.as_ref().unwrap().pairs;
    assert_eq!(used, 256);
    assert!(some.plan.left_out.iter().any(|l| l.contains("of 1024 pairs")), "{:?}", some.plan.left_out);
    assert_valid(&gpu);
}

/// The impulse response and its tail are part of the model: results are as with sharp paths.
#[test]
fn an_impulse_response_is_part_of_the_model() {
    let gpu = host();
    let sharp = Scene { scan: 12, ..scene("figure") };
    let truth = truth(&sharp, LATERAL).unwrap();
    for (name, pulse) in [
        ("sharp", None),
        ("Gaussian", Some(Pulse::gaussian(0.04).unwrap())),
        ("tail", Some(Pulse::gaussian(0.04).unwrap().with_tail(0.05).unwrap())),
    ] {
        let capture = rendered(&Scene { pulse, ..sharp.clone() });
        let m = figures(&solve(&gpu, &capture, options(&capture)), &truth);
        assert!(m.iou > Some(0.65) && m.depth_mae < Some(0.01), "{name}: {m:?}");
    }
    assert_valid(&gpu);
}
