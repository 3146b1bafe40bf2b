//! What the vector solver's kernels compute from samples and histograms, against the float64 twins, on random
//! input in poisoned buffers.

mod device;

use device::vectors::*;
use device::*;
use glam::{DVec3, dvec3};
use thirdbounce::gpu::Schedule;
use thirdbounce::solve::{Job, VectorOptions, vector};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::twin::{self, Bound, Momentum, Raw, Sample, Shine, Told, Twin};
use thirdbounce::transport::{Grid, Model, Volume};

#[test]
fn points_and_extrapolate() {
    let gpu = gpu();
    let (mut model, grid) = (scene(3, 40, 1), grid());
    model.roughness = 0.9;
    let twin = Twin { model: &model, grid: &grid };
    let domain = state(&model, &grid, 0.3, 2).1;
    let active = twin::compact(&domain);
    let (v, before) = (vectors(grid.storage(), 3), vectors(grid.storage(), 4));
    // Some have no bound, for some the step limits the roughness, for some the noise does.
    let mut random = Random::new(5);
    let mut bound = || if random.uniform(0.0, 1.0) < 0.1 { 0.0 } else { random.uniform(0.0, 1.0) };
    let bounds: Vec<[f32; 2]> = (0..grid.storage()).map(|_| [6.0 * bound() as f32, bound() as f32]).collect();
    let wide: Vec<[f64; 2]> = bounds.iter().map(|b| b.map(f64::from)).collect();
    let mut job = job(&gpu, &model, &grid, &vector_options(&grid));
    write_vectors(&mut job, "raw", &v);
    write_vectors(&mut job, "before", &before);
    write(&mut job, "active_voxels", &active);
    write(&mut job, "bounds", &bounds);
    write_mask(&mut job, "mask", &domain);
    for (beta, smooth) in [(0.0, 0.8f32), (0.75, 0.8), (0.75, 0.0), (0.75, f32::INFINITY)] {
        write_momentum(&mut job, Momentum { beta, share: 0.75, ..REST });
        set_counts(&mut job, active.len(), 0.0);
        let count = active.len() as u32;
        write(&mut job, "counts", &[count, count, 0, smooth.to_bits()]);
        run_start(&mut job, &["points"]);
        run_iteration(&mut job, 0, &["extrapolate"]);
        let want = twin::extrapolate(&twin, &active, &v, &before, beta);
        let got = read_samples(&mut job, active.len());
        for (g, w) in got.iter().zip(&want) {
            assert!((g.point - w.point).length() < 1e-6 && g.albedo == 1.0, "{g:?} {w:?}");
            assert!((g.normal - w.normal).length() < 1e-6, "{g:?} {w:?}");
        }
        let rough = twin::roughness(&twin, &active, &want, &wide, 0.75, f64::from(smooth));
        assert!(error(got.iter().map(|s| s.length), rough.iter().map(|r| r.energy)) < 3e-6);
        let slopes: Vec<DVec3> = rough.iter().map(|r| r.gradient).collect();
        assert!(
            error(
                read_raw(&mut job, "gradient", active.len()).iter().flat_map(|g| [g[1], g[2], g[3]]),
                flat(&slopes)
            ) < 3e-6
        );
        let rough = rough.iter().filter(|r| r.energy > 0.0).count();
        let none = smooth == 0.0 || smooth.is_infinite();
        assert!(if none { rough == 0 } else { rough > active.len() / 2 && rough < active.len() });
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

    /// Directions at y, and some roughness there.
    fn samples(&self) -> Vec<Sample> {
        let y = twin::extrapolate(&self.twin(), &self.active, &self.v, &self.before, BETA);
        let mut random = Random::new(41);
        let rough = |s| Sample { length: random.uniform(0.0, 0.1), ..s };
        rounded(&y.into_iter().map(rough).collect::<Vec<_>>())
    }

    /// What the roughness has left in the sums.
    fn rough(&self) -> Vec<DVec3> {
        vectors(self.active.len(), 42).into_iter().map(|v| (0.2 * v).map(|v| f64::from(v as f32))).collect()
    }

    fn gradient(&self, samples: &[Sample], shine: Shine) -> Vec<DVec3> {
        let data = twin::gradient_vectors(&self.twin(), samples, &self.residual, shine);
        data.into_iter().zip(self.rough()).map(|(d, r)| d + r).collect()
    }

    fn write(&self, job: &mut Job<'_>) {
        write_vectors(job, "raw", &self.v);
        write_vectors(job, "before", &self.before);
        write(job, "active_voxels", &self.active);
        write(job, "residual", &self.residual.iter().map(|r| *r as f32).collect::<Vec<f32>>());
        write(job, "bounds", &self.bounds.iter().map(|b| b.map(|b| b as f32)).collect::<Vec<[f32; 2]>>());
        write_momentum(job, Momentum { beta: BETA, share: SHARE, ..REST });
        write_samples(job, &self.samples());
        let sums: Vec<Raw> = self.rough().iter().map(|r| [0.0, r.x, r.y, r.z]).collect();
        write_raw(job, "gradient", &sums);
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
                .with(Push { flags: BACKWARD_CONTINUE | BACKWARD_FINISH, ..Default::default() });
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
