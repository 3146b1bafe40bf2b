//! The bins that contributions go to: at edges and centres, beyond both ends, never into padding. And voxels on a wall
//! point.

use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::engine::{Accumulation, OnDevice};
use thirdbounce::gpu::{Gpu, Schedule};
use thirdbounce::methods::paper;
use thirdbounce::transport::kernels::{Push, buffer, constant};
use thirdbounce::transport::{Binning, Geometry, Gradient, Model, Wall};
use thirdbounce_verify::{Sample, rendered};

const BINS: usize = 40;
const WIDTH: f64 = 1.0 / 64.0;
const START: f64 = 0.75;

/// Paths, in bins from the start of the first one: at ends, edges and centres of bins, and far beyond.
const POSITIONS: [f64; 22] = [
    -1e9, -20.0, -2.0, -1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0, 7.0, 7.5, 39.0, 39.5, 39.75, 40.0,
    40.25, 40.5, 41.0, 60.0, 1e6,
];

/// Three pairs that see a sample straight ahead at the same distance. All numbers are exact in fp32.
fn scene(geometry: Geometry, binning: Binning) -> Model {
    let origin = |n: usize| vec![DVec3::ZERO; n];
    let wall = match geometry {
        Geometry::Confocal => Wall::confocal(origin(3)),
        Geometry::TwoPoints => Wall { geometry, scanned: origin(3), others: origin(3), normals: None },
        Geometry::Product => Wall { geometry, scanned: origin(3), others: origin(2), normals: None },
    };
    let base = model(1, BINS, 1);
    let elements = wall.pairs() * BINS;
    let measured = (0..elements).map(|i| base.measured[i % BINS]).collect();
    Model { elements, wall, measured, binning, bin_width: WIDTH, t_start: START, ..base }
}

fn ahead(position: f64) -> Sample {
    // The plan allows nothing nearer than this. A place farther before the first bin lies behind the wall.
    let z = 0.5 * (START + position * WIDTH);
    Sample {
        point: dvec3(0.0, 0.0, z.abs().max(0.125)),
        albedo: 0.75,
        normal: dvec3(0.0, 0.0, -1.0),
        length: 1.0,
    }
}

fn run(job: &mut OnDevice, name: &str) {
    let mut s = Schedule::of(|s| paper::iteration(s, &job.plan, job.plan.finest(), 0, 1));
    s.commands.retain(|c| c.name() == name);
    job.perform(&s);
}

fn check(gpu: &Gpu, model: &Model, accumulation: Accumulation, fine: bool, window: u32) {
    let grid = grid();
    let scene = (model, &grid);
    let o = options(model, &grid).with(|o| (o.accumulation, o.gradient) = (accumulation, Gradient::Exact));
    let mut job = job_tuned(gpu, model, &grid, &o, |t| {
        (t.window, t.window_span) = (window, u32::MAX);
        t.chunk = if window > 0 { 64 } else { t.chunk };
    });
    if fine {
        remake(&mut job, &[(constant::FINE, 1)]);
    }
    let (geometry, binning) = (model.wall.geometry, model.binning);
    let mut random = Random::new(3);
    let residual: Vec<f32> = (0..model.elements).map(|_| random.uniform(0.5, 1.0) as f32).collect();
    let exact: Vec<f64> = residual.iter().map(|r| f64::from(*r)).collect();
    let inside = [ahead(7.5)];
    let most = rendered(model, &grid, &inside).into_iter().fold(0.0, f64::max);
    let steepest = gathered("backward", scene, &inside, &exact, true)[0][0];
    for position in POSITIONS {
        let what =
            format!("{geometry:?} {binning:?} {accumulation:?} fine {fine} window {window} at {position}");
        let samples = [ahead(position)];
        write_samples(&mut job, &samples);
        set_counts(&mut job, 1, 0.75);
        zero_histograms(&mut job);
        run(&mut job, "forward");
        let want = rendered(model, &grid, &samples);
        let got: Vec<f64> = if job.plan.fixed_point() {
            let sums: Vec<i64> = read_rows(&mut job, buffer::HISTOGRAMS);
            let light = job.model.scene(&grid).kernel_bound;
            let exponent = |v: f32| v.log2().floor() as i32 + 1;
            let scale = 2f64.powi(-(61 - exponent(0.75) - exponent(light) - 1));
            sums.iter().map(|s| *s as f64 * scale).collect()
        } else {
            read_rows::<f32>(&mut job, buffer::HISTOGRAMS).into_iter().map(f64::from).collect()
        };
        let beyond = !(-0.6..=40.6).contains(&position);
        if beyond {
            assert!(got.iter().all(|g| *g == 0.0), "{what}: {got:?}");
        }
        let e = got.iter().zip(&want).fold(0.0f64, |a, (g, w)| a.max((g - w).abs()));
        assert!(e < 2e-5 * most, "{what}: forward {e}");
        run(&mut job, "residual");
        for buffer in [buffer::HISTOGRAMS, buffer::RESIDUAL] {
            assert!(
                read_padding(&mut job, buffer).iter().all(|w| *w == 0),
                "{what}: {buffer} keeps its padding empty"
            );
        }

        write_rows(&mut job, buffer::RESIDUAL, &residual, 0.0);
        let mut s = Schedule::default();
        // Without the last flag the gradient stays as it was gathered.
        s.dispatch(&paper::passes::BACKWARD, [1, 1, 1], 1)
            .bind(buffer::SCENE, job.plan.finest().scene)
            .with(Push { last: model.pairs() as u32, ..Default::default() });
        job.perform(&s);
        let got = read_raw(&mut job, buffer::GRADIENT, 1)[0];
        let want = gathered("backward", scene, &samples, &exact, true)[0][0];
        assert!(!beyond || got[0] == 0.0, "{what}: backward {}", got[0]);
        let e = (got[0] - want).abs();
        assert!(e < 2e-5 * steepest, "{what}: backward {} {want}", got[0]);
    }
}

#[test]
#[ignore = "long: make soak"]
fn edges_centres_and_what_lies_beyond() {
    let gpu = gpu();
    for geometry in [Geometry::Confocal, Geometry::TwoPoints, Geometry::Product] {
        for binning in [Binning::Linear, Binning::Nearest] {
            let model = scene(geometry, binning);
            for accumulation in accumulations(&gpu) {
                check(&gpu, &model, accumulation, false, 0);
            }
            check(&gpu, &model, Accumulation::Owned, true, 0);
            check(&gpu, &model, Accumulation::Fixed, true, 16);
            check(&gpu, &model, Accumulation::Fixed, false, 16);
        }
    }
    assert_valid(&gpu);
}

#[test]
fn a_voxel_on_a_wall_point_gives_nothing_to_its_pair() {
    let gpu = gpu();
    let grid = grid();
    let on = grid.position(dvec3(5.0, 6.0, 7.0));
    for geometry in [Geometry::Confocal, Geometry::TwoPoints, Geometry::Product] {
        // A wall point inside the volume, and one in front of it.
        let points = vec![on.as_vec3().as_dvec3(), dvec3(0.1, 0.1, 0.0)];
        let others =
            if geometry == Geometry::Confocal { vec![] } else { points.iter().rev().copied().collect() };
        let base = model(1, 64, 5);
        let wall = Wall { geometry, scanned: points, others, normals: None };
        let elements = wall.pairs() * 64;
        let measured = (0..elements).map(|i| base.measured[i % 64]).collect();
        let model = Model { elements, wall, measured, ..base };
        assert!(model.touches(&grid));
        let scene = (&model, &grid);
        let mut job = job(&gpu, &model, &grid, &options(&model, &grid).with(|o| o.l1 = 0.0));
        assert!(job.plan.levels.touching);
        let sample = |point: DVec3| Sample { point, albedo: 1.0, normal: dvec3(0.0, 0.0, -1.0), length: 1.0 };
        let nearest = model.nearest(&grid);
        let samples =
            rounded(&[sample(on), sample(on + 0.9 * nearest), sample(on + DVec3::Z * nearest * 0.9)]);
        write_samples(&mut job, &samples);
        set_counts(&mut job, samples.len(), 1.0);
        zero_histograms(&mut job);
        run(&mut job, "forward");
        let got: Vec<f64> =
            read_rows::<f32>(&mut job, buffer::HISTOGRAMS).into_iter().map(f64::from).collect();
        let e = error(got, rendered(&model, &grid, &samples));
        assert!(e < 2e-5, "{geometry:?}: {e}");
        let mut random = Random::new(6);
        let residual: Vec<f32> = (0..model.elements).map(|_| random.uniform(-1.0, 1.0) as f32).collect();
        let exact: Vec<f64> = residual.iter().map(|r| f64::from(*r)).collect();
        write_rows(&mut job, buffer::RESIDUAL, &residual, 0.0);
        run(&mut job, "backward");
        let want = gathered("backward", scene, &samples, &exact, false).concat();
        let e = error(read_raw(&mut job, buffer::GRADIENT, samples.len()).concat(), want);
        assert!(e < 2e-5, "{geometry:?}: {e}");
    }
    assert_valid(&gpu);
}
