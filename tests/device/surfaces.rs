//! What tests of the surface share: a height field, its buffers, and where its derivatives jump.

use glam::{DVec2, dvec3};
use thirdbounce::solve::surface::{self, Pixels};
use thirdbounce::solve::{OnDevice, VectorOptions};
use thirdbounce::transport::twin::{self, Bond, Height, Sample, SurfaceWeights, Twin};
use thirdbounce::transport::{Grid, Model, Reflectance, Volume};

use super::vectors::{run, vector_options};
use super::{Random, write};

/// Pixels and what they hold; albedo is that of the maps before.
pub struct Field {
    /// Points of a pixel.
    pub each: usize,
    pub columns: Vec<u32>,
    pub heights: Vec<Height>,
    pub albedo: Vec<f64>,
}

/// A grid whose pixels are not square and whose sides have different numbers of them.
pub fn oblong() -> Grid {
    let volume = Volume { min: dvec3(-0.5, -0.4, 0.2), max: dvec3(0.5, 0.4, 1.0) };
    let grid = Grid::new(volume, 12, 0.8 / 18.0).expect("a plain grid");
    Grid { n: [12, 11, grid.n[2]], ..grid }
}

/// A rough surface that fills about four fifths of the grid: with a sharp step, holes, pixels at every border, one without
/// neighbours, two that touch at a corner.
pub fn field(grid: &Grid, seed: u64) -> Field {
    let mut random = Random::new(seed);
    let [nx, ny, _] = grid.n;
    let alone = |x: usize, y: usize| {
        (x < 3 && y < 4 && [x, y] != [1, 1])
            || (x > nx - 5 && y > ny - 5 && ![[nx - 3; 2], [nx - 2; 2]].contains(&[x, y]))
    };
    let mut all = Field { each: 4, columns: vec![], heights: vec![], albedo: vec![] };
    for (x, y) in (0..nx * ny).map(|c| (c / ny, c % ny)) {
        if nx > 8 && alone(x, y) || random.uniform(0.0, 1.0) < 0.15 && (x, y) != (1, 1) {
            continue;
        }
        let step = if x > nx / 2 { 0.2 } else { 0.0 };
        let depth = 0.42 + step + 0.1 * (y as f64 / ny as f64) + random.uniform(-0.02, 0.02);
        all.columns.push((x * ny + y) as u32);
        all.heights.push(Height { depth: f64::from(depth as f32), albedo: random.uniform(10.0, 60.0) });
        all.albedo.push(random.uniform(0.1, 3.0));
    }
    all.heights[5].albedo = 0.0;
    all
}

impl Field {
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    pub fn pixels(&self) -> Pixels {
        let f = |v: f64| v as f32;
        Pixels {
            columns: self.columns.clone(),
            albedo: self.albedo.iter().map(|a| f(*a)).collect(),
            depth: self.heights.iter().map(|h| f(h.depth)).collect(),
        }
    }

    pub fn bonds(&self, twin: &Twin) -> Vec<Vec<Bond>> {
        twin::surface_bonds(twin, &self.columns, &self.heights)
    }

    pub fn points(&self, twin: &Twin, bonds: &[Vec<Bond>]) -> (Vec<DVec2>, Vec<Sample>) {
        twin::surface_points(twin, &self.columns, bonds, &self.heights, self.each)
    }

    /// Writes pixels and heights. What depth bonds come from is for the kernel to tell.
    pub fn write(&self, job: &mut OnDevice<'_>) {
        let [x, y, _] = job.plan.finest().grid.n;
        let words = self.pixels().words().into_iter().map(|[c, a, _, _]| [c, a, u32::MAX, u32::MAX]);
        write(job, buffer::PIXELS, &words.collect::<Vec<_>>());
        write(job, buffer::PIXEL_OF, &self.pixels().places(x * y));
        self.write_heights(job);
    }

    pub fn write_heights(&self, job: &mut OnDevice<'_>) {
        let words: Vec<[f32; 2]> = self.heights.iter().map(|h| [h.depth as f32, h.albedo as f32]).collect();
        write(job, buffer::HEIGHTS, &words);
    }
}

/// The model with a measurement that is about what the field renders.
pub fn measured(model: &Model, grid: &Grid, field: &Field, seed: u64) -> Model {
    let mut random = Random::new(seed);
    let twin = Twin { model, grid };
    let rendered = twin::forward(&twin, &field.points(&twin, &field.bonds(&twin)).1);
    let scale = f64::from(model.scene(grid).render_scale);
    let level = rendered.iter().fold(0.0f64, |a, b| a.max(*b)) * scale;
    let mut draw = |r: &f64| (r * scale * random.uniform(0.5, 1.4) + level * random.uniform(0.0, 0.1)) as f32;
    Model { measured: rendered.iter().map(&mut draw).collect(), ..model.clone() }
}

/// Every binary choice that the value of a sample to a pair takes: its bins, and who sees whom. Where none of them changes
/// the value is smooth. And whether one is about to, by so many bins or so much of a cosine.
pub fn choices(twin: &Twin, s: &Sample, margin: f64) -> (Vec<i64>, bool) {
    let m = twin.model;
    let (mut all, mut close) = (vec![], false);
    for pair in 0..m.pairs() {
        let bin = (m.wall.path(pair, s.point) - m.t_start) / m.bin_width - 0.5;
        all.push(bin.floor() as i64);
        close |= (bin - bin.round()).abs() < margin;
        for number in m.wall.points_of(pair) {
            let [point, normal] = m.wall.point(number);
            let toward = (point - s.point).normalize();
            let cosines = match m.reflectance {
                Reflectance::Lambertian => vec![s.normal.dot(toward), -normal.dot(toward)],
                Reflectance::Cosine => vec![s.normal.dot(toward)],
                _ => vec![],
            };
            all.extend(cosines.iter().map(|c| i64::from(*c > 0.0)));
            close |= cosines.iter().any(|c| c.abs() < margin);
        }
    }
    (all, close)
}

/// With so many points of a pixel.
pub fn surface_options(grid: &Grid, each: usize) -> VectorOptions {
    VectorOptions { surface_iterations: 12, surface_points: Some(each), ..vector_options(grid) }
}

/// Runs those kernels of the surface's iteration `at` that are among `names`.
pub fn run_surface(job: &mut OnDevice<'_>, count: usize, at: usize, names: &[&str]) {
    let s = surface::iteration(&job.plan, job.plan.finest(), count, at, at, None);
    run(job, s, names);
}

pub fn run_bonds(job: &mut OnDevice<'_>, count: usize) {
    let s = surface::start(job.plan.finest(), count, surface::points_of(&job.plan));
    job.executor.run(&s).expect("the schedule runs");
}

pub fn write_weights(job: &mut OnDevice<'_>, w: &SurfaceWeights) {
    let [rates, largest] = [w.rates, w.largest].map(|h| [h.depth, h.albedo]);
    let all = [
        w.bend,
        w.jump,
        rates[0],
        rates[1],
        w.iterations,
        largest[0],
        largest[1],
        w.smooth,
        w.spread,
        w.sparse,
        w.faint,
    ];
    let words = all.map(|v| v as f32);
    assert_eq!(SurfaceWeights::from(words), *w, "weights that fp32 holds");
    write(job, buffer::SURFACE_WEIGHTS, &words);
}

pub fn read_pairs(job: &mut OnDevice<'_>, buffer: &'static str, count: usize) -> Vec<[f64; 2]> {
    super::read::<[f32; 2]>(job, buffer, count).into_iter().map(|v| v.map(f64::from)).collect()
}

pub fn read_heights(job: &mut OnDevice<'_>, count: usize) -> Vec<Height> {
    let one = |[depth, albedo]: [f64; 2]| Height { depth, albedo };
    read_pairs(job, buffer::HEIGHTS, count).into_iter().map(one).collect()
}

/// Heights as (depths, albedos), which have units of their own.
pub fn halves(all: &[Height]) -> [Vec<f64>; 2] {
    [all.iter().map(|h| h.depth).collect(), all.iter().map(|h| h.albedo).collect()]
}
