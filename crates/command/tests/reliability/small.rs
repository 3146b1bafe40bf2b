//! Scenes and requests that take a fraction of a second.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use thirdbounce::capture::Capture;
use thirdbounce::engine::{Accumulation, Problem, Progress, Reconstruction, Watch};
use thirdbounce::gpu::{Faults, Gpu, GpuOptions};
use thirdbounce::job::Loaded;
use thirdbounce::methods::{NoiseTerm, PaperOptions, SolverOptions};
use thirdbounce::options::Preset;
use thirdbounce::settings::Settings;
use thirdbounce::surface::SurfaceOptions;
use thirdbounce::transport::Reflectance;
use thirdbounce::{Result, capture, export, job};
use thirdbounce_simulate::{Layout, RenderOptions, Scene, WallShape, simulate, truth};

/// Files that many cases share.
pub struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    pub fn capture(&self) -> PathBuf {
        self.folder.path().join("capture.npz")
    }

    pub fn truth(&self) -> PathBuf {
        self.folder.path().join("truth.npz")
    }

    pub fn folder(&self) -> &Path {
        self.folder.path()
    }
}

fn scene() -> Scene {
    Scene { scan: 6, bin_width: 0.03, ..Scene::named("letter-Z").expect("a built-in scene") }
}

fn render(scene: &Scene) -> Capture {
    simulate(scene, &RenderOptions { noise: 0.2, ..RenderOptions::default() }).expect("a rendering").capture
}

pub fn files() -> &'static Files {
    static FILES: OnceLock<Files> = OnceLock::new();
    FILES.get_or_init(|| {
        let files = Files { folder: tempfile::tempdir().expect("a temporary folder") };
        capture::write(&render(&scene()), &files.capture()).expect("a capture");
        export::npz::write_truth(&files.truth(), &truth(&scene(), 16).expect("truth")).expect("a truth");
        files
    })
}

pub fn loaded() -> Loaded {
    job::load(&files().capture(), &Settings::default()).expect("the capture loads")
}

/// Captures of every kind of pairs, on a flat and on a bumpy wall.
pub fn kinds() -> Vec<(&'static str, Capture)> {
    let point = glam::dvec2(0.1, -0.1);
    let flat = |layout| render(&Scene { layout, ..scene() });
    let bump = Scene { wall_shape: WallShape::Bump, reflectance: Reflectance::Lambertian, ..scene() };
    vec![
        ("confocal", flat(Layout::Confocal)),
        ("one laser point", flat(Layout::OneLaser { point })),
        ("one sensor point", flat(Layout::OneSensor { point })),
        ("exhaustive", render(&Scene { scan: 4, layout: Layout::Exhaustive { lasers: 3 }, ..scene() })),
        ("irregular", flat(Layout::Irregular { seed: 3 })),
        ("confocal, a curved wall", render(&bump)),
        ("irregular, a curved wall", render(&Scene { layout: Layout::Irregular { seed: 4 }, ..bump })),
    ]
}

/// Both solvers, with every kind of step, doubling included, in a dozen iterations.
pub fn solvers(accumulation: Accumulation) -> [(&'static str, SolverOptions); 2] {
    [("paper", paper(accumulation).into()), ("surface", surface(accumulation).into())]
}

pub fn paper(accumulation: Accumulation) -> PaperOptions {
    PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.lateral = 12;
        o.iterations = 12;
        o.domain.double_every = 5;
        o.restart_every = 3;
        o.domain.reduce_every = 4;
        o.noise.term = NoiseTerm::Bin;
        o.accumulation = accumulation;
    })
}

pub fn surface(accumulation: Accumulation) -> SurfaceOptions {
    SurfaceOptions::default().with(|o| {
        o.lateral = 12;
        o.iterations = 12;
        o.accumulation = accumulation;
    })
}

pub fn open(faults: Faults, validation: bool) -> Gpu {
    Gpu::open(&GpuOptions { validation, robust: true, faults, ..GpuOptions::default() })
        .expect("a Vulkan device and the validation layer: `make setup` installs both")
}

/// A solve; `cancel` breaks it off at that point of the trace.
pub fn solve(
    gpu: &Gpu,
    solver: &SolverOptions,
    capture: &Capture,
    cancel: Option<usize>,
) -> Result<Reconstruction> {
    let mut heard = 0;
    let mut hear = |_: &Progress| {
        heard += 1;
        if cancel.is_some_and(|at| heard > at) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    let grid = Settings::default().grid(solver, capture)?;
    solver.solve(gpu, &Problem::new(capture, grid).and_volume(), &mut watch)
}

/// Every bit of a result except times.
pub fn bits(done: &Reconstruction) -> Vec<u64> {
    let floats = |v: &[f32]| v.iter().map(|f| u64::from(f.to_bits())).collect::<Vec<_>>();
    let mut all = floats(&done.maps.albedo);
    all.extend(floats(&done.maps.depth));
    all.extend(done.maps.normal.iter().flat_map(|n| floats(n)));
    all.extend(done.volume.iter().flat_map(|v| floats(&v.albedo)));
    for p in &done.trace {
        all.extend([
            p.iteration as u64,
            p.lateral as u64,
            p.active as u64,
            p.loss.to_bits(),
            p.data_loss.to_bits(),
        ]);
    }
    all.push(done.pairs);
    all
}

/// Every file below a folder with its content.
pub fn tree(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(at) = folders.pop() {
        for entry in std::fs::read_dir(&at).into_iter().flatten().flatten() {
            let path = entry.path();
            match path.is_dir() {
                true => folders.push(path),
                false => drop(all.insert(path.clone(), std::fs::read(&path).unwrap_or_default())),
            }
        }
    }
    all
}

/// Files and folders below a folder that an unfinished write left behind.
pub fn leftovers(folder: &Path) -> Vec<PathBuf> {
    let mut all = vec![];
    let mut folders = vec![folder.to_path_buf()];
    while let Some(at) = folders.pop() {
        for path in std::fs::read_dir(&at).into_iter().flatten().flatten().map(|e| e.path()) {
            if path.extension().is_some_and(|e| e == "part") {
                all.push(path.clone());
            }
            if path.is_dir() {
                folders.push(path);
            }
        }
    }
    all
}
