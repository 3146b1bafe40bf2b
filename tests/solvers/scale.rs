//! Default settings on walls of any size: a scene in another unit gives the same maps.

use std::ops::ControlFlow;

use fixtures::captures::{changed, scaled};
use fixtures::device::*;
use thirdbounce::capture::Capture;
use thirdbounce::engine::{Accumulation, Problem, Watch};
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::maps::{Maps, Truth};
use thirdbounce::measure::metrics;
use thirdbounce::methods::{PaperOptions, SolverOptions};
use thirdbounce::options::SceneTraits;
use thirdbounce::surface::SurfaceOptions;
use thirdbounce::transport::Grid;
use thirdbounce::{Grade, Kind, Settings, reconstruct};
use thirdbounce_simulate::{RenderOptions, Scene, simulate, truth};

const LATERAL: usize = 24;

fn solved(gpu: &Gpu, solver: &str, capture: &Capture) -> Maps {
    let mut options = SolverOptions::defaults_for(solver, &SceneTraits::of(capture)).unwrap();
    match &mut options {
        SolverOptions::Paper(o) => (o.iterations, o.domain.double_every) = (24, 8),
        SolverOptions::Surface(o) => o.iterations = 24,
        _ => {}
    }
    // Sums in a fixed order, so that rounding is all that differs.
    let options = options.with_lateral(LATERAL).with_accumulation(Accumulation::Repeatable);
    let volume = options.default_volume(capture).unwrap();
    let grid = Grid::new(volume, LATERAL, capture.bin_width).unwrap();
    let mut hear = |_: &_| ControlFlow::Continue(());
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    options.solve(gpu, &Problem::new(capture, grid), &mut watch).unwrap().maps
}

/// The truth of the scene in another unit.
fn resized(truth: &Truth, scale: f64) -> Truth {
    Truth {
        extent: truth.extent.map(|v| v * scale),
        depth: truth.depth.iter().map(|z| (f64::from(*z) * scale) as f32).collect(),
        ..truth.clone()
    }
}

#[test]
#[ignore = "long: make soak"]
fn default_settings_know_no_unit() {
    let gpu = host();
    let scene = Scene { scan: 12, bin_width: 0.02, ..Scene::named("figure").unwrap() };
    let metre = simulate(&scene, &RenderOptions { noise: 0.1, ..Default::default() }).unwrap().capture;
    let truth = truth(&scene, LATERAL).unwrap();
    for solver in SolverOptions::NAMES {
        let as_metre = solved(&gpu, solver, &metre);
        let best = metrics(&as_metre, &truth, 0.3).unwrap();
        assert!(best.best_iou.unwrap() > 0.4, "{solver}: {best:?}");
        // What has no iterations has little that could know a unit.
        let iterates = ["paper", "surface"].contains(solver);
        let scales = match *solver {
            // Rounding decides on single pixels of the support, and these on others.
            SurfaceOptions::NAME => &[1.0 / 1024.0, 4096.0][..],
            _ if iterates => &[1e-3, 1.0 / 1024.0, 1e3],
            _ => &[1e3],
        };
        for scale in scales.iter().copied() {
            let maps = solved(&gpu, solver, &scaled(&metre, scale));
            let other = metrics(&maps, &resized(&truth, scale), 0.3).unwrap();
            let off = (other.best_iou.unwrap() - best.best_iou.unwrap()).abs();
            assert!(off < 5e-3, "{solver}, {scale}: {:?}, {:?}", other.best_iou, best.best_iou);
            let apart = |(a, b): (&f32, &f32)| (f64::from(*a) / scale - f64::from(*b)).abs();
            let mut apart: Vec<f64> =
                maps.depth.iter().zip(&as_metre.depth).map(apart).filter(|d| d.is_finite()).collect();
            apart.sort_unstable_by(f64::total_cmp);
            // A power of two changes no rounding. Otherwise rounding moves single pixels.
            let share = if scale.log2().fract() == 0.0 { 1.0 } else { 0.9 };
            // Filtered sums cancel: dark pixels keep fewer digits.
            let rounding = if iterates { 2e-5 } else { 2e-4 };
            let most = apart[((apart.len() - 1) as f64 * share) as usize];
            // The surface has depths where it is lit, the others nearly everywhere.
            let fewest = if *solver == SurfaceOptions::NAME { 60 } else { 300 };
            assert!(
                apart.len() > fewest && most < if share == 1.0 { 1e-12 } else { rounding },
                "{solver}, {scale}: {most}, {} pixels",
                apart.len()
            );
        }
    }
    assert_valid(&gpu);
}

#[test]
fn the_least_depth_follows_walls_that_are_not_of_metres() {
    let scan = |wall: f64| {
        let scene = Scene { scan: 4, wall, bins: Some(4), ..Scene::named("plane").unwrap() };
        let pairs = scene.pairs();
        Capture::new(pairs.scan, pairs.laser, pairs.sensor, 4, wall, vec![1.0; 64])
    };
    for solver in SolverOptions::NAMES {
        let least = |wall: f64| {
            SolverOptions::defaults_for(solver, &SceneTraits::of(&scan(wall))).unwrap().common().min_depth
        };
        if *solver != PaperOptions::NAME {
            for wall in [1e-3, 0.1, 0.26, 1.0, 7.9, 1e3] {
                assert!((least(wall) / wall - 0.1).abs() < 1e-12, "{solver}, {wall}");
            }
            continue;
        }
        for ordinary in [0.26, 1.0, 2.0, 7.9] {
            assert_eq!(least(ordinary), 0.2, "{solver}, {ordinary}");
        }
        for other in [1e-3, 0.1, 10.0, 1e3] {
            assert!((least(other) / other - 0.2).abs() < 1e-12, "{solver}, {other}");
        }
    }
    // The usual depth leaves nothing of a small scene.
    let small = scan(0.01);
    let usual = SolverOptions::defaults_for("surface", &SceneTraits::DEFAULT).unwrap();
    assert_eq!(usual.default_volume(&small).unwrap_err().kind, Kind::Options);
    assert!(
        SolverOptions::defaults_for("surface", &SceneTraits::of(&small))
            .unwrap()
            .default_volume(&small)
            .is_ok()
    );
}

/// Half or twice the wall, and points in feet, are undone and named with the factor; the right wall has no such reason.
#[test]
fn a_wall_of_the_wrong_size_is_undone() {
    let gpu = Gpu::open(&GpuOptions::default()).expect("a device");
    let scene = Scene { scan: 16, bin_width: 0.01, photons: Some(1000.0), ..Scene::named("figure").unwrap() };
    let capture = simulate(&scene, &RenderOptions::default()).unwrap().capture;
    let settings = Settings::from_texts([("lateral", "32"), ("deterministic", "true")]).unwrap();
    for wrong in [1.0, 0.5, 3.28084] {
        let taken = changed(&capture, |c| {
            c.laser.iter_mut().chain(&mut c.sensor).for_each(|point| *point *= wrong);
        });
        let verdict = reconstruct(&gpu, &taken, &settings).unwrap().verdict.unwrap();
        let factor = verdict.reasons.iter().find_map(|reason| {
            let (_, rest) = reason.split_once("the wall is ")?;
            rest.split_once(" times as large").map(|(factor, _)| factor.parse::<f64>().unwrap())
        });
        if wrong == 1.0 {
            assert_eq!(factor, None, "{verdict:?}");
            continue;
        }
        let found = factor.unwrap_or_else(|| panic!("{wrong}: {verdict:?}"));
        assert!((found * wrong - 1.0).abs() < 0.05 && verdict.grade == Grade::Fair, "{wrong}: {verdict:?}");
    }
}
