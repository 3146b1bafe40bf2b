//! Several devices for one solve: the pairs are shared, and the result is that of one device to rounding. Where one of them
//! fails or the caller cancels, all end, with one error.

use std::ops::ControlFlow;
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use thirdbounce::capture::Capture;
use thirdbounce::gpu::{EXCHANGED, Faults, Gpu, GpuOptions, Point};
use thirdbounce::job::{Request, SolverOptions};
use thirdbounce::simulate::Scene;
use thirdbounce::solve::{
    Accumulation, Beside, Keep, NoiseTerm, Plan, Problem, Progress, Reconstruction, Share, VectorOptions,
    Watch,
};
use thirdbounce::{Error, Kind, Result};

use super::parts::{
    SMALL, assert_alike, confocal, exhaustive, kinds, open, paper, render, scene, vector_with,
};

/// Nothing here takes as long, unless a device waits for one that is gone.
const HANGS: Duration = Duration::from_secs(120);

/// What `work` gives; fails the test if it never ends.
fn in_time<R: Send + 'static>(work: impl FnOnce() -> R + Send + 'static) -> R {
    let (done, told) = channel();
    thread::spawn(move || done.send(work()));
    told.recv_timeout(HANGS).expect("it ends")
}

fn solve_hearing(
    gpus: &[Gpu],
    solver: &SolverOptions,
    capture: &Capture,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Reconstruction> {
    let grid = Request::new(solver.clone(), "").grid(capture)?;
    let mut watch = Watch { hear, maps_every: Some(5), maps_at: &[] };
    solver.solve_on(gpus, &Problem::new(capture, grid).and_volume(), &mut watch)
}

fn solve(gpus: &[Gpu], solver: &SolverOptions, capture: &Capture) -> Result<Reconstruction> {
    solve_hearing(gpus, solver, capture, &mut |_| ControlFlow::Continue(()))
}

/// So many devices with buffers of at most `binding` bytes.
fn several(count: usize, binding: Option<u64>) -> Vec<Gpu> {
    (0..count).map(|_| open(binding)).collect()
}

fn auto() -> SolverOptions {
    vector_with(Accumulation::Auto)
}

/// Holds a solve on `gpus` against that on one.
fn assert_as_one(what: &str, gpus: &[Gpu], solver: &SolverOptions, capture: &Capture) -> Reconstruction {
    let one = solve(&several(1, None), solver, capture).expect("it solves");
    let shared = solve(gpus, solver, capture).expect("it solves on several devices");
    assert_alike(what, &one, &shared);
    assert!(one.plan.bytes_of(EXCHANGED) == 0 && shared.plan.bytes_of(EXCHANGED) > 0, "{what}");
    let volumes = [&one, &shared].map(|r| r.volume.as_ref().expect("a volume").albedo.len());
    assert_eq!(volumes[0], volumes[1], "{what}");
    shared
}

#[test]
fn two_devices_end_as_one() {
    let gpus = several(2, None);
    for (what, capture) in [("confocal", confocal()), ("exhaustive", exhaustive(12, 3))] {
        assert_as_one(what, &gpus, &auto(), &capture);
    }
    // A quarter of the pairs, a quarter of these at first, and odd numbers of both.
    let spread = render(&Scene { bin_width: 0.03, ..scene(62) });
    let shared = assert_as_one("levels with some of the pairs", &gpus, &auto(), &spread);
    assert_eq!((shared.plan.levels.volume[0].pairs, shared.plan.scene.pairs), (241, 961));
}

#[test]
#[ignore = "long: make soak"]
fn three_devices_end_as_one_for_every_kind_of_pairs() {
    let gpus = several(3, None);
    for (what, capture) in kinds() {
        assert_as_one(what, &gpus, &auto(), &capture);
    }
}

#[test]
fn a_share_that_does_not_fit_is_taken_in_parts() {
    let shared = assert_as_one("parts of shares", &several(2, Some(SMALL)), &auto(), &confocal());
    assert!(shared.plan.part_counts().concat().iter().any(|n| *n > 1));
}

#[test]
fn two_runs_give_the_same_bits() {
    let run = || solve(&several(2, None), &auto(), &confocal()).expect("it solves").maps;
    let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let [a, b] = [run(), run()];
    assert!(bits(&a.albedo) == bits(&b.albedo) && bits(&a.depth) == bits(&b.depth));
}

#[test]
fn every_pair_is_on_one_device() {
    let options = VectorOptions::default().with(|o| o.lateral = 32);
    for capture in [confocal(), exhaustive(12, 3)] {
        let grid = Request::new(options.clone(), "").grid(&capture).expect("a grid");
        let gpu = open(None);
        let plan = SolverOptions::from(options.clone()).plan(&Problem::new(&capture, grid), &gpu.abilities());
        let plan: Plan = plan.expect("a plan");
        let of = |number| plan.clone().shared(Share { number, of: 3 }, &options).expect("a share");
        let shares = [0, 1, 2].map(of);
        for (i, level) in plan.levels.volume.iter().enumerate() {
            let own = shares.each_ref().map(|share| share.measured(&share.levels.volume[i]).count);
            assert_eq!(own.iter().sum::<usize>(), level.pairs);
            assert!(own.iter().max() <= Some(&(level.pairs / 3 + plan.scene.scanned)), "{own:?}");
            assert!(shares.iter().all(|share| share.levels.volume[i] == *level), "the same voxels");
        }
        assert!(
            shares[0].bytes_of(thirdbounce::transport::kernels::buffer::RESIDUAL)
                < plan.scene.pairs as u64 * plan.scene.bins as u64 * 2
        );
    }
}

#[test]
fn a_cancelled_solve_ends_on_all_devices() {
    let (error, heard) = in_time(|| {
        let mut heard = 0;
        let mut hear = |_: &Progress| {
            heard += 1;
            if heard == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let done = solve_hearing(&several(2, None), &auto(), &confocal(), &mut hear);
        (done.err(), heard)
    });
    let error = error.expect("it was cancelled");
    assert!(error.kind == Kind::Cancelled && heard == 2, "{error}");
}

/// The error of a solve on two devices, one of which fails as `faults` say.
fn failing(which: usize, faults: Faults) -> Error {
    in_time(move || {
        let mut gpus = several(2, None);
        gpus[which] = Gpu::open(&GpuOptions { faults, ..GpuOptions::default() }).expect("a device");
        solve(&gpus, &auto(), &confocal()).expect_err("a device failed")
    })
}

#[test]
fn a_device_that_fails_ends_the_solve_with_its_error() {
    for which in [0, 1] {
        for point in [Point::Submission, Point::Wait] {
            let error = failing(which, Faults { fail: Some((point, 40)), ..Faults::default() });
            let device = format!("device {} of 2", which + 1);
            assert!(error.kind == Kind::Device && error.what.starts_with(&device), "{error}");
            assert!(error.what.contains("was lost"), "{error}");
        }
    }
    let error = failing(1, Faults { fail: Some((Point::Allocation, 3)), ..Faults::default() });
    assert!(error.kind == Kind::Memory && error.what.starts_with("device 2 of 2"), "{error}");
}

#[test]
fn what_cannot_be_shared_is_refused() {
    let gpus = several(2, None);
    let refused = |gpus: &[Gpu], solver: &SolverOptions, capture: &Capture, words: &str| {
        let error = solve(gpus, solver, capture).expect_err("it is refused");
        assert!(error.kind == Kind::Options && error.what.contains(words), "{error}");
        assert!(error.mend.to_string().contains("device"), "{error}");
    };
    refused(&gpus, &paper(NoiseTerm::Off), &confocal(), "paper runs on one");
    let mut spots = confocal();
    spots.sensor_spot = Some(0.05);
    refused(&gpus, &auto(), &spots, "spots");
    refused(&several(5, None), &auto(), &exhaustive(12, 2), "4 rows of pairs");
    refused(&[], &auto(), &confocal(), "no device");
    let capture = confocal();
    let grid = Request::new(auto(), "").grid(&capture).expect("a grid");
    let mut hear = |_: &Progress| ControlFlow::Continue(());
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    let keep = Keep { every: 2, save: &mut |_| Ok(()), from: None };
    let beside = Beside { watch: &mut watch, keep: Some(keep), lent: None };
    let error = auto().solve_on(&gpus, &Problem::new(&capture, grid), beside).expect_err("it is refused");
    assert!(error.kind == Kind::Options && error.what.contains("saved or resumed"), "{error}");
}
