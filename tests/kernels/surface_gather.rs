//! The surface's gather against its float64 twin: every model, kind of pairs and wall, long paths, slices and split
//! dispatches.

use std::sync::Arc;

use fixtures::device::surfaces::*;
use fixtures::device::*;
use thirdbounce::gpu::{Abilities, DeviceKind, Gpu, Schedule};
use thirdbounce::solve::{OnDevice, Plan, surface};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Raw, Sample, Twin};
use thirdbounce::transport::{Geometry, Grid, Model, Reflectance};

/// A gather's input: random residuals, and samples of a field that are not about to change their bins.
struct GatherCase {
    model: Model,
    grid: Grid,
    samples: Vec<Sample>,
    residual: Vec<f64>,
}

impl GatherCase {
    fn new(model: Model, grid: Grid, seed: u64) -> GatherCase {
        let twin = Twin { model: &model, grid: &grid };
        let field = field(&grid, seed);
        let (_, samples) = field.points(&twin, &field.bonds(&twin));
        let margin = if model.pairs() > 1000 { 1e-6 } else { 1e-4 };
        let clear = |s: &Sample| !choices(&twin, s, margin).1;
        let samples: Vec<Sample> = rounded(&samples).into_iter().filter(clear).collect();
        let mut random = Random::new(seed + 1);
        let residual = (0..model.pairs() * model.bins).map(|_| random.uniform(-1.0, 0.6)).collect();
        GatherCase { model, grid, samples, residual }
    }

    fn write(&self, job: &mut OnDevice) {
        write_rows(
            job,
            buffer::RESIDUAL,
            &self.residual.iter().map(|r| *r as f32).collect::<Vec<f32>>(),
            0.0,
        );
        write_samples(job, &self.samples);
        set_counts(job, self.samples.len(), 1.0);
    }

    fn check(&self, job: &mut OnDevice, tolerance: f64) {
        let twin = Twin { model: &self.model, grid: &self.grid };
        let want = twin::surface_gather(&twin, &self.samples, &self.residual);
        let got = read_raw(job, buffer::GRADIENT, want.len());
        let directed = self.model.reflectance.has_normals();
        let what = format!(
            "{:?} {:?} curved {}",
            self.model.wall.geometry,
            self.model.reflectance,
            self.model.wall.normals.is_some()
        );
        // Each component has its own unit.
        let depth = |g: &Raw| if directed { g[3] } else { g[1] };
        let e = error(got.iter().map(depth), want.iter().map(|p| p.depth));
        assert!(e < tolerance, "{what}: depth {e}");
        let e = match directed {
            true => error(
                got.iter().flat_map(|g| [g[0], g[1], g[2]]),
                want.iter().flat_map(|p| p.vector.to_array()),
            ),
            false => error(got.iter().map(|g| g[0]), want.iter().map(|p| p.albedo)),
        };
        assert!(e < tolerance, "{what}: {e}");
        assert!(directed || got.iter().all(|g| g[2] == 0.0 && g[3] == 0.0));
    }
}

/// Compares an iteration's gather, which must run in `dispatches` dispatches, with its twin. Returns the job.
fn check_gather(gpu: &Gpu, case: &GatherCase, dispatches: usize, tolerance: f64) -> OnDevice {
    check_gather_seen(gpu, case, dispatches, tolerance, true)
}

/// The same, with buffers seen as texels where the device is for it, or not.
fn check_gather_seen(
    gpu: &Gpu,
    case: &GatherCase,
    dispatches: usize,
    tolerance: f64,
    texels: bool,
) -> OnDevice {
    let mut job = job_tuned(gpu, &case.model, &case.grid, &Fit::of(&case.grid, 4), |t| t.texels &= texels);
    case.write(&mut job);
    let s = Schedule::of(|s| {
        surface::iteration(s, &job.plan, job.plan.finest(), case.samples.len() / 4, [0, 0, 1])
    });
    assert_eq!(s.commands.iter().filter(|c| c.name() == "surface_gather").count(), dispatches);
    run(&mut job, s, &["surface_gather"]);
    case.check(&mut job, tolerance);
    job
}

#[test]
pub fn gather_of_every_model_pair_and_wall() {
    let gpu = gpu();
    for (geometry, reflectance, curved) in variants() {
        let model = variant(&scene(5, 64, 9), geometry, reflectance, curved, 20);
        let case = GatherCase::new(model, oblong(), 21);
        assert!(case.samples.len() > 200, "{}", case.samples.len());
        assert!(case.samples.iter().any(|s| s.albedo == 0.0));
        check_gather(&gpu, &case, 1, 3e-5);
        check_gather_seen(&gpu, &case, 1, 3e-5, false);
    }
    assert_valid(&gpu);
}

/// Paths with enough bins for places in parts.
#[test]
fn gather_of_long_paths() {
    let gpu = gpu();
    for (i, geometry) in [Geometry::Confocal, Geometry::TwoPoints, Geometry::Product].into_iter().enumerate()
    {
        let model = variant(&scene(5, 4096, 9), geometry, Reflectance::Cosine, false, 23 + i as u64);
        let case = GatherCase::new(model, oblong(), 24);
        assert!(check_gather(&gpu, &case, 1, 3e-5).plan.scene.fine);
    }
    assert_valid(&gpu);
}

#[test]
fn gather_in_slices_and_groups() {
    let gpu = gpu();
    let case = GatherCase::new(scene(5, 64, 9), oblong(), 22);
    let mut job = job(&gpu, &case.model, &case.grid, &Fit::of(&case.grid, 4));
    let pairs = case.model.pairs() as u32;
    let all = case.samples.len();
    let [most, fill] = [u32::MAX, 3 * all as u32];
    let sizes = [[32, 4, most], [8, 8, most], [1, 64, most], [64, 2, most], [8, 32, fill], [8, 32, 1]];
    for (i, (sizes, samples)) in sizes.into_iter().zip([32, 8, 1, 64, 64, 256]).enumerate() {
        Arc::make_mut(&mut job.plan).constants.insert(constant::POLISHED, (i % 2) as u32);
        let of_group = resize(&mut job, sizes, all);
        // The more samples there are, the fewer lanes share one.
        assert_eq!(of_group, samples, "{sizes:?} for {all} samples");
        case.write(&mut job);
        let mut s = Schedule::default();
        // Two dispatches: the second adds to the first.
        for (first, last, flags) in [(0, 10, 0), (10, pairs, BACKWARD_CONTINUE)] {
            s.dispatch(&surface::passes::SURFACE_GATHER, [all.div_ceil(of_group) as u32, 1, 1], 1)
                .bind(buffer::SCENE, job.plan.finest().scene)
                .with(Push { first, last, flags, ..Default::default() });
        }
        job.perform(&s);
        case.check(&mut job, 3e-5);
    }
    assert_valid(&gpu);
}

#[test]
fn gather_over_more_pairs_than_a_dispatch_takes() {
    let gpu = gpu();
    let (grid, models) = more_pairs_than_a_dispatch_takes();
    for (model, dispatches) in models {
        let case = GatherCase::new(model, grid, 24);
        assert!(case.samples.len() > 20, "{}", case.samples.len());
        // Sums of 1e5 values of both signs. The largest sum is a hundredth of the sum of magnitudes.
        check_gather(&gpu, &case, dispatches, 1e-4);
    }
    assert_valid(&gpu);
}

#[test]
fn a_gpus_distances_are_polished_where_its_root_is_too_rough() {
    let gpu = gpu();
    for (bins, polished, fine) in [(300, false, false), (500, true, false), (700, false, true)] {
        let (model, grid) = (scene(5, bins, 9), grid());
        for (kind, asks) in [(DeviceKind::Discrete, polished), (DeviceKind::Cpu, false)] {
            let device = Abilities { kind, ..gpu.abilities() };
            let plan = Plan::new(&model, grid, [5, 5], &Fit::of(&grid, 4), &device, false).unwrap();
            assert_eq!((plan.scene.polished, plan.scene.fine), (asks, fine), "{bins} bins, {kind}");
            assert_eq!(plan.constant(constant::POLISHED), Some(u32::from(asks)));
        }
    }
}
