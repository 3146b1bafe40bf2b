//! Dispatches of more workgroups than the work fills. Where there are many, they are rounded up to whole rows of
//! [`GROUPS_X`]: the groups beyond the work must write nothing, and change nothing.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use fixtures::device::*;
use thirdbounce::closed_form::hat;
use thirdbounce::closed_form::passes::{PROJECTED, gather_filtered};
use thirdbounce::engine::{Accumulation, OnDevice, Tuning};
use thirdbounce::gpu::{Buffer, Command, Gpu, Schedule, Size};
use thirdbounce::methods::{NoiseTerm, paper};
use thirdbounce::surface::{self, Judged, Placed};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::{Geometry, HighPass, Model, Reflectance};
use thirdbounce_verify::place;

/// More than 65,535 groups, in rows.
const WIDE: [u32; 3] = [GROUPS_X, 2, 1];

/// Sources of kernels whose groups are counted in rows.
fn in_rows() -> BTreeSet<PathBuf> {
    let glsl = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let all = std::fs::read_dir(glsl).expect("the kernels").map(|e| e.expect("an entry").path());
    let counts = |path: &PathBuf| {
        path.is_file() && std::fs::read_to_string(path).expect("a source").contains("group_index()")
    };
    all.filter(counts).collect()
}

/// The source of a module: its name, or what it begins with.
fn source_of(module: &str) -> PathBuf {
    let glsl = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let ends = module.match_indices('_').map(|(at, _)| at).chain([module.len()]);
    let mut paths = ends.map(|end| glsl.join(format!("{}.comp", &module[..end])));
    paths.rfind(|p| p.is_file()).expect("a source")
}

/// Runs schedules as they are, or with every kernel of [`in_rows`] at [`WIDE`], and collects the sources of those.
struct Runs {
    wide: bool,
    seen: BTreeSet<PathBuf>,
}

impl Runs {
    fn run(&mut self, job: &mut OnDevice, mut schedule: Schedule) {
        for command in &mut schedule.commands {
            let Command::Dispatch { kernel, size, .. } = command else { continue };
            let pass = job.plan.passes.iter().find(|p| p.kernel == *kernel).expect("a pass of the plan");
            let source = source_of((pass.code)(&job.plan).name);
            if self.wide && in_rows().contains(&source) {
                *size = Size::Groups(WIDE);
                self.seen.insert(source);
            }
        }
        job.perform(&schedule);
    }
}

/// The trace and the content of some buffers, as words.
fn left(job: &mut OnDevice, rows: usize, buffers: &[Buffer]) -> Vec<u32> {
    let mut all: Vec<u32> = job.executor.read(buffer::TRACE, ..rows * TRACE_ROW as usize);
    for buffer in buffers {
        let words = job.plan.bytes_of(*buffer) as usize / 4;
        all.extend(read::<u32>(job, *buffer, words));
    }
    all
}

fn of_pulse() -> Model {
    Model { pulse: Some(tail()), ..model(5, 48, 31) }
}

fn paper_solve(gpu: &Gpu, runs: &mut Runs) -> Vec<u32> {
    let (model, grid) = (of_pulse(), grid());
    let o = options(&model, &grid).with(|o| {
        o.accumulation = Accumulation::Fixed;
        o.domain.coarse_to_fine = true;
        o.domain.double_every = 2;
        o.domain.reduce_every = 1;
        // So that there is room for some voxels only.
        o.domain.room = Some(0.4);
        (o.noise.term, o.noise.base, o.noise.span) = (NoiseTerm::Bin, 0.02, 0.05);
    });
    let mut job = job(gpu, &model, &grid, &o);
    let mut level = 0;
    let start = Schedule::of(|s| paper::initialise(s, &job.plan, &job.plan.levels.volume[0]));
    runs.run(&mut job, start);
    for i in 0..3 {
        let mut s =
            Schedule::of(|s| paper::iteration(s, &job.plan, &job.plan.levels.volume[level], i, i + 1));
        paper::due(&mut s, &job.plan, &o, &mut level, i as usize + 1);
        runs.run(&mut job, s);
    }
    assert_eq!(level, 1, "doubling is among them");
    let maps = Schedule::of(|s| paper::extract(s, job.plan.finest()));
    runs.run(&mut job, maps);
    left(&mut job, 3, &[buffer::MASK, buffer::COLUMNS])
}

fn projection(gpu: &Gpu, runs: &mut Runs) -> Vec<u32> {
    let (model, grid) = (model(5, 110, 32), grid());
    let mut job = job(gpu, &model, &grid, Needs::Projection);
    write(&mut job, buffer::HAT_TAPS, &hat(2.0, model.bins));
    let s = Schedule::of(|s| gather_filtered(s, &job.plan, job.plan.finest(), 8));
    runs.run(&mut job, s);
    left(&mut job, 0, &[buffer::RESIDUAL, PROJECTED])
}

fn surface_solve(gpu: &Gpu, runs: &mut Runs) -> Vec<u32> {
    surface_of(gpu, runs, [0, 1])
}

/// Lanes share rows and pixels, as on a GPU.
fn surface_of_lanes(gpu: &Gpu, runs: &mut Runs) -> Vec<u32> {
    surface_of(gpu, runs, [32, 8])
}

fn surface_of(gpu: &Gpu, runs: &mut Runs, lanes: [u32; 2]) -> Vec<u32> {
    let grid = oblong();
    let field = field(&grid, 61);
    let model = variant(&model(5, 48, 9), Geometry::TwoPoints, Reflectance::Lambertian, true, 62);
    let model = Model {
        high_pass: Some(HighPass { length: 0.05, floor: 0.1 }),
        ..spotted(&model, spots_for(Geometry::TwoPoints))
    };
    let o = FitNeeds::of(&grid, 4).with(|o| o.accumulation = Accumulation::Fixed);
    let share = |t: &mut Tuning| [t.row_lanes, t.pixel_lanes] = lanes;
    let mut job = thirdbounce_verify::job(gpu, &model, &grid, &o, share).expect("the device runs it");
    let placed = Placed { pixels: field.len(), most: 60.0, explained: 2.0, left: 2.0 };
    let words = surface::weights(&model, job.plan.finest(), placed, &o.options, 12, 1.0);
    write(&mut job, buffer::SURFACE_WEIGHTS, &words);
    place(&mut job, &field).expect("uploads run");
    zero_histograms(&mut job);
    let mut s = Schedule::default();
    s.fill(buffer::COUNTS, job.plan.bytes_of(buffer::COUNTS), 0);
    surface::start_of(&mut s, &job.plan, job.plan.finest(), field.len(), 4);
    runs.run(&mut job, s);
    for i in 0..2 {
        let s =
            Schedule::of(|s| surface::iteration(s, &job.plan, job.plan.finest(), field.len(), [i, i, 12]));
        runs.run(&mut job, s);
    }
    write(&mut job, buffer::SURFACE_ENERGIES, &[1.0f32]);
    let judged = Judged { iterations: [0, 2], at: 2, flags: JUDGE_FIRST };
    let s = Schedule::of(|s| surface::check(s, &job.plan, job.plan.finest(), field.len(), judged));
    runs.run(&mut job, s);
    let maps = Schedule::of(|s| surface::extract(s, job.plan.finest(), [field.len(), 0], 0));
    runs.run(&mut job, maps);
    left(&mut job, 2, &[buffer::HEIGHTS])
}

#[test]
fn groups_beyond_the_work_write_nothing() {
    let mut seen = BTreeSet::new();
    for solve in [paper_solve, projection, surface_solve, surface_of_lanes] {
        let [plain, wide] = [false, true].map(|wide| {
            // Dropped at the end: no canary was touched.
            let gpu = gpu();
            let mut runs = Runs { wide, seen: BTreeSet::new() };
            let left = solve(&gpu, &mut runs);
            assert_valid(&gpu);
            seen.append(&mut runs.seen);
            left
        });
        assert!(plain == wide, "groups beyond the work change what is left");
    }
    let missed: Vec<_> = in_rows().difference(&seen).cloned().collect();
    assert!(missed.is_empty() && seen.len() > 20, "never run at that size: {missed:?}");
}

/// A device that gets little at once runs every direct dispatch in parts, to the same bits: no kernel counts on the
/// workgroups of a dispatch to begin at the first, or to be all that there are.
#[test]
fn passes_in_parts_leave_the_same() {
    let alone = alone();
    for solve in [paper_solve, projection, surface_solve, surface_of_lanes] {
        let [(whole, few), (parts, many)] = [u64::MAX, 60].map(|work| {
            let gpu = gpu_of(work, &alone);
            let mut runs = Runs { wide: false, seen: BTreeSet::new() };
            let left = solve(&gpu, &mut runs);
            assert_valid(&gpu);
            assert_eq!(gpu.take_guarded().overruns, []);
            (left, gpu.take_recording().device.len())
        });
        assert!(whole == parts, "a dispatch in parts leaves something else");
        assert!(many > few + 10, "{many} commands instead of {few}");
    }
}
