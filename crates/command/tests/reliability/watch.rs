//! A value that is not finite is found on the device and reported as one error. Values out of proportion stay bounded.

use fixtures::device;
use std::ops::ControlFlow;

use fixtures::captures::scaled;
use fixtures::device::{
    FitNeeds, Perform, assert_valid, field, gpu, model, oblong, options, state, unwatched, write, write_mask,
    write_raw,
};
use thirdbounce::advice::Setting;
use thirdbounce::capture::Capture;
use thirdbounce::engine::{Accumulation, Problem, Reconstruction, Solver, default_volume};
use thirdbounce::gpu::{Gpu, Schedule};
use thirdbounce::methods::{PaperOptions, SolverOptions, paper};
use thirdbounce::options::Preset;
use thirdbounce::surface::{Placed, SurfaceOptions};
use thirdbounce::transport::Grid;
use thirdbounce::transport::kernels::*;
use thirdbounce::{Kind, surface};
use thirdbounce_simulate::{RenderOptions, Scene, simulate};
use thirdbounce_verify::place;

/// The lowest bit: the first kernel in schedule order that found a fault.
fn first(faults: u32) -> u32 {
    faults & faults.wrapping_neg()
}

/// A NaN written before the third iteration of a surface is found in the third, by the kernel that reads it.
#[test]
fn a_nan_is_found_where_it_is_read() {
    let gpu = gpu();
    let (model, grid) = (model(5, 48, 9), oblong());
    let field = field(&grid, 61);
    let fit = FitNeeds::of(&grid, 4);
    for (broken, fault) in [
        (buffer::HEIGHTS, FAULT_SAMPLE),
        (buffer::HISTOGRAMS, FAULT_FORWARD),
        (buffer::MEASURED, FAULT_RESIDUAL),
        (buffer::WALL, FAULT_BACKWARD),
        (buffer::HEIGHT_MOMENTS, FAULT_UPDATE),
    ] {
        let mut job = device::job(&gpu, &model, &grid, &fit);
        let placed = Placed { pixels: field.len(), most: 60.0, explained: 2.0, left: 2.0 };
        let weights = surface::weights(&model, job.plan.finest(), placed, &fit.options, 12, 1.0);
        write(&mut job, buffer::SURFACE_WEIGHTS, &weights);
        place(&mut job, &field).expect("uploads run");
        let mut s = Schedule::default();
        for cleared in [buffer::COUNTS, buffer::HISTOGRAMS] {
            s.fill(cleared, job.plan.bytes_of(cleared), 0);
        }
        surface::start_of(&mut s, &job.plan, job.plan.finest(), field.len(), 4);
        for i in 0..3 {
            if i == 2 {
                // Where they are read: the first pixel, the first bin of the first pair, the first point of the wall.
                let words = if broken == buffer::HISTOGRAMS { PADDING as usize + 1 } else { 1 };
                write(&mut job, broken, &vec![f32::NAN; words]);
            }
            surface::iteration(&mut s, &job.plan, job.plan.finest(), field.len(), [i, i, 12]);
            job.perform(&std::mem::take(&mut s));
            let rows: Vec<[u32; TRACE_ROW as usize]> = job.executor.read(buffer::TRACE, ..3);
            let want = if i == 2 { fault } else { 0 };
            assert_eq!(first(rows[i][TRACE_FAULTS as usize]), want, "{broken}, iteration {i}");
        }
    }
    assert_valid(&gpu);
}

#[test]
fn the_papers_kernels_watch_too() {
    let gpu = gpu();
    let (model, grid) = (device::model(4, 48, 61), device::grid());
    let (raw, domain) = state(&model, &grid, 0.3, 62);
    for (broken, fault) in [
        (buffer::RAW, FAULT_SAMPLE),
        (buffer::MOMENT_FIRST, FAULT_UPDATE),
        (buffer::MEASURED, FAULT_RESIDUAL),
    ] {
        let mut job = device::job(&gpu, &model, &grid, &options(&model, &grid));
        let mut s = Schedule::default();
        for b in [buffer::COUNTS, buffer::HISTOGRAMS, buffer::MOMENT_FIRST, buffer::MOMENT_SECOND] {
            s.fill(b, job.plan.bytes_of(b), 0);
        }
        job.perform(&s);
        write_raw(&mut job, buffer::RAW, &raw);
        write_mask(&mut job, buffer::MASK, &domain);
        let s = Schedule::of(|s| paper::compact(s, &job.plan, job.plan.finest()));
        job.perform(&s);
        for i in 0..2 {
            if i == 1 {
                let count = if broken == buffer::MEASURED { 1 } else { 4 * grid.storage() };
                write(&mut job, broken, &vec![f32::NAN; count]);
            }
            let s = Schedule::of(|s| paper::iteration(s, &job.plan, job.plan.finest(), i, i + 1));
            job.perform(&s);
            let rows: Vec<[u32; TRACE_ROW as usize]> = job.executor.read(buffer::TRACE, ..);
            let want = if i == 1 { fault } else { 0 };
            assert_eq!(first(rows[i as usize][TRACE_FAULTS as usize]), want, "{broken}, iteration {i}");
        }
    }
    assert_valid(&gpu);
}

fn letter() -> Capture {
    let scene = Scene { scan: 6, bin_width: 0.02, ..Scene::named("letter-l").unwrap() };
    simulate(&scene, &RenderOptions { noise: 0.1, ..RenderOptions::default() }).unwrap().capture
}

fn grid_of(capture: &Capture) -> Grid {
    Grid::new(default_volume(capture, 0.2).unwrap(), 12, capture.bin_width).unwrap()
}

fn by_paper(
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    o: &PaperOptions,
) -> thirdbounce::Result<Reconstruction> {
    o.solve(
        gpu,
        &Problem::new(capture, grid).and_volume(),
        &mut unwatched(&mut |_| ControlFlow::Continue(())),
    )
}

fn by_surface(
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    o: &SurfaceOptions,
) -> thirdbounce::Result<Reconstruction> {
    SolverOptions::from(o.clone()).solve(
        gpu,
        &Problem::new(capture, grid).and_volume(),
        &mut unwatched(&mut |_| ControlFlow::Continue(())),
    )
}

fn paper_options() -> PaperOptions {
    PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.lateral = 12;
        o.iterations = 30;
    })
}

fn surface_options() -> SurfaceOptions {
    SurfaceOptions::default().with(|o| {
        o.lateral = 12;
        o.iterations = 30;
    })
}

/// The error says what, where and how to fix it.
#[test]
fn a_user_is_told_iteration_kernel_and_mend() {
    let gpu = gpu();
    let capture = letter();
    let grid = grid_of(&capture);
    let o = paper_options().with(|o| o.learning_rate = 1e38);
    let failed = by_paper(&gpu, &capture, grid, &o).unwrap_err();
    assert_eq!(failed.kind, Kind::Options);
    assert!(failed.what.contains("iteration ") && failed.what.contains("kernel "), "{failed}");
    assert!(failed.hint.names(Setting::LearningRate), "{failed}");
    let failed = by_paper(&gpu, &capture, grid, &paper_options().with(|o| o.peak = 1e25)).unwrap_err();
    assert!(failed.what.contains("iteration 1: kernel residual"), "{failed}");
    assert!(failed.hint.names(Setting::Peak), "{failed}");
}

#[test]
fn captures_that_are_no_numbers_are_refused_by_the_solvers() {
    let gpu = gpu();
    let good = letter();
    let grid = grid_of(&good);
    for (value, words) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (f32::NEG_INFINITY, "-inf")] {
        let mut bad = good.clone();
        bad.histograms[3 * bad.bins + 7] = value;
        let failures =
            [by_paper(&gpu, &bad, grid, &paper_options()), by_surface(&gpu, &bad, grid, &surface_options())];
        for failed in failures.map(|f| f.map(drop).unwrap_err()) {
            assert_eq!(failed.kind, Kind::Input);
            assert!(["pair 3", "bin 7", words].iter().all(|w| failed.what.contains(w)), "{failed}");
        }
    }
    let mut dark = good.clone();
    dark.histograms.fill(0.0);
    let failed = by_surface(&gpu, &dark, grid, &surface_options()).unwrap_err();
    assert!(failed.what.contains("no signal") && failed.kind == Kind::Input, "{failed}");
}

/// Some counts may be negative, where others took the background off, but not most of the light.
#[test]
fn negative_counts_are_taken_unless_they_outweigh_the_others() {
    let gpu = gpu();
    let good = letter();
    let grid = grid_of(&good);
    let with = |value: f32| {
        let mut capture = good.clone();
        capture.histograms[3 * capture.bins + 7] = value;
        [
            by_paper(&gpu, &capture, grid, &paper_options()),
            by_surface(&gpu, &capture, grid, &surface_options()),
        ]
    };
    for solved in with(-1.0) {
        assert!(solved.unwrap().trace.iter().all(|p| p.loss.is_finite()));
    }
    for refused in with(-1e9) {
        let failed = refused.map(drop).unwrap_err();
        assert!(failed.what.contains("negative counts outweigh") && failed.kind == Kind::Input, "{failed}");
    }
}

/// Steps and weights ten times too large or too small still give a finite loss, not far above that of an empty volume.
#[test]
fn steps_and_weights_ten_times_off_stay_bounded() {
    let gpu = gpu();
    let capture = letter();
    let grid = grid_of(&capture);
    let base = paper_options();
    for times in [0.1, 10.0] {
        for o in [
            base.clone().with(|o| o.learning_rate = base.learning_rate * times),
            base.clone().with(|o| o.l1 = base.l1 * times),
        ] {
            let done = by_paper(&gpu, &capture, grid, &o).unwrap_or_else(|e| panic!("{times}: {e}"));
            assert!(done.trace.iter().all(|p| p.loss.is_finite()));
            let end = done.trace.last().unwrap().data_loss;
            // A rate of 10 overshoots and recovers.
            assert!(end < 10.0 * done.empty_loss, "{times}, rate {}: {end}", o.learning_rate);
        }
        let o = surface_options().with(|o| o.sparsity = 0.05 * times);
        let done = by_surface(&gpu, &capture, grid, &o).unwrap_or_else(|e| panic!("{times}: {e}"));
        assert!(done.trace.iter().all(|p| p.loss.is_finite()));
        let end = done.trace.last().unwrap().data_loss;
        assert!(end <= done.empty_loss, "{times}: {end} of {}", done.empty_loss);
    }
    assert_valid(&gpu);
}

/// Step and epsilon of the paper's solver are lengths of its own, in widths of the volume.
#[test]
fn the_papers_solver_knows_no_scale() {
    let gpu = gpu();
    let metre = letter();
    let mut losses = vec![];
    for scale in [1.0, 1e-3, 100.0] {
        let capture = scaled(&metre, scale);
        let o = paper_options().with(|o| {
            o.domain.min_depth = 0.2 * scale;
            o.accumulation = Accumulation::Repeatable;
        });
        let volume = default_volume(&capture, o.domain.min_depth).unwrap();
        let grid = Grid::new(volume, 12, capture.bin_width).unwrap();
        let done = by_paper(&gpu, &capture, grid, &o).unwrap_or_else(|e| panic!("{scale}: {e}"));
        losses.push(done.trace.last().unwrap().data_loss / done.empty_loss);
    }
    assert!(losses[0] < 0.7, "{losses:?}");
    // The wall is about a metre wide, and Adam's first steps follow the signs of gradients.
    assert!(losses.iter().all(|l| (l / losses[0] - 1.0).abs() < 0.1), "{losses:?}");
}

/// Ten thousand iterations of both solvers stay bounded and are no worse than a few.
#[test]
#[ignore = "long: make soak"]
fn ten_thousand_iterations() {
    let gpu = gpu();
    let capture = letter();
    let o = paper_options().with(|o| o.iterations = 10_000);
    let done = by_paper(&gpu, &capture, grid_of(&capture), &o).unwrap();
    let largest = done.trace.iter().skip(1).fold(0.0f64, |a, p| a.max(p.loss));
    assert!(largest < 10.0 * done.empty_loss);
    let o = surface_options().with(|o| (o.iterations, o.grow) = (10_000, false));
    let done = by_surface(&gpu, &capture, grid_of(&capture), &o).unwrap();
    let losses: Vec<f64> = done.trace.iter().map(|p| p.loss).collect();
    assert!(losses.iter().all(|loss| loss.is_finite()));
    assert!(losses[losses.len() - 1] <= 1.001 * losses[0], "{losses:?}");
    assert_valid(&gpu);
}
