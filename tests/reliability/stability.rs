//! Stiff and extreme cases against the float64 twins: single passes, then ten iterations. `cargo bench --bench stability`
//! has whole solves and figures, `make soak` long runs.

use fixtures::device::{accumulations, assert_valid, gpu};
use fixtures::extreme::{Case, cases, passes, solve};
use thirdbounce::gpu::Gpu;
use thirdbounce::solve::Accumulation;
use thirdbounce::transport::{Geometry, Reflectance};

/// Relative to the largest value, and to the largest of each histogram.
const LARGEST: f64 = 1e-4;
const HISTOGRAM: f64 = 1e-3;

#[track_caller]
fn hold(gpu: &Gpu, case: &Case, paths: &[Accumulation]) {
    for a in paths {
        let p = passes(gpu, case, *a);
        let good = p.forward.largest < LARGEST && p.forward.histogram < HISTOGRAM && p.gradient < LARGEST;
        assert!(good, "{}, {a:?}: {p:?}", case.name);
    }
}

#[test]
fn passes_of_every_case() {
    let gpu = gpu();
    for case in cases::all() {
        hold(&gpu, &case, &[Accumulation::Owned, Accumulation::Fixed32]);
    }
    assert_valid(&gpu);
}

#[test]
fn every_path_on_the_stiffest() {
    let gpu = gpu();
    let stiff = [
        cases::near_far(Geometry::Confocal, Reflectance::Cosine, false),
        cases::retroreflector(1e6),
        cases::narrow(1e5),
        cases::crowded(64, 64),
    ];
    for case in stiff {
        hold(&gpu, &case, &accumulations(&gpu));
    }
    assert_valid(&gpu);
}

/// Narrow and crowded bins with the other kinds of pairs, walls and surfaces.
#[test]
fn exact_places_and_runs_of_every_kind_of_pair() {
    let gpu = gpu();
    for geometry in [Geometry::TwoPoints, Geometry::Product] {
        for (reflectance, curved) in [(Reflectance::Lambertian, true), (Reflectance::Isotropic, false)] {
            let narrow = cases::of_pairs(&cases::narrow(3e4), geometry, reflectance, curved);
            let crowded = cases::of_pairs(&cases::crowded(32, 64), geometry, reflectance, curved);
            for case in [narrow, crowded] {
                let job = case.job(&gpu, Accumulation::Owned);
                assert!(job.plan.scene.fine || job.plan.division.runs, "{}", case.name);
                // Float atomics, or fixed point where the device has none.
                hold(&gpu, &case, &[Accumulation::Owned, accumulations(&gpu)[0]]);
            }
        }
    }
    assert_valid(&gpu);
}

/// Ordinary scenes get kernels without the code for extreme ones.
#[test]
fn ordinary_scenes_pay_nothing() {
    let gpu = gpu();
    let wants = |case: Case| {
        let job = case.job(&gpu, Accumulation::Owned);
        (job.plan.scene.fine, job.plan.division.runs)
    };
    assert_eq!(wants(cases::plain()), (false, false));
    assert_eq!(wants(cases::narrow(1e4)), (true, false));
    assert_eq!(wants(cases::crowded(64, 64)), (false, true));
}

#[test]
fn ten_iterations() {
    let gpu = gpu();
    for case in cases::all() {
        let got = solve::on_device(&gpu, &case, Accumulation::Owned, 10);
        // The voxels' centres as the device has them: in fp32 they differ from those in float64.
        let want = solve::by_twin(&case, &got.points, 10, false);
        let [v, objective] = solve::state_apart(&got, &want);
        assert!(v < LARGEST && objective < LARGEST, "{}: {v:.1e}, objective {objective:.1e}", case.name);
    }
    assert_valid(&gpu);
}

/// The same scene on a wall of 1 mm and of 100 m gives the same vectors.
#[test]
fn walls_of_any_size_give_the_same_volume() {
    let gpu = gpu();
    let solved = |scale| solve::on_device(&gpu, &cases::wall_of(scale), Accumulation::Fixed, 20);
    let metre = solved(1.0);
    assert!(metre.data[19] < 0.1 * metre.data[0]);
    for scale in [1e-3, 100.0] {
        let [v, objective] = solve::state_apart(&solved(scale), &metre);
        assert!(v < 3e-4 && objective < 1e-4, "wall of {scale} m: {v:.1e}, objective {objective:.1e}");
    }
    assert_valid(&gpu);
}
