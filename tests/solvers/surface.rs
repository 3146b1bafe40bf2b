//! The surface stage in whole solves: which pixels it takes, what it improves, what it leaves unchanged.

use std::ops::ControlFlow;

use fixtures::captures::scaled;
use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::capture::Capture;
use thirdbounce::gpu::{Gpu, Schedule};
use thirdbounce::maps::{Maps, Truth};
use thirdbounce::simulate::{Object, RenderOptions, Scene, WallShape, rectangle, simulate, truth};
use thirdbounce::solve::surface::{self, Pixels, SUPPORT};
use thirdbounce::solve::{
    Accumulation, Plan, Problem, Reconstruction, VectorOptions, Watch, default_volume, vector,
};
use thirdbounce::transport::{Grid, Reflectance, Volume};

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
fn pixels_are_the_bright_ones_with_a_depth() {
    let all =
        maps(vec![1.0, 0.05, 0.9, 0.0, 0.11, 2.0, 0.8], vec![0.5, 0.6, f32::NAN, f32::NAN, 0.7, 0.8, 0.9]);
    let few = Maps { albedo: all.albedo.iter().map(|a| a / 2.0).collect(), ..all.clone() };
    // White is next to the largest, 2: its tenth is 0.2.
    let pixels = Pixels::of(std::slice::from_ref(&all), SUPPORT, 7);
    assert_eq!(pixels.columns, [0, 5, 6]);
    assert_eq!(pixels.depth, [0.5, 0.8, 0.9]);
    assert_eq!(pixels.albedo, [1.0, 2.0, 0.8]);
    assert_eq!(
        Pixels::of(std::slice::from_ref(&few), SUPPORT, 7).columns,
        pixels.columns,
        "whatever the scale"
    );
    // Room for two: the brightest two, in the order of the maps.
    let two = Pixels::of(std::slice::from_ref(&all), SUPPORT, 2);
    assert_eq!((two.columns.as_slice(), two.len()), ([0, 5].as_slice(), 2));
    assert_eq!(two.albedo, [1.0, 2.0]);
    let last = Pixels::of(&[maps(vec![1.0, 3.0, 2.0], vec![0.5; 3])], SUPPORT, 2);
    assert_eq!((last.columns, last.albedo), (vec![1, 2], vec![3.0, 2.0]));
    assert!(Pixels::of(std::slice::from_ref(&all), SUPPORT, 0).is_empty());
    assert!(Pixels::of(&[maps(vec![0.0; 5], vec![f32::NAN; 5])], SUPPORT, 5).is_empty());
    assert!(Pixels::of(&[maps(vec![1.0; 5], vec![f32::NAN; 5])], SUPPORT, 5).is_empty());
}

#[test]
fn pixels_lie_along_a_morton_curve_layer_by_layer() {
    let square = Maps { nx: 4, ny: 4, ..maps(vec![1.0; 16], vec![0.5; 16]) };
    let pixels = Pixels::of(&[square.clone(), square], SUPPORT, usize::MAX);
    let first = [0, 1, 4, 5, 2, 3, 6, 7, 8, 9, 12, 13, 10, 11, 14, 15];
    let both: Vec<u32> = first.into_iter().chain(first.map(|c| c + 16)).collect();
    assert_eq!((pixels.of_layers(16), &pixels.columns), ([16, 16], &both));
    let places = pixels.places(16);
    assert!((0..32).all(|pixel| places[pixels.columns[pixel] as usize] == pixel as u32), "{places:?}");
    // A side that is no power of two: the same order among those that there are.
    let narrow = Maps { nx: 2, ny: 3, ..maps(vec![1.0; 6], vec![0.5; 6]) };
    assert_eq!(Pixels::of(&[narrow], SUPPORT, usize::MAX).columns, [0, 1, 3, 4, 2, 5]);
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
    let words = [[1, 0.5f32.to_bits(), 0.75f32.to_bits(), 0], [4, 2.0f32.to_bits(), 1.5f32.to_bits(), 0]];
    assert_eq!(pixels.words(), words);
}

fn scene(name: &str) -> (Capture, Truth) {
    let scene = Scene { scan: 16, bin_width: 0.01, ..Scene::named(name).unwrap() };
    (
        simulate(&scene, &RenderOptions { noise: 0.02, ..Default::default() }).unwrap().capture,
        truth(&scene, 32).unwrap(),
    )
}

fn options(surface_iterations: usize) -> VectorOptions {
    VectorOptions::default().with(|o| {
        o.lateral = 32;
        o.iterations = 30;
        o.surface.iterations = surface_iterations;
        o.stop = false;
    })
}

fn solve(gpu: &Gpu, capture: &Capture, o: &VectorOptions, watch: &mut Watch<'_>) -> Reconstruction {
    let volume = default_volume(capture, o.domain.min_depth).unwrap();
    solve_in(gpu, capture, volume, o, watch)
}

fn solve_in(
    gpu: &Gpu,
    capture: &Capture,
    volume: Volume,
    o: &VectorOptions,
    watch: &mut Watch<'_>,
) -> Reconstruction {
    let grid = Grid::new(volume, o.lateral, capture.bin_width).unwrap();
    vector::reconstruct(gpu, &Problem::new(capture, grid).and_volume(), o, watch).unwrap()
}

fn run(gpu: &Gpu, capture: &Capture, o: &VectorOptions) -> Reconstruction {
    solve(gpu, capture, o, &mut unwatched(&mut |_| ControlFlow::Continue(())))
}

/// The bits of the maps, including NaN.
fn bits(maps: &Maps) -> Vec<u32> {
    let all = maps.albedo.iter().chain(&maps.depth).chain(maps.normal.iter().flatten());
    all.map(|v| v.to_bits()).collect()
}

/// Mean errors of depth (metres) and normals (degrees) over these pixels.
fn errors(maps: &Maps, truth: &Truth, pixels: &[usize]) -> [f64; 2] {
    let mean = |of: &dyn Fn(usize) -> f64| pixels.iter().map(|p| of(*p)).sum::<f64>() / pixels.len() as f64;
    let normal = |n: [f32; 3]| DVec3::from_array(n.map(f64::from));
    [
        mean(&|p| f64::from(maps.depth[p] - truth.depth[p]).abs()),
        mean(&|p| normal(maps.normal[p]).angle_between(normal(truth.normal[p])).to_degrees()),
    ]
}

/// Intersection over union of the true and the found mask.
fn share_found(maps: &Maps, truth: &Truth) -> f64 {
    let count = |of: &dyn Fn(usize) -> bool| (0..truth.mask.len()).filter(|p| of(*p)).count() as f64;
    count(&|p| truth.mask[p] && maps.mask[p]) / count(&|p| truth.mask[p] || maps.mask[p])
}

/// On a curved surface, over the pixels that the volume has found. Measured: errors of depths and normals are halved (those
/// of a figure fall to 0.4 and 0.6).
#[test]
fn the_surface_lowers_the_errors_of_depth_and_normals() {
    let gpu = gpu();
    let (capture, truth) = scene("torus");
    let [before, after] = [0, 40].map(|count| run(&gpu, &capture, &options(count)));
    let hit = |p: &usize| truth.mask[*p] && before.maps.mask[*p];
    let found: Vec<usize> = (0..truth.mask.len()).filter(hit).collect();
    assert!(found.len() > 100, "{}", found.len());
    let [was, is] = [&before, &after].map(|r| errors(&r.maps, &truth, &found));
    assert!(is[0] < 0.65 * was[0] && is[1] < 0.7 * was[1], "{was:?} to {is:?}");
    let [was, is] = [&before, &after].map(|r| share_found(&r.maps, &truth));
    assert!(is > was, "IoU {was} to {is}");
    let last = |r: &Reconstruction| r.trace.last().map(|p| p.iteration);
    assert_eq!([last(&before), last(&after)], [Some(30), Some(70)]);
    // The stage's objective falls over its own iterations.
    let losses: Vec<f64> = after.trace.iter().filter(|p| p.iteration > 30).map(|p| p.loss).collect();
    assert!(losses.len() > 1 && losses[losses.len() - 1] < losses[0], "{losses:?}");
    assert_valid(&gpu);
}

/// With the model that the scene has. Measured: 5.2 mm and 13.3° to 4.6 mm and 11.7°.
#[test]
fn a_right_model_gains_by_blurred_residuals_and_few_pixels() {
    let gpu = gpu();
    let (capture, truth) = scene("torus");
    let plain = run(&gpu, &capture, &options(40));
    let helped = run(
        &gpu,
        &capture,
        &options(40).with(|o| {
            o.surface.blur = 0.4;
            o.surface.sparsity = 0.05;
        }),
    );
    let hit = |p: &usize| truth.mask[*p] && plain.maps.mask[*p];
    let found: Vec<usize> = (0..truth.mask.len()).filter(hit).collect();
    let [was, is] = [&plain, &helped].map(|r| errors(&r.maps, &truth, &found));
    assert!(is[0] < was[0] && is[1] < was[1], "{was:?} to {is:?}");
    let lit = |r: &Reconstruction| {
        let white = Maps::white(&r.maps.albedo);
        r.maps.albedo.iter().filter(|a| **a > 0.1 * white).count()
    };
    assert!(lit(&helped) < lit(&plain), "{} pixels, then {}", lit(&plain), lit(&helped));
    let more = helped.plan.bytes()["spread"] - plain.plan.bytes()["spread"];
    assert!(more > 4 * (capture.pair_count() * 10) as u64, "left out where nothing is averaged: {more}");
    assert_valid(&gpu);
}

/// The volume of a Lambertian surface has one cosine, also where the wall is curved; that of no surface has both.
#[test]
fn a_lambertian_surface_begins_with_a_volume_of_one_cosine() {
    let gpu = gpu();
    for wall_shape in [WallShape::Flat, WallShape::Bump] {
        let scene = Scene { scan: 8, bin_width: 0.02, wall_shape, ..Scene::named("torus").unwrap() };
        let scene = Scene { reflectance: Reflectance::Lambertian, ..scene };
        let capture = simulate(&scene, &RenderOptions::default()).unwrap().capture;
        // The losses of the volume and of the surface.
        let solved = |reflectance, cosine_volume, surface_iterations| {
            let options = short(surface_iterations).with(|o| {
                (o.reflectance, o.cosine_volume) = (reflectance, cosine_volume);
            });
            let Reconstruction { trace, plan, .. } = run(&gpu, &capture, &options);
            let losses = |of: &dyn Fn(usize) -> bool| -> Vec<u64> {
                trace.iter().filter(|p| of(p.iteration)).map(|p| p.loss.to_bits()).collect()
            };
            (losses(&|i| i <= options.iterations), losses(&|i| i > options.iterations), plan)
        };
        let own_pass = |plan: &Plan| {
            let of_surface = |v: &String| v.starts_with("surface_forward") && v.contains("REFLECTANCE=1");
            plan.variants().iter().any(of_surface)
        };
        let (cosine, of_cosine, _) = solved(Reflectance::Cosine, true, 2);
        let (volume, surface, plan) = solved(Reflectance::Lambertian, true, 2);
        assert!(!volume.is_empty() && !surface.is_empty());
        assert_eq!(volume, cosine, "the same volume");
        assert_ne!(surface, of_cosine, "another surface");
        assert!(own_pass(&plan));
        let (same, _, plan) = solved(Reflectance::Lambertian, false, 2);
        assert_ne!(same, volume);
        assert!(!own_pass(&plan), "one pass renders both");
        let (alone, _, plan) = solved(Reflectance::Lambertian, true, 0);
        assert_eq!(alone, same);
        assert_eq!(plan.scene.volume_reflectance, Reflectance::Lambertian);
    }
    assert_valid(&gpu);
}

fn short(surface_iterations: usize) -> VectorOptions {
    options(surface_iterations).with(|o| {
        o.lateral = 16;
        o.iterations = 10;
        o.growth_iterations = 5;
        o.accumulation = Accumulation::Repeatable;
    })
}

#[test]
fn fixed_point_gives_the_same_bits_twice() {
    let gpu = gpu();
    let (capture, _) = scene("torus");
    let fixed = short(12).with(|o| o.accumulation = Accumulation::Fixed);
    let [one, two] = [(); 2].map(|()| run(&gpu, &capture, &fixed));
    assert!(one.maps.mask.iter().filter(|m| **m).count() > 20);
    assert_eq!(bits(&one.maps), bits(&two.maps));
    assert_eq!(one.trace.last().unwrap().loss, two.trace.last().unwrap().loss);
    assert_valid(&gpu);
}

/// Every histogram holds one count that is earlier than light from anywhere in the grid: there is no surface to refine.
#[test]
fn where_nothing_is_found_nothing_is_refined() {
    let gpu = gpu();
    let (mut capture, _) = scene("torus");
    let (bins, volume) = (capture.bins, default_volume(&capture, 0.2).unwrap());
    capture.histograms.iter_mut().enumerate().for_each(|(i, h)| *h = if i % bins == 0 { 1.0 } else { 0.0 });
    let [none, some] = [0, 12].map(|count| {
        let mut hear = |_: &_| ControlFlow::Continue(());
        solve_in(&gpu, &capture, volume, &short(count), &mut unwatched(&mut hear))
    });
    assert!(some.maps.albedo.iter().all(|a| *a == 0.0) && some.maps.depth.iter().all(|z| z.is_nan()));
    assert_eq!(bits(&none.maps), bits(&some.maps));
    assert_eq!(none.trace.last().unwrap().iteration, some.trace.last().unwrap().iteration);
    assert_eq!(none.volume, some.volume);
    assert_valid(&gpu);
}

#[test]
fn without_iterations_the_maps_are_those_that_the_stage_begins_with() {
    let gpu = gpu();
    let (capture, _) = scene("torus");
    let before = run(&gpu, &capture, &short(0));
    let mut seen = None;
    let at = [short(0).iterations];
    let mut hear = |p: &thirdbounce::solve::Progress| {
        seen = p.maps.clone().or(seen.take());
        ControlFlow::Continue(())
    };
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &at };
    let after = solve(&gpu, &capture, &short(12), &mut watch);
    let seen = seen.expect("maps were asked for");
    assert_eq!(bits(&seen), bits(&before.maps));
    assert_ne!(bits(&seen), bits(&after.maps));
    assert_eq!(after.volume, before.volume, "the volume is not the stage's");
    // Pixels that the stage does not take stay the same, bit by bit.
    let pixels = Pixels::of(std::slice::from_ref(&seen), SUPPORT, usize::MAX).columns;
    assert!(pixels.len() > 20 && pixels.len() < seen.albedo.len());
    for c in (0..seen.albedo.len()).filter(|c| !pixels.contains(&(*c as u32))) {
        let of = |m: &Maps| [m.albedo[c], m.depth[c], m.normal[c][0], m.normal[c][2]].map(f32::to_bits);
        assert_eq!(of(&seen), of(&after.maps));
    }
    assert!(surface::pixels(&before.plan) == 0 && surface::pixels(&after.plan) == seen.albedo.len() * 5 / 4);
    assert_valid(&gpu);
}

/// The same scene in another unit gives the same surface, whether the wall is a millimetre or a hundred metres wide.
#[test]
#[ignore = "long: make soak"]
fn surfaces_on_walls_of_any_size() {
    let gpu = gpu();
    let (capture, _) = scene("sphere");
    let solved = |scale: f64| {
        let capture = scaled(&capture, scale);
        let o = options(20).with(|o| {
            o.domain.min_depth = 0.2 * scale;
            o.accumulation = Accumulation::Repeatable;
        });
        run(&gpu, &capture, &o).maps
    };
    let metre = solved(1.0);
    let pixels = Pixels::of(std::slice::from_ref(&metre), SUPPORT, usize::MAX).columns;
    assert!(pixels.len() > 20);
    for scale in [1e-3, 100.0] {
        let other = solved(scale);
        let off = |c: &u32| {
            let c = *c as usize;
            let depth = (f64::from(other.depth[c]) / scale - f64::from(metre.depth[c])).abs();
            let normal = (0..3).map(|k| f64::from((other.normal[c][k] - metre.normal[c][k]).abs()));
            [depth, normal.fold(0.0, f64::max)]
        };
        let sum = pixels.iter().map(off).fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        let [depth, normal] = sum.map(|s| s / pixels.len() as f64);
        // In the mean: rounding decides on which side of a bin's centre a path falls, and that moves a pixel.
        assert!(
            depth < 6e-4 && normal < 1e-2,
            "wall of {scale} m: {depth:.1e} m of a metre's, normals {normal:.1e}"
        );
    }
    assert_valid(&gpu);
}

/// Early iterations of the volume take a part of the pairs that are used; the surface takes all of them in turns.
#[test]
fn a_large_scans_surface_takes_all_pairs_in_turns() {
    let gpu = gpu();
    let scene = Scene { scan: 64, bin_width: 0.02, ..Scene::named("sphere").unwrap() };
    let capture = simulate(&scene, &RenderOptions { noise: 0.1, ..Default::default() }).unwrap().capture;
    let o = options(10).with(|o| {
        o.iterations = 6;
        o.growth_iterations = 2;
        o.domain.coarse_iterations = 2;
    });
    let done = run(&gpu, &capture, &o);
    let pairs: Vec<[usize; 2]> = done.trace.iter().map(|p| [p.iteration, p.pairs]).collect();
    let of = |from: usize, to: usize| pairs.iter().filter(move |p| p[0] > from && p[0] <= to).map(|p| p[1]);
    assert!(
        of(0, 4).all(|p| p == 256) && of(0, 4).count() > 0,
        "{pairs:?}: the volume begins with a quarter"
    );
    assert!(of(4, 6).all(|p| p == 1024), "{pairs:?}: the volume ends with all");
    assert!(of(6, 16).all(|p| p == 256) && of(6, 16).count() > 0, "{pairs:?}: the surface has batches");
    // The batches are all pairs that are used, each once.
    let plan = &done.plan;
    assert_eq!(plan.levels.batches.iter().map(|b| b.pairs).collect::<Vec<_>>(), [256; 4]);
    let model = vector::model(&capture, &plan.levels.maps, &o);
    let mut job = job(&gpu, &model, &plan.levels.maps, &o);
    job.perform(&Schedule::of(|s| surface::divide(s, plan)));
    for (i, batch) in plan.levels.batches.iter().enumerate() {
        let row = i * 256 * batch.bins;
        let measured: Vec<f32> = read(&mut job, batch.measured, 256 * batch.bins);
        assert_eq!(measured, model.measured[row..row + measured.len()], "batch {i}");
        let wall: Vec<[f32; 4]> = read(&mut job, batch.wall, 256);
        assert_eq!(wall, model.wall.stretch(256 * i, 256).words(), "batch {i}");
    }
    // Each is spread over the wall.
    for batch in 0..4 {
        let points = &model.wall.scanned[256 * batch..][..256];
        for corner in [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]] {
            let near = points.iter().filter(|p| p.x * corner[0] > 0.0 && p.y * corner[1] > 0.0);
            assert_eq!(near.count(), 64, "batch {batch}");
        }
    }
    assert_eq!(pairs.last().map(|p| p[0]), Some(16));
    assert!(done.trace.iter().all(|p| p.loss.is_finite()));
    let [before, after] = [8, 16].map(|i| done.trace.iter().rfind(|p| p.iteration <= i).unwrap().loss);
    assert!(after < before, "{before} to {after}");
    assert_valid(&gpu);
}

/// Pixels finer than voxels: a volume of half the resolution gives maps as good as one of full resolution.
#[test]
fn pixels_may_be_finer_than_voxels() {
    let gpu = gpu();
    let (capture, truth) = scene("torus");
    let of = |pixels_per_voxel| options(40).with(|o| o.surface.pixels_per_voxel = Some(pixels_per_voxel));
    let [whole, half] = [1, 2].map(|k| run(&gpu, &capture, &of(k)));
    let alone = run(&gpu, &capture, &options(0).with(|o| o.lateral = 16));
    assert_eq!((half.maps.nx, half.lateral, half.plan.factor()), (32, 16, 2));
    assert_eq!(half.volume.as_ref().unwrap().grid, alone.plan.finest().grid);
    assert_eq!(half.volume_iterations, 30);
    let lateral = |iteration: usize| half.trace.iter().find(|p| p.iteration == iteration).map(|p| p.lateral);
    assert_eq!([lateral(30), lateral(70)], [Some(16), Some(32)]);
    assert!(half.device_bytes < whole.device_bytes && half.pairs < whole.pairs);
    // Measured: half the depth error of the volume's maps, and no more than the surface after a volume of full resolution.
    let begun = alone.maps.finer(2);
    let all = [&whole.maps, &half.maps, &begun];
    let hit = |p: &usize| truth.mask[*p] && all.iter().all(|m| m.mask[*p]);
    let found: Vec<usize> = (0..truth.mask.len()).filter(hit).collect();
    assert!(found.len() > 100, "{}", found.len());
    let [of_whole, of_half, of_begun] = all.map(|m| errors(m, &truth, &found));
    assert!(
        of_half[0] < 0.65 * of_begun[0] && of_half[1] < 0.75 * of_begun[1],
        "{of_begun:?} to {of_half:?}"
    );
    assert!(of_half[0] < 1.2 * of_whole[0] && of_half[1] < 1.2 * of_whole[1], "{of_whole:?}, {of_half:?}");
    assert_valid(&gpu);
}

/// Three plates behind each other, none of which hides another: more than two height fields explain.
#[test]
fn what_is_no_height_field_stays_a_volume() {
    let gpu = gpu();
    let plate = |z: f64, half: f64| Object {
        mesh: rectangle(dvec3(0.0, 0.0, z), DVec3::Y * half, DVec3::X * half),
        albedo: 1.0,
    };
    let plates = vec![plate(0.5, 0.16), plate(0.75, 0.24), plate(1.0, 0.35)];
    let scene = Scene { scan: 16, bin_width: 0.01, occlusion: false, ..Scene::new("three", plates) };
    let capture = simulate(&scene, &RenderOptions { noise: 0.02, ..Default::default() }).unwrap().capture;
    let [volume, both] = [0, 20].map(|n| run(&gpu, &capture, &options(n).with(|o| o.iterations = 60)));
    assert!(both.surface_left && !volume.surface_left);
    assert_eq!(bits(&both.maps), bits(&volume.maps));
    assert_eq!(both.trace.last().unwrap().iteration, 80, "the trace tells what was tried");
    let finer = options(20).with(|o| {
        o.iterations = 60;
        o.surface.pixels_per_voxel = Some(2);
    });
    let coarse = options(0).with(|o| {
        o.lateral = 16;
        o.iterations = 60;
    });
    let [finer, coarse] = [finer, coarse].map(|o| run(&gpu, &capture, &o));
    assert!(finer.surface_left);
    assert_eq!(bits(&finer.maps), bits(&coarse.maps.finer(2)));
    let (capture, _) = self::scene("torus");
    assert!(!run(&gpu, &capture, &options(20)).surface_left);
    assert_valid(&gpu);
}
