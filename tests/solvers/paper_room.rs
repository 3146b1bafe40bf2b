//! Room for a part of the voxels in the paper's solver: the same result if all fit, the brightest if they do not, and the
//! memory that it saves.

use std::ops::ControlFlow;

use fixtures::device::*;
use thirdbounce::engine::{Accumulation, Problem, Reconstruction, Solver, default_volume};
use thirdbounce::gpu::Gpu;
use thirdbounce::methods::{NoiseTerm, PaperOptions, paper};
use thirdbounce::options::Preset;
use thirdbounce::transport::{Grid, Sampling, Volume};
use thirdbounce_simulate::{RenderOptions, Scene, simulate};

fn solve(gpu: &Gpu, o: &PaperOptions) -> Reconstruction {
    let scene = Scene { scan: 8, bin_width: 0.01, ..Scene::named("letter-l").unwrap() };
    let capture = simulate(&scene, &RenderOptions { noise: 0.01, ..Default::default() }).unwrap().capture;
    let volume = default_volume(&capture, o.domain.min_depth).unwrap();
    let grid = Grid::new(volume, o.lateral, capture.bin_width).unwrap();
    let mut hear = |_: &_| ControlFlow::Continue(());
    o.solve(gpu, &Problem::new(&capture, grid).and_volume(), &mut unwatched(&mut hear)).unwrap()
}

fn options_of(sampling: Sampling) -> PaperOptions {
    PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.lateral = 32;
        o.iterations = 70;
        o.domain.double_every = 20;
        o.restart_every = 20;
        o.domain.reduce_every = 10;
        o.sampling = sampling;
        o.domain.smooth_sigma = 1.5;
        o.accumulation = Accumulation::Repeatable;
    })
}

/// The same bits with room for all voxels and for two fifths of them, as no more are ever active.
#[test]
#[ignore = "long: make soak"]
fn room_that_is_enough_changes_nothing() {
    let gpu = host();
    for sampling in [Sampling::Continuous, Sampling::Fixed] {
        let all = solve(&gpu, &options_of(sampling));
        let part = solve(&gpu, &options_of(sampling).with(|o| o.domain.room = Some(0.4)));
        let storage = all.plan.finest().grid.storage();
        assert_eq!([all.plan.domain.capacity, all.plan.domain.touched_capacity], [storage; 2]);
        assert!(part.plan.domain.touched_capacity < storage && part.device_bytes < all.device_bytes);
        assert!(!all.full && !part.full);
        let reported = |r: &Reconstruction| -> Vec<_> {
            let point = |p: &thirdbounce::engine::TracePoint| (p.iteration, p.active, p.loss.to_bits());
            r.trace.iter().map(point).collect()
        };
        let last = |r: &Reconstruction| *reported(r).last().unwrap();
        assert_eq!(last(&part), last(&all), "{sampling:?}");
        assert_eq!(part.volume, all.volume, "{sampling:?}");
        assert!(all.volume.unwrap().albedo.iter().filter(|a| **a != 0.0).count() > 100);
    }
    assert_valid(&gpu);
}

/// A whole solve with too little room stays within it, still finds the letter, and says that voxels were left out.
#[test]
fn a_solve_beyond_its_room_stays_within_it() {
    let gpu = host();
    let all = solve(&gpu, &options_of(Sampling::Continuous));
    let o = options_of(Sampling::Continuous).with(|o| o.domain.room = Some(0.0625));
    let small = solve(&gpu, &o);
    let most =
        |r: &Reconstruction| r.trace.iter().filter(|p| p.lateral == 32).map(|p| p.active).max().unwrap();
    assert!(
        small.full && most(&small) <= small.plan.domain.capacity && most(&all) > small.plan.domain.capacity
    );
    let brightest = |r: &Reconstruction| {
        let albedo = &r.maps.albedo;
        (0..albedo.len()).max_by(|a, b| albedo[*a].total_cmp(&albedo[*b])).unwrap()
    };
    // On the same stroke, which runs along y.
    let [a, b] = [&all, &small].map(brightest).map(|i| [i / 32, i % 32]);
    assert!(a[0].abs_diff(b[0]) <= 2 && a[1].abs_diff(b[1]) <= 12, "{a:?} {b:?}");
    assert_valid(&gpu);
}

/// The paper's scene: 32 x 32 confocal points, 128 x 128 x 333 voxels. The paper's code takes 1,659 MB for it.
#[test]
fn the_papers_scene_takes_less_than_150_megabytes() {
    let gpu = host();
    let volume = Volume { min: glam::dvec3(-0.5, -0.5, 0.25), max: glam::dvec3(0.5, 0.5, 1.4) };
    let grid = Grid::new(volume, 128, (volume.max.z - volume.min.z) / 333.0).unwrap();
    assert_eq!(grid.n, [128, 128, 333]);
    for (preset, has_noise) in [(Preset::Synthetic, false), (Preset::Captured, true)] {
        let (model, o) = (model(32, 512, 40), PaperOptions::preset(preset));
        assert_eq!(o.noise.term != NoiseTerm::Off, has_noise);
        // With the volume that is read back at the end.
        let plan = paper::plan(&model, grid, [32, 32], &o, &gpu.abilities(), true).unwrap();
        let bytes: u64 = plan.buffers.iter().map(|b| b.bytes).sum();
        assert!(bytes < 150_000_000, "{preset:?}: {bytes}");
        let [first, last] = [plan.levels.volume[0].grid.storage(), plan.finest().grid.storage()];
        assert!(
            plan.levels.volume.len() == 3
                && plan.domain.capacity >= first
                && plan.domain.capacity * 11 > last
        );
        assert!(plan.domain.touched_capacity > plan.domain.capacity && plan.domain.touched_capacity < last);
        assert!(plan.left_out.iter().any(|l| l.contains("inactive voxels")), "{:?}", plan.left_out);
        // Without a reduction before the doubling there is room for everything.
        for whole in [o.clone().with(|o| o.domain.reduce = false), o.with(|o| o.domain.reduce_every = 30)] {
            let plan = paper::plan(&model, grid, [32, 32], &whole, &gpu.abilities(), false).unwrap();
            assert_eq!([plan.domain.capacity, plan.domain.touched_capacity], [last; 2]);
        }
    }
}
