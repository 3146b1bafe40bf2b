//! The model of memory traffic on real solves (docs/gpu.md): the orderings that the kernels' order of work was chosen by, and a
//! table.

use std::ops::ControlFlow;
use std::path::Path;

use fixtures::device::{gpu, unwatched};
use fixtures::traffic::{Histograms, WARP};
use glam::{DVec3, dvec3};
use thirdbounce::capture::{Capture, read};
use thirdbounce::maps::Maps;
use thirdbounce::simulate::{RenderOptions, Scene, simulate};
use thirdbounce::solve::Discretisation;
use thirdbounce::solve::surface::{Pixels, SMALL_PIXEL, points_of};
use thirdbounce::solve::{Plan, Problem, Progress, SolverOptions, SurfaceOptions};
use thirdbounce::transport::{Binning, Grid, Model, Reflectance};

/// Samples of a workgroup of the forward pass, and bins of a lane's column: those of a GPU.
const CHUNK: usize = 256;
const WINDOW: usize = 64;

/// Samples of a workgroup with histograms of its own.
const OWN_CHUNK: usize = 2048;

/// The surface of a solve.
struct Solved {
    plan: Plan,
    /// The pairs in the order that fits have.
    model: Model,
    grid: Grid,
    maps: Maps,
}

fn solved(capture: &Capture, options: SurfaceOptions) -> Solved {
    let gpu = gpu();
    let options = SolverOptions::from(options);
    let grid = Discretisation::default().grid(&options, capture).expect("a grid");
    let (model, _) = Model::outline(capture, Reflectance::Cosine, 10.0, false);
    let mut model = Model { binning: Binning::Linear, ..model };
    model.spread();
    let problem = Problem::new(capture, grid);
    let plan = options.plan(&problem, &gpu.abilities()).expect("a plan");
    let mut hear = |_: &Progress| ControlFlow::Continue(());
    let done = options.solve(&gpu, &problem, &mut unwatched(&mut hear)).expect("a solve");
    Solved { plan, model, grid, maps: done.maps }
}

impl Solved {
    /// The voxels within a pixel's width of the surface, in the order of their storage.
    fn voxels(&self) -> Vec<DVec3> {
        let grid = &self.grid;
        let at = |c: [usize; 3]| grid.position(DVec3::from_array(c.map(|c| c as f64)));
        let near = |c: &[usize; 3]| {
            grid.contains(*c) && {
                let depth = f64::from(self.maps.depth[c[0] * grid.n[1] + c[1]]);
                (at(*c).z - depth).abs() <= grid.pitch.x
            }
        };
        (0..grid.storage()).map(|i| grid.voxel(i)).filter(near).map(at).collect()
    }

    /// The points of the surface as `surface_points.comp` writes them for these columns of the maps.
    fn surface(&self, columns: &[u32]) -> Vec<DVec3> {
        let points = |c: &u32| {
            let c = *c as usize;
            let [x, y] = self.maps.centre(c / self.maps.ny, c % self.maps.ny);
            let centre = dvec3(x, y, f64::from(self.maps.depth[c]));
            let normal = self.maps.normal[c].map(f64::from);
            let slope = [0, 1].map(|axis| -normal[axis] / normal[2]);
            let quarter = self.grid.pitch * 0.25;
            (0..points_of(&self.plan)).map(move |k| {
                if points_of(&self.plan) == 1 {
                    return centre;
                }
                let [dx, dy] =
                    [quarter.x * (k / 2 * 2) as f64 - quarter.x, quarter.y * (k % 2 * 2) as f64 - quarter.y];
                centre + dvec3(dx, dy, slope[0] * dx + slope[1] * dy)
            })
        };
        columns.iter().flat_map(points).collect()
    }

    /// The columns of the surface's pixels in the order of the device, and in that of the maps.
    fn columns(&self) -> [Vec<u32>; 2] {
        let ordered = Pixels::of(std::slice::from_ref(&self.maps), usize::MAX).columns;
        let mut by_rows = ordered.clone();
        by_rows.sort_unstable();
        [ordered, by_rows]
    }

    /// A row of the table for each list of samples.
    fn print(&self, name: &str) {
        let [ordered, by_rows] = self.columns();
        let width = 1e3 * self.grid.pitch.x;
        let points = points_of(&self.plan);
        let lists = [
            (format!("voxels of {width:.1} mm"), self.voxels()),
            (format!("pixels by rows, {points} points of {width:.1} mm"), self.surface(&by_rows)),
            (format!("pixels as they are, {points} points of {width:.1} mm"), self.surface(&ordered)),
        ];
        let h = Histograms::of(&self.model);
        for (text, samples) in lists {
            let (columns, own) = (h.columns(&samples, CHUNK, WINDOW), h.own(&samples, OWN_CHUNK));
            // As `Plan::forward_direct` on a GPU.
            let direct = 16.0 * self.grid.pitch.length() / self.model.bin_width > 4.0 * WINDOW as f64;
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

fn simulated(name: &str, scan: usize, bin_width: f64) -> Capture {
    let scene = Scene { scan, bin_width, ..Scene::named(name).expect("a scene") };
    simulate(&scene, &RenderOptions { noise: 0.05, ..Default::default() }).expect("a capture").capture
}

fn options(lateral: usize, iterations: usize) -> SurfaceOptions {
    SurfaceOptions::default().with(|o| {
        o.lateral = lateral;
        o.iterations = iterations;
    })
}

/// What the orders of lists and the sizes of chunks were chosen by (docs/gpu.md), on a small solve.
#[test]
fn lists_keep_neighbours_together() {
    let solved = solved(&simulated("figure", 16, 0.01), options(128, 4).with(|o| o.grow = false));
    let voxels = solved.voxels();
    let mut by_rows = voxels.clone();
    by_rows.sort_by(|a, b| [a.x, a.y, a.z].partial_cmp(&[b.x, b.y, b.z]).expect("numbers"));
    let [ordered, maps] = solved.columns().map(|columns| solved.surface(&columns));
    assert!(voxels.len() > 2000 && ordered.len() > 500, "{} and {}", voxels.len(), ordered.len());
    assert!(ordered != maps, "the surface's pixels are not in the order of the maps");
    let h = Histograms::of(&solved.model);
    for (what, samples, others) in [("voxels", &voxels, &by_rows), ("pixels", &ordered, &maps)] {
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
#[ignore = "prints a table"]
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
