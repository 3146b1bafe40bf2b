//! The savings of what plans leave out: for each part that a scene may not need, the same iterations with and without
//! it, in turns. Prints the table of docs/leave-out.md.
//!
//!     cargo bench --bench leave_out

mod scene;

use std::time::Instant;

use glam::DVec3;
use scene::{capture, gpu, median};
use thirdbounce::capture::{Capture, Gate, Pulse};
use thirdbounce::gpu::{Gpu, Schedule};
use thirdbounce::solve::{
    Needs, NoiseTerm, OnDevice, PaperOptions, Plan, Preset, VectorOptions, compact, paper, vector,
};
use thirdbounce::transport::kernels::buffer;
use thirdbounce::transport::{Grid, Model, Reflectance, Sampling};

/// Runs of each side, and iterations of a run.
const RUNS: usize = 7;
const COUNT: u32 = 4;

/// One side of a comparison: a job, and its iteration.
struct Side {
    job: OnDevice,
    each: Schedule,
}

fn main() {
    let gpu = gpu(false);
    println!("{} ({}), medians of {RUNS} runs in turns\n", gpu.info.name, gpu.info.driver);
    println!("| left out | scene | time of an iteration, without / with | memory, without / with |");
    println!("|---|---|---|---|");
    let grid = scene::grid(65_536);
    let confocal = capture(16);
    let one_laser = spread(&confocal, |_, n| n == 0);
    let exhaustive = spread(&capture(4), |_, _| true);
    let vector = |capture: &Capture, reflectance, general| {
        let options = VectorOptions::default().with(|o| {
            o.reflectance = reflectance;
            o.general = general;
        });
        vector_side(&gpu, capture, grid, options, |_| ())
    };

    use Reflectance::{Cosine, Isotropic, Lambertian};
    compare(
        "second distance, wall's normals, a pulse, unreached bins and bricks (`--general` has them)",
        "confocal, 256 pairs",
        vector(&confocal, Cosine, false),
        vector(&confocal, Cosine, true),
    );
    compare(
        "distances per pair: one per point",
        "one laser point, 256 sensor points",
        vector(&one_laser, Cosine, false),
        vector(&one_laser, Cosine, true),
    );
    compare(
        "distances per pair: one per point",
        "16 laser x 16 sensor points",
        vector(&exhaustive, Cosine, false),
        vector(&exhaustive, Cosine, true),
    );
    compare(
        "wall's normals",
        "confocal, Lambertian, flat",
        vector(&confocal, Lambertian, false),
        vector(&tilted(&confocal), Lambertian, false),
    );
    let asking =
        vector_side(&gpu, &confocal, grid, VectorOptions::default(), |plan| plan.levels.touching = true);
    compare("voxels on wall points", "confocal, 256 pairs", vector(&confocal, Cosine, false), asking);
    compare(
        "surfaces' normals (another model)",
        "confocal, isotropic for cosine",
        vector(&confocal, Isotropic, false),
        vector(&confocal, Cosine, false),
    );
    compare(
        "both second cosines (another model)",
        "confocal, cosine for Lambertian",
        vector(&confocal, Cosine, false),
        vector(&confocal, Lambertian, false),
    );
    let mut pulsed = confocal.clone();
    pulsed.pulse = Some(Pulse::gaussian(4.0 * confocal.bin_width).expect("a width"));
    compare(
        "the instrument's pulse",
        "confocal, a Gaussian of four bins",
        vector(&confocal, Cosine, false),
        vector(&pulsed, Cosine, false),
    );
    let paper = PaperOptions::preset(Preset::Synthetic).with(|o| o.iterations = 64);
    compare(
        "noise term",
        "confocal, paper's solver",
        paper_side(&gpu, &confocal, grid, &paper),
        paper_side(&gpu, &confocal, grid, &paper.clone().with(|o| o.noise.term = NoiseTerm::Bin)),
    );
    compare(
        "random sampling",
        "confocal, paper's solver",
        paper_side(&gpu, &confocal, grid, &paper.clone().with(|o| o.sampling = Sampling::Fixed)),
        paper_side(&gpu, &confocal, grid, &paper),
    );
    // Bins from 1.8 m see only voxels deeper than about 0.55 m, far off the axis.
    let gated = confocal.gated(Gate { from: 1.8, to: f64::INFINITY }).expect("a gate inside");
    compare(
        "unreached bricks and bins",
        "confocal, paper's solver, gate from 1.8 m",
        paper_side(&gpu, &gated, grid, &paper),
        paper_side(&gpu, &gated, grid, &paper.clone().with(|o| o.general = true)),
    );
    compare(
        "bins outside the gate",
        "confocal, paper's solver, gate from 1.8 m",
        paper_side(&gpu, &gated, grid, &paper),
        paper_side(&gpu, &confocal, grid, &paper),
    );
    let half = confocal.subset(128, 1).expect("half of the pairs");
    compare(
        "pairs without signal",
        "confocal, half of the pairs dead",
        vector(&half, Cosine, false),
        vector(&confocal, Cosine, false),
    );
}

/// A capture whose pairs are every point with those of the other points that `kept` keeps.
fn spread(base: &Capture, kept: impl Fn(usize, usize) -> bool) -> Capture {
    let points = &base.sensor;
    let combine = |other: usize| (0..points.len()).map(move |p| (other, p));
    let pairs: Vec<(usize, usize)> =
        (0..points.len()).filter(|o| kept(points.len(), *o)).flat_map(combine).collect();
    let bins = base.bins;
    let shift = DVec3::new(0.001, 0.002, 0.0);
    let mut made = base.clone();
    made.scan = [pairs.len() / points.len(), points.len()];
    made.laser = pairs.iter().map(|p| points[p.0] + shift).collect();
    made.sensor = pairs.iter().map(|p| points[p.1]).collect();
    let histogram = |p: &(usize, usize)| &base.histograms[p.1 * bins..(p.1 + 1) * bins];
    made.histograms = pairs.iter().flat_map(histogram).copied().collect();
    made
}

/// The same capture with normals that are not (0, 0, 1).
fn tilted(base: &Capture) -> Capture {
    let normals = vec![DVec3::new(0.1, 0.0, 1.0).normalize(); base.laser.len()];
    let mut made = base.clone();
    (made.laser_normal, made.sensor_normal) = (Some(normals.clone()), Some(normals));
    made
}

fn vector_side(
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    options: VectorOptions,
    change: impl FnOnce(&mut Plan),
) -> Side {
    let model = vector::model(capture, &grid, &options);
    let mut plan = plan(&model, grid, &options, gpu);
    change(&mut plan);
    let mut job = OnDevice::new(gpu, model, plan, None).expect("memory");
    // Every voxel is active: the back-projection keeps all values above zero.
    let mut start = Schedule::of(|s| {
        vector::start(s, &job.plan, job.plan.finest(), &options.with(|o| o.domain.start_above = 0.0))
    });
    everything(&job, &mut start);
    job.executor.run(&start).expect("the start runs");
    let each = Schedule::of(|s| vector::iteration(s, &job.plan, job.plan.finest(), 0));
    Side { job, each }
}

fn paper_side(gpu: &Gpu, capture: &Capture, grid: Grid, options: &PaperOptions) -> Side {
    let model = paper::model(capture, &grid, options);
    let plan = plan(&model, grid, options, gpu);
    let mut job = OnDevice::new(gpu, model, plan, None).expect("memory");
    let start = Schedule::of(|s| paper::initialise(s, &job.plan, job.plan.finest()));
    job.executor.run(&start).expect("the start runs");
    let each = Schedule::of(|s| paper::iteration(s, &job.plan, job.plan.finest(), 0, 1));
    Side { job, each }
}

fn plan(model: &Model, grid: Grid, options: &dyn Needs, gpu: &Gpu) -> Plan {
    // The scan is as fine as the grid: one level.
    Plan::new(model, grid, [grid.n[0]; 2], options, &gpu.abilities(), false).expect("a plan")
}

/// Activates all voxels of the storage, so both sides of a comparison walk the same list.
fn everything(job: &OnDevice, start: &mut Schedule) {
    start.fill(buffer::MASK, job.plan.bytes_of(buffer::MASK), u32::MAX);
    compact(start, &job.plan, job.plan.finest());
    start
        .indirect(&vector::passes::POINTS, buffer::ARGUMENTS, 0, 1)
        .bind(buffer::SCENE, job.plan.finest().scene);
}

fn compare(what: &str, of: &str, mut without: Side, mut with: Side) {
    let mut seconds = [vec![], vec![]];
    for run in 0..=RUNS {
        for (k, side) in [&mut without, &mut with].into_iter().enumerate() {
            let start = Instant::now();
            for _ in 0..COUNT {
                side.job.executor.run(&side.each).expect("an iteration runs");
            }
            // The first run warms up.
            if run > 0 {
                seconds[k].push(start.elapsed().as_secs_f64() / f64::from(COUNT));
            }
        }
    }
    let ratio = median(seconds[0].iter().zip(&seconds[1]).map(|(a, b)| a / b).collect());
    let bytes = [&without, &with].map(|s| s.job.plan.buffers.iter().map(|b| b.bytes).sum::<u64>() as f64);
    let [a, b] = seconds.map(|s| 1e3 * median(s));
    let mib = bytes.map(|b| b / f64::from(1 << 20));
    println!(
        "| {what} | {of} | {ratio:.2} ({a:.1} / {b:.1} ms) | {:.2} ({:.1} / {:.1} MiB) |",
        bytes[0] / bytes[1],
        mib[0],
        mib[1]
    );
}
