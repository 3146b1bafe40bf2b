//! Leaving work out changes no result: every variant that a scene can get is compared with the most general one in whole
//! solves of both solvers. The plan says what it left out.

use std::ops::ControlFlow;

use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::capture::{Capture, Gate};
use thirdbounce::engine::{Accumulation, Plan, Problem, Reconstruction, Solver, default_volume};
use thirdbounce::gpu::Gpu;
use thirdbounce::methods::{PaperOptions, SolverOptions};
use thirdbounce::options::Preset;
use thirdbounce::surface::{Begin, SurfaceOptions};
use thirdbounce::transport::{Geometry, Grid, Reflectance, Sampling};

/// A capture of a few pairs of that kind off a flat or a curved wall. Its hidden scene is two points, rendered by hand.
fn capture(geometry: Geometry, curved: bool) -> Capture {
    let mut random = Random::new(91);
    let mut point = || {
        let (x, y) = (random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4));
        dvec3(x, y, if curved { 0.1 * (x - y * y) } else { 0.0 })
    };
    let (laser, sensor): (Vec<DVec3>, Vec<DVec3>) = match geometry {
        Geometry::Confocal => (0..24).map(|_| point()).map(|p| (p, p)).unzip(),
        Geometry::TwoPoints => (0..24).map(|_| (point(), point())).unzip(),
        Geometry::Product => {
            let [a, b]: [Vec<DVec3>; 2] = [6, 5].map(|n| (0..n).map(|_| point()).collect());
            a.iter().flat_map(|l| b.iter().map(|s| (*l, *s))).unzip()
        }
    };
    let normal = |p: &DVec3| dvec3(-0.1, 0.2 * p.y, 1.0).normalize();
    let normals = |points: &[DVec3]| curved.then(|| points.iter().map(normal).collect());
    let (bins, bin_width) = (96, 0.02);
    let mut histograms = vec![0.0f32; laser.len() * bins];
    let hidden = [dvec3(0.1, 0.05, 0.5), dvec3(-0.15, -0.1, 0.6), dvec3(0.0, 0.2, 0.7)];
    for (pair, (l, s)) in laser.iter().zip(&sensor).enumerate() {
        for x in hidden {
            let [a, b] = [l.distance(x), s.distance(x)];
            histograms[pair * bins + ((a + b) / bin_width) as usize] += (1.0 / (a * b).powi(2)) as f32;
        }
    }
    let facing = (normals(&laser), normals(&sensor));
    let mut made = Capture::new([laser.len(), 1], laser, sensor, bins, bin_width, histograms);
    (made.laser_normal, made.sensor_normal) = facing;
    made
}

fn grid_of(capture: &Capture) -> Grid {
    Grid::new(default_volume(capture, 0.3).unwrap(), 16, 0.02).unwrap()
}

fn surface(reflectance: Reflectance, general: bool) -> SolverOptions {
    let o = SurfaceOptions::default().with(|o| {
        o.lateral = 16;
        // Three points are no surface: rounding decides where its pixels go.
        o.iterations = 3;
        o.grow = false;
        o.begin = Begin::Plane;
        o.min_depth = 0.3;
        o.reflectance = reflectance;
        o.general = general;
        o.accumulation = Accumulation::Repeatable;
    });
    o.into()
}

fn solve_surface(gpu: &Gpu, capture: &Capture, reflectance: Reflectance, general: bool) -> Reconstruction {
    let mut hear = |_: &_| ControlFlow::Continue(());
    let problem = Problem::new(capture, grid_of(capture)).and_volume();
    surface(reflectance, general).solve(gpu, &problem, &mut unwatched(&mut hear)).unwrap()
}

fn solve_paper(gpu: &Gpu, capture: &Capture, reflectance: Reflectance, general: bool) -> Reconstruction {
    let o = PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.lateral = 16;
        o.iterations = 4;
        o.domain.coarse_to_fine = false;
        o.domain.min_depth = 0.3;
        o.learning_rate = 0.05;
        // Voxels that no bin sees feel the L1 term alone.
        o.l1 = 0.0;
        o.sampling = Sampling::Fixed;
        o.reflectance = reflectance;
        o.general = general;
        o.accumulation = Accumulation::Repeatable;
    });
    let mut hear = |_: &_| ControlFlow::Continue(());
    o.solve(gpu, &Problem::new(capture, grid_of(capture)).and_volume(), &mut unwatched(&mut hear)).unwrap()
}

/// Both solves agree: in the data term at every point, and in the volume where both have one.
fn assert_same(what: &str, short: &Reconstruction, general: &Reconstruction) {
    assert_eq!(short.trace.len(), general.trace.len());
    // Bins that no voxel reaches add a constant to every point of the general trace.
    let constant = general.empty_loss - short.empty_loss;
    assert!(constant >= -1e-6 * general.empty_loss, "{what}");
    for (a, b) in short.trace.iter().zip(&general.trace) {
        let e = (a.data_loss + constant - b.data_loss).abs() / general.empty_loss;
        // Adam's first step is as long for a gradient of mere rounding as for any other.
        let stepped = a.iteration > 1 && short.volume_iterations == 0;
        assert!(
            e < if stepped { 1e-3 } else { 1e-4 },
            "{what}, iteration {}: {} and {}",
            a.iteration,
            a.data_loss + constant,
            b.data_loss
        );
    }
    // A surface has its albedo in one voxel of a column, and rounding may move it to the next.
    let is_surface = short.volume_iterations == 0;
    let values = |r: &Reconstruction| match is_surface {
        true => r.maps.albedo.clone(),
        false => r.volume.as_ref().expect("asked for").albedo.clone(),
    };
    let volumes = [short, general].map(values);
    // Light in bins that no place reaches is part of the misfit that the prior is weighed by.
    let apart = if is_surface { 2e-2 } else { 2e-3 };
    let largest = volumes[1].iter().fold(0.0f32, |a, v| a.max(v.abs()));
    assert!(largest > 0.0, "{what}: something is there");
    let mut differ = 0;
    for (a, b) in volumes[0].iter().zip(&volumes[1]) {
        // Out of reach, one side has nothing, the other its first value.
        if *a != 0.0 && (a - b).abs() > apart * largest {
            differ += 1;
        }
    }
    let most = volumes[0].len() / if is_surface { 8 } else { 500 };
    assert!(differ <= most, "{what}: {differ} values differ");
}

#[test]
fn every_variant_agrees_with_the_general_one() {
    let gpu = host();
    for (geometry, reflectance, curved) in variants() {
        let capture = capture(geometry, curved);
        let what = format!("{geometry:?} {reflectance:?} curved {curved}");
        let short = solve_surface(&gpu, &capture, reflectance, false);
        assert_eq!(short.plan.scene.geometry, geometry, "{what}");
        assert_eq!(short.plan.scene.curved, curved && reflectance == Reflectance::Lambertian, "{what}");
        let general = solve_surface(&gpu, &capture, reflectance, true);
        assert_eq!((general.plan.scene.geometry, general.plan.scene.curved), (Geometry::TwoPoints, true));
        assert_same(&format!("surface, {what}"), &short, &general);
        let [short, general] = [false, true].map(|g| solve_paper(&gpu, &capture, reflectance, g));
        assert_same(&format!("paper, {what}"), &short, &general);
    }
    assert_valid(&gpu);
}

#[test]
fn unreached_bins_and_bricks_change_nothing() {
    let gpu = host();
    let capture = capture(Geometry::Confocal, false);
    let gated = capture.gated(Gate { from: 0.0, to: 1.3 }).unwrap();
    let deep = Grid::new(default_volume(&capture, 0.3).unwrap(), 16, 0.02).unwrap();
    let o = |general| {
        PaperOptions::preset(Preset::Synthetic).with(|o| {
            o.lateral = 16;
            o.iterations = 6;
            o.domain.coarse_to_fine = false;
            o.domain.min_depth = 0.3;
            o.l1 = 0.0;
            o.sampling = Sampling::Fixed;
            o.learning_rate = 0.05;
            o.general = general;
            o.accumulation = Accumulation::Repeatable;
        })
    };
    let mut hear = |_: &_| ControlFlow::Continue(());
    let [short, general] = [false, true].map(|general| {
        o(general).solve(&gpu, &Problem::new(&gated, deep).and_volume(), &mut unwatched(&mut hear)).unwrap()
    });
    let dark = short.plan.levels.reachable[0].iter().filter(|r| !**r).count();
    assert!(dark > 0 && general.plan.levels.reachable[0].iter().all(|r| *r));
    assert!(short.plan.scene.bins < general.plan.scene.bins, "bins before 0.6 m cannot be reached");
    assert!(short.trace[0].active < general.trace[0].active);
    assert_same("gate", &short, &general);
}

#[test]
fn the_plan_says_what_it_leaves_out_and_leaves_it_unallocated() {
    let gpu = host();
    let plan = |geometry, reflectance, general| -> Plan {
        let capture = capture(geometry, false);
        let problem = Problem::new(&capture, grid_of(&capture));
        surface(reflectance, general).plan(&problem, &gpu.abilities()).unwrap()
    };
    let says = |p: &Plan, words: &str| p.left_out.iter().any(|l| l.contains(words));
    let cosine = plan(Geometry::Confocal, Reflectance::Cosine, false);
    assert!(
        says(&cosine, "second distance") && says(&cosine, "wall's normals") && says(&cosine, "gated bins")
    );
    assert!(!says(&cosine, "surfaces' normals"));
    assert!(says(&cosine, "voxels on wall points") && !cosine.levels.touching);
    let general = plan(Geometry::Confocal, Reflectance::Cosine, true);
    assert!(
        !says(&general, "distance") && !says(&general, "wall's normals") && !says(&general, "gated bins")
    );
    assert!(!says(&general, "voxels on wall points") && general.levels.touching, "the general one asks");
    let isotropic = plan(Geometry::Product, Reflectance::Isotropic, false);
    assert!(says(&isotropic, "surfaces' normals") && says(&isotropic, "every scanned point"));
    let bytes = |p: &Plan, name: &str| p.bytes()[name];
    assert!(bytes(&isotropic, "sample_normals") <= 16 && bytes(&cosine, "sample_normals") > 16);
    assert!(
        bytes(&general, "wall") == 4 * bytes(&cosine, "wall"),
        "two points and two normals for one point"
    );
    assert!(bytes(&general, "measured") > bytes(&cosine, "measured"));
}
