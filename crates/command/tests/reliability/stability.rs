//! Passes of stiff and extreme cases against the float64 references.

use fixtures::device::{accumulations, assert_valid, gpu};
use fixtures::extreme::{Case, cases, passes};
use thirdbounce::engine::Accumulation;
use thirdbounce::gpu::Gpu;
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
        hold(&gpu, &case, &[Accumulation::Owned, Accumulation::Fixed]);
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
