//! The paper's solver as a whole: published defaults, order of events, results.

use std::ops::ControlFlow;

use fixtures::device::*;
use thirdbounce::Kind;
use thirdbounce::advice::Setting;
use thirdbounce::engine::{Accumulation, Problem, Reconstruction, Solver, default_volume};
use thirdbounce::gpu::{Buffer, Gpu, Schedule};
use thirdbounce::measure::metrics;
use thirdbounce::methods::{Decay, NoiseTerm, PaperOptions, paper};
use thirdbounce::options::Preset;
use thirdbounce::transport::kernels::buffer;
use thirdbounce::transport::{Binning, Gradient, Grid, Sampling};
use thirdbounce_simulate::{RenderOptions, Scene, simulate, truth};

#[test]
fn published_defaults() {
    let o = PaperOptions::preset(Preset::Synthetic);
    assert_eq!((o.lateral, o.iterations, o.domain.coarse_to_fine, o.domain.reduce), (128, 1000, true, true));
    assert_eq!((o.domain.double_every, o.restart_every, o.domain.reduce_every), (100, 100, 50));
    assert_eq!(
        (o.domain.keep_above, o.domain.smooth_sigma, o.domain.smooth_truncate, o.domain.min_depth),
        (0.05, 3.0, 4.0, 0.2)
    );
    assert_eq!(o.learning_rate_decay, Decay::None);
    assert_eq!((o.learning_rate, o.beta1, o.beta2, o.epsilon), (1.0, 0.9, 0.999, 1e-8));
    assert_eq!((o.l1, o.noise.term, o.peak, o.initial_albedo), (0.001, NoiseTerm::Off, 10.0, 1.0));
    assert_eq!(
        (o.sampling, o.binning, o.gradient),
        (Sampling::Continuous, Binning::Nearest, Gradient::Published)
    );
    let c = PaperOptions::preset(Preset::Captured);
    assert_eq!((c.l1, c.noise.term, c.noise.base, c.noise.span), (0.8, NoiseTerm::Bin, 0.05, 0.06));
    let rest = c.with(|new| {
        new.l1 = o.l1;
        new.noise = o.noise.clone();
    });
    assert_eq!(rest, o, "the sets differ in nothing else");
}

#[test]
fn options_that_make_no_sense_are_named() {
    let good = || PaperOptions::preset(Preset::Captured);
    assert!(good().check().is_ok());
    type Spoil = fn(&mut PaperOptions);
    let bad: [(&str, Spoil); 11] = [
        ("lateral", |o| o.lateral = 0),
        ("iterations", |o| o.iterations = 0),
        ("double_every", |o| o.domain.double_every = 0),
        ("learning_rate", |o| o.learning_rate = f64::NAN),
        ("l1", |o| o.l1 = -1.0),
        ("keep_above", |o| o.domain.keep_above = 1.0),
        ("smooth_sigma", |o| o.domain.smooth_sigma = 1e9),
        ("beta1", |o| o.beta1 = 1.5),
        ("peak", |o| o.peak = f64::INFINITY),
        ("min_depth", |o| o.domain.min_depth = f64::NAN),
        ("room", |o| o.domain.room = Some(0.0)),
    ];
    for (name, spoil) in bad {
        let mut o = good();
        spoil(&mut o);
        let error = o.check().unwrap_err();
        assert!(error.what.contains(name) && error.kind == Kind::Options, "{error}");
    }
}

fn letter(scan: usize) -> (Scene, thirdbounce::capture::Capture) {
    let mut scene = Scene::named("letter-l").unwrap();
    (scene.scan, scene.bin_width) = (scan, 0.01);
    let capture = simulate(&scene, &RenderOptions { noise: 0.01, ..Default::default() }).unwrap().capture;
    (scene, capture)
}

fn small(iterations: usize) -> PaperOptions {
    PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.lateral = 32;
        o.iterations = iterations;
    })
}

fn grid(capture: &thirdbounce::capture::Capture, o: &PaperOptions) -> Grid {
    Grid::new(default_volume(capture, o.domain.min_depth).unwrap(), o.lateral, capture.bin_width).unwrap()
}

fn run(gpu: &Gpu, capture: &thirdbounce::capture::Capture, o: &PaperOptions) -> Reconstruction {
    o.solve(
        gpu,
        &Problem::new(capture, grid(capture, o)).and_volume(),
        &mut unwatched(&mut |_| ControlFlow::Continue(())),
    )
    .unwrap()
}

#[test]
fn the_order_of_events_is_the_papers() {
    let gpu = host();
    let (_, capture) = letter(8);
    let o = small(1000);
    let model = paper::model(&capture, &grid(&capture, &o), &o);
    let plan = paper::plan(&model, grid(&capture, &o), capture.scan, &o, &gpu.abilities(), false).unwrap();
    let laterals: Vec<usize> = plan.levels.volume.iter().map(|l| l.grid.n[0]).collect();
    assert_eq!(laterals, [8, 16, 32], "from the scan's resolution, doubling");
    let mut level = 0;
    for done in 1..1000 {
        let s = Schedule::of(|s| paper::due(s, &plan, &o, &mut level, done));
        let names: Vec<_> = s.commands.iter().map(|c| c.name()).collect();
        let at = |n: &str| names.iter().position(|c| *c == n);
        assert_eq!(at("threshold").is_some(), done % 50 == 0, "reduction every 50 iterations, at {done}");
        let doubles = at("carry_doubled").is_some();
        assert_eq!(doubles, done == 100 || done == 200, "doubling every 100, at {done}");
        if done % 100 == 0 {
            let forgets = |buffer: Buffer| {
                s.commands.iter().any(|c| matches!(c, thirdbounce::gpu::Command::Fill { buffer: b, value: 0, .. } if *b == buffer))
            };
            assert!(
                forgets(buffer::MOMENT_FIRST) && forgets(buffer::MOMENT_SECOND),
                "restart every 100, at {done}"
            );
        }
        if let (Some(reduced), Some(doubled)) = (at("threshold"), at("double_domain")) {
            assert!(reduced < doubled, "reduction first");
        }
    }
    assert_eq!(level, 2);
    let o = o.with(|o| {
        o.domain.coarse_to_fine = false;
        o.domain.reduce = false;
    });
    let plan = paper::plan(&model, grid(&capture, &o), capture.scan, &o, &gpu.abilities(), false).unwrap();
    assert_eq!(plan.levels.volume.len(), 1);
    assert!(Schedule::of(|s| paper::due(s, &plan, &o, &mut 0, 50)).commands.is_empty());
}

#[test]
#[ignore = "long: make soak"]
fn a_simulated_letter_end_to_end() {
    let gpu = host();
    let (scene, capture) = letter(16);
    let truth = truth(&scene, 64).unwrap();
    let result = run(&gpu, &capture, &small(160));
    // The edge of a flat object is where its albedo falls to a half.
    let m = metrics(&result.maps, &truth, 0.5).unwrap();
    assert!(m.iou.unwrap() > 0.75, "{m:?}");
    assert!(m.depth_mae.unwrap() < 0.003, "{m:?}");
    // The axes are right: mirrored truths score far worse.
    for flip in [(true, false), (false, true)] {
        let mut other = truth.clone();
        for i in 0..truth.mask.len() {
            let (x, y) = (i / truth.ny, i % truth.ny);
            let x = if flip.0 { truth.nx - 1 - x } else { x };
            let y = if flip.1 { truth.ny - 1 - y } else { y };
            other.mask[i] = truth.mask[x * truth.ny + y];
            other.depth[i] = truth.depth[x * truth.ny + y];
            other.normal[i] = truth.normal[x * truth.ny + y];
        }
        let wrong = metrics(&result.maps, &other, 0.5).unwrap();
        assert!(wrong.iou.unwrap() < 0.5 * m.iou.unwrap(), "{wrong:?}");
    }
    let normals = m.normal_error_deg.unwrap();
    assert!(normals < 45.0, "{normals}");

    // The trace: all active at first, few at last; resolution doubled; the loss fell.
    let (first, last) = (result.trace[0], *result.trace.last().unwrap());
    assert_eq!((first.lateral, last.lateral, last.iteration), (16, 32, 160));
    assert!(first.active_ratio > 0.99 && last.active_ratio < 0.15, "{last:?}");
    assert!(last.loss < 0.2 * first.loss && last.seconds >= first.seconds);
    assert!(result.pairs > 0 && result.solve_seconds > 0.0 && result.device_bytes > 0);
    let planned: u64 = result.plan.buffers.iter().map(|b| b.bytes).sum();
    assert!(
        result.device_bytes >= planned && result.device_bytes < planned + (1 << 20),
        "the plan tells the memory"
    );

    // The volume agrees with the maps: the brightest voxel of a column is the map's albedo.
    let volume = result.volume.unwrap();
    let n = volume.grid.n;
    for i in 0..n[0] * n[1] {
        let column = &volume.albedo[i * n[2]..(i + 1) * n[2]];
        let best = column.iter().fold(0.0f32, |a, b| a.max(*b));
        assert_eq!(best, result.maps.albedo[i]);
    }
    assert_valid(&gpu);
}

#[test]
#[ignore = "long: make soak"]
fn the_noise_term_finds_the_letter_through_dark_counts() {
    let gpu = host();
    let mut scene = Scene::named("letter-l").unwrap();
    (scene.scan, scene.bin_width) = (16, 0.01);
    scene.photons = Some(50.0);
    scene.dark = thirdbounce_simulate::Dark::Fraction(0.01);
    let capture = simulate(&scene, &RenderOptions { noise: 0.01, ..Default::default() }).unwrap().capture;
    for noise in [NoiseTerm::Bin, NoiseTerm::Histogram] {
        // The published weight of the L1 term is for 32 x 32 points on a wall of 2 m; it prunes this scan of
        // 16 x 16 on 1 m to nothing.
        let o = PaperOptions::preset(Preset::Captured).with(|o| {
            o.noise.term = noise;
            o.l1 = 0.02;
        });
        let o = o.with(|o| {
            o.lateral = 32;
            o.iterations = 120;
        });
        let m = metrics(&run(&gpu, &capture, &o).maps, &truth(&scene, 64).unwrap(), 0.5).unwrap();
        assert!(m.iou.unwrap() > 0.6 && m.depth_mae.unwrap() < 0.02, "{noise:?} {m:?}");
    }
    assert_valid(&gpu);
}

#[test]
fn fixed_point_repeats_bit_by_bit_and_agrees_with_the_others() {
    let gpu = gpu();
    let (_, capture) = letter(8);
    let solve = |accumulation, seed| {
        let o = small(24).with(|o| {
            o.accumulation = accumulation;
            o.seed = seed;
            o.lateral = 16;
            o.domain.double_every = 12;
        });
        run(&gpu, &capture, &o)
    };
    let bits = |r: &Reconstruction| r.maps.albedo.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let fixed = solve(Accumulation::Fixed, 3);
    let volume_bits = |r: &Reconstruction| {
        r.volume.as_ref().unwrap().albedo.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    };
    let again = solve(Accumulation::Fixed, 3);
    assert!(bits(&again) == bits(&fixed) && volume_bits(&again) == volume_bits(&fixed));
    assert!(bits(&solve(Accumulation::Fixed, 4)) != bits(&fixed), "the seed matters");
    let loss = fixed.trace.last().unwrap().loss;
    for accumulation in accumulations(&gpu).into_iter().filter(|a| !a.is_fixed()) {
        // Rounding errors grow with iterations; the result is as good.
        let other = solve(accumulation, 3).trace.last().unwrap().loss;
        assert!((other / loss - 1.0).abs() < 0.05, "{accumulation:?}: {other} {loss}");
    }
    assert_valid(&gpu);
}

#[test]
fn a_caller_can_break_off() {
    let gpu = host();
    let (_, capture) = letter(8);
    let o = small(100);
    let mut heard = 0;
    let mut hear = |_: &thirdbounce::engine::Progress| {
        heard += 1;
        ControlFlow::Break(())
    };
    let result = o.solve(&gpu, &Problem::new(&capture, grid(&capture, &o)), &mut unwatched(&mut hear));
    assert_eq!(result.unwrap_err().kind, Kind::Cancelled);
    assert_eq!(heard, 1);
    assert_valid(&gpu);
}

#[test]
fn what_cannot_run_is_refused_in_words() {
    let gpu = gpu();
    let (_, capture) = letter(8);
    let o = small(10);
    let refused = |capture: &thirdbounce::capture::Capture, o: &PaperOptions, memory| {
        let g = grid(capture, o);
        o.solve(
            &gpu,
            &Problem { memory, ..Problem::new(capture, g) },
            &mut unwatched(&mut |_| ControlFlow::Continue(())),
        )
        .unwrap_err()
    };
    let error = refused(&capture, &o, Some(1 << 16));
    assert!(error.kind == Kind::Memory && error.hint.names(Setting::Memory), "{error}");
    let deep = Grid { n: [8, 8, 40_000], ..grid(&capture, &o) };
    let model = paper::model(&capture, &deep, &o);
    let error = paper::plan(&model, deep, capture.scan, &o, &gpu.abilities(), false).unwrap_err();
    assert!(error.what.contains("40000 voxels deep"), "{error}");
    // Few workgroups make long chunks, but none too long. Where they are too few for the pairs, these are refused.
    let mut few = gpu.abilities();
    few.limits.groups = [2, 3, 1];
    let fixed = o.clone().with(|o| o.accumulation = Accumulation::Fixed);
    let (_, many) = letter(16);
    let g = grid(&many, &o);
    let error = paper::plan(&paper::model(&many, &g, &o), g, many.scan, &fixed, &few, false).unwrap_err();
    assert!(error.what.contains("256 pairs are more"), "{error}");
    few.limits.groups = [8, 3, 1];
    let plan = paper::plan(&model, grid(&capture, &o), capture.scan, &fixed, &few, false).unwrap();
    assert!(3 * plan.division.tuning.chunk as usize >= plan.finest().grid.storage());
    let error = refused(&capture, &small(40).with(|o| o.learning_rate = 1e30), None);
    assert!(error.what.contains("loss"), "{error}");
    assert_valid(&gpu);
}
