//! Light from beyond the box: found where it is, and taken off.

use std::ops::ControlFlow;

use fixtures::device::*;
use thirdbounce::capture::Capture;
use thirdbounce::gpu::Gpu;
use thirdbounce::maps::Truth;
use thirdbounce::measure::metrics;
use thirdbounce::simulate::{RenderOptions, Scene, simulate, truth};
use thirdbounce::solve::{Doing, Reconstruction, VectorOptions, Watch, default_volume, vector};
use thirdbounce::transport::Grid;

/// What 16 × 16 points see of a built-in scene, and its truth.
fn seen(name: &str, bin_width: f64) -> (Capture, Truth) {
    let scene = Scene { scan: 16, bin_width, ..Scene::named(name).unwrap() };
    let capture = simulate(&scene, &RenderOptions { noise: 0.05, ..Default::default() }).unwrap().capture;
    (capture, truth(&scene, 32).unwrap())
}

/// Solves with 32 × 32 pixels; the result, and the IoU of its best mask.
fn solve(gpu: &Gpu, (capture, truth): &(Capture, Truth), beyond: bool) -> (Reconstruction, f64) {
    let options = VectorOptions::default().with(|o| {
        o.lateral = 32;
        o.iterations = 30;
        o.surface.iterations = 0;
        o.beyond = beyond;
    });
    let volume = default_volume(capture, options.domain.min_depth).unwrap();
    let grid = Grid::new(volume, 32, capture.bin_width).unwrap();
    let mut trials = 0;
    let mut hear = |p: &thirdbounce::solve::Progress| {
        trials += usize::from(p.doing == Doing::Trial);
        ControlFlow::Continue(())
    };
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    let done = vector::reconstruct(gpu, capture, grid, &options, None, false, &mut watch).unwrap();
    assert_eq!(trials > 0, beyond, "coarse volumes are heard as trials, and only if they are asked for");
    let found = metrics(&done.maps, truth, 0.3).unwrap();
    (done, found.best_iou.unwrap())
}

#[test]
fn light_from_beyond_the_box_is_taken_off() {
    let gpu = gpu();
    let scene = seen("beyond", 0.02);
    let (plain, without) = solve(&gpu, &scene, false);
    let (done, with) = solve(&gpu, &scene, true);
    println!("IoU {without:.3} without, {with:.3} with, {:?}", done.beyond);
    assert_eq!(plain.beyond, None);
    let told = done.beyond.expect("there is light beyond the box");
    assert!(told.left < told.left_without);
    assert!(told.strength > 1.0, "the box has a part of the floor's light: {told:?}");
    assert!(with > without + 0.3, "{without} {with}");
}

#[test]
fn nothing_is_taken_off_where_nothing_is_beyond() {
    let gpu = gpu();
    let scene = seen("figure", 0.02);
    let (done, with) = solve(&gpu, &scene, true);
    let (_, without) = solve(&gpu, &scene, false);
    assert_eq!(done.beyond, None);
    assert!((with - without).abs() < 0.01, "{without} {with}");
}

/// Coarse voxels are two bins of 13 mm deep then, so the coarse volume sums them, and the pairs that judge it, too.
#[test]
#[ignore = "long: make soak"]
fn bins_that_a_coarse_volume_sums_are_judged() {
    let gpu = gpu();
    let scene = seen("beyond", 0.013);
    let (done, with) = solve(&gpu, &scene, true);
    let (_, without) = solve(&gpu, &scene, false);
    let told = done.beyond.expect("there is light beyond the box");
    assert!(told.left < told.left_without && told.left_without < 0.5, "{told:?}");
    assert!(with > without, "{without} {with}");
}
