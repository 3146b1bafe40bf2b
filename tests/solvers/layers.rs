//! Two surfaces behind each other: how the maps of a closed form are divided between layers, and whole solves.

use std::ops::ControlFlow;

use fixtures::device::*;
use thirdbounce::engine::{Accumulation, Problem, Reconstruction, default_volume};
use thirdbounce::gpu::Gpu;
use thirdbounce::maps::{Layer, Maps};
use thirdbounce::measure::metrics;
use thirdbounce::methods::SolverOptions;
use thirdbounce::surface::SurfaceOptions;
use thirdbounce::surface::layers::{merge, split};
use thirdbounce::transport::Grid;
use thirdbounce_simulate::{RenderOptions, Scene, simulate, truth};

const SIDE: usize = 12;

/// Maps of 12 × 12 pixels of 1 cm with the albedo and depth of `at`; nothing where it is `None`.
fn maps(at: impl Fn(usize, usize) -> Option<(f32, f32)>) -> Maps {
    let all: Vec<Option<(f32, f32)>> = (0..SIDE * SIDE).map(|c| at(c / SIDE, c % SIDE)).collect();
    let normal = |found: &Option<(f32, f32)>| found.map_or([f32::NAN; 3], |_| [0.0, 0.0, -1.0]);
    let mut maps = Maps {
        albedo: all.iter().map(|p| p.map_or(0.0, |p| p.0)).collect(),
        depth: all.iter().map(|p| p.map_or(f32::NAN, |p| p.1)).collect(),
        normal: all.iter().map(normal).collect(),
        mask_fraction: Some(0.3),
        ..Maps::empty([SIDE, SIDE], [0.0, 0.12, 0.0, 0.12])
    };
    maps.set_mask(0.3);
    maps
}

fn in_plate(x: usize, y: usize) -> bool {
    (3..8).contains(&x) && (2..9).contains(&y)
}

/// A plate at 0.5 m before a wall at 0.8 m. In every other column the brightest surface is the plate.
fn plates(x: usize, y: usize) -> [Option<(f32, f32)>; 2] {
    let wall = Some((if (x + y).is_multiple_of(2) { 0.9 } else { 1.0 }, 0.8));
    match (in_plate(x, y), (x + y).is_multiple_of(2)) {
        (false, _) => [wall, None],
        (true, true) => [Some((1.0, 0.5)), wall],
        (true, false) => [wall, Some((0.9, 0.5))],
    }
}

#[test]
fn sheets_become_layers() {
    let [first, second] = [0, 1].map(|k| maps(|x, y| plates(x, y)[k]));
    let [one, two] = split(&first, &second, 8.0).expect("two layers");
    assert!(one.depth.iter().all(|z| *z == 0.8), "the wall is the larger sheet, and whole");
    for (c, z) in two.depth.iter().enumerate() {
        assert_eq!(z.is_finite(), in_plate(c / SIDE, c % SIDE));
        assert!(z.is_nan() || *z == 0.5);
    }
    // Too small, too dim in the mean, and none at all.
    assert_eq!(split(&first, &second, 36.0), None);
    let dim = Maps { albedo: second.albedo.iter().map(|a| 0.35 * a).collect(), ..second.clone() };
    assert_eq!(split(&first, &dim, 8.0), None);
    assert_eq!(split(&first, &maps(|_, _| None), 8.0), None);
}

/// Two surfaces of one column never share a layer, even if a chain of neighbours joins them to one sheet.
#[test]
fn a_winding_sheet_is_cut() {
    let turns = |x: usize, y: usize| {
        let at = 0.5 + 0.01 * if x < 6 { y as f32 } else { 23.0 - y as f32 };
        Some((1.0, if x < 6 { at } else { at - 0.11 * (11 - y) as f32 / 11.0 }))
    };
    let first = maps(turns);
    let second = maps(|x, y| Some((0.9, turns(x, y)?.1 + 0.02)));
    let [one, two] = split(&first, &second, 8.0).expect("two layers");
    for c in 0..SIDE * SIDE {
        let mut found = [one.depth[c], two.depth[c]];
        found.sort_by(f32::total_cmp);
        assert_eq!(found, [first.depth[c], second.depth[c]]);
    }
}

#[test]
fn layers_become_maps() {
    let wall = maps(|_, _| Some((1.0, 0.8)));
    // The plate has a dim rim of one pixel, and a speck beside it.
    let rim = |x: usize, y: usize| (2..9).contains(&x) && (1..10).contains(&y);
    let plate = maps(|x, y| match (in_plate(x, y) || (x, y) == (10, 10), rim(x, y)) {
        (true, _) => Some((0.9, 0.5)),
        (false, true) => Some((0.2, 0.5)),
        _ => None,
    });
    let both = merge(&[wall.clone(), plate.clone()], 8.0);
    let Layer { albedo, depth, mask, .. } = both.behind.clone().expect("a second layer");
    for c in 0..SIDE * SIDE {
        let double = in_plate(c / SIDE, c % SIDE);
        assert_eq!(both.depth[c], if double { 0.5 } else { 0.8 });
        assert_eq!((mask[c], albedo[c] == 1.0, depth[c] == 0.8), (double, double, double));
    }
    assert_eq!(merge(&[plate.clone(), wall.clone()], 8.0).depth, both.depth, "whichever layer is first");
    // A plate that has become dark explains nothing.
    let dark = Maps { albedo: plate.albedo.iter().map(|a| 0.15 * a).collect(), ..plate };
    let one = merge(&[wall.clone(), dark], 8.0);
    assert_eq!((one.depth, one.behind), (wall.depth, None));
}

fn run(gpu: &Gpu, scene: Scene) -> Reconstruction {
    let scene = Scene { scan: 16, bin_width: 0.01, occlusion: false, ..scene };
    let options = RenderOptions { noise: 0.02, ..Default::default() };
    let capture = simulate(&scene, &options).unwrap().capture;
    let o = SurfaceOptions::default().with(|o| {
        o.lateral = 32;
        o.iterations = 40;
        o.accumulation = Accumulation::Repeatable;
    });
    let grid = Grid::new(default_volume(&capture, 0.2).unwrap(), o.lateral, capture.bin_width).unwrap();
    let mut hear = |_: &_| ControlFlow::Continue(());
    SolverOptions::from(o).solve(gpu, &Problem::new(&capture, grid), &mut unwatched(&mut hear)).unwrap()
}

/// Each within 1.5 × of the errors that it has alone, and the second layer takes no more than room in the plan.
#[test]
fn two_plates_are_as_exact_as_each_alone() {
    let gpu = host();
    let scene = || Scene::named("plates").unwrap();
    let real = truth(&scene(), 32).unwrap();
    let found = run(&gpu, scene());
    let m = metrics(&found.maps, &real, 0.3).unwrap();
    let [first, behind] = m.layers[..] else { panic!("the truth has two layers") };
    assert!(first.iou > Some(0.8) && behind.iou > Some(0.8), "{m:?}");
    for (k, name) in ["plates-front", "plates-back"].into_iter().enumerate() {
        let alone = run(&gpu, Scene::named(name).unwrap());
        assert_eq!(alone.maps.behind, None, "nothing is behind one plate");
        let (depth, normals) = errors(&alone.maps, &real, k);
        let (of_depth, of_normals) = errors(&found.maps, &real, k);
        let what = format!("{name}: {depth:.5} m {normals:.2}°, then {of_depth:.5} m {of_normals:.2}°");
        assert!(of_depth < 1.5 * depth + 5e-4 && of_normals < 1.5 * normals + 0.5, "{what}");
    }
    assert_valid(&gpu);
}

/// Mean errors of depth (metres) and normals (degrees) where the truth has both plates: of the front one or the back one.
fn errors(maps: &Maps, real: &thirdbounce::maps::Truth, plate: usize) -> (f64, f64) {
    let behind = real.behind.as_ref().expect("two layers");
    let (depth, normal) =
        if plate == 0 { (&real.depth, &real.normal) } else { (&behind.depth, &behind.normal) };
    let mut sums = [0.0; 3];
    for layer in (0..2).filter_map(|l| maps.layer(l)) {
        let on_plate =
            |c: &usize| behind.mask[*c] && layer.mask[*c] && (layer.depth[*c] < 0.7) == (plate == 0);
        for c in (0..layer.depth.len()).filter(on_plate) {
            let cosine: f32 = (0..3).map(|k| layer.normal[c][k] * normal[c][k]).sum();
            let off = [(layer.depth[c] - depth[c]).abs(), cosine.clamp(-1.0, 1.0).acos().to_degrees(), 1.0];
            (0..3).for_each(|k| sums[k] += f64::from(off[k]));
        }
    }
    assert!(sums[2] > 20.0, "{} pixels of plate {plate}", sums[2]);
    (sums[0] / sums[2], sums[1] / sums[2])
}
