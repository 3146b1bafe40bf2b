//! One solve on one device and on several that share its pairs: seconds of each, and what the exchanges take.
//!
//!     cargo bench --bench devices [-- 0,1 2,3]        the devices of each solve, by index or part of a name
//!                                                     [default: 0 0,0]
//!
//! On lavapipe, give every device one core: LP_NUM_THREADS=1 cargo bench --bench devices

use std::ops::ControlFlow;

use thirdbounce::gpu::{Gpu, GpuOptions};
use thirdbounce::job::{Request, SolverOptions};
use thirdbounce::simulate::{RenderOptions, Scene, simulate};
use thirdbounce::solve::{Problem, Reconstruction, VectorOptions, Watch};

const TURNS: usize = 2;

fn main() {
    let given: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let named = if given.is_empty() { vec!["0".into(), "0,0".into()] } else { given };
    let open = |names: &String| {
        let options = GpuOptions { device: Some(names.clone()), ..GpuOptions::default() };
        Gpu::open_all(&options).unwrap_or_else(|e| panic!("{e}"))
    };
    let devices: Vec<Vec<Gpu>> = named.iter().map(open).collect();
    let scene = Scene { scan: 48, bin_width: 0.012, ..Scene::named("figure").expect("a built-in scene") };
    let options = RenderOptions { noise: 0.05, ..RenderOptions::default() };
    let capture = simulate(&scene, &options).expect("it renders").capture;
    let options = VectorOptions::default().with(|o| {
        (o.lateral, o.iterations, o.surface.iterations) = (64, 30, 15);
        o.stop = false;
    });
    let solver: SolverOptions = options.into();
    let grid = Request::new(solver.clone(), "").grid(&capture).expect("a grid");
    let solve = |gpus: &[Gpu]| {
        let mut hear = |_: &_| ControlFlow::Continue(());
        let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
        solver.solve_on(gpus, &Problem::new(&capture, grid), &mut watch).expect("it solves")
    };
    let first = &devices[0][0].info;
    println!("{} ({}): {} pairs of {} bins", first.name, first.driver, capture.pair_count(), capture.bins);
    println!(
        "| devices | s | times as fast | iterations | exchanges | kB each | of the time, waiting included |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut all: Vec<Vec<Reconstruction>> = devices.iter().map(|_| vec![]).collect();
    for _ in 0..TURNS {
        all.iter_mut().zip(&devices).for_each(|(done, gpus)| done.push(solve(gpus)));
    }
    // Other programs only make a solve longer.
    let seconds =
        |done: &[Reconstruction]| done.iter().map(|r| r.solve_seconds).fold(f64::INFINITY, f64::min);
    for (name, done) in named.iter().zip(&all) {
        let (took, last) = (seconds(done), &done[TURNS - 1]);
        let exchanged = last.exchanged;
        println!(
            "| {name} | {took:.2} | {:.2} | {} | {} | {:.0} | {:.1} % |",
            seconds(&all[0]) / took,
            last.trace.last().map_or(0, |p| p.iteration),
            exchanged.times,
            1e-3 * exchanged.bytes as f64 / exchanged.times.max(1) as f64,
            100.0 * exchanged.seconds / last.solve_seconds
        );
    }
    for (name, done) in named.iter().zip(&all).skip(1) {
        let [a, b] = [&all[0][0].maps, &done[0].maps];
        let most = a.albedo.iter().fold(0.0f32, |m, v| m.max(*v));
        let albedo = a.albedo.iter().zip(&b.albedo).fold(0.0f32, |m, (a, b)| m.max((a - b).abs())) / most;
        let lit = a.depth.iter().zip(&b.depth).zip(&a.albedo).filter(|(_, albedo)| **albedo > 0.1 * most);
        let depth = lit.fold(0.0f32, |m, ((a, b), _)| m.max((a - b).abs()));
        println!(
            "{name} against {}: albedo differs by {albedo:.1e} of the largest at most, depths of lit pixels by {:.1e} mm",
            named[0],
            1e3 * depth
        );
    }
}
