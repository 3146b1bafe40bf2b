//! The model of memory traffic on real solves: the orderings that the kernels' order of work was chosen by, and the table of
//! docs/gpu.md.

use fixtures::device::{gpu, unwatched, write};
use fixtures::traffic::{Histograms, WARP};
use glam::{DVec3, dvec3};
use std::ops::ControlFlow;
use std::path::Path;
use thirdbounce::capture::{Capture, read};
use thirdbounce::gpu::{Buffer, BufferPlan, Gpu, Place, Schedule};
use thirdbounce::job::Request;
use thirdbounce::maps::Maps;
use thirdbounce::simulate::{RenderOptions, Scene, simulate};
use thirdbounce::solve::surface::{Pixels, SMALL_PIXEL, SUPPORT, points_of};
use thirdbounce::solve::{Level, OnDevice, Plan, Problem, Progress, VectorOptions, vector};
use thirdbounce::transport::kernels::buffer;
use thirdbounce::transport::{Grid, Model};

/// Samples of a workgroup of the forward pass, and bins of a lane's column: those of a GPU.
const CHUNK: usize = 256;
const WINDOW: usize = 64;

/// Samples of a workgroup with histograms of its own.
const OWN_CHUNK: usize = 2048;

/// The mask of the active voxels, for the host.
const DOMAIN: Buffer = Buffer::named("domain_host");

/// The samples of a solve, in the order of their slots.
struct Solved {
    plan: Plan,
    model: Model,
    /// The active voxels at the end of each level of the volume.
    levels: Vec<(Level, Vec<DVec3>)>,
    maps: Maps,
}

fn solved(capture: &Capture, options: VectorOptions) -> Solved {
    let gpu = gpu();
    let grid = Request::new(options.clone(), "").grid(capture).expect("a grid");
    let model = vector::model(capture, &grid, &options);
    let plan =
        Plan::new(&model, grid, capture.resolution(), &options, &gpu.abilities(), false).expect("a plan");
    let mut hear = |_: &Progress| ControlFlow::Continue(());
    let problem = Problem::new(capture, grid);
    let done = vector::reconstruct(&gpu, &problem, &options, &mut unwatched(&mut hear)).expect("a solve");
    let levels = domains(&gpu, &model, &plan, &options);
    Solved { levels, plan, model, maps: done.maps }
}

/// The active voxels at the end of each level of the volume.
fn domains(gpu: &Gpu, model: &Model, plan: &Plan, options: &VectorOptions) -> Vec<(Level, Vec<DVec3>)> {
    let (mut plan, bytes) = (plan.clone(), plan.bytes_of(buffer::MASK));
    plan.buffers.push(BufferPlan::new(DOMAIN, bytes, Place::Readback));
    let mut job = OnDevice::new(gpu, model.clone(), plan, None).expect("memory for a small scene");
    let (plan, first) = (job.plan.clone(), job.plan.levels.volume[0]);
    let hat = vector::hat(vector::HAT_SIGMA * first.grid.pitch.x / first.bin_width, first.bins);
    write(&mut job, buffer::HAT_TAPS, &hat);
    let mut run = |s: &Schedule| job.executor.run(s).map(|()| job.executor.read::<u32>(DOMAIN, ..));
    run(&Schedule::of(|s| vector::start(s, &plan, &first, options))).expect("the start runs");
    let (mut level, mut all) = (0, vec![]);
    for i in 0..options.iterations {
        let here = plan.levels.volume[level];
        let (mut s, mut change, before) = (Schedule::default(), Schedule::default(), level);
        vector::iteration(&mut s, &plan, &here, i as u32);
        s.copy(buffer::MASK, DOMAIN, bytes);
        let words = run(&s).expect("an iteration runs");
        vector::due(&mut change, &plan, options, &mut level, i + 1);
        if level > before || i + 1 == options.iterations {
            let grid: &Grid = &here.grid;
            let active = |i: &usize| words[i / 32] >> (i % 32) & 1 == 1;
            let at = |i: usize| grid.position(DVec3::from_array(grid.voxel(i).map(|c| c as f64)));
            all.push((here, (0..grid.storage()).filter(active).map(at).collect()));
        }
        run(&change).expect("a change of the domain runs");
    }
    all
}

impl Solved {
    /// The level of the surface, and its points as `surface_points.comp` writes them for these columns of the maps.
    fn surface(&self, columns: &[u32]) -> (Level, Vec<DVec3>) {
        let level = self.plan.levels.pixels.expect("a surface");
        let points = |c: &u32| {
            let c = *c as usize;
            let [x, y] = self.maps.centre(c / self.maps.ny, c % self.maps.ny);
            let centre = dvec3(x, y, f64::from(self.maps.depth[c]));
            let normal = self.maps.normal[c].map(f64::from);
            let slope = [0, 1].map(|axis| -normal[axis] / normal[2]);
            let quarter = level.grid.pitch * 0.25;
            (0..points_of(&self.plan)).map(move |k| {
                if points_of(&self.plan) == 1 {
                    return centre;
                }
                let [dx, dy] =
                    [quarter.x * (k / 2 * 2) as f64 - quarter.x, quarter.y * (k % 2 * 2) as f64 - quarter.y];
                centre + dvec3(dx, dy, slope[0] * dx + slope[1] * dy)
            })
        };
        (level, columns.iter().flat_map(points).collect())
    }

    /// The columns of the surface's pixels in the order of the device, and in that of the maps.
    fn columns(&self) -> [Vec<u32>; 2] {
        let ordered = Pixels::of(std::slice::from_ref(&self.maps), SUPPORT, usize::MAX).columns;
        let mut by_rows = ordered.clone();
        by_rows.sort_unstable();
        [ordered, by_rows]
    }

    /// A row of the table for each list of samples.
    fn print(&self, name: &str) {
        let [ordered, by_rows] = self.columns();
        let mut lists: Vec<_> =
            self.levels.iter().map(|(l, s)| (format!("voxels of {} mm", width(l)), *l, s.clone())).collect();
        for (text, columns) in [("pixels by rows", by_rows), ("pixels as they are", ordered)] {
            let (level, samples) = self.surface(&columns);
            lists.push((
                format!("{text}, {} points of {} mm", points_of(&self.plan), width(&level)),
                level,
                samples,
            ));
        }
        for (text, level, samples) in lists {
            let h = Histograms::of(&self.model, &level);
            let (columns, own) = (h.columns(&samples, CHUNK, WINDOW), h.own(&samples, OWN_CHUNK));
            // As `Plan::forward_direct` on a GPU.
            let direct = 16.0 * level.grid.pitch.length() / level.bin_width > 4.0 * WINDOW as f64;
            println!(
                "| {name}, {text}{} | {} | {:.1} % | {:.1} % | {:.0} | {:.2} | {:.1} | {:.3} | {:.4} | {:.1} | {:.1} |",
                if direct { " (*)" } else { "" },
                samples.len(),
                100.0 * columns.outside,
                100.0 * columns.flush,
                columns.slots(WINDOW),
                columns.global,
                own.turns,
                own.global,
                own.sectors,
                h.gather(&samples, WARP),
                h.gather(&samples, WARP / 4),
            );
        }
    }
}

fn width(level: &Level) -> String {
    format!("{:.1}", 1e3 * level.grid.pitch.x)
}

fn simulated(name: &str, scan: usize, bin_width: f64) -> Capture {
    let scene = Scene { scan, bin_width, ..Scene::named(name).expect("a scene") };
    simulate(&scene, &RenderOptions { noise: 0.05, ..Default::default() }).expect("a capture").capture
}

fn options(lateral: usize, iterations: usize) -> VectorOptions {
    VectorOptions::default().with(|o| {
        o.lateral = lateral;
        o.iterations = iterations;
        o.surface.iterations = 4;
        o.stop = false;
    })
}

/// What the orders of lists and the sizes of chunks were chosen by (docs/gpu.md), on a small solve.
#[test]
fn lists_keep_neighbours_together() {
    let solved = solved(&simulated("figure", 16, 0.01), options(64, 20));
    let (level, voxels) = solved.levels.last().expect("a level");
    let mut by_rows = voxels.clone();
    by_rows.sort_by(|a, b| [a.x, a.y, a.z].partial_cmp(&[b.x, b.y, b.z]).expect("numbers"));
    let [ordered, maps] = solved.columns().map(|columns| solved.surface(&columns));
    assert!(voxels.len() > 2000 && ordered.1.len() > 500, "{} and {}", voxels.len(), ordered.1.len());
    assert!(ordered.1 != maps.1, "the surface's pixels are not in the order of the maps");
    for (what, level, samples, others) in
        [("voxels", level, voxels, &by_rows), ("pixels", &ordered.0, &ordered.1, &maps.1)]
    {
        let h = Histograms::of(&solved.model, level);
        let [columns, rows] = [samples, others].map(|s| h.columns(s, CHUNK, WINDOW));
        assert!(columns.flush < 0.5 * rows.flush, "{what}: {columns:?} by rows {rows:?}");
        // Columns of half the width, as products have, are still far from the two additions of a pair without columns.
        let half = h.columns(samples, CHUNK, WINDOW / 2);
        assert!(half.global < 0.7 && half.slots(WINDOW / 2) < 100.0, "{what}: {half:?}");
        assert!(columns.outside < 0.5 * rows.outside && columns.global < rows.global, "{what}");
        let [gather, rows] = [samples, others].map(|s| h.gather(s, WARP));
        assert!(gather < rows, "{what}: {gather} sectors of a gather, {rows} by rows");
        // Slices within a warp read more sectors at once.
        assert!(h.gather(samples, WARP / 4) > gather, "{what}");
        // Lanes that own pairs share no sector; histograms of a workgroup go to memory once.
        let own = h.own(samples, OWN_CHUNK);
        assert!(
            h.direct(samples) > 0.9 * WARP as f64 && own.global < 0.5 * columns.global,
            "{what}: {own:?}"
        );
        assert!(own.turns > 1.0 && own.sectors < 0.25 * own.global, "{what}: {own:?}");
    }
}

/// `cargo test --test kernels -- --ignored --nocapture traffic`
#[test]
#[ignore = "prints the table of docs/gpu.md"]
fn traffic_of_real_solves() {
    println!(
        "| scene, samples | samples | outside | flush | slots | global adds | own: turns | own: global adds | own: sectors | gather, 32 x 1 | gather, 8 x 4 |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let mut captures = vec![("figure, 32 x 32".to_string(), simulated("figure", 32, 0.01))];
    captures.push(("torus, 32 x 32, 3 mm bins".into(), simulated("torus", 32, 0.003)));
    for name in ["z_confocal_32", "spheres_confocal_32", "statue_confocal_64", "su_confocal_64"] {
        let file =
            std::env::var_os("THIRDBOUNCE_DATA").map(|data| Path::new(&data).join(format!("{name}.npz")));
        let Some(file) = file.filter(|f| f.exists()) else { continue };
        captures.push((name.into(), read(&file).expect("a capture")));
    }
    for (name, capture) in captures {
        let [x0, x1, ..] = capture.wall_extent();
        // As wide as the program makes them.
        let bins = ((x1 - x0) / 128.0 / (SMALL_PIXEL * capture.bin_width)).ceil() as usize;
        let capture = capture.binned(bins.max(1)).expect("wider bins");
        solved(&capture, options(128, 60)).print(&name);
    }
}
