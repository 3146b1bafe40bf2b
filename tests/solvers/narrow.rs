//! Captures whose bins are narrower than the voxels: the volume sums them, the surface does not.

use std::ops::ControlFlow;

use fixtures::device::*;
use thirdbounce::measure::metrics;
use thirdbounce::simulate::{RenderOptions, Scene, simulate, truth};
use thirdbounce::solve::{Problem, VectorOptions, default_volume, vector};
use thirdbounce::transport::Grid;

/// Bins that one voxel is deep.
const SUM: usize = 5;

#[test]
fn a_volume_of_summed_bins_begins_as_good_a_surface() {
    let gpu = gpu();
    let mut scene = Scene::named("letter-z").unwrap();
    (scene.scan, scene.bin_width) = (16, 0.003);
    let capture = simulate(&scene, &RenderOptions { noise: 0.03, ..Default::default() }).unwrap().capture;
    let truth = truth(&scene, 64).unwrap();
    let options = VectorOptions::default().with(|o| {
        o.lateral = 32;
        o.iterations = 30;
        o.surface.iterations = 30;
    });
    let volume = default_volume(&capture, options.domain.min_depth).unwrap();
    let grid = Grid::new(volume, 32, SUM as f64 * capture.bin_width).unwrap();
    let mut hear = |_: &_| ControlFlow::Continue(());
    let [summed, all] = [false, true].map(|all_bins| {
        let o = options.clone().with(|o| o.all_bins = all_bins);
        vector::reconstruct(&gpu, &Problem::new(&capture, grid), &o, &mut unwatched(&mut hear)).unwrap()
    });
    assert_eq!([&summed.plan, &all.plan].map(|p| p.finest().sum), [SUM, 1]);
    assert_eq!(summed.plan.finest().bins, summed.plan.scene.bins / SUM);
    assert!(
        summed.plan.levels.pixels.iter().all(|l| l.bins == summed.plan.scene.bins),
        "the surface has all bins"
    );
    assert!(summed.plan.left_out.iter().any(|l| l.contains("bins finer than the volume's voxels")));
    assert!(!summed.surface_left && !all.surface_left);
    let [summed, all] = [summed, all].map(|r| metrics(&r.maps, &truth, 0.3).unwrap());
    let [depth, iou, usual] = [summed.depth_mae, summed.best_iou, all.best_iou].map(Option::unwrap);
    // Voxels are 15 mm deep.
    assert!(depth < 0.1 * grid.pitch.z && iou > 0.8, "{summed:?}");
    assert!(iou > usual - 0.02, "{iou} {usual}");
}
