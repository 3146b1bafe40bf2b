//! A solve takes as many pairs as it needs, and early iterations a part of them: which part, what the kernels compute from
//! it, and the figures of whole solves.

use fixtures::device::vectors::*;
use fixtures::device::*;
use glam::{DVec3, dvec3};
use std::ops::ControlFlow;
use thirdbounce::capture::Capture;
use thirdbounce::gpu::{Gpu, GpuOptions, Schedule};
use thirdbounce::job::Request;
use thirdbounce::simulate::{RenderOptions, Scene, simulate};
use thirdbounce::solve::{
    Accumulation, Level, OnDevice, Plan, Problem, Progress, Reconstruction, SolverOptions, VectorOptions,
    passes, vector,
};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::{Geometry, Grid, Model, Reflectance, Volume, Wall};
use thirdbounce::trials::Choice;

/// A model with that many pairs, but without their histograms.
fn claimed(geometry: Geometry, scanned: usize, others: usize, is_spread: bool) -> Model {
    let wall = Wall {
        geometry,
        scanned: vec![DVec3::ZERO; scanned],
        others: vec![DVec3::ZERO; others],
        normals: None,
    };
    Model { elements: wall.pairs() * 64, wall, is_spread, measured: vec![], ..model(2, 64, 1) }
}

fn grid_of(lateral: usize) -> Grid {
    let volume = Volume { min: dvec3(-0.5, -0.5, 0.3), max: dvec3(0.5, 0.5, 0.8) };
    Grid::new(volume, lateral, 0.05).expect("a grid")
}

/// Lateral voxels and pairs of every level of the volume, and of the surface, with the pairs that they need of a model's.
fn both(
    gpu: &Gpu,
    model: &Model,
    scan: usize,
    lateral: usize,
    pixels_per_voxel: Option<usize>,
) -> (Vec<[usize; 2]>, [usize; 2]) {
    let mut model = model.clone();
    let o = VectorOptions::default().with(|o| {
        o.lateral = lateral;
        o.surface.pixels_per_voxel = pixels_per_voxel;
    });
    // In proportion to the area of grids beyond 64 voxels.
    let times = (lateral / o.pixels_per_voxel() / 64).max(1).pow(2);
    model.use_first(model.enough(o.pairs * times));
    let plan = Plan::new(&model, grid_of(lateral), [scan; 2], &o, &gpu.abilities(), false).expect("a plan");
    let of = |l: &Level| [l.grid.n[0], l.pairs];
    let surface = plan.levels.pixels.as_ref().expect("a surface");
    assert_eq!([plan.finest().wall, surface.wall], [buffer::WALL; 2]);
    (plan.levels.volume.iter().map(of).collect(), of(surface))
}

fn levels(gpu: &Gpu, model: &Model, scan: usize, lateral: usize) -> Vec<[usize; 2]> {
    let (levels, surface) = both(gpu, model, scan, lateral, Some(1));
    assert_eq!(Some(&surface), levels.last(), "the surface takes the pairs of the finest grid");
    levels
}

#[test]
fn a_finer_surface_takes_the_pairs_of_the_finest_volume() {
    let gpu = gpu();
    let of = |side: usize, lateral, pixels_per_voxel| {
        let model = claimed(Geometry::Confocal, side * side, 0, true);
        both(&gpu, &model, side, lateral, pixels_per_voxel)
    };
    let volume = vec![[32, 256], [64, 256], [64, 1024]];
    assert_eq!(of(64, 64, None), (volume.clone(), [64, 1024]));
    assert_eq!(of(64, 128, None), (volume.clone(), [128, 1024]));
    assert_eq!(of(64, 192, Some(3)), (volume, [192, 1024]));
    assert_eq!(of(32, 128, Some(4)), (vec![[32, 256], [32, 1024]], [128, 1024]));
}

#[test]
fn levels_take_the_pairs_that_their_grid_needs() {
    let gpu = gpu();
    let confocal = |side: usize, lateral| {
        levels(&gpu, &claimed(Geometry::Confocal, side * side, 0, true), side, lateral)
    };
    assert_eq!(confocal(64, 64), [[32, 256], [64, 256], [64, 1024]]);
    assert_eq!(confocal(64, 128), [[32, 256], [64, 256], [128, 1024], [128, 4096]]);
    assert_eq!(confocal(256, 64), [[32, 256], [64, 256], [64, 1024]]);
    assert_eq!(confocal(256, 128), [[32, 256], [64, 256], [128, 1024], [128, 4096]]);
    // A quarter of 9,216 is more than 1,024, a sixteenth is less.
    assert_eq!(confocal(96, 64), [[32, 576], [64, 576], [64, 2304]]);
    let of =
        |geometry, scanned, others, scan| levels(&gpu, &claimed(geometry, scanned, others, true), scan, 64);
    assert_eq!(of(Geometry::TwoPoints, 4096, 4096, 64), [[32, 256], [64, 256], [64, 1024]]);
    assert_eq!(of(Geometry::Product, 4096, 1, 64), [[32, 256], [64, 256], [64, 1024]]);
    // Whole rows of a product, sixteen at least.
    assert_eq!(of(Geometry::Product, 256, 256, 16), [[16, 4096], [32, 4096], [64, 4096]]);
    assert_eq!(of(Geometry::Product, 4096, 4, 64), [[32, 16_384], [64, 16_384]]);
}

#[test]
fn few_pairs_are_all_taken_and_so_are_those_that_are_not_spread() {
    let gpu = gpu();
    for (side, spread) in [(32, false), (16, true), (5, true), (64, false)] {
        let model = claimed(Geometry::Confocal, side * side, 0, spread);
        let all = levels(&gpu, &model, side, 64);
        assert!(all.iter().all(|l| l[1] == side * side), "{all:?}");
        assert_eq!(all[0][0], if side == 5 { 8 } else { side }, "by doubling from the scan's own resolution");
    }
    // Few pairs keep the order of the capture. So do many pairs if all are asked for from the start.
    let capture = small_capture();
    let grid = grid_of(16);
    let spread = |o: &VectorOptions, c: &Capture| vector::model(c, &grid, o).is_spread;
    let o = VectorOptions::default();
    assert!(spread(&o, &capture));
    assert!(!spread(&o.clone().with(|o| o.all_pairs = true), &capture));
    assert!(!spread(&o.clone().with(|o| o.general = true), &capture));
    assert!(spread(&o, &capture.stride(2).expect("every other point")));
    assert!(!spread(&o, &capture.stride(4).expect("every fourth point")));
    let used = |o: &VectorOptions| vector::model(&capture, &grid, o).pairs();
    let of = |pairs| used(&o.clone().with(|o| o.pairs = pairs));
    assert_eq!([of(4), of(5), of(39)], [4, 16, 64], "few are few");
    assert_eq!([of(256), of(1024), of(1025), of(4096), of(1 << 20)], [256, 1024, 1024, 4096, 4096]);
    assert_eq!(used(&o.clone().with(|o| o.all_pairs = true)), 4096);
}

#[test]
fn few_photons_need_more_pairs() {
    let points: Vec<DVec3> = (0..4096).map(|i| dvec3((i % 64) as f64, (i / 64) as f64, 0.0) / 64.0).collect();
    let of = |light: f32, background: f32, opens: usize| {
        let of_bin = |bin: usize| match bin % 64 {
            before if before < opens => 0.0,
            20 => background + light,
            _ => background,
        };
        let counts = (0..4096 * 64).map(of_bin).collect();
        let mut capture = Capture::new([64, 64], points.clone(), points.clone(), 64, 0.02, counts);
        capture.integer_counts = true;
        match Choice::default().resolve(&capture).solver {
            SolverOptions::Vector(options) => options.pairs,
            other => panic!("{other:?}"),
        }
    };
    let pairs = |light, background| of(light, background, 0);
    // 32,768 photons; exact histograms, and bright ones, need 1,024 pairs.
    assert_eq!([1e9, 100.0, 32.0].map(|light| pairs(light, 0.0)), [1024; 3]);
    assert_eq!([8.0, 2.0].map(|light| pairs(light, 0.0)), [4096, 16_384]);
    // Background adds its noise: 16 of 16 + 64 counts are as good as 3.2 alone.
    assert_eq!(pairs(16.0, 1.0), 10_240);
    assert_eq!(of(32.0, 1.0, 16), 3072, "empty bins before a gate opens take nothing off the light");
    assert_eq!(pairs(0.0, 0.0), 1_000_000_000, "no light: all there are");
}

/// Bounds, vectors and rows of the trace after three iterations at the first level, from a random domain.
fn begun(job: &mut OnDevice, model: &Model, grid: &Grid) -> (Vec<[f32; 2]>, Vec<[f32; 4]>, Vec<u32>) {
    let (_, domain) = state(model, grid, 0.3, 4);
    let active = write_domain(job, &domain);
    let count = active.len();
    assert!(count > 100, "{count}");
    [buffer::RAW, buffer::BEFORE]
        .into_iter()
        .for_each(|buffer| write_raw(job, buffer, &vec![[0.0; 4]; count]));
    zero_histograms(job);
    write_momentum(job, REST);
    write(job, buffer::COUNTS, &[count as u32, count as u32, 0, f32::INFINITY.to_bits(), 0, 0]);
    let level = job.plan.levels.volume[0];
    let mut s = Schedule::default();
    s.dispatch(&passes::ARGUMENTS, [1, 1, 1], 1).bind(buffer::SCENE, level.scene);
    job.perform(&s);
    run_start(job, &["points", "forward_bound", "residual_bound", "bound_step", "variance", "bound_noise"]);
    let mut s = Schedule::default();
    (0..3).for_each(|i| vector::iteration(&mut s, &job.plan, &level, i));
    job.perform(&s);
    let rows = job.executor.read(buffer::TRACE, ..3 * TRACE_ROW as usize);
    (read(job, buffer::BOUNDS, count), read(job, buffer::RAW, count), rows)
}

#[test]
fn a_level_of_some_pairs_is_the_scene_of_these_alone() {
    let gpu = gpu();
    let grid = grid_of(16);
    let base = scene(64, 40, 5);
    for (geometry, reflectance, curved) in [
        (Geometry::Confocal, Reflectance::Cosine, false),
        (Geometry::TwoPoints, Reflectance::Lambertian, true),
        (Geometry::Product, Reflectance::Lambertian, true),
    ] {
        let mut model = variant(&base, geometry, reflectance, curved, 3);
        if geometry == Geometry::Product {
            // 64 x 64 points.
            let few = variant(&scene(13, 40, 5), geometry, reflectance, curved, 3);
            let points = |n: usize, seed: usize| -> Vec<DVec3> {
                (0..n)
                    .map(|i| {
                        few.wall.scanned[(i * seed) % few.wall.scanned.len()] + DVec3::X * 1e-3 * i as f64
                    })
                    .collect()
            };
            let normals =
                Some(few.wall.normals.as_ref().unwrap().iter().cycle().take(128).copied().collect());
            let wall = Wall { geometry, scanned: points(64, 1), others: points(64, 5), normals };
            let measured = base.measured.clone();
            model = Model { elements: wall.pairs() * 40, wall, measured, ..few };
        }
        model.spread();
        let o = vector_options(&grid).with(|o| {
            o.accumulation = Accumulation::Owned;
            o.reflectance = reflectance;
        });
        let mut whole = job(&gpu, &model, &grid, &o);
        let pairs = whole.plan.levels.volume[0].pairs;
        assert_eq!(pairs, if geometry == Geometry::Product { 1024 } else { 256 }, "{geometry:?}");
        let part = Model {
            elements: model.elements_of(pairs),
            wall: model.wall.first(pairs),
            measured: model.measured[..pairs * model.bins].to_vec(),
            is_spread: false,
            ..model.clone()
        };
        let mut alone = job(&gpu, &part, &grid, &o);
        assert_eq!(alone.plan.levels.volume.len(), 1);
        assert!(begun(&mut whole, &model, &grid) == begun(&mut alone, &part, &grid), "{geometry:?}");
    }
    assert_valid(&gpu);
}

#[test]
#[ignore = "long: make soak"]
fn the_order_of_the_pairs_changes_nothing_but_rounding() {
    let gpu = gpu();
    let grid = grid_of(12);
    for (geometry, reflectance, curved) in variants() {
        let model = variant(&scene(6, 48, 9), geometry, reflectance, curved, 4);
        let mut other = model.clone();
        other.spread();
        assert!(other.measured != model.measured && other.wall != model.wall, "another order");
        other.is_spread = false;
        let o = vector_options(&grid).with(|o| o.reflectance = reflectance);
        let [(bounds, raw, _), (other_bounds, other_raw, _)] =
            [&model, &other].map(|m| begun(&mut job(&gpu, m, &grid, &o), m, &grid));
        let floats = |v: &[[f32; 4]]| v.iter().flatten().map(|f| f64::from(*f)).collect::<Vec<_>>();
        let pairs = |v: &[[f32; 2]]| v.iter().map(|f| f64::from(f[0])).collect::<Vec<_>>();
        let what = format!("{geometry:?} {reflectance:?} curved {curved}");
        assert!(error(pairs(&other_bounds), pairs(&bounds)) < 1e-4, "{what}");
        assert!(error(floats(&other_raw), floats(&raw)) < 1e-3, "{what}");
    }
}

/// 64 x 64 points, few bins.
fn small_capture() -> Capture {
    let scene = Scene { scan: 64, bin_width: 0.05, ..Scene::named("letter-Z").expect("a built-in scene") };
    simulate(&scene, &RenderOptions { noise: 0.2, ..RenderOptions::default() }).expect("a rendering").capture
}

fn small_options() -> VectorOptions {
    VectorOptions::default().with(|o| {
        o.lateral = 16;
        o.iterations = 9;
        o.surface.iterations = 10;
        o.growth_iterations = 4;
        o.domain.reduce_every = 3;
        o.bound_every = 3;
        o.stop = false;
        o.accumulation = Accumulation::Repeatable;
    })
}

fn solve(options: &VectorOptions, capture: &Capture) -> Reconstruction {
    let gpu = Gpu::open(&GpuOptions::default()).expect("a device");
    let grid = Request::new(options.clone(), "").grid(capture).expect("a grid");
    let mut hear = |_: &Progress| ControlFlow::Continue(());
    vector::reconstruct(&gpu, &Problem::new(capture, grid), options, &mut unwatched(&mut hear))
        .expect("a solve of a small scene")
}

#[test]
#[ignore = "long: make soak"]
fn a_solve_goes_from_some_pairs_to_all_and_tells_how_many_it_took() {
    let (capture, o) = (small_capture(), small_options());
    let done = solve(&o, &capture);
    let taken = |r: &Reconstruction| r.trace.iter().map(|p| [p.iteration, p.pairs]).collect::<Vec<_>>();
    // The volume grows after the fifth of nine; the surface takes quarters in turns.
    let of = |p: &[usize; 2]| if matches!(p[0], 6..=9) { 1024 } else { 256 };
    assert!(taken(&done).iter().all(|p| p[1] == of(p)), "{:?}", taken(&done));
    assert_eq!(taken(&done).last(), Some(&[o.iterations + o.surface.iterations, 256]));
    for told in ["3072 of 4096 pairs", "pairs of early iterations: of 1024 they take 256 on 16"] {
        assert!(done.plan.left_out.iter().any(|l| l.contains(told)), "{:?}", done.plan.left_out);
    }
    // The domain changes between points of the trace only.
    let mut sum = 0;
    let mut before = 0;
    for p in &done.trace {
        sum += (p.iteration - before) * p.active * p.pairs;
        before = p.iteration;
    }
    assert_eq!(done.pairs, sum as u64);

    let all = o.clone().with(|o| o.all_pairs = true);
    let whole = solve(&all, &capture);
    assert!(taken(&whole).iter().all(|p| p[1] == 4096));
    assert!(!whole.plan.left_out.iter().any(|l| l.contains("early")));
    let fits = |r: &Reconstruction| r.trace.last().map_or(0.0, |p| p.data_loss) / r.empty_loss;
    assert!(fits(&done) < 1.3 * fits(&whole) && fits(&done) < 0.2, "{} {}", fits(&done), fits(&whole));
}
