//! The cost of an iteration without pairs (an empty list of active voxels), kernel by kernel; and the cost of time
//! stamps after every command, by runs with and without them in turns.
//!
//!     cargo bench --bench iteration

mod scene;

use std::ops::ControlFlow;
use std::time::Instant;

use scene::{capture, gpu, median};
use thirdbounce::gpu::{DeviceKind, Gpu, Schedule};
use thirdbounce::solve::{
    Accumulation, OnDevice, PaperOptions, Plan, Preset, Problem, VectorOptions, Watch, compact,
    default_volume, paper, vector,
};
use thirdbounce::transport::Grid;
use thirdbounce::transport::kernels::buffer;

fn main() {
    empty();
    stamps();
}

/// Iterations of both solvers without active voxels.
fn empty() {
    // Time stamps separate the kernels, but on a CPU each one flushes the queue. The cost is measured without them.
    for stamped in [false, true] {
        let gpu = gpu(stamped);
        println!(
            "\n{} ({}), {} time stamps",
            gpu.info.name,
            gpu.info.driver,
            if stamped { "with" } else { "no" }
        );
        empty_on(&gpu);
    }
}

fn empty_on(gpu: &Gpu) {
    for side in [8, 32] {
        let capture = capture(side);
        let grid = scene::grid(20_480);
        let paper = PaperOptions::preset(Preset::Synthetic).with(|o| o.iterations = 64);
        let model = paper::model(&capture, &grid, &paper);
        let plan = Plan::new(&model, grid, [32; 2], &paper, &gpu.abilities(), false).expect("a plan");
        let job = OnDevice::new(gpu, model, plan, None).expect("memory");
        let start = Schedule::of(|s| paper::initialise(s, &job.plan, job.plan.finest()));
        report("paper", job, start, &|s, plan, i| paper::iteration(s, plan, plan.finest(), i, 1));
        let options = VectorOptions::default().with(|o| o.iterations = 64);
        let model = vector::model(&capture, &grid, &options);
        let plan = Plan::new(&model, grid, [32; 2], &options, &gpu.abilities(), false).expect("a plan");
        let job = OnDevice::new(gpu, model, plan, None).expect("memory");
        let start = Schedule::of(|s| vector::start(s, &job.plan, job.plan.finest(), &options));
        report("vector", job, start, &|s, plan, i| vector::iteration(s, plan, plan.finest(), i));
    }
}

fn report(solver: &str, mut job: OnDevice, mut start: Schedule, one: &dyn Fn(&mut Schedule, &Plan, u32)) {
    const COUNT: u32 = 32;
    let level = *job.plan.finest();
    start.fill(buffer::MASK, job.plan.bytes_of(buffer::MASK), 0);
    compact(&mut start, &job.plan, &level);
    one(&mut start, &job.plan, 0);
    job.executor.run(&start).expect("the start runs");
    let mut all = Schedule::default();
    (0..COUNT).for_each(|i| one(&mut all, &job.plan, i));
    let mut runs = vec![];
    let before = job.executor.times().clone();
    const RUNS: usize = 9;
    for _ in 0..RUNS {
        let begin = Instant::now();
        job.executor.run(&all).expect("iterations run");
        runs.push(begin.elapsed().as_secs_f64());
    }
    println!(
        "{solver}, {} pairs x {} bins, nothing active: {:.0} us an iteration",
        job.plan.scene.pairs,
        job.plan.scene.bins,
        1e6 * median(runs) / f64::from(COUNT)
    );
    for (name, time) in job.executor.times() {
        let old = before.get(name).copied().unwrap_or_default();
        let (calls, seconds) = (time.calls - old.calls, time.seconds - old.seconds);
        if calls > 0 {
            let each = 1e6 * seconds / (RUNS as f64 * f64::from(COUNT));
            println!(
                "  {name:<14}{:>5.1} dispatches {each:>9.1} us",
                calls as f64 / (RUNS as f64 * f64::from(COUNT))
            );
        }
    }
}

/// The same solve on a device that stamps every command and on one that does not, in turns.
fn stamps() {
    let devices = [gpu(false), gpu(true)];
    let capture = capture(32);
    let volume = default_volume(&capture, 0.5).expect("it has a signal");
    let grid = Grid::new(volume, 32, 0.04).expect("a plain grid");
    let options = VectorOptions::default().with(|o| {
        o.lateral = 32;
        o.iterations = 8;
        o.stop = false;
    });
    let options = options.with(|o| {
        o.accumulation = Accumulation::Auto;
        o.domain.min_depth = 0.5;
    });
    let mut seconds: [Vec<f64>; 2] = [vec![], vec![]];
    for run in 0..18 {
        // The order alternates, so a drift of the machine affects both.
        for k in [run % 2, 1 - run % 2] {
            let done = solve(&devices[k], &capture, grid, &options);
            if run > 1 {
                seconds[k].push(done);
            }
        }
    }
    let mut ratios: Vec<f64> =
        seconds[1].iter().zip(&seconds[0]).map(|(with, without)| with / without).collect();
    ratios.sort_by(f64::total_cmp);
    let percent = |at: f64| 100.0 * (ratios[(at * (ratios.len() - 1) as f64).round() as usize] - 1.0);
    let sum = |k: usize| seconds[k].iter().sum::<f64>();
    println!(
        "\ntime stamps: device seconds with over without, {} pairs of runs: median {:+.2} %, quartiles {:+.2} and \
         {:+.2} %; of the sums {:+.2} %",
        ratios.len(),
        percent(0.5),
        percent(0.25),
        percent(0.75),
        100.0 * (sum(1) / sum(0) - 1.0)
    );
}

/// Device seconds of a solve. A CPU device shares the processor with other programs, whose work must not count: there
/// it is this program's CPU time.
fn solve(gpu: &Gpu, capture: &thirdbounce::capture::Capture, grid: Grid, options: &VectorOptions) -> f64 {
    let mut hear = |_: &_| ControlFlow::Continue(());
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    let before = processor_seconds();
    let done =
        vector::reconstruct(gpu, &Problem::new(capture, grid), options, &mut watch).expect("it solves");
    match (before, processor_seconds()) {
        (Some(before), Some(after)) if gpu.info.kind == DeviceKind::Cpu => after - before,
        _ => done.trace.last().map_or(0.0, |p| p.gpu_seconds),
    }
}

/// CPU seconds of this program over all processors, if the system provides them (Linux: in hundredths).
fn processor_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name in brackets may contain spaces. Of the fields behind it, the 12th and 13th are user and system ticks.
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
    let ticks = |i: usize| fields.get(i)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / 100.0)
}
