//! Work is divided so that no dispatch and no submission meets a driver's time limit, and a device that hangs is found.

use std::collections::BTreeSet;

use thirdbounce::capture::Capture;
use thirdbounce::engine::{Accumulation, Plan, Reconstruction};
use thirdbounce::gpu::{
    Abilities, Accumulations, Arena, Buffer, BufferPlan, Command, DeviceKind, Faults, Gpu, GpuOptions,
    Limits, Place, Point, Schedule,
};
use thirdbounce::methods::{SolverOptions, paper};
use thirdbounce::surface::SurfaceOptions;
use thirdbounce::transport::{Geometry, Grid, Model, Reflectance, Volume, Wall};
use thirdbounce::{Kind, surface};

use super::small::{kinds, loaded, solve, solvers, surface as small_surface};

/// Turns of a dispatch that a discrete card gets at most.
const MOST: u64 = 1_200_000_000;

/// What most discrete GPUs offer.
fn card() -> Abilities {
    let limits = Limits {
        storage_range: u64::from(u32::MAX),
        workgroup_invocations: 1024,
        shared_memory: 48 << 10,
        groups: [i32::MAX as u32, 65_535, 65_535],
        subgroup: 32,
        work: MOST,
    };
    let accumulations = Accumulations { float: true, int64: true };
    Abilities { kind: DeviceKind::Discrete, accumulations, limits }
}

/// A confocal scan of 256 x 256 points, or as many pairs of a product, without their histograms.
fn large(geometry: Geometry) -> Model {
    let at = |i: usize, n: usize| {
        glam::dvec3((i / n) as f64 / n as f64 - 0.5, (i % n) as f64 / n as f64 - 0.5, 0.0)
    };
    let mut wall = Wall::confocal((0..1 << 16).map(|i| at(i, 256)).collect());
    if geometry == Geometry::Product {
        wall = Wall::confocal((0..1 << 14).map(|i| at(i, 128)).collect());
        wall.geometry = Geometry::Product;
        wall.others = (0..4).map(|i| at(i, 2)).collect();
    }
    Model {
        elements: wall.pairs() * 1024,
        wall,
        bins: 1024,
        bin_width: 0.003,
        t_start: 0.3,
        measured: vec![],
        ..Model::new(&loaded().capture, Reflectance::Cosine, 10.0, true)
    }
}

fn grid() -> Grid {
    let volume = Volume { min: glam::dvec3(-0.5, -0.5, 0.3), max: glam::dvec3(0.5, 0.5, 1.3) };
    Grid::new(volume, 128, 0.003).expect("a grid")
}

/// The plan of a surface on the pixels of that grid.
fn surface_plan(model: &Model, scan: [usize; 2]) -> Plan {
    let options: SurfaceOptions = small_surface(Accumulation::Auto);
    surface::plan(model, grid(), scan, &options, [0, 12], 0, &card()).expect("a plan")
}

/// Turns of a kernel's dispatches in a schedule: the most of one, all, and how many there are.
fn of(s: &Schedule, kernel: &str) -> [u64; 3] {
    let works: Vec<u64> = s.commands.iter().filter(|c| c.name() == kernel).map(Command::work).collect();
    [works.iter().copied().max().unwrap_or(0), works.iter().sum(), works.len() as u64]
}

#[test]
fn a_dense_start_of_a_large_scan_is_many_dispatches() {
    for geometry in [Geometry::Confocal, Geometry::Product] {
        let model = large(geometry);
        let options = super::small::paper(Accumulation::Auto).with(|o| {
            o.domain.coarse_to_fine = false;
            o.domain.reduce = false;
        });
        let plan = paper::plan(&model, grid(), [256, 256], &options, &card(), false).expect("a plan");
        let level = plan.finest();
        let all = (level.grid.storage() * model.pairs()) as u64;
        assert!(all > 200 * MOST, "{all}");
        let s = Schedule::of(|s| paper::iteration(s, &plan, level, 0, 1));
        for kernel in ["forward", "backward"] {
            let [most, sum, count] = of(&s, kernel);
            assert!(most <= MOST, "{geometry:?} {kernel}: {most} turns at once");
            assert!(sum >= all && sum < all + all / 8, "{geometry:?} {kernel}: {sum} of {all} turns");
            assert!(count > 200, "{geometry:?} {kernel}: {count}");
        }
        let plan = surface_plan(&model, [256, 256]);
        let count = surface::pixels(&plan);
        for s in [
            Schedule::of(|s| surface::start_of(s, &plan, plan.finest(), count, surface::points_of(&plan))),
            Schedule::of(|s| surface::iteration(s, &plan, plan.finest(), count, [0, 0, 12])),
        ] {
            let long = s.commands.iter().filter(|c| c.work() > MOST);
            assert_eq!(long.map(Command::name).collect::<Vec<_>>(), Vec::<&str>::new());
        }
    }
    // What fits stays whole.
    let mut model = large(Geometry::Confocal);
    model.wall.scanned.truncate(1024);
    model.elements = 1024 * model.bins;
    let plan = surface_plan(&model, [32, 32]);
    let s = Schedule::of(|s| surface::iteration(s, &plan, plan.finest(), surface::pixels(&plan), [0, 0, 12]));
    assert_eq!(["forward", "surface_gather"].map(|kernel| of(&s, kernel)[2]), [1, 1]);
}

/// A solve in parts of at most `work` turns; how many submissions it took.
fn solved(capture: &Capture, solver: &SolverOptions, work: Option<u64>) -> (Reconstruction, usize) {
    let gpu = Gpu::open(&GpuOptions { work, timings: true, ..GpuOptions::vulkan() }).expect("a device");
    let result = solve(&gpu, &solver.clone(), capture, None).expect("it solves");
    let ran = gpu.take_recording();
    let submissions: BTreeSet<u64> = ran.device.iter().map(|r| r.submission).collect();
    let iterations = ran.stages.iter().filter(|s| s.name == "iteration").count();
    let last = result.trace.last().expect("a point").iteration;
    assert_eq!(iterations, last, "a divided iteration is one stage");
    (result, submissions.len())
}

#[test]
fn a_divided_solve_gives_the_same() {
    for (name, capture) in kinds().into_iter().filter(|(name, _)| ["confocal", "exhaustive"].contains(name)) {
        for (solver, options) in solvers(Accumulation::Fixed) {
            // Rounding may change which round of the support is the best.
            let options = match options {
                SolverOptions::Surface(o) => o.with(|o| o.grow = false).into(),
                paper => paper,
            };
            let (whole, few) = solved(&capture, &options, None);
            let (parts, many) = solved(&capture, &options, Some(2_000));
            let of =
                |r: &Reconstruction| (r.plan.forward_sets(r.plan.finest()), r.trace.last().map(|p| p.loss));
            let ((one, loss), (several, divided)) = (of(&whole), of(&parts));
            assert!(
                one == 1 && (several > 1 || solver == "surface") && many > 2 * few,
                "{name} {solver}: {several}, {few} and {many}"
            );
            // Gathers add up in another order.
            let (loss, divided) = (loss.expect("a loss"), divided.expect("a loss"));
            assert!((divided / loss - 1.0).abs() < 3e-3, "{name} {solver}: {loss} and {divided}");
        }
    }
}

#[test]
fn a_device_that_hangs_is_an_error_and_not_the_end() {
    let (_, options) = &solvers(Accumulation::Owned)[1];
    for hang in [0, 1] {
        let faults = Faults { hang: Some(hang), ..Faults::default() };
        let gpu = Gpu::open(&GpuOptions { faults, ..GpuOptions::default() }).expect("a device");
        let error = solve(&gpu, options, &loaded().capture, None).expect_err("the device hangs");
        assert_eq!(error.kind, Kind::Device);
        assert!(error.what.contains("did not finish its work within 60"), "{error}");
        assert!(error.hint.to_string().contains("hangs"), "{error}");
    }
    let gpu = Gpu::open(&GpuOptions::default()).expect("another device");
    solve(&gpu, options, &loaded().capture, None).expect("it solves");
}

/// Nothing is asked of a device that is down. Whatever is tried, the error is that of the loss, and names what it was at.
#[test]
fn a_device_that_is_down_stays_down_and_says_where() {
    let (_, options) = &solvers(Accumulation::Owned)[1];
    let lost = |point, number| Faults { fail: Some((point, number)), ..Faults::default() };
    let hung = Faults { hang: Some(1), ..Faults::default() };
    let reported = Faults { fault_address: Some(0xbad0), ..lost(Point::Wait, 1) };
    for (faults, what) in [
        (lost(Point::Submission, 1), "was lost while submitting `"),
        (lost(Point::Wait, 1), "was lost while computing `"),
        (reported, "`; driver report: invalid read at 0xbad0"),
        (hung, "did not finish its work within 60"),
    ] {
        let gpu = Gpu::open(&GpuOptions { faults, ..GpuOptions::default() }).expect("a device");
        let first = solve(&gpu, options, &loaded().capture, None).expect_err("the device is down");
        assert!(first.kind == Kind::Device && first.what.contains(what), "{first}");
        let names = first.what.split('`').nth(1).expect("a pass");
        assert!(!names.is_empty(), "{first}");
        let reached = Point::ALL.map(|point| gpu.reached(point));
        let plan = [BufferPlan::new(Buffer::named("small"), 16, Place::Device)];
        let later =
            [solve(&gpu, options, &loaded().capture, None).err(), Arena::new(&gpu, &plan, None).err()];
        for error in later {
            assert_eq!(error.expect("it stays down").to_string(), first.to_string());
        }
        assert_eq!(Point::ALL.map(|point| gpu.reached(point)), reached, "no call reaches the driver");
    }
}
