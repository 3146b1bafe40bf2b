//! Times whole solves of a small simulated scene by both solvers, on the host's clock: plan, memory, uploads,
//! iterations, maps.
//!
//!     cargo bench --bench solves

mod scene;

use std::ops::ControlFlow;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use thirdbounce::simulate::{RenderOptions, Scene, simulate};
use thirdbounce::solve::{
    PaperOptions, Preset, Problem, VectorOptions, Watch, default_volume, paper, vector,
};
use thirdbounce::transport::Grid;

fn solves(c: &mut Criterion) {
    let gpu = scene::gpu(false);
    let scene = Scene { scan: 16, bin_width: 0.012, ..Scene::named("figure").expect("a built-in scene") };
    let options = RenderOptions { noise: 0.05, ..RenderOptions::default() };
    let capture = simulate(&scene, &options).expect("it renders").capture;
    let lateral = 32;
    let volume = default_volume(&capture, 0.2).expect("it has a signal");
    let grid = Grid::new(volume, lateral, capture.bin_width).expect("a plain grid");
    let mut group = c.benchmark_group("solve");
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(5));
    let mut hear = |_: &_| ControlFlow::Continue(());
    group.bench_function("vector, 20 iterations and 20 of the surface", |b| {
        let o = VectorOptions::default().with(|o| {
            o.lateral = lateral;
            o.iterations = 20;
            o.domain.coarse_iterations = 10;
            o.surface.iterations = 20;
        });
        b.iter(|| {
            let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
            vector::reconstruct(&gpu, &Problem::new(&capture, grid), &o, &mut watch).expect("it solves")
        });
    });
    group.bench_function("paper, 20 iterations", |b| {
        let o = PaperOptions::preset(Preset::Synthetic).with(|o| {
            o.lateral = lateral;
            o.iterations = 20;
        });
        let o = o.with(|o| {
            o.domain.double_every = 10;
            o.domain.reduce_every = 5;
        });
        b.iter(|| {
            let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
            paper::reconstruct(&gpu, &Problem::new(&capture, grid), &o, &mut watch).expect("it solves")
        });
    });
    group.finish();
}

criterion_group!(benches, solves);
criterion_main!(benches);
