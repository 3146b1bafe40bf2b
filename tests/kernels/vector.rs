//! The vector solver's kernels on samples and histograms against the float64 twins, on random input in poisoned
//! buffers.

use std::sync::Arc;

use fixtures::device::vectors::*;
use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::gpu::{Abilities, DeviceKind, Gpu, Schedule};
use thirdbounce::solve::{OnDevice, Plan, vector};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Bound, Momentum, Raw, Sample, StepSums, Twin};
use thirdbounce::transport::{Grid, Model, Reflectance};

#[test]
pub fn points_and_extrapolate() {
    check_extrapolate(Reflectance::Cosine);
    check_extrapolate(Reflectance::Isotropic);
}

fn check_extrapolate(reflectance: Reflectance) {
    let gpu = gpu();
    let (model, grid) = (scene(3, 40, 1), grid());
    let model = Model { reflectance, roughness: 0.9, ..model };
    let directed = reflectance.has_normals();
    let twin = Twin { model: &model, grid: &grid };
    let domain = state(&model, &grid, 0.3, 2).1;
    let active = twin::compact(&domain);
    let (mut v, mut before) = (vectors(grid.storage(), 3), vectors(grid.storage(), 4));
    if !directed {
        v.iter_mut().chain(&mut before).for_each(|v| *v = v.z * DVec3::Z);
    }
    // Some voxels have no bound; for some the step limits the roughness, for some the noise does.
    let mut random = Random::new(5);
    let mut bound = || if random.uniform(0.0, 1.0) < 0.1 { 0.0 } else { random.uniform(0.0, 1.0) };
    let mut pair = || [6.0 * bound(), bound()].map(|b| f64::from(b as f32));
    let bounds: Vec<[f64; 2]> = (0..grid.storage()).map(|_| pair()).collect();
    let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
    write_domain(&mut job, &domain);
    for (beta, smooth) in [(0.0, 0.8f32), (0.75, 0.8), (0.75, 0.0), (0.75, f32::INFINITY)] {
        set_counts(&mut job, active.len(), 0.0);
        let count = active.len() as u32;
        write(&mut job, buffer::COUNTS, &[count, count, 0, smooth.to_bits(), 0, 0]);
        run_start(&mut job, &["points"]);
        // The start has set these, too.
        write_vectors(&mut job, buffer::RAW, &active, &v);
        write_vectors(&mut job, buffer::BEFORE, &active, &before);
        write_bounds(&mut job, &active, &bounds);
        write_momentum(&mut job, Momentum { beta, share: 0.75, ..REST });
        run_iteration(&mut job, 0, &["extrapolate"]);
        let want = twin::extrapolate(&twin, &active, &v, &before, beta);
        let rough = twin::roughness(&twin, &active, &want, &bounds, 0.75, f64::from(smooth));
        let points = read_raw(&mut job, buffer::SAMPLE_POINTS, active.len());
        for (g, w) in points.iter().zip(&want) {
            assert!((dvec3(g[0], g[1], g[2]) - w.point).length() < 1e-6, "{g:?} {w:?}");
            assert!((g[3] - w.albedo).abs() < 1e-6, "{g:?} {w:?}");
        }
        // (y, energy) and slope. Without normals y is the albedo, and the energy is stored next to the slope.
        let sums = read_raw(&mut job, buffer::GRADIENT, active.len());
        let energy: Vec<f64> = if directed {
            let normals = read_raw(&mut job, buffer::SAMPLE_NORMALS, active.len());
            for (g, w) in normals.iter().zip(&want) {
                assert!((dvec3(g[0], g[1], g[2]) - w.normal).length() < 1e-6, "{g:?} {w:?}");
            }
            normals.iter().map(|n| n[3]).collect()
        } else {
            sums.iter().map(|s| s[1]).collect()
        };
        assert!(error(energy, rough.iter().map(|r| r.energy)) < 3e-6);
        let slope = |s: &Raw| if directed { dvec3(s[1], s[2], s[3]) } else { dvec3(0.0, 0.0, -s[0]) };
        let got: Vec<DVec3> = sums.iter().map(slope).collect();
        let slopes: Vec<DVec3> = rough.iter().map(|r| r.gradient).collect();
        assert!(error(flat(&got), flat(&slopes)) < 3e-6);
        let rough = rough.iter().filter(|r| r.energy > 0.0).count();
        let none = smooth == 0.0 || smooth.is_infinite();
        assert!(if none { rough == 0 } else { rough > active.len() / 2 && rough < active.len() });
        let peak = want.iter().fold(0.0f64, |a, s| a.max(s.normal.length()));
        let counts: Vec<u32> = read(&mut job, buffer::COUNTS, COUNTS as usize);
        let told = f64::from(f32::from_bits(counts[COUNT_PEAK_ALBEDO as usize]));
        assert!((told / peak - 1.0).abs() < 1e-6, "{told} {peak}");
    }
    assert_valid(&gpu);
}

/// A step's input: gradients of about the size of the bounds, some of them zero, and group terms that remove some
/// voxels.
struct StepCase {
    model: Model,
    grid: Grid,
    active: Vec<u32>,
    v: Vec<DVec3>,
    before: Vec<DVec3>,
    residual: Vec<f64>,
    bounds: Vec<[f64; 2]>,
}

const SHARE: f64 = 0.75;
const BETA: f64 = 0.5;

impl StepCase {
    fn new(model: Model, grid: Grid, share: f64) -> StepCase {
        let active = twin::compact(&state(&model, &grid, share, 10).1);
        let (mut v, mut before) = (vectors(grid.storage(), 11), vectors(grid.storage(), 12));
        if !model.reflectance.has_normals() {
            v.iter_mut().chain(&mut before).for_each(|v| *v = v.z * DVec3::Z);
        }
        for (b, v) in before.iter_mut().zip(&v).filter(|(_, v)| **v == DVec3::ZERO) {
            *b = *v;
        }
        let mut random = Random::new(13);
        let residual: Vec<f64> = (0..model.pairs() * model.bins).map(|_| random.uniform(-1.0, 0.6)).collect();
        let mut case =
            StepCase { model, grid, active, v, before, residual, bounds: vec![[0.0; 2]; grid.storage()] };
        let gradient = case.gradient(&case.samples());
        let largest = gradient.iter().fold(0.0f64, |a, g| a.max(g.length()));
        for (i, g) in case.active.iter().zip(&gradient) {
            // A voxel that faces away has almost no gradient. Divided by that little, its rounding would show.
            let size = g.length().max(0.05 * largest);
            let bound = [size * random.uniform(0.5, 2.0), size * random.uniform(0.0, 1.2)];
            let none = random.uniform(0.0, 1.0) < 0.1;
            case.bounds[*i as usize] = if none { [0.0; 2] } else { bound.map(|b| f64::from(b as f32)) };
        }
        case
    }

    fn twin(&self) -> Twin<'_> {
        Twin { model: &self.model, grid: &self.grid }
    }

    /// Samples with directions at y and some roughness.
    fn samples(&self) -> Vec<Sample> {
        let y = twin::extrapolate(&self.twin(), &self.active, &self.v, &self.before, BETA);
        let mut random = Random::new(41);
        let rough = |s| Sample { length: random.uniform(0.0, 0.1), ..s };
        rounded(&y.into_iter().map(rough).collect::<Vec<_>>())
    }

    /// The gradient of the roughness, with which the sums begin.
    fn rough(&self) -> Vec<DVec3> {
        let along = if self.model.reflectance.has_normals() { DVec3::ONE } else { DVec3::Z };
        let one = |v: DVec3| (0.2 * v * along).map(|v| f64::from(v as f32));
        vectors(self.active.len(), 42).into_iter().map(one).collect()
    }

    fn gradient(&self, samples: &[Sample]) -> Vec<DVec3> {
        let data = twin::gradient_vectors(&self.twin(), samples, &self.residual);
        data.into_iter().zip(self.rough()).map(|(d, r)| d + r).collect()
    }

    fn write(&self, job: &mut OnDevice) {
        write_vectors(job, buffer::RAW, &self.active, &self.v);
        write_vectors(job, buffer::BEFORE, &self.active, &self.before);
        write(job, buffer::ACTIVE_VOXELS, &self.active);
        write_rows(
            job,
            buffer::RESIDUAL,
            &self.residual.iter().map(|r| *r as f32).collect::<Vec<f32>>(),
            0.0,
        );
        write_bounds(job, &self.active, &self.bounds);
        write_momentum(job, Momentum { beta: BETA, share: SHARE, ..REST });
        write_samples(job, &self.samples());
        let directed = self.model.reflectance.has_normals();
        let sum = |(r, s): (&DVec3, &Sample)| match directed {
            true => [0.0, r.x, r.y, r.z],
            false => [-r.z, s.length, 0.0, 0.0],
        };
        let sums: Vec<Raw> = self.rough().iter().zip(&self.samples()).map(sum).collect();
        write_raw(job, buffer::GRADIENT, &sums);
        set_counts(job, self.active.len(), 1.0);
    }

    /// Compares the state after a step, in groups of `group` voxels, with the twin.
    fn check(&self, job: &mut OnDevice, group: usize) {
        let samples = self.samples();
        let gradient = self.gradient(&samples);
        let (mut v, mut before) = (self.v.clone(), self.before.clone());
        let told = twin::step(
            &self.twin(),
            &self.active,
            &samples,
            &gradient,
            &self.bounds,
            SHARE,
            &mut v,
            &mut before,
        );
        let count = self.grid.storage();
        let of_active = |v: &[DVec3]| -> Vec<DVec3> { self.active.iter().map(|i| v[*i as usize]).collect() };
        let got = of_active(&read_vectors(job, buffer::RAW, &self.active, count));
        let e = error(flat(&got), flat(&of_active(&v)));
        let (geometry, reflectance) = (self.model.wall.geometry, self.model.reflectance);
        assert!(e < 3e-5, "{geometry:?} {reflectance:?} in groups of {group}: {e}");
        let got = read_vectors(job, buffer::BEFORE, &self.active, count);
        assert_eq!(of_active(&got), of_active(&before), "what was, bit by bit");
        let groups = self.active.len().div_ceil(group);
        let sums = |of: &dyn Fn(&StepSums) -> f64| -> Vec<f64> {
            told.chunks(group).map(|c| c.iter().map(of).sum()).collect()
        };
        let l1 = read_floats(job, buffer::L1_PARTIALS, groups);
        assert!(error(l1, sums(&|t| t.group)) < 1e-5);
        let against = read_floats(job, buffer::AGAINST_PARTIALS, groups);
        assert!(error(against, sums(&|t| t.against)) < 3e-5);
        let signs = [told.iter().any(|t| t.against > 0.0), told.iter().any(|t| t.against < 0.0)];
        assert!(told.len() < 300 || signs == [true, true]);
    }
}

#[test]
fn step_in_slices_and_groups() {
    let gpu = gpu();
    let case = StepCase::new(scene(5, 64, 9), grid(), 0.35);
    let mut job = job(&gpu, &case.model, &case.grid, &vector_options(&case.grid));
    for (sizes, polished) in
        [([32, 4, u32::MAX], 0), ([8, 8, u32::MAX], 1), ([1, 64, u32::MAX], 0), ([64, 2, u32::MAX], 0)]
    {
        Arc::make_mut(&mut job.plan).constants.insert(constant::POLISHED, polished);
        let of_group = resize(&mut job, sizes, case.active.len());
        case.write(&mut job);
        let groups = case.active.len().div_ceil(of_group) as u32;
        let mut s = Schedule::default();
        let pairs = case.model.pairs() as u32;
        s.dispatch(&vector::passes::STEP, [groups, 1, 1], 1)
            .bind(buffer::SCENE, job.plan.finest().scene)
            .with(Push { last: pairs, flags: BACKWARD_CONTINUE | BACKWARD_FINISH, ..Default::default() });
        job.perform(&s);
        case.check(&mut job, of_group);
    }
    // The case contains every situation that a step can meet.
    let y = case.samples();
    let g = case.gradient(&y);
    let mut seen = [0; 5];
    for ((s, g), i) in y.iter().zip(&g).zip(&case.active) {
        let [d, lambda] = case.bounds[*i as usize];
        let u = s.normal - *g / (d * SHARE);
        let held = twin::into_cone(case.model.cone, u);
        seen[0] += usize::from(s.normal == DVec3::ZERO);
        seen[1] += usize::from(d == 0.0);
        seen[2] += usize::from(d > 0.0 && held == u);
        seen[3] += usize::from(d > 0.0 && held != u && held != DVec3::ZERO);
        seen[4] += usize::from(d > 0.0 && held != DVec3::ZERO && held.length() < lambda / (d * SHARE));
    }
    assert!(seen.iter().all(|n| *n > 10), "{seen:?}");
    assert_valid(&gpu);
}

#[test]
fn a_gpus_distances_are_polished_where_its_root_is_too_rough() {
    let gpu = gpu();
    for (bins, polished, fine) in [(300, false, false), (500, true, false), (700, false, true)] {
        let (model, grid) = (scene(5, bins, 9), grid());
        for (kind, asks) in [(DeviceKind::Discrete, polished), (DeviceKind::Cpu, false)] {
            let device = Abilities { kind, ..gpu.abilities() };
            let plan = Plan::new(&model, grid, [5, 5], &vector_options(&grid), &device, false).unwrap();
            assert_eq!((plan.scene.polished, plan.scene.fine), (asks, fine), "{bins} bins, {kind}");
            assert_eq!(plan.constant(constant::POLISHED), Some(u32::from(asks)));
        }
    }
}

#[test]
pub fn step_bounds_and_backprojection_of_every_model_pair_and_wall() {
    let gpu = gpu();
    for (geometry, reflectance, curved) in variants() {
        let model = variant(&scene(5, 64, 9), geometry, reflectance, curved, 20);
        let case = StepCase::new(model, grid(), 0.35);
        for texels in [false, true] {
            check_gathers(&gpu, &case, 1, texels);
        }
    }
    assert_valid(&gpu);
}

/// As on a GPU: lanes share a voxel, the fewer the more voxels there are.
#[test]
fn gathers_share_voxels_by_how_many_there_are() {
    let gpu = gpu();
    let case = StepCase::new(scene(5, 64, 9), grid(), 0.35);
    let all = case.active.len() as u32;
    for (fill, slices) in [(u32::MAX, 32), (9 * all, 16), (4 * all, 4), (2 * all - 1, 2), (all, 1), (1, 1)] {
        let mut job = job(&gpu, &case.model, &case.grid, &vector_options(&case.grid));
        let of_group = resize(&mut job, [8, 32, fill], case.active.len());
        assert_eq!(of_group, 256 / slices, "{fill} lanes for {all} voxels");
        check_gathers_of(job, &case, 1);
    }
    assert_valid(&gpu);
}

/// The second dispatch continues the sums of the first.
#[test]
fn gathers_over_more_pairs_than_a_dispatch_takes() {
    let gpu = gpu();
    let (grid, models) = more_pairs_than_a_dispatch_takes();
    for (model, dispatches) in models {
        check_gathers(&gpu, &StepCase::new(model, grid, 0.4), dispatches, true);
    }
    assert_valid(&gpu);
}

/// Compares the kernels that gather over pairs with their twins. Each must run in `dispatches` dispatches.
/// `texels`: buffers are seen as texels where the device is for it.
fn check_gathers(gpu: &Gpu, case: &StepCase, dispatches: usize, texels: bool) {
    let job = job_tuned(gpu, &case.model, &case.grid, &vector_options(&case.grid), |t| t.texels &= texels);
    check_gathers_of(job, case, dispatches);
}

fn check_gathers_of(mut job: OnDevice, case: &StepCase, dispatches: usize) {
    let twin = case.twin();
    case.write(&mut job);
    let voxels = job.plan.division.tuning.samples_of_group(case.active.len()) as usize;
    let s = Schedule::of(|s| vector::iteration(s, &job.plan, job.plan.finest(), 0));
    assert_eq!(s.commands.iter().filter(|c| c.name() == "step").count(), dispatches);
    run(&mut job, s, &["step"]);
    case.check(&mut job, voxels);
    check_bounds(&mut job, &twin, &case.active, 15);
    write_rows(
        &mut job,
        buffer::RESIDUAL,
        &case.residual.iter().map(|r| *r as f32).collect::<Vec<f32>>(),
        0.0,
    );
    run_start(&mut job, &["backproject"]);
    let want = twin::backproject(&twin, &case.residual);
    let projected = job.plan.domain.volumes[1];
    assert!(error(read_floats(&mut job, projected, case.grid.storage()), want) < 3e-5);
}

/// Both bounds of the active voxels from random residuals.
fn check_bounds(job: &mut OnDevice, twin: &Twin, active: &[u32], seed: u64) {
    let mut random = Random::new(seed);
    let residual: Vec<f64> =
        (0..twin.model.pairs() * twin.model.bins).map(|_| random.uniform(0.0, 1e-3)).collect();
    write_rows(job, buffer::RESIDUAL, &residual.iter().map(|r| *r as f32).collect::<Vec<f32>>(), 0.0);
    write(job, buffer::ACTIVE_VOXELS, active);
    let samples = rounded(&twin::points(twin, active));
    write_samples(job, &samples);
    set_counts(job, active.len(), 1.0);
    let count = twin.grid.storage();
    run_start(job, &["bound_step", "bound_noise"]);
    let got = read_bounds(job, active, count);
    for (k, what) in [Bound::Step, Bound::Noise].into_iter().enumerate() {
        let mut want = vec![0.0; count];
        for (i, b) in active.iter().zip(twin::bound(twin, &samples, &residual, what)) {
            want[*i as usize] = b;
        }
        let e = error(got.iter().map(|b| b[k]), want);
        // The error of fp32 sums of positive values grows with their number.
        let pairs = twin.model.pairs() as f64;
        assert!(e < 1e-5 + 2e-9 * pairs, "{what:?}: {e}");
    }
}

#[test]
fn bounds_of_active_voxels_only() {
    let gpu = gpu();
    let (model, grid) = (scene(5, 64, 16), grid());
    let twin = Twin { model: &model, grid: &grid };
    let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
    check_bounds(&mut job, &twin, &twin::compact(&state(&model, &grid, 0.3, 17).1), 18);
    assert_valid(&gpu);
}

/// The variances taken back to the paths, which the noise bound gathers.
fn check_variance_of_paths(gpu: &Gpu, model: &Model, grid: &Grid) {
    let mut job = job(gpu, model, grid, &vector_options(grid));
    run_start(&mut job, &["variance", "pulse_noise", "spot_noise"]);
    let want = twin::variance(&Twin { model, grid });
    let of_paths = job.plan.residual();
    assert!(error(read_rows::<f32>(&mut job, of_paths).into_iter().map(f64::from), want) < 3e-6);
    assert!(read_padding(&mut job, of_paths).iter().all(|w| *w == 0));
}

#[test]
pub fn bins_are_summed_for_the_volume() {
    let gpu = gpu();
    // Voxels are 3.76 bins deep. The last 2 of 203 bins fill no sum of 3.
    let (model, grid) = (scene(4, 203, 19), grid());
    let options = vector_options(&grid).with(|o| o.all_bins = false);
    let mut job = job(&gpu, &model, &grid, &options);
    let level = *job.plan.finest();
    assert_eq!([level.sum, job.plan.scene.bins, level.bins], [3, 203, 67]);
    let want = twin::sum_bins(&model.measured, model.bins, 3);
    assert_eq!(want.len(), 16 * 67);
    assert!(error(read_floats(&mut job, level.measured, want.len()), want) < 1e-6);
    // Passes over the level's bins read the sums, in rows of the level's length.
    let summed = model.summed(3);
    run_start(&mut job, &["variance"]);
    let got = summed.bins_of(&read_floats(&mut job, buffer::RESIDUAL, summed.cells()));
    assert!(error(got, twin::variance(&Twin { model: &summed, grid: &grid })) < 3e-6);
    assert_valid(&gpu);
}

#[test]
pub fn variance_filter_and_backproject() {
    let gpu = gpu();
    let mut model = scene(4, 50, 19);
    // A subtracted background leaves negative values.
    model.measured.iter_mut().for_each(|m| *m -= 2.0);
    let grid = grid();
    let twin = Twin { model: &model, grid: &grid };
    let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
    run_start(&mut job, &["variance"]);
    let want = twin::variance(&twin);
    assert!(error(read_rows::<f32>(&mut job, buffer::RESIDUAL).into_iter().map(f64::from), want) < 3e-6);
    for sharp in [model.clone(), spotted(&model, [0.1, 0.0])] {
        check_variance_of_paths(&gpu, &Model { pulse: Some(tail()), ..sharp }, &grid);
    }
    check_variance_of_paths(&gpu, &spotted(&model, [0.1, 0.0]), &grid);

    for (sigma, odd) in [(0.2, false), (2.5, false), (40.0, false), (2.5, true)] {
        let mut hat = vector::hat(sigma, model.bins);
        if odd {
            hat[0] = -hat[0];
        }
        write(&mut job, buffer::HAT_TAPS, &hat);
        run_start(&mut job, &["filter"]);
        let half: Vec<f64> = hat[1..].iter().map(|w| f64::from(*w)).collect();
        let want = twin::filter(&twin, &half, odd);
        assert!(
            error(
                read_rows::<f32>(&mut job, buffer::RESIDUAL).into_iter().map(f64::from),
                want.iter().copied()
            ) < 3e-6
        );
        run_start(&mut job, &["backproject"]);
        let filtered: Vec<f64> = want.iter().map(|w| f64::from(*w as f32)).collect();
        let want = twin::backproject(&twin, &filtered);
        assert!(want.iter().filter(|v| **v > 0.0).count() > 100, "some is there, some is below zero");
        let projected = job.plan.domain.volumes[1];
        assert!(error(read_floats(&mut job, projected, grid.storage()), want) < 3e-5);
    }
    assert_valid(&gpu);
}
