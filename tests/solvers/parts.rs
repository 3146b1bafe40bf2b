//! Pairs in parts: where the histograms of all pairs do not fit into the memory that is there, passes over pairs take them
//! part by part. Solves end with the same result to rounding, whatever the pairs are; what cannot be divided says so.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use fixtures::device::{model, unwatched};
use glam::{DVec3, dvec2, dvec3};
use thirdbounce::capture::{Capture, Pulse};
use thirdbounce::gpu::{Abilities, Accumulations, Arena, DeviceKind, Gpu, GpuOptions, Limits, Memory, check};
use thirdbounce::job::SolverOptions;
use thirdbounce::simulate::{Layout, RenderOptions, Scene, WallShape, simulate};
use thirdbounce::solve::Discretisation;
use thirdbounce::solve::surface::OfFit;
use thirdbounce::solve::{
    Accumulation, Begin, Level, NoiseTerm, PaperOptions, Plan, Preset, Problem, Reconstruction,
    SurfaceOptions,
};
use thirdbounce::transport::{Geometry, Grid, Model, Reflectance, Volume, Wall};
use thirdbounce::{Kind, Result};

fn render(scene: &Scene) -> Capture {
    simulate(scene, &RenderOptions { noise: 0.1, ..RenderOptions::default() }).expect("a rendering").capture
}

/// Narrow bins, except for scans of many points.
fn scene(scan: usize) -> Scene {
    let bin_width = if scan >= MANY { 0.01 } else { 0.004 };
    Scene { scan, bin_width, ..Scene::named("letter-Z").expect("a built-in scene") }
}

fn confocal() -> Capture {
    render(&scene(16))
}

fn with_pulse() -> Capture {
    let mut capture = confocal();
    capture.pulse = Some(Pulse::gaussian(0.03).expect("a pulse"));
    capture
}

fn exhaustive(scan: usize, lasers: usize) -> Capture {
    render(&Scene { layout: Layout::Exhaustive { lasers }, ..scene(scan) })
}

/// Captures of every kind of pairs whose histograms are larger than any other buffer. The surface takes so few pairs at once:
/// where there are more, it takes them in batches, and pairs in parts are one batch.
fn kinds() -> Vec<(&'static str, Capture)> {
    let bump = Scene { wall_shape: WallShape::Bump, reflectance: Reflectance::Lambertian, ..scene(16) };
    vec![
        ("confocal", confocal()),
        (
            "one laser point",
            render(&Scene { layout: Layout::OneLaser { point: dvec2(0.1, -0.1) }, ..scene(16) }),
        ),
        ("exhaustive, parts of several rows", exhaustive(4, 4)),
        ("exhaustive, rows of several parts", exhaustive(8, 2)),
        ("irregular, a curved wall", render(&Scene { layout: Layout::Irregular { seed: 4 }, ..bump })),
        ("a pulse", with_pulse()),
    ]
}

fn paper(term: NoiseTerm) -> SolverOptions {
    let options = PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.lateral = 12;
        o.iterations = 12;
        o.domain.double_every = 5;
        o.restart_every = 3;
        o.domain.reduce_every = 4;
        o.noise.term = term;
    });
    options.into()
}

fn surface_with(accumulation: Accumulation) -> SolverOptions {
    let options = SurfaceOptions::default().with(|o| {
        o.lateral = 12;
        o.iterations = 3;
        o.begin = Begin::Plane;
        o.min_depth = 0.2;
        o.grow = false;
        o.accumulation = accumulation;
    });
    options.into()
}

/// Points to a side of the scans that the paper's solver takes, whose volume has a voxel for each bin.
const MANY: usize = 24;

/// Largest buffers that cut the pairs, but no volume.
const SMALL: u64 = 190 << 10;
const SMALL_FOR_PAPER: u64 = 440 << 10;

fn open(binding: Option<u64>) -> Gpu {
    Gpu::open(&GpuOptions { binding, ..GpuOptions::default() }).expect("a Vulkan device")
}

fn solve(
    gpu: &Gpu,
    solver: &SolverOptions,
    capture: &Capture,
    memory: Option<u64>,
) -> Result<Reconstruction> {
    let mut hear = |_: &_| ControlFlow::Continue(());
    let grid = Discretisation::default().grid(solver, capture)?;
    solver.solve(
        gpu,
        &Problem { capture, grid, memory, with_volume: true, begin: None },
        &mut unwatched(&mut hear),
    )
}

/// Holds a solve in parts against the whole one.
fn assert_same(what: &str, whole: &Reconstruction, parts: &Reconstruction) {
    assert_eq!(whole.plan.part_counts().concat().iter().max(), Some(&1), "{what}: the whole one is whole");
    assert!(parts.plan.part_counts().concat().iter().any(|n| *n > 1), "{what}: in parts");
    assert!(whole.plan.stored_bytes() == 0 && parts.plan.stored_bytes() > 0, "{what}");
    assert_alike(what, whole, parts);
}

/// Holds two solves of the same capture against each other: all is the same to rounding.
fn assert_alike(what: &str, whole: &Reconstruction, parts: &Reconstruction) {
    assert_eq!(whole.pairs, parts.pairs, "{what}: the same work");
    assert_eq!(whole.trace.len(), parts.trace.len(), "{what}: as many points");
    for (a, b) in whole.trace.iter().zip(&parts.trace) {
        assert!(
            (a.loss / b.loss - 1.0).abs() < 1e-3,
            "{what}, iteration {}: {} {}",
            a.iteration,
            a.loss,
            b.loss
        );
        assert!((a.data_loss / b.data_loss - 1.0).abs() < 1e-3, "{what}, iteration {}", a.iteration);
    }
    let brightest = whole.maps.albedo.iter().fold(0.0f32, |a, b| a.max(*b));
    assert!(brightest > 0.0, "{what}: something is found");
    for (a, b) in whole.maps.albedo.iter().zip(&parts.maps.albedo) {
        assert!((a - b).abs() < 1e-2 * brightest, "{what}: albedo {a} {b}");
    }
    for ((a, b), albedo) in whole.maps.depth.iter().zip(&parts.maps.depth).zip(&whole.maps.albedo) {
        let same = (a - b).abs() < 1e-3 || a.is_nan() && b.is_nan();
        assert!(same || *albedo < 1e-2 * brightest, "{what}: depth {a} {b}");
    }
}

#[test]
fn parts_end_as_the_whole_for_every_kind_of_pairs() {
    let [whole, small, small_for_paper] = [None, Some(SMALL), Some(SMALL_FOR_PAPER)].map(open);
    for (name, capture) in kinds() {
        let options = surface_with(Accumulation::Auto);
        let of = |gpu| solve(gpu, &options, &capture, None).expect("it solves");
        assert_same(&format!("surface, {name}"), &of(&whole), &of(&small));
    }
    let options = paper(NoiseTerm::Bin);
    let capture = render(&scene(MANY));
    let of = |gpu| solve(gpu, &options, &capture, None).expect("it solves");
    let [all, parts] = [of(&whole), of(&small_for_paper)];
    assert_same("paper", &all, &parts);
    // A lane of a CPU owns its voxel alone, and walks on from part to part.
    if whole.abilities().kind == DeviceKind::Cpu {
        let bits = |r: &Reconstruction| r.maps.albedo.iter().map(|a| a.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&all), bits(&parts));
    }
}

#[test]
fn parts_end_as_the_whole_for_every_accumulation_and_noise_term() {
    let [whole, small, small_for_paper] = [None, Some(SMALL), Some(SMALL_FOR_PAPER)].map(open);
    let capture = with_pulse();
    let many = render(&scene(MANY));
    for accumulation in [Accumulation::Fixed, Accumulation::Cas] {
        let options = surface_with(accumulation);
        // Fixed point takes twice the memory, so it is cut more often.
        let of = |gpu| solve(gpu, &options, &capture, None).expect("it solves");
        assert_same(&format!("{accumulation:?}"), &of(&whole), &of(&small));
    }
    for term in [NoiseTerm::Off, NoiseTerm::Histogram] {
        let options = paper(term);
        let of = |gpu| solve(gpu, &options, &many, None).expect("it solves");
        assert_same(&format!("{term:?}"), &of(&whole), &of(&small_for_paper));
    }
}

#[test]
fn a_budget_holds_what_is_on_the_device() {
    let gpu = open(None);
    let capture = render(&Scene { bin_width: 0.001, ..scene(16) });
    let options = surface_with(Accumulation::Auto);
    let whole = solve(&gpu, &options, &capture, Some(64 << 20)).expect("it fits");
    let budget = 4 << 20;
    assert!(whole.device_bytes > budget);
    let parts = solve(&gpu, &options, &capture, Some(budget)).expect("it fits in parts");
    assert_same("4 MiB", &whole, &parts);
    let arena = Arena::new(&gpu, &parts.plan.buffers, Some(budget)).expect("memory");
    assert!(arena.taken() <= budget && parts.device_bytes <= budget, "{}", arena.taken());
    assert!(arena.stored() >= parts.plan.stored_bytes());
    // A plan that fits is the one that is made without a budget.
    let grid = Discretisation::default().grid(&options, &capture).expect("a grid");
    let plan = |memory| {
        options
            .plan_within(&gpu, &Problem { capture: &capture, grid, memory, with_volume: true, begin: None })
            .expect("a plan")
    };
    assert_eq!(plan(None), plan(Some(64 << 20)));
    assert_eq!(
        plan(None),
        options.plan(&Problem::new(&capture, grid).and_volume(), &gpu.abilities()).expect("a plan")
    );
}

#[test]
fn what_cannot_be_divided_says_so() {
    let gpu = open(Some(SMALL));
    let mut capture = confocal();
    capture.sensor_spot = Some(0.05);
    let options = surface_with(Accumulation::Auto);
    let error = solve(&gpu, &options, &capture, None).map(|_| ()).expect_err("spots mix pairs");
    assert!(error.kind == Kind::Memory && error.what.contains("spots"), "{error}");
    let capture = confocal();
    // Not even one pair at a time.
    let error =
        solve(&open(Some(4 << 10)), &options, &capture, None).map(|_| ()).expect_err("a surface is larger");
    assert!(error.kind == Kind::Memory && error.what.contains("even with the pairs in parts"), "{error}");
}

/// A model with that many pairs, but without their histograms.
fn claimed(geometry: Geometry, scanned: usize, others: usize, bins: usize) -> Model {
    let wall = Wall {
        geometry,
        scanned: vec![DVec3::ZERO; scanned],
        others: vec![DVec3::ZERO; others],
        normals: None,
    };
    let t = Model { bins, bin_width: 0.004, ..model(2, 64, 1) };
    Model { elements: wall.pairs() * bins, wall, is_spread: true, measured: vec![], ..t }
}

fn card(groups: u32) -> Abilities {
    let limits = Limits {
        texels: 1 << 27,
        storage_range: u64::from(u32::MAX),
        workgroup_invocations: 1024,
        shared_memory: 48 << 10,
        groups: [groups, 65_535, 65_535],
        subgroup: 32,
        work: 1 << 30,
    };
    let accumulations = Accumulations { float: true, int64: true };
    Abilities { kind: DeviceKind::Discrete, accumulations, limits }
}

#[test]
fn parts_of_huge_captures_cover_all_pairs_within_every_limit() {
    let volume = Volume { min: dvec3(-0.5, -0.5, 0.3), max: dvec3(0.5, 0.5, 0.8) };
    let grid = Grid::new(volume, 64, 0.02).expect("a grid");
    // To find what no pair reaches would take long.
    let options = SurfaceOptions::default().with(|o| (o.lateral, o.general) = (64, true));
    let options = OfFit { options: &options, iterations: [0, 6] };
    let cases = [
        (claimed(Geometry::Confocal, 256 * 256, 0, 1024), 256, 256 << 20),
        (claimed(Geometry::Product, 4096, 4096, 512), 64, 4 << 30),
        (claimed(Geometry::Product, 4096, 4096, 512), 64, 256 << 20),
        (claimed(Geometry::TwoPoints, 1 << 20, 1 << 20, 512), 64, 1 << 30),
    ];
    for (model, scan, budget) in cases {
        let device = card(i32::MAX as u32);
        let plan = Plan::new(&model, grid, [scan; 2], &options, &device, false).expect("a plan");
        // Kernels index each part, even where no budget asks for parts.
        let most = |plan: &Plan| {
            let all = plan.levels.volume.iter().chain(&plan.levels.pixels);
            all.flat_map(|l| plan.parts(l).map(|p| p.own.count * plan.scene.bins)).max()
        };
        assert!(most(&plan).is_some_and(|values| values <= 1 << 30));
        let memory = Memory::of_card(u64::from(u32::MAX), [80 << 30, 1 << 40]);
        let plan = plan.within(&options, &memory, Some(budget)).expect("it fits in parts");
        check(&plan.buffers, &memory, Some(budget)).expect("it fits");
        assert!(plan.stored_bytes() as usize >= model.pairs() * model.bins * 4);
        let last = plan.levels.pixels.as_ref().expect("a surface");
        let parts: Vec<_> = plan.parts(last).collect();
        let is_large = |l: &Level| l.pairs > parts[0].own.count;
        assert!(
            parts.len() > 1 && plan.levels.volume.iter().all(|l| (plan.parts(l).count() > 1) == is_large(l))
        );
        let mut next = 0;
        for part in &parts {
            assert_eq!((part.first, part.of), (next, parts.len()));
            let [scanned, others] = [part.own.scanned, part.own.others];
            let pairs = match model.wall.geometry {
                Geometry::Product => scanned * others,
                _ => scanned,
            };
            assert_eq!(pairs, part.own.count);
            let stretch = model.wall.stretch(part.first, part.own.count);
            assert_eq!((stretch.pairs(), stretch.scanned.len()), (part.own.count, scanned));
            next += part.own.count;
        }
        assert_eq!(next, last.pairs, "every pair is in one part");
        let scenes: BTreeSet<_> = parts.iter().map(|p| p.own.scene).collect();
        assert!(scenes.len() <= 2 && parts.iter().all(|p| p.own.count <= parts[0].own.count));
        assert!(parts.windows(2).all(|two| two[0].measured != two[1].measured), "two slots in turn");
    }
    // Workgroups of a dispatch are limited, too.
    let model = claimed(Geometry::Product, 4096, 4096, 16);
    let plan = Plan::new(&model, grid, [64; 2], &options, &card(65_535), false).expect("a plan");
    assert!(plan.parts(plan.finest()).count() > 1);
}
