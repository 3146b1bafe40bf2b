//! Random scenes, small enough for float64.

use glam::{DVec3, dvec3};

use thirdbounce::capture::PulseTaps;
use thirdbounce::engine::Plan;
use thirdbounce::gpu::Abilities;
use thirdbounce::methods::{NoiseTerm, PaperOptions};
use thirdbounce::options::Preset;
use thirdbounce::surface::{Pixels, SurfaceOptions};
use thirdbounce::transport::{Binning, Geometry, Grid, Model, Reflectance, Rendered, Spot, Wall};
use thirdbounce::{Result, surface};

/// Repeatable numbers for tests: PCG-XSH-RR (O'Neill 2014).
pub struct Random(u64);

impl Random {
    /// A sequence that the seed determines.
    pub fn new(seed: u64) -> Random {
        Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// The next number.
    pub fn draw(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        x.rotate_right((self.0 >> 59) as u32)
    }

    /// Uniform in [a, b), representable in fp32.
    pub fn uniform(&mut self, a: f64, b: f64) -> f64 {
        f64::from((a + (b - a) * f64::from(self.draw()) / 4_294_967_296.0) as f32)
    }
}

/// A scan of `n` × `n` confocal points on a 1 m wall and random histograms.
pub fn model(n: usize, bins: usize, seed: u64) -> Model {
    let mut random = Random::new(seed);
    let at = |i: usize| (i as f64 + 0.5) / n as f64 - 0.5;
    let points: Vec<DVec3> = (0..n * n).map(|i| dvec3(at(i / n), at(i % n), 0.0)).collect();
    let measured: Vec<f32> = (0..n * n * bins).map(|_| random.uniform(0.0, 10.0) as f32).collect();
    let bin_width = 2.4 / bins as f64;
    Model {
        given: None,
        centre: DVec3::ZERO,
        elements: n * n * bins,
        wall: Wall::confocal(points),
        rendered: None,
        is_spread: false,
        unused: 0,
        held_out: 0,
        pulse: None,
        high_pass: None,
        reflectance: Reflectance::Cosine,
        bins,
        bin_width,
        t_start: 0.3,
        measured,
        peak: 10.0,
        counts_per_unit: 1.0,
        reference: 0.6,
        min_depth: 0.25,
        binning: Binning::Linear,
        variance: [0.1, 0.02],
    }
}

/// An asymmetric pulse with a tail behind the path.
pub fn tail() -> PulseTaps {
    PulseTaps { before: 2, weights: vec![0.05, 0.2, 0.4, 0.2, 0.1, 0.05] }
}

/// The model with spots of these standard deviations at the scanned and at the other points, metres.
pub fn spotted(model: &Model, sigma: [f64; 2]) -> Model {
    let spot = Spot { sigma, coarsest: model.bin_width, path: 1.4 };
    Model { rendered: Some(Rendered::of(&model.wall, spot)), ..model.clone() }
}

/// Spots of a tenth of the wall for a kind of pairs.
pub fn spots_for(geometry: Geometry) -> [f64; 2] {
    if geometry == Geometry::Confocal { [0.1, 0.0] } else { [0.1, 0.06] }
}

/// The same model with other, random pairs, another reflectance and possibly a curved wall. A product has a third as
/// many scanned points as the model has pairs, and six other points.
pub fn variant(base: &Model, geometry: Geometry, reflectance: Reflectance, curved: bool, seed: u64) -> Model {
    let mut random = Random::new(seed);
    let mut point = || {
        let z = if curved { random.uniform(-0.05, 0.05) } else { 0.0 };
        dvec3(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), z)
    };
    let pairs = base.pairs();
    let (scanned, others) = match geometry {
        Geometry::Confocal => (pairs, 0),
        Geometry::TwoPoints => (pairs, pairs),
        // Not a multiple of the number that a kernel processes together.
        Geometry::Product => (pairs / 3, 6),
    };
    let scanned: Vec<DVec3> = (0..scanned).map(|_| point()).collect();
    let others: Vec<DVec3> = (0..others).map(|_| point()).collect();
    let count = scanned.len() + others.len();
    let mut normal = || dvec3(random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4), 1.0).normalize();
    let normals = curved.then(|| (0..count).map(|_| normal()).collect());
    let wall = Wall { geometry, scanned, others, normals };
    let elements = wall.pairs() * base.bins;
    let measured = (0..elements).map(|i| base.measured[i % base.measured.len()]).collect();
    Model { elements, wall, reflectance, measured, ..base.clone() }
}

/// Every combination of pairs, walls and reflectances.
pub fn variants() -> Vec<(Geometry, Reflectance, bool)> {
    let mut all = vec![];
    for geometry in [Geometry::Confocal, Geometry::TwoPoints, Geometry::Product] {
        for reflectance in [
            Reflectance::Cosine,
            Reflectance::Lambertian,
            Reflectance::Retroreflective,
            Reflectance::Isotropic,
        ] {
            all.extend([false, true].map(|curved| (geometry, reflectance, curved)));
        }
    }
    all
}

/// A grid whose last bricks extend beyond it on every axis.
pub fn grid() -> Grid {
    let pitch = dvec3(1.0 / 12.0, 1.0 / 12.0, 0.8 / 18.0);
    Grid { n: [12, 12, 18], origin: dvec3(-0.5 + 0.5 * pitch.x, -0.5 + 0.5 * pitch.y, 5.0 * pitch.z), pitch }
}

/// Options of the paper's solver for a model.
pub fn options(model: &Model, grid: &Grid) -> PaperOptions {
    PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.lateral = grid.n[0];
        o.iterations = 64;
        o.peak = model.peak;
        o.domain.coarse_to_fine = false;
        o.domain.min_depth = model.min_depth;
        o.domain.keep_above = 0.05;
        o.l1 = 0.01;
        o.binning = model.binning;
        o.noise.term = NoiseTerm::Off;
        o.seed = 7;
    })
}

/// A grid of few voxels.
pub fn coarse() -> Grid {
    Grid { n: [4, 4, 7], origin: dvec3(-0.375, -0.375, 0.3), pitch: dvec3(0.25, 0.25, 0.1) }
}

/// Models with more pairs than one dispatch may walk. A product is split between other points, or within one that has too
/// many scanned points.
pub fn more_pairs_than_a_dispatch_takes() -> [Model; 3] {
    let confocal = model(182, 8, 14);
    let rows = variant(&confocal, Geometry::Product, Reflectance::Cosine, false, 22);
    let mut long = variant(&model(346, 8, 14), Geometry::Product, Reflectance::Lambertian, false, 23);
    long.wall.others.truncate(2);
    long.measured.truncate(long.pairs() * long.bins);
    long.elements = long.measured.len();
    [confocal, rows, long]
}

/// What a fit needs of a plan, with room for as many samples as the grid has voxels.
#[derive(Debug, Clone)]
pub struct FitNeeds {
    /// Options of the solver.
    pub options: SurfaceOptions,
    /// Rows of the trace.
    pub iterations: usize,
}

impl FitNeeds {
    /// A fit with `each` points per pixel.
    pub fn of(grid: &Grid, each: usize) -> FitNeeds {
        let options = SurfaceOptions::default().with(|o| {
            o.lateral = grid.n[0];
            o.points = Some(each);
        });
        FitNeeds { options, iterations: 64 }
    }

    /// The same with changed options.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut SurfaceOptions)) -> FitNeeds {
        change(&mut self.options);
        self
    }

    /// Its plan.
    ///
    /// # Errors
    /// As [`surface::plan`].
    pub fn plan(&self, model: &Model, grid: Grid, scan: [usize; 2], device: &Abilities) -> Result<Plan> {
        surface::plan(model, grid, scan, &self.options, [0, self.iterations], grid.storage(), device)
    }
}

/// A grid with pixels that are not square, and with different numbers of them along x and y.
pub fn oblong() -> Grid {
    let pitch = dvec3(1.0 / 12.0, 0.8 / 12.0, 0.8 / 18.0);
    Grid { n: [12, 11, 18], origin: dvec3(-0.5 + 0.5 * pitch.x, -0.4 + 0.5 * pitch.y, 5.0 * pitch.z), pitch }
}

/// A rough surface that fills about four fifths of the grid. It has a sharp step, holes, pixels at every border, one
/// pixel without neighbours, and two that touch at a corner.
pub fn field(grid: &Grid, seed: u64) -> Pixels {
    let mut random = Random::new(seed);
    let [nx, ny, _] = grid.n;
    let alone = |x: usize, y: usize| {
        (x < 3 && y < 4 && [x, y] != [1, 1])
            || (x > nx - 5 && y > ny - 5 && ![[nx - 3; 2], [nx - 2; 2]].contains(&[x, y]))
    };
    let mut all = Pixels { columns: vec![], albedo: vec![], depth: vec![] };
    for (x, y) in (0..nx * ny).map(|c| (c / ny, c % ny)) {
        if nx > 8 && alone(x, y) || random.uniform(0.0, 1.0) < 0.15 && (x, y) != (1, 1) {
            continue;
        }
        let step = if x > nx / 2 { 0.2 } else { 0.0 };
        all.columns.push((x * ny + y) as u32);
        all.depth.push((0.42 + step + 0.1 * (y as f64 / ny as f64) + random.uniform(-0.02, 0.02)) as f32);
        all.albedo.push(random.uniform(10.0, 60.0) as f32);
    }
    all.albedo[5] = 0.0;
    all
}

/// The same with a second layer in the middle, so near behind the first that pixels of both would be bound together if
/// they were in one layer.
pub fn both(grid: &Grid, seed: u64) -> Pixels {
    let mut all = field(grid, seed);
    let mut random = Random::new(seed + 1000);
    let [nx, ny, _] = grid.n;
    for (x, y) in (nx / 4..3 * nx / 4).flat_map(|x| (ny / 4..3 * ny / 4).map(move |y| (x, y))) {
        if random.uniform(0.0, 1.0) < 0.15 {
            continue;
        }
        all.columns.push(((nx + x) * ny + y) as u32);
        all.depth.push((0.47 + 0.1 * (x as f64 / nx as f64) + random.uniform(-0.02, 0.02)) as f32);
        all.albedo.push(random.uniform(10.0, 60.0) as f32);
    }
    all
}
