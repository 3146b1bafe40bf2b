//! Every kernel of the vector solver against its float64 twin, on random input in poisoned buffers.

mod device;

use device::*;
use glam::{DVec3, dvec3};
use thirdbounce::gpu::Schedule;
use thirdbounce::solve::{Job, VectorOptions, extract, vector};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Bound, Momentum, Sample, Shine, Told, Twin};
use thirdbounce::transport::{Gradient, Grid, Model, Sampling, Volume};

/// What the vector solver makes of the tests' random scene.
fn scene(n: usize, bins: usize, seed: u64) -> Model {
    Model { sampling: Sampling::Fixed, gradient: Gradient::Exact, ..model(n, bins, seed) }
}

fn vector_options(grid: &Grid) -> VectorOptions {
    VectorOptions { lateral: grid.n[0], iterations: 64, coarse_to_fine: false, ..Default::default() }
}

/// Runs those of the schedule's commands whose kernel is among `names`.
fn run(job: &mut Job<'_>, mut schedule: Schedule, names: &[&str]) {
    schedule.commands.retain(|c| names.contains(&c.name()));
    assert!(!schedule.commands.is_empty());
    job.executor.run(&schedule).expect("the schedule runs");
}

fn run_iteration(job: &mut Job<'_>, number: u32, names: &[&str]) {
    let s = vector::iteration(&job.plan, job.plan.finest(), number);
    run(job, s, names);
}

fn run_start(job: &mut Job<'_>, names: &[&str]) {
    let s = vector::start(&job.plan, &job.plan.levels[0], &vector_options(&job.plan.finest().grid));
    run(job, s, names);
}

/// Random vectors, some zero, some outside the cone.
fn vectors(count: usize, seed: u64) -> Vec<DVec3> {
    let mut random = Random::new(seed);
    let mut one = || {
        let v = dvec3(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(-1.5, 0.3));
        if random.uniform(0.0, 1.0) < 0.15 { DVec3::ZERO } else { v }
    };
    (0..count).map(|_| one()).collect()
}

fn write_vectors(job: &mut Job<'_>, buffer: &'static str, v: &[DVec3]) {
    write_raw(job, buffer, &v.iter().map(|v| [v.x, v.y, v.z, 0.0]).collect::<Vec<_>>());
}

fn read_vectors(job: &mut Job<'_>, buffer: &'static str, count: usize) -> Vec<DVec3> {
    read_raw(job, buffer, count).iter().map(|r| dvec3(r[0], r[1], r[2])).collect()
}

fn read_floats(job: &mut Job<'_>, buffer: &'static str, count: usize) -> Vec<f64> {
    read::<f32>(job, buffer, count).into_iter().map(f64::from).collect()
}

fn flat(v: &[DVec3]) -> Vec<f64> {
    v.iter().flat_map(|v| v.to_array()).collect()
}

fn zero_histograms(job: &mut Job<'_>) {
    let bytes = job.plan.bytes()["histograms"];
    let mut s = Schedule::default();
    s.fill("histograms", bytes, 0);
    job.executor.run(&s).unwrap();
}

fn write_momentum(job: &mut Job<'_>, m: Momentum) {
    write(job, "momentum", &[m.t, m.beta, m.objective, m.restarts, m.share].map(|v| v as f32));
}

fn read_momentum(job: &mut Job<'_>) -> Momentum {
    let m = read_floats(job, "momentum", MOMENTUM as usize);
    let at = |i: u32| m[i as usize];
    Momentum {
        t: at(MOMENTUM_T),
        beta: at(MOMENTUM_BETA),
        objective: at(MOMENTUM_OBJECTIVE),
        restarts: at(MOMENTUM_RESTARTS),
        share: at(MOMENTUM_SHARE),
    }
}

const REST: Momentum = Momentum { t: 1.0, beta: 0.0, objective: f64::INFINITY, restarts: 0.0, share: 0.25 };

#[test]
fn points_and_extrapolate() {
    let gpu = gpu();
    let (model, grid) = (scene(3, 40, 1), grid());
    let twin = Twin { model: &model, grid: &grid };
    let active = twin::compact(&state(&model, &grid, 0.3, 2).1);
    let (v, before) = (vectors(grid.storage(), 3), vectors(grid.storage(), 4));
    let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
    write_vectors(&mut job, "raw", &v);
    write_vectors(&mut job, "before", &before);
    write(&mut job, "active_voxels", &active);
    for beta in [0.0, 0.75] {
        write_momentum(&mut job, Momentum { beta, ..REST });
        set_counts(&mut job, active.len(), 0.0);
        run_start(&mut job, &["points"]);
        run_iteration(&mut job, 0, &["extrapolate"]);
        let want = twin::extrapolate(&twin, &active, &v, &before, beta);
        let got = read_samples(&mut job, active.len());
        for (g, w) in got.iter().zip(&want) {
            assert!((g.point - w.point).length() < 1e-6 && g.albedo == 1.0, "{g:?} {w:?}");
            assert!((g.normal - w.normal).length() < 1e-6, "{g:?} {w:?}");
        }
        let peak = want.iter().fold(0.0f64, |a, s| a.max(s.normal.length()));
        let counts: Vec<u32> = read(&mut job, "counts", COUNTS as usize);
        let told = f64::from(f32::from_bits(counts[COUNT_PEAK_ALBEDO as usize]));
        assert!((told / peak - 1.0).abs() < 1e-6, "{told} {peak}");
    }
    assert_valid(&gpu);
}

#[test]
fn forward_and_weighted_residual_on_every_accumulation_path() {
    let gpu = gpu();
    let mut model = scene(5, 64, 3);
    let grid = grid();
    let points = {
        let twin = Twin { model: &model, grid: &grid };
        let active = twin::compact(&state(&model, &grid, 0.5, 4).1);
        away_from_edges(&twin, &twin::points(&twin, &active))
    };
    assert!(points.len() > 800);
    let directions = vectors(points.len(), 5);
    let samples: Vec<Sample> =
        points.iter().zip(&directions).map(|(s, v)| Sample { normal: *v, ..*s }).collect();
    for shine in [Shine::Cosine, Shine::Lambertian, Shine::Isotropic] {
        let bounding = shine == Shine::Isotropic;
        let accumulated = twin::forward_vectors(&Twin { model: &model, grid: &grid }, &samples, shine);
        // Measured is about what is rendered.
        let render = f64::from(model.scene(&grid).render_scale);
        let mut random = Random::new(6);
        model.measured = accumulated.iter().map(|a| (a * render * random.uniform(0.5, 1.5)) as f32).collect();
        let twin = Twin { model: &model, grid: &grid };
        let (want, loss) = twin::residual_weighted(&twin, &accumulated, !bounding);
        let peak = if bounding { 1.0 } else { directions.iter().fold(0.0, |a, v| v.length().max(a)) };
        for accumulation in ACCUMULATIONS {
            let o = VectorOptions {
                accumulation,
                lambertian: shine == Shine::Lambertian,
                ..vector_options(&grid)
            };
            let mut job = job(&gpu, &model, &grid, &o);
            write_samples(&mut job, &samples);
            set_counts(&mut job, samples.len(), peak);
            zero_histograms(&mut job);
            if bounding {
                run_start(&mut job, &["forward_bound", "residual_bound"]);
            } else {
                run_iteration(&mut job, 0, &["forward", "residual"]);
            }
            let got = read_floats(&mut job, "residual", want.len());
            let e = error(got, want.iter().copied());
            assert!(e < 3e-5, "{shine:?} {accumulation:?}: {e}");
            let partials: Vec<[f32; 2]> = read(&mut job, "loss_partials", want.len().div_ceil(64));
            for k in 0..2 {
                let sum: f64 = partials.iter().map(|p| f64::from(p[k])).sum();
                assert!((sum / want.len() as f64 / loss[k] - 1.0).abs() < 1e-4, "{shine:?} {k}");
            }
            let bytes = job.plan.bytes()["histograms"] as usize;
            assert!(read::<u8>(&mut job, "histograms", bytes).iter().all(|b| *b == 0));
        }
    }
    assert_valid(&gpu);
}

/// A step's input: gradients of about the size of the bounds, some of them none, group terms that end some.
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
        let (v, mut before) = (vectors(grid.storage(), 11), vectors(grid.storage(), 12));
        for (b, v) in before.iter_mut().zip(&v).filter(|(_, v)| **v == DVec3::ZERO) {
            *b = *v;
        }
        let mut random = Random::new(13);
        let residual: Vec<f64> = (0..model.pairs() * model.bins).map(|_| random.uniform(-1.0, 0.6)).collect();
        let mut case =
            StepCase { model, grid, active, v, before, residual, bounds: vec![[0.0; 2]; grid.storage()] };
        let gradient = case.gradient(&case.samples(), Shine::Cosine);
        for (i, g) in case.active.iter().zip(&gradient) {
            let size = g.length();
            let bound = [size * random.uniform(0.5, 2.0), size * random.uniform(0.0, 1.2)];
            let none = random.uniform(0.0, 1.0) < 0.1;
            case.bounds[*i as usize] = if none { [0.0; 2] } else { bound.map(|b| f64::from(b as f32)) };
        }
        case
    }

    fn twin(&self) -> Twin<'_> {
        Twin { model: &self.model, grid: &self.grid }
    }

    fn samples(&self) -> Vec<Sample> {
        rounded(&twin::extrapolate(&self.twin(), &self.active, &self.v, &self.before, BETA))
    }

    fn gradient(&self, samples: &[Sample], shine: Shine) -> Vec<DVec3> {
        twin::gradient_vectors(&self.twin(), samples, &self.residual, shine)
    }

    fn write(&self, job: &mut Job<'_>) {
        write_vectors(job, "raw", &self.v);
        write_vectors(job, "before", &self.before);
        write(job, "active_voxels", &self.active);
        write(job, "residual", &self.residual.iter().map(|r| *r as f32).collect::<Vec<f32>>());
        write(job, "bounds", &self.bounds.iter().map(|b| b.map(|b| b as f32)).collect::<Vec<[f32; 2]>>());
        write_momentum(job, Momentum { beta: BETA, share: SHARE, ..REST });
        write_samples(job, &self.samples());
        set_counts(job, self.active.len(), 1.0);
    }

    /// What is left on the device after a step in groups of so many voxels, against the twin.
    fn check(&self, job: &mut Job<'_>, shine: Shine, group: usize) {
        let samples = self.samples();
        let gradient = self.gradient(&samples, shine);
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
        let got = read_vectors(job, "raw", count);
        let e = error(flat(&got), flat(&v));
        assert!(e < 3e-5, "{shine:?} in groups of {group}: {e}");
        assert_eq!(read_vectors(job, "before", count), before, "what was, bit by bit");
        let groups = self.active.len().div_ceil(group);
        let sums = |of: &dyn Fn(&Told) -> f64| -> Vec<f64> {
            told.chunks(group).map(|c| c.iter().map(of).sum()).collect()
        };
        let l1 = read_floats(job, "l1_partials", groups);
        assert!(error(l1, sums(&|t| t.group)) < 1e-5);
        let against = read_floats(job, "against_partials", groups);
        assert!(error(against, sums(&|t| t.against)) < 3e-5);
        assert!(told.iter().any(|t| t.against > 0.0) && told.iter().any(|t| t.against < 0.0));
    }
}

#[test]
fn step_in_slices_and_groups() {
    let gpu = gpu();
    let case = StepCase::new(scene(5, 64, 9), grid(), 0.35);
    let step = KERNELS.iter().find(|k| k.name == "step").unwrap();
    for lambertian in [false, true] {
        let o = VectorOptions { lambertian, ..vector_options(&case.grid) };
        let shine = if lambertian { Shine::Lambertian } else { Shine::Cosine };
        let mut job = job(&gpu, &case.model, &case.grid, &o);
        case.write(&mut job);
        let voxels = job.plan.tuning.voxels as usize;
        run_iteration(&mut job, 0, &["step"]);
        case.check(&mut job, shine, voxels);
        for (voxels, slices) in [(32, 4), (8, 8), (1, 64), (64, 2)] {
            let constants = [
                ("VOXELS", voxels),
                ("SLICES", slices),
                ("SPLIT", 1),
                ("EXACT", 1),
                ("LAMBERTIAN", u32::from(lambertian)),
            ];
            job.executor.add_kernel("step", step, &constants).unwrap();
            case.write(&mut job);
            let groups = (case.active.len() as u32).div_ceil(voxels);
            let mut s = Schedule::default();
            s.dispatch("step", [groups, 1, 1])
                .bind("scene", job.plan.finest().scene)
                .with(Push { flags: BACKWARD_FINISH, ..Default::default() });
            job.executor.run(&s).unwrap();
            case.check(&mut job, shine, voxels as usize);
        }
    }
    // The case has what a step can meet.
    let y = case.samples();
    let g = case.gradient(&y, Shine::Cosine);
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

/// More pairs than one dispatch may walk: the sums of the first go on in the second.
#[test]
fn gathers_over_more_pairs_than_a_dispatch_takes() {
    let gpu = gpu();
    let volume = Volume { min: dvec3(-0.5, -0.5, 0.25), max: dvec3(0.5, 0.5, 0.9) };
    let grid = Grid::new(volume, 4, 0.1).unwrap();
    let case = StepCase::new(scene(182, 8, 14), grid, 0.4);
    assert!(case.model.pairs() > PAIR_CHUNK as usize && case.model.pairs() < 2 * PAIR_CHUNK as usize);
    let twin = case.twin();
    for lambertian in [false, true] {
        let o = VectorOptions { lambertian, ..vector_options(&grid) };
        let mut job = job(&gpu, &case.model, &grid, &o);
        case.write(&mut job);
        let voxels = job.plan.tuning.voxels as usize;
        let s = vector::iteration(&job.plan, job.plan.finest(), 0);
        assert_eq!(s.commands.iter().filter(|c| c.name() == "step").count(), 2);
        run(&mut job, s, &["step"]);
        case.check(&mut job, if lambertian { Shine::Lambertian } else { Shine::Cosine }, voxels);
        if lambertian {
            continue;
        }
        check_bounds(&mut job, &twin, &case.active, 15);
        write(&mut job, "residual", &case.residual.iter().map(|r| *r as f32).collect::<Vec<f32>>());
        run_start(&mut job, &["backproject"]);
        let want = twin::backproject(&twin, &case.residual);
        assert!(error(read_floats(&mut job, "sample_points", grid.storage()), want) < 3e-5);
    }
    assert_valid(&gpu);
}

/// Both bounds of the active voxels from random residuals.
fn check_bounds(job: &mut Job<'_>, twin: &Twin, active: &[u32], seed: u64) {
    let mut random = Random::new(seed);
    let residual: Vec<f64> =
        (0..twin.model.pairs() * twin.model.bins).map(|_| random.uniform(0.0, 1e-3)).collect();
    write(job, "residual", &residual.iter().map(|r| *r as f32).collect::<Vec<f32>>());
    write(job, "active_voxels", active);
    let samples = rounded(&twin::points(twin, active));
    write_samples(job, &samples);
    set_counts(job, active.len(), 1.0);
    let count = twin.grid.storage();
    write(job, "bounds", &vec![[0.0f32; 2]; count]);
    run_start(job, &["bound_step", "bound_noise"]);
    let got: Vec<[f32; 2]> = read(job, "bounds", count);
    for (k, what) in [Bound::Step, Bound::Noise].into_iter().enumerate() {
        let mut want = vec![0.0; count];
        for (i, b) in active.iter().zip(twin::bound(twin, &samples, &residual, what)) {
            want[*i as usize] = b;
        }
        let e = error(got.iter().map(|b| f64::from(b[k])), want);
        // Sums of many positive values in fp32 drift with their number.
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

#[test]
fn variance_filter_and_backproject() {
    let gpu = gpu();
    let mut model = scene(4, 50, 19);
    // A background taken off leaves negative values.
    model.measured.iter_mut().for_each(|m| *m -= 2.0);
    let grid = grid();
    let twin = Twin { model: &model, grid: &grid };
    let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
    let elements = model.pairs() * model.bins;
    run_start(&mut job, &["variance"]);
    let want = twin::variance(&twin);
    assert!(error(read_floats(&mut job, "residual", elements), want) < 3e-6);

    for sigma in [0.2, 2.5, 40.0] {
        let hat = vector::hat(sigma, model.bins);
        write(&mut job, "hat_taps", &hat);
        run_start(&mut job, &["filter"]);
        let half: Vec<f64> = hat[1..].iter().map(|w| f64::from(*w)).collect();
        let want = twin::filter(&twin, &half);
        assert!(error(read_floats(&mut job, "residual", elements), want.iter().copied()) < 3e-6);
        run_start(&mut job, &["backproject"]);
        let filtered: Vec<f64> = want.iter().map(|w| f64::from(*w as f32)).collect();
        let want = twin::backproject(&twin, &filtered);
        assert!(want.iter().filter(|v| **v > 0.0).count() > 100, "some is there, some is below zero");
        assert!(error(read_floats(&mut job, "sample_points", grid.storage()), want) < 3e-5);
    }
    assert_valid(&gpu);
}

#[test]
fn finish_decides_on_the_momentum() {
    let gpu = gpu();
    let (model, grid) = (scene(4, 50, 20), grid());
    let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
    let voxels = job.plan.tuning.voxels as usize;
    let (active, elements) = (777usize, model.pairs() * model.bins);
    let mut random = Random::new(21);
    let mut want = Momentum { share: 0.5, ..REST };
    write_momentum(&mut job, want);
    let (mut rises, mut turns) = (0, 0);
    for i in 0..24 {
        // Falls for a while, with a rise now and then; against the momentum now and then.
        let rise = i % 7 == 6;
        let level = 1.0 / f64::from(1 + i) + if rise { 2.0 } else { 0.0 };
        let sign = if i % 5 == 4 { 1.0 } else { -1.0 };
        let loss: Vec<f32> =
            (0..2 * elements.div_ceil(64)).map(|_| (level * random.uniform(50.0, 51.0)) as f32).collect();
        let l1: Vec<f32> = (0..active.div_ceil(voxels)).map(|_| (level * 0.01) as f32).collect();
        let against: Vec<f32> = l1.iter().map(|_| (sign * random.uniform(0.1, 1.0)) as f32).collect();
        write(&mut job, "loss_partials", &loss);
        write(&mut job, "l1_partials", &l1);
        write(&mut job, "against_partials", &against);
        set_counts(&mut job, active, 1.25);
        run_iteration(&mut job, i, &["finish"]);
        let sum = |v: &[f32]| v.iter().map(|x| f64::from(*x)).sum::<f64>();
        let data = |k: usize| loss.iter().skip(k).step_by(2).map(|x| f64::from(*x)).sum::<f64>();
        let objective = data(0) / elements as f64 + sum(&l1);
        let before = want;
        want = twin::finish_accelerated(want, objective, sum(&against));
        rises += usize::from(objective > before.objective);
        turns += usize::from(sign > 0.0);
        let got = read_momentum(&mut job);
        let close =
            |a: f64, b: f64| assert!((a - b).abs() < 2e-6 * b.abs().max(1.0), "{i}: {got:?} {want:?}");
        close(got.t, want.t);
        close(got.beta, want.beta);
        close(got.objective, want.objective);
        close(got.share, want.share);
        assert_eq!(got.restarts, want.restarts);
        let bytes = 4 * TRACE_ROW as usize;
        let row = &job.executor.arena.mapped("trace")[i as usize * bytes..][..bytes];
        let row: Vec<u32> = bytemuck::pod_collect_to_vec(row);
        let told = |k: u32| f64::from(f32::from_bits(row[k as usize]));
        close(told(TRACE_OBJECTIVE), data(0) / elements as f64);
        close(told(TRACE_DATA), data(1) / elements as f64);
        close(told(TRACE_L1), sum(&l1));
        close(told(TRACE_RESTARTS), want.restarts);
        assert_eq!((row[TRACE_ACTIVE as usize], told(TRACE_PEAK)), (777, 1.25));
        assert_eq!(read::<u32>(&mut job, "counts", 4), [777, 777, 0, 0]);
    }
    assert!(rises > 2 && turns > 3 && want.share == 1.0 && want.restarts > 4.0);
    assert_valid(&gpu);
}

/// FISTA's sequence, by its own recurrence: t grows by about a half, beta toward one.
#[test]
fn momentum_grows_until_a_restart() {
    let mut m = REST;
    for i in 1..=50 {
        m = twin::finish_accelerated(m, 1.0 / f64::from(i), -1.0);
    }
    assert!(m.t > 25.0 && m.t < 30.0 && m.beta > 0.88 && m.beta < 1.0 && m.restarts == 0.0, "{m:?}");
    let turned = twin::finish_accelerated(m, 0.001, 1.0);
    assert_eq!((turned.t, turned.beta, turned.restarts, turned.share), (1.0, 0.0, 1.0, REST.share));
    let rose = twin::finish_accelerated(m, 1.0, -1.0);
    assert_eq!((rose.t, rose.beta, rose.share), (1.0, 0.0, 1.5 * REST.share));
    assert_eq!(twin::finish_accelerated(Momentum { share: 0.9, ..m }, 1.0, -1.0).share, 1.0);
}

/// After the domain has changed to `mask`: nothing outside it, momentum at rest, lists, points.
fn check_settled(job: &mut Job<'_>, twin: &Twin, mask: &[bool], v: &[DVec3], momentum: Momentum) {
    let count = twin.grid.storage();
    let (mut want, mut before) = (v.to_vec(), vec![DVec3::NAN; count]);
    let mut rest = momentum;
    twin::settle(mask, &mut want, &mut before, &mut rest);
    assert!(error(flat(&read_vectors(job, "raw", count)), flat(&want)) < 1e-6);
    assert_eq!(read_vectors(job, "before", count), read_vectors(job, "raw", count));
    assert_eq!(read_momentum(job), rest);
    let active = twin::compact(mask);
    assert_eq!(read::<u32>(job, "active_voxels", active.len()), active);
    let points = read_raw(job, "sample_points", active.len());
    for (got, want) in points.iter().zip(twin::points(twin, &active)) {
        assert!((dvec3(got[0], got[1], got[2]) - want.point).length() < 1e-6 && got[3] == 1.0);
    }
}

#[test]
fn reduction_smooths_the_lengths_and_settles() {
    let gpu = gpu();
    let (mut model, grid) = (scene(3, 40, 22), grid());
    model.keep_above = 0.6;
    let twin = Twin { model: &model, grid: &grid };
    let domain = state(&model, &grid, 0.4, 23).1;
    let v = vectors(grid.storage(), 24);
    let o = VectorOptions { keep_above: 0.6, ..vector_options(&grid) };
    let mut job = job(&gpu, &model, &grid, &o);
    write_vectors(&mut job, "raw", &v);
    write_mask(&mut job, "mask", &domain);
    set_counts(&mut job, twin::compact(&domain).len(), 0.0);
    let momentum = Momentum { t: 7.0, beta: 0.8, objective: 3.0, restarts: 2.0, share: 0.5 };
    write_momentum(&mut job, momentum);
    let mut level = 0;
    let s = vector::due(&job.plan, &o, &mut level, o.reduce_every);
    job.executor.run(&s).unwrap();
    let smooth = twin::smooth(&grid, twin::lengths(&v, &domain), &job.plan.taps);
    assert!(error(read_floats(&mut job, "gradient", grid.storage()), smooth.iter().copied()) < 2e-6);
    let kept = twin::threshold(&twin, &smooth);
    let share = kept.iter().filter(|k| **k).count() as f64 / grid.voxels() as f64;
    assert!(share > 0.02 && share < 0.9, "{share}");
    assert_eq!(read_mask(&mut job, "mask", grid.storage()), kept);
    check_settled(&mut job, &twin, &kept, &v, momentum);
    assert!(vector::due(&job.plan, &o, &mut level, o.reduce_every + 1).commands.is_empty());
    assert_valid(&gpu);
}

/// D and lambda that the solver finds for a domain, by storage index.
fn bounds_of(twin: &Twin, mask: &[bool]) -> Vec<[f64; 2]> {
    let active = twin::compact(mask);
    let points = twin::points(twin, &active);
    let rendered = twin::forward_vectors(twin, &points, Shine::Isotropic);
    let (residual, _) = twin::residual_weighted(twin, &rendered, false);
    let d = twin::bound(twin, &points, &residual, Bound::Step);
    let lambda = twin::bound(twin, &points, &twin::variance(twin), Bound::Noise);
    let mut all = vec![[0.0; 2]; mask.len()];
    active.iter().zip(d.iter().zip(&lambda)).for_each(|(i, (d, l))| all[*i as usize] = [*d, *l]);
    all
}

fn check_bounds_of(job: &mut Job<'_>, twin: &Twin, mask: &[bool]) {
    let got: Vec<[f32; 2]> = read(job, "bounds", mask.len());
    let want = bounds_of(twin, mask);
    for k in 0..2 {
        let e = error(got.iter().map(|b| f64::from(b[k])), want.iter().map(|b| b[k]));
        assert!(e < 3e-5, "{k}: {e}");
    }
}

#[test]
fn doubling_interpolates_the_vectors_and_bounds_the_new_domain() {
    let gpu = gpu();
    let (model, fine) = (scene(3, 40, 25), grid());
    let coarse = fine.coarser(2);
    let o = VectorOptions { coarse_to_fine: true, keep_above: 0.5, ..vector_options(&fine) };
    let mut job = job(&gpu, &model, &fine, &o);
    assert_eq!(job.plan.levels.len(), 2);
    let domain = state(&model, &coarse, 0.6, 26).1;
    let v = vectors(coarse.storage(), 27);
    write_vectors(&mut job, "raw", &v);
    write_mask(&mut job, "mask", &domain);
    set_counts(&mut job, twin::compact(&domain).len(), 0.0);
    zero_histograms(&mut job);
    write_momentum(&mut job, REST);
    let mut level = 0;
    let s = vector::due(&job.plan, &o, &mut level, o.coarse_iterations);
    assert_eq!(level, 1);
    job.executor.run(&s).unwrap();

    // Vectors outside the coarse domain count as they stand: reduction does not zero them before the doubling.
    let kept_model = Model { keep_above: 0.5, ..model.clone() };
    let smooth = twin::smooth(&coarse, twin::lengths(&v, &domain), &job.plan.taps);
    let kept = twin::threshold(&Twin { model: &kept_model, grid: &coarse }, &smooth);
    let split = twin::double_domain(&coarse, &fine, &kept);
    assert_eq!(read_mask(&mut job, "mask", fine.storage()), split);
    let share = kept.iter().filter(|k| **k).count() as f64 / coarse.voxels() as f64;
    assert!(share > 0.02 && share < 0.9, "{share}");
    let raw: Vec<twin::Raw> = v.iter().map(|v| [v.x, v.y, v.z, 0.0]).collect();
    let doubled: Vec<DVec3> =
        twin::double_raw(&coarse, &fine, &raw).iter().map(|r| dvec3(r[0], r[1], r[2])).collect();
    let twin = Twin { model: &model, grid: &fine };
    check_settled(&mut job, &twin, &split, &doubled, REST);
    check_bounds_of(&mut job, &twin, &split);
    assert_valid(&gpu);
}

#[test]
fn start_leaves_a_domain_with_its_bounds_and_nothing_in_it() {
    let gpu = gpu();
    let (mut model, grid) = (scene(5, 64, 28), grid());
    model.keep_above = 0.3;
    let twin = Twin { model: &model, grid: &grid };
    let o = VectorOptions { start_above: 0.3, ..vector_options(&grid) };
    let mut job = job(&gpu, &model, &grid, &o);
    let hat = vector::hat(2.0, model.bins);
    write(&mut job, "hat_taps", &hat);
    let s = vector::start(&job.plan, job.plan.finest(), &o);
    job.executor.run(&s).unwrap();
    let half: Vec<f64> = hat[1..].iter().map(|w| f64::from(*w)).collect();
    let projected = twin::backproject(&twin, &twin::filter(&twin, &half));
    let smooth = twin::smooth(&grid, projected, &job.plan.taps);
    assert!(error(read_floats(&mut job, "gradient", grid.storage()), smooth.iter().copied()) < 3e-5);
    let mask = read_mask(&mut job, "mask", grid.storage());
    let want = twin::threshold(&twin, &smooth);
    let differ = mask.iter().zip(&want).filter(|(a, b)| a != b).count();
    assert!(differ <= 1, "{differ} voxels on the wrong side of the threshold");
    assert!(want.iter().any(|w| *w) && want.iter().filter(|w| **w).count() < grid.voxels() / 2);
    let share = f64::from(o.step_share as f32);
    check_settled(&mut job, &twin, &mask, &vec![DVec3::ZERO; grid.storage()], Momentum { share, ..REST });
    check_bounds_of(&mut job, &twin, &mask);
    let counts: Vec<u32> = read(&mut job, "counts", COUNTS as usize);
    assert_eq!(counts[COUNT_PEAK_ALBEDO as usize], 0);
    let bytes = job.plan.bytes()["histograms"] as usize;
    assert!(read::<u8>(&mut job, "histograms", bytes).iter().all(|b| *b == 0));
    assert_valid(&gpu);
}

#[test]
fn extract_sums_the_albedo_of_a_column() {
    let gpu = gpu();
    let (model, grid) = (scene(3, 40, 29), grid());
    let twin = Twin { model: &model, grid: &grid };
    let domain = state(&model, &grid, 0.15, 30).1;
    let v: Vec<DVec3> = vectors(grid.storage(), 31)
        .into_iter()
        .map(|v| twin::into_cone(model.cone, v).map(|v| f64::from(v as f32)))
        .collect();
    let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
    write_vectors(&mut job, "raw", &v);
    write_mask(&mut job, "mask", &domain);
    let s = extract(job.plan.finest());
    job.executor.run(&s).unwrap();
    let got: Vec<[f32; 8]> = bytemuck::pod_collect_to_vec(job.executor.arena.mapped("columns_host"));
    let (mut found, mut empty, mut summed) = (0, 0, 0);
    for (g, w) in got.iter().zip(twin::extract_vectors(&twin, &v, &domain, 2)) {
        let Some(w) = w else {
            assert_eq!(*g, [0.0; 8]);
            empty += 1;
            continue;
        };
        found += 1;
        let close = |a: f32, b: f64| assert!((f64::from(a) - b).abs() < 2e-5, "{g:?} {w:?}");
        close(g[0], w.albedo);
        close(g[1], w.depth);
        close(g[2], w.refined);
        (0..3).for_each(|k| close(g[4 + k], w.normal[k]));
        summed += usize::from(w.albedo > 1.6);
    }
    assert!(found > 80 && empty > 5 && summed > 10, "{found} {empty} {summed}");
    assert_valid(&gpu);
}
