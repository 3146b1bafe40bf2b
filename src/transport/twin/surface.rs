//! The surface's kernels: pixels with a depth and an albedo. Lists are by pixel; `columns` gives each pixel's index in
//! the maps, `ix * ny + iy`, plus `nx * ny` in the second layer. Every pixel has the same number of samples.

use glam::{DMat3, DVec2, DVec3, dvec2, dvec3};

use super::domain::Column;
use super::render::{Kernel, gather_rising, shine};
use super::{Sample, Twin, forward, residual_weighted};
use crate::transport::Reflectance;
use crate::transport::kernels::*;

/// A pixel's depth and albedo, or a value for each of them: a gradient, a moment.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Height {
    /// Depth, metres.
    pub depth: f64,
    /// Albedo per area of the surface; for reflectances without normals, per lateral area.
    pub albedo: f64,
}

/// The bond of a pixel to one of its neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bond {
    /// The neighbour's number.
    pub other: usize,
    /// Offset to the neighbour, pixels.
    pub way: [i32; 2],
    /// Weight of the bond, 0 to 1.
    pub weight: f64,
    /// Derivative of the pixel's slopes by the neighbour's depth, per metre.
    pub stencil: DVec2,
}

/// The content of the buffer `surface_weights`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SurfaceWeights {
    /// Weight of squared distances of pixels from their neighbours' planes.
    pub bend: f64,
    /// Weight of squared differences of neighbouring albedos.
    pub jump: f64,
    /// First steps of depths, metres, and of albedos.
    pub rates: Height,
    /// Iterations over which steps fall to zero.
    pub iterations: f64,
    /// Largest gradients so far by pixels' own depths and albedos.
    pub largest: Height,
    /// First sigma of the Gaussian that spreads gradients, pixels.
    pub spread: f64,
    /// Weight of the term that keeps few pixels lit.
    pub sparse: f64,
    /// Albedo above which more albedo adds little to that term.
    pub faint: f64,
    /// `bend` over the objective.
    pub bend_share: f64,
    /// `jump` over the objective.
    pub jump_share: f64,
}

impl SurfaceWeights {
    /// Updates `largest` from the output of [`surface_combine`].
    pub fn see(&mut self, combined: &[Combined]) {
        for c in combined {
            self.largest.depth = self.largest.depth.max(c.height.depth.abs());
            self.largest.albedo = self.largest.albedo.max(c.height.albedo.abs());
        }
    }

    /// Weighs the prior against what the surface leaves of the objective; [`surface_bonds`]' kernel does so, too.
    pub fn renew(&mut self, left: f64) {
        (self.bend, self.jump) = (self.bend_share * left, self.jump_share * left);
    }

    /// The term that keeps few pixels lit, for one pixel with this albedo, and its derivative by the albedo.
    fn lit(&self, albedo: f64) -> [f64; 2] {
        match self.sparse > 0.0 {
            true => [
                self.sparse * self.faint * (albedo / self.faint).ln_1p(),
                self.sparse / (1.0 + albedo / self.faint),
            ],
            false => [0.0; 2],
        }
    }
}

impl From<[f32; SURFACE_WEIGHTS as usize]> for SurfaceWeights {
    fn from(words: [f32; SURFACE_WEIGHTS as usize]) -> SurfaceWeights {
        let at = |i: u32| f64::from(words[i as usize]);
        SurfaceWeights {
            bend: at(SURFACE_BEND),
            jump: at(SURFACE_JUMP),
            rates: Height { depth: at(SURFACE_DEPTH_RATE), albedo: at(SURFACE_ALBEDO_RATE) },
            iterations: at(SURFACE_ITERATIONS),
            largest: Height { depth: at(SURFACE_LARGEST), albedo: at(SURFACE_LARGEST + 1) },
            spread: at(SURFACE_SPREAD),
            sparse: at(SURFACE_SPARSE),
            faint: at(SURFACE_FAINT),
            bend_share: at(SURFACE_BEND_SHARE),
            jump_share: at(SURFACE_JUMP_SHARE),
        }
    }
}

/// Slope between two pixels that halves their bond.
const EDGE: f64 = 2.5;

/// Weight of zero slope; each neighbour weighs up to one.
const LEVEL: f64 = 1e-3;

/// Lateral position of a pixel, in pixels.
fn place(twin: &Twin, column: u32) -> [i32; 2] {
    let [x, y, _] = twin.grid.n.map(|n| n as u32);
    [(column % (x * y) / y) as i32, (column % y) as i32]
}

/// The same for the distance between pixels: layers are so far apart that no pixel has neighbours in another.
fn apart(twin: &Twin, column: u32) -> [i32; 2] {
    let ([x, y], layer) = (place(twin, column), column as usize / (twin.grid.n[0] * twin.grid.n[1]));
    [x + ((layer as i32) << 20), y]
}

fn pitch(twin: &Twin) -> DVec2 {
    twin.grid.pitch.truncate()
}

/// Side of a square with a pixel's area, metres.
fn size(twin: &Twin) -> f64 {
    (twin.grid.pitch.x * twin.grid.pitch.y).sqrt()
}

fn metres(twin: &Twin, way: [i32; 2]) -> DVec2 {
    dvec2(way[0].into(), way[1].into()) * pitch(twin)
}

/// Bonds of every pixel to its neighbours. A pixel's slopes are those of the plane that fits the pixel (with a weight
/// of one) and its neighbours best. A small weight pulls the plane's slopes per pixel toward zero.
pub fn surface_bonds(twin: &Twin, columns: &[u32], heights: &[Height]) -> Vec<Vec<Bond>> {
    let places: Vec<[i32; 2]> = columns.iter().map(|c| apart(twin, *c)).collect();
    let of_pixel = |pixel: usize| {
        // A plane's value at a neighbour, as coefficients of its depth at the pixel and its two slopes.
        let row = |way: [i32; 2]| dvec3(1.0, way[0].into(), way[1].into());
        let weight = |other: usize, way: [i32; 2]| {
            let steep = (heights[other].depth - heights[pixel].depth) / (EDGE * size(twin));
            (-0.5 * f64::from(way[0] * way[0] + way[1] * way[1])).exp() / (1.0 + steep.powi(4))
        };
        let way = |other: usize| [0, 1].map(|a| places[other][a] - places[pixel][a]);
        let near = |other: &usize| *other != pixel && way(*other).iter().all(|w| w.abs() <= 1);
        let all: Vec<(usize, [i32; 2], f64)> = (0..places.len())
            .filter(near)
            .map(|other| (other, way(other), weight(other, way(other))))
            .collect();
        let outer = |r: DVec3| DMat3::from_cols(r * r.x, r * r.y, r * r.z);
        let own = outer(row([0, 0])) + DMat3::from_diagonal(dvec3(0.0, LEVEL, LEVEL));
        let normal = all.iter().fold(own, |sum, (_, way, weight)| sum + *weight * outer(row(*way)));
        let inverse = normal.inverse();
        let bond = |(other, way, weight): (usize, [i32; 2], f64)| {
            let plane = inverse * (weight * row(way));
            Bond { other, way, weight, stencil: dvec2(plane.y, plane.z) / pitch(twin) }
        };
        all.into_iter().map(bond).collect()
    };
    (0..columns.len()).map(of_pixel).collect()
}

/// Unit normal, toward the wall, of a pixel with these slopes.
fn facing(slope: DVec2) -> DVec3 {
    slope.extend(-1.0).normalize()
}

/// Area of a pixel's surface over its lateral area. Without normals, albedo is per lateral area, and this is 1.
fn stretch(twin: &Twin, slope: DVec2) -> f64 {
    if twin.model.reflectance.has_normals() { slope.extend(-1.0).length() } else { 1.0 }
}

/// Offset of a pixel's k-th point (of 1 or 4) from its centre, metres.
fn part(twin: &Twin, k: usize, points: usize) -> DVec2 {
    let quarter = |k: usize| [-0.25, 0.25][k];
    if points == 1 { DVec2::ZERO } else { dvec2(quarter(k / 2), quarter(k % 2)) * pitch(twin) }
}

/// Slopes of every pixel, and its samples: `points` (1 or 4) points of its tilted square, with depths limited to the
/// grid's.
pub fn surface_points(
    twin: &Twin,
    columns: &[u32],
    bonds: &[Vec<Bond>],
    heights: &[Height],
    points: usize,
) -> (Vec<DVec2>, Vec<Sample>) {
    let slope = |(bonds, here): (&Vec<Bond>, &Height)| -> DVec2 {
        bonds.iter().map(|b| b.stencil * (heights[b.other].depth - here.depth)).sum()
    };
    let slopes: Vec<DVec2> = bonds.iter().zip(heights).map(slope).collect();
    let [near, far] =
        [twin.model.near_z(twin.grid), twin.grid.n[2] - 1].map(|z| twin.grid.position(DVec3::Z * z as f64).z);
    let mut samples = vec![];
    for ((column, height), slope) in columns.iter().zip(heights).zip(&slopes) {
        let [x, y] = place(twin, *column).map(f64::from);
        let centre = twin.grid.position(dvec3(x, y, 0.0)).truncate();
        for d in (0..points).map(|k| part(twin, k, points)) {
            let z = (height.depth + slope.dot(d)).clamp(near, far);
            let albedo = height.albedo * stretch(twin, *slope) / points as f64;
            let normal = facing(*slope);
            samples.push(Sample { point: (centre + d).extend(z), albedo, normal, length: 0.0 });
        }
    }
    (slopes, samples)
}

/// The gradient at a sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pull {
    /// By the vector albedo · normal; zero for reflectances without normals.
    pub vector: DVec3,
    /// By the albedo.
    pub albedo: f64,
    /// By the depth, per metre.
    pub depth: f64,
}

/// Derivative by depth of a pair's kernel for a sample of unit albedo: the product rule over its factors.
fn deeper(twin: &Twin, k: &Kernel, normal: DVec3) -> f64 {
    let model = twin.model;
    let power = f64::from(model.falloff_power()) / 2.0;
    // Derivatives of an arm's direction and falloff as the sample moves along z.
    let turned = k.arms.map(|arm| (arm.toward * arm.toward.z - DVec3::Z) / arm.distance);
    let fallen = k.arms.map(|arm| arm.falloff * power * arm.toward.z / arm.distance);
    let [a, b] = k.arms;
    let of_falloff = fallen[0] * b.falloff + a.falloff * fallen[1];
    let (shown, _) = shine(model.reflectance, &k.arms, normal);
    let of_shine = match model.reflectance {
        Reflectance::Cosine if shown > 0.0 => normal.dot(turned[0]),
        Reflectance::Lambertian if shown > 0.0 => {
            let (cos_a, cos_b) = (normal.dot(a.toward), normal.dot(b.toward));
            let of_surface = normal.dot(turned[0]) * cos_b + cos_a * normal.dot(turned[1]);
            let [wall_a, wall_b] = [0, 1].map(|i| -k.arms[i].wall_normal.dot(turned[i]));
            a.wall * b.wall * of_surface + (wall_a * b.wall + a.wall * wall_b) * cos_a * cos_b
        }
        _ => 0.0,
    };
    of_falloff * shown + k.falloff * of_shine
}

/// Gradients at the samples, which have unit normals.
pub fn surface_gather(twin: &Twin, samples: &[Sample], residual: &[f64]) -> Vec<Pull> {
    let of_sample = |s: &Sample| {
        let mut pull = Pull::default();
        gather_rising(twin, s, residual, |k, [r, rise]| {
            if k.falloff == 0.0 {
                return;
            }
            let (value, slope) = shine(twin.model.reflectance, &k.arms, s.normal);
            pull.albedo += r * k.falloff * value;
            pull.vector += r * k.falloff * slope;
            let longer = -(k.arms[0].toward.z + k.arms[1].toward.z) / twin.model.bin_width;
            let moved = rise * longer * k.falloff * value;
            pull.depth += s.albedo * (moved + r * deeper(twin, k, s.normal));
        });
        pull
    };
    samples.iter().map(of_sample).collect()
}

/// The gradient by a pixel's own depth, albedo and slopes, and its energy.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Combined {
    /// Gradient by the slopes, as if they did not depend on depths.
    pub slope: DVec2,
    /// Gradient by depth and albedo.
    pub height: Height,
    /// The pixel's part of the prior: half of each pair's, and its own.
    pub energy: f64,
}

/// Combines the gradients of every pixel's samples and adds the prior: for each pair of neighbours
///   bond * (bend (off / size)² + jump (a_i - a_j)²) / 2
/// where `off` is the distance along z of one pixel from the plane through the other with the mean slopes of both; and
/// for every pixel the term that keeps few of them lit.
pub fn surface_combine(
    twin: &Twin,
    bonds: &[Vec<Bond>],
    heights: &[Height],
    slopes: &[DVec2],
    pulls: &[Pull],
    weights: &SurfaceWeights,
) -> Vec<Combined> {
    let points = pulls.len() / heights.len();
    let share = 1.0 / points as f64;
    let of_points = |(pixel, pulls): (usize, &[Pull])| {
        let mut all = Combined::default();
        for (k, p) in pulls.iter().enumerate() {
            all.height.depth += p.depth;
            let (slope, stretched) = (slopes[pixel], stretch(twin, slopes[pixel]));
            let light = share * heights[pixel].albedo;
            all.height.albedo += share * stretched * p.albedo;
            all.slope += p.depth * part(twin, k, points);
            // The normal is (slope, -1) over its length; a steeper pixel has more surface.
            let n = facing(slope);
            let across = (p.vector - n * n.dot(p.vector)) / slope.extend(-1.0).length();
            all.slope += light * stretched * across.truncate();
            if twin.model.reflectance.has_normals() {
                all.slope += light * p.albedo * slope / stretched;
            }
        }
        all
    };
    let mut all: Vec<Combined> = pulls.chunks(points).enumerate().map(of_points).collect();
    for (combined, height) in all.iter_mut().zip(heights) {
        let [energy, rise] = weights.lit(height.albedo);
        combined.energy += energy;
        combined.height.albedo += rise;
    }
    // Each pair of neighbours once.
    for (i, b) in bonds.iter().enumerate().flat_map(|(i, all)| all.iter().map(move |b| (i, b))) {
        let (j, way, size) = (b.other, metres(twin, b.way), size(twin));
        if i > j {
            continue;
        }
        let off = (heights[j].depth - heights[i].depth - way.dot(slopes[i] + slopes[j]) / 2.0) / size;
        let jump = heights[j].albedo - heights[i].albedo;
        let (bend, unlike) = (b.weight * weights.bend, b.weight * weights.jump);
        for (pixel, sign) in [(i, -1.0), (j, 1.0)] {
            all[pixel].energy += 0.25 * (bend * off * off + unlike * jump * jump);
            all[pixel].height.depth += sign * bend * off / size;
            all[pixel].height.albedo += sign * unlike * jump;
            all[pixel].slope -= bend * off / size * way / 2.0;
        }
    }
    all
}

/// The gradient by every depth and albedo, with the part that reaches depths through the slopes.
pub fn surface_gradient(bonds: &[Vec<Bond>], combined: &[Combined]) -> Vec<Height> {
    let mut all: Vec<Height> = combined.iter().map(|c| c.height).collect();
    for (pixel, bonds) in bonds.iter().enumerate() {
        for b in bonds {
            let through = b.stencil.dot(combined[pixel].slope);
            all[b.other].depth += through;
            all[pixel].depth -= through;
        }
    }
    all
}

/// The gradient for step `number` (from 1): each pixel's gradient is spread over the pixels around it, by a Gaussian up
/// to two sigmas. The Gaussian narrows to the pixel itself in three fifths of the iterations, and stops at edges of
/// `depths`, from which the bonds come.
pub fn surface_pull(
    twin: &Twin,
    columns: &[u32],
    depths: &[f64],
    gradient: &[Height],
    weights: &SurfaceWeights,
    number: u32,
) -> Vec<Height> {
    let sigma = weights.spread * (1.0 - f64::from(number - 1) / weights.iterations / 0.6);
    if sigma < 0.35 {
        return gradient.to_vec();
    }
    let reach = (2.0 * sigma - 1e-3).ceil() as i32;
    let places: Vec<[i32; 2]> = columns.iter().map(|c| apart(twin, *c)).collect();
    let mut spread = vec![Height::default(); gradient.len()];
    for (from, value) in gradient.iter().enumerate() {
        let way = |to: usize| [0, 1].map(|a| places[to][a] - places[from][a]);
        let near = |to: &usize| way(*to).iter().all(|w| w.abs() <= reach);
        let weight = |to: usize| {
            let square = f64::from(way(to).iter().map(|w| w * w).sum::<i32>());
            let steep = (depths[to] - depths[from]) / (EDGE * size(twin));
            (-square / (2.0 * sigma * sigma)).exp() / (1.0 + steep.powi(4))
        };
        let to: Vec<(usize, f64)> = (0..gradient.len()).filter(near).map(|to| (to, weight(to))).collect();
        let whole: f64 = to.iter().map(|t| t.1).sum();
        for (to, weight) in to {
            spread[to].depth += weight / whole * value.depth;
            spread[to].albedo += weight / whole * value.albedo;
        }
    }
    spread
}

/// Step `number` (from 1) of Adam. Its rate falls as half a cosine to a fiftieth of the first; its denominator is at
/// least a thousandth of the largest gradient. `moments` are the first and the second moment of each pixel.
pub fn surface_step(
    twin: &Twin,
    gradient: &[Height],
    weights: &SurfaceWeights,
    number: u32,
    heights: &mut [Height],
    moments: &mut [[Height; 2]],
) {
    const BETAS: [f64; 2] = [0.9, 0.99];
    let age = f64::from(number);
    let rate = 0.5 + 0.5 * (std::f64::consts::PI * (age - 1.0) / weights.iterations).cos() + 0.02;
    let one = |g: f64, largest: f64, [first, second]: [&mut f64; 2]| {
        *first += (1.0 - BETAS[0]) * (g - *first);
        *second += (1.0 - BETAS[1]) * (g * g - *second);
        let unbiased = |moment: f64, beta: f64| moment / (1.0 - beta.powf(age));
        rate * unbiased(*first, BETAS[0]) / unbiased(*second, BETAS[1]).sqrt().max(1e-3 * largest).max(1e-18)
    };
    let [near, far] =
        [twin.model.near_z(twin.grid), twin.grid.n[2] - 1].map(|z| twin.grid.position(DVec3::Z * z as f64).z);
    for ((height, g), [first, second]) in heights.iter_mut().zip(gradient).zip(moments) {
        let depth = one(g.depth, weights.largest.depth, [&mut first.depth, &mut second.depth]);
        let albedo = one(g.albedo, weights.largest.albedo, [&mut first.albedo, &mut second.albedo]);
        height.depth = (height.depth - weights.rates.depth * depth).clamp(near, far);
        height.albedo = (height.albedo - weights.rates.albedo * albedo).max(0.0);
    }
}

/// The maps' columns of the pixels.
pub fn surface_extract(heights: &[Height], slopes: &[DVec2]) -> Vec<Column> {
    let of = |(h, s): (&Height, &DVec2)| Column { albedo: h.albedo, depth: h.depth, normal: facing(*s) };
    heights.iter().zip(slopes).map(of).collect()
}

/// The surface's objective while `bonds` stay: the weighted mean squared error and the prior.
pub fn surface_objective(
    twin: &Twin,
    columns: &[u32],
    bonds: &[Vec<Bond>],
    heights: &[Height],
    points: usize,
    weights: &SurfaceWeights,
) -> f64 {
    let (slopes, samples) = surface_points(twin, columns, bonds, heights, points);
    let (_, loss) = residual_weighted(twin, &forward(twin, &samples));
    let mut prior: f64 = heights.iter().map(|h| weights.lit(h.albedo)[0]).sum();
    for (i, b) in bonds.iter().enumerate().flat_map(|(i, all)| all.iter().map(move |b| (i, b))) {
        let plane = heights[i].depth + 0.5 * (slopes[i] + slopes[b.other]).dot(metres(twin, b.way));
        let off = (heights[b.other].depth - plane) / size(twin);
        let jump = heights[i].albedo - heights[b.other].albedo;
        // Each pair of neighbours comes twice.
        prior += 0.5 * b.weight * (weights.bend * off.powi(2) + weights.jump * jump.powi(2)) / 2.0;
    }
    loss[0] + prior
}
