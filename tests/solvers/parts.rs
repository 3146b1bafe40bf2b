//! Pairs in parts: where the histograms of all pairs do not fit into the memory that is allowed, passes over pairs take them
//! part by part, and solves end with the same result to rounding.

use fixtures::device::unwatched;
use fixtures::keeping::solve_keeping;
use thirdbounce::capture::{Capture, Pulse};
use thirdbounce::gpu::{Faults, Gpu, GpuOptions};
use thirdbounce::job::{Request, SolverOptions};
use thirdbounce::simulate::{Layout, RenderOptions, Scene, WallShape, simulate};
use thirdbounce::solve::{Accumulation, NoiseTerm, PaperOptions, Preset, Reconstruction, VectorOptions};
use thirdbounce::transport::Reflectance;

fn render(scene: &Scene) -> Capture {
    simulate(scene, &RenderOptions { noise: 0.1, ..RenderOptions::default() }).expect("a rendering").capture
}

fn scene(scan: usize) -> Scene {
    Scene { scan, bin_width: 0.01, ..Scene::named("letter-Z").expect("a built-in scene") }
}

/// Captures of every kind of pairs whose histograms take most of the memory.
fn kinds() -> Vec<(&'static str, Capture)> {
    let point = glam::dvec2(0.1, -0.1);
    let of = |layout| render(&Scene { layout, ..scene(24) });
    let bump = Scene { wall_shape: WallShape::Bump, reflectance: Reflectance::Lambertian, ..scene(24) };
    let mut pulse = of(Layout::Confocal);
    pulse.pulse = Some(Pulse::gaussian(0.03).expect("a pulse"));
    vec![
        ("confocal", of(Layout::Confocal)),
        ("one laser point", of(Layout::OneLaser { point })),
        ("exhaustive", render(&Scene { scan: 12, layout: Layout::Exhaustive { lasers: 3 }, ..scene(12) })),
        ("irregular, a curved wall", render(&Scene { layout: Layout::Irregular { seed: 4 }, ..bump })),
        ("a pulse", pulse),
    ]
}

fn paper(term: NoiseTerm) -> SolverOptions {
    let options = PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.lateral = 12;
        o.iterations = 12;
        o.domain.double_every = 5;
        o.restart_every = 3;
        o.domain.reduce_every = 4;
        o.noise.term = term;
        o.accumulation = Accumulation::Auto;
    });
    options.into()
}

fn vector() -> SolverOptions {
    let options = VectorOptions::default().with(|o| {
        o.lateral = 12;
        o.iterations = 12;
        o.domain.coarse_iterations = 5;
        o.domain.reduce_every = 3;
        o.bound_every = 6;
        o.surface.iterations = 6;
        o.stop = false;
    });
    options.into()
}

fn solve(gpu: &Gpu, solver: &SolverOptions, capture: &Capture) -> Reconstruction {
    let mut hear = |_: &_| std::ops::ControlFlow::Continue(());
    let grid = Request::new(solver.clone(), "").grid(capture).expect("a grid");
    solver.solve(gpu, capture, grid, None, true, &mut unwatched(&mut hear)).expect("it solves")
}

#[test]
fn try_it() {
    let open = |binding| Gpu::open(&GpuOptions { binding, ..GpuOptions::default() }).expect("a device");
    for (name, capture) in kinds() {
        for (solver, options) in [("vector", vector()), ("paper", paper(NoiseTerm::Bin)), ("paper h", paper(NoiseTerm::Histogram))] {
            let t = std::time::Instant::now();
            let whole = solve(&open(None), &options, &capture);
            println!("{name} {solver} {} {:?}", whole.device_bytes >> 10, t.elapsed());
            for range in [540 << 10, 300 << 10] {
                let done = solve(&open(Some(range)), &options, &capture);
                let l = |r: &Reconstruction| r.trace.last().unwrap().loss;
                println!("  {range}: {:?} {} {} {} {}", done.plan.part_counts(), done.device_bytes >> 10, done.plan.stored_bytes() >> 10, l(&whole), l(&done));
                let e = whole.maps.depth.iter().zip(&done.maps.depth).filter(|(a,b)| a.is_finite()||b.is_finite()).map(|(a,b)| (a-b).abs()).fold(0.0f32, |m,v| if v.is_nan() || v>m {v} else {m});
                let a = whole.maps.albedo.iter().zip(&done.maps.albedo).map(|(a,b)| (a-b).abs()).fold(0.0f32, f32::max) / whole.maps.albedo.iter().fold(0.0f32, |a,b| a.max(*b));
                println!("  depth {e} albedo {a}");
            }
        }
    }
}
