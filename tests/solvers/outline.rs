//! The outline of a solve lists exactly the commands that run, and only buffers of the plan.

use std::collections::BTreeMap;

use fixtures::device::unwatched;
use thirdbounce::engine::{Plan, Problem, Reconstruction, Solver, TimedSchedule, When, default_volume};
use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::methods::{PaperOptions, SolverOptions};
use thirdbounce::options::Preset;
use thirdbounce::surface::SurfaceOptions;
use thirdbounce::transport::Grid;
use thirdbounce_simulate::{RenderOptions, Scene, simulate};

/// How often the commands of all parts run.
fn reported(parts: &[TimedSchedule]) -> BTreeMap<String, usize> {
    let mut all = BTreeMap::new();
    for part in parts {
        let times = match &part.when {
            When::Start | When::End => 1,
            When::Iterations(first, last) => last + 1 - first,
            When::After(times) => times.len(),
        };
        for step in &part.steps {
            *all.entry(step.name.clone()).or_insert(0) += times * step.sizes.len();
        }
    }
    all
}

/// How often the device ran them.
fn ran(gpu: &Gpu) -> BTreeMap<String, usize> {
    let recording = gpu.take_recording();
    recording.device.iter().fold(BTreeMap::new(), |mut all, r| {
        // Uploads of the capture and the placing of the surface are not part of a schedule.
        let stage = r.stage.map(|s| recording.stages[s].name);
        if stage.is_some_and(|name| name != "surface") {
            *all.entry(r.kernel.to_string()).or_insert(0) += 1;
        }
        all
    })
}

fn assert_known(plan: &Plan, parts: &[TimedSchedule]) {
    for step in parts.iter().flat_map(|p| &p.steps) {
        for b in step.reads.iter().chain(&step.writes) {
            assert!(plan.bytes_of(*b) > 0, "{} uses {b}, which the plan lacks", step.name);
        }
        assert!(!step.writes.is_empty(), "{} writes nothing", step.name);
    }
}

#[test]
fn the_outline_is_what_runs() {
    let gpu = Gpu::open(&GpuOptions { timings: true, ..GpuOptions::vulkan() }).expect("a device");
    let scene = Scene { scan: 8, bin_width: 0.02, ..Scene::named("letter-L").unwrap() };
    let capture = simulate(&scene, &RenderOptions { noise: 0.1, ..Default::default() }).unwrap().capture;
    let mut hear = |_: &_| std::ops::ControlFlow::Continue(());
    let check = |done: Reconstruction, parts: &[TimedSchedule]| {
        assert_known(&done.plan, parts);
        assert_eq!(reported(parts), ran(&gpu));
    };
    let o = PaperOptions::preset(Preset::Captured).with(|o| {
        o.lateral = 16;
        o.iterations = 25;
        o.domain.double_every = 10;
        o.domain.reduce_every = 4;
        o.restart_every = 6;
    });
    let grid = Grid::new(default_volume(&capture, o.domain.min_depth).unwrap(), o.lateral, 0.02).unwrap();
    gpu.take_recording();
    let done = o.solve(&gpu, &Problem::new(&capture, grid), &mut unwatched(&mut hear)).unwrap();
    let parts = o.outline(&done.plan);
    assert!(parts.iter().any(|p| matches!(&p.when, When::After(times) if times.len() > 1)));
    check(done, &parts);

    // Its number of pixels depends on the closed form, and with it the sizes of dispatches, but not their number.
    let o = SolverOptions::from(SurfaceOptions::default().with(|o| {
        o.lateral = 16;
        o.iterations = 20;
        o.grow = false;
    }));
    gpu.take_recording();
    let done = o.solve(&gpu, &Problem::new(&capture, grid), &mut unwatched(&mut hear)).unwrap();
    let parts = o.outline(&done.plan);
    let (start, rest): (Vec<_>, Vec<_>) = parts.into_iter().partition(|p| matches!(p.when, When::Start));
    // It is placed before.
    assert!(!start.is_empty());
    let iterations = rest.iter().filter(|part| matches!(part.when, When::Iterations(..)));
    let dispatches = iterations.map(|part| {
        let kernels = part.steps.iter().filter(|step| !["fill", "copy"].contains(&&*step.name));
        kernels.map(|step| step.sizes.len()).sum::<usize>()
    });
    // Points, forward, residual, gather, combine, pull and step; no pull once gradients are no longer spread. After ten iterations
    // the state is judged and kept, and the bonds are found.
    assert_eq!(dispatches.collect::<Vec<_>>(), [7, 10, 7, 6]);
    check(done, &rest);
}
