//! The paper's solver beside the arithmetic of the published code, written down in float64 from its definitions, with its
//! conventions where ours differ: points at (i / n - 1/2) of the wall, bins rounded to, whole tensors that keep and move
//! what was pruned. Random numbers differ, so both end at the same figures, not at the same bits.

use std::ops::ControlFlow;

use fixtures::device::*;
use thirdbounce::capture::Capture;
use thirdbounce::engine::{Problem, Solver, Watch, default_volume, gaussian_weights};
use thirdbounce::methods::PaperOptions;
use thirdbounce::options::Preset;
use thirdbounce::transport::Grid;
use thirdbounce_simulate::{RenderOptions, Scene, simulate};

/// Side of the wall, metres.
const WALL: f64 = 1.0;

/// Albedo, then the normal, along x, y, z.
type Raw = [f64; 4];

/// A point that a voxel draws: its place in voxels, in metres, albedo, normal, length of the normal before.
struct Point {
    place: [f64; 3],
    at: [f64; 3],
    albedo: f64,
    normal: [f64; 3],
    length: f64,
}

struct Published<'c> {
    capture: &'c Capture,
    /// Scan points per side, voxels per side, layers.
    scan: usize,
    n: usize,
    layers: usize,
    raw: Vec<Raw>,
    moments: [Vec<Raw>; 2],
    active: Vec<bool>,
    random: u64,
    /// Steps of Adam since its restart.
    step: i32,
}

impl Published<'_> {
    fn new(capture: &Capture) -> Published<'_> {
        let (scan, layers) = (capture.scan[0], (WALL / capture.bin_width) as usize);
        let voxels = layers * scan * scan;
        let near = (0.2 / WALL * layers as f64) as usize * scan * scan;
        let mut new = Published {
            capture,
            scan,
            n: scan,
            layers,
            raw: vec![[0.0; 4]; voxels],
            moments: [0; 2].map(|_| vec![[0.0; 4]; voxels]),
            active: (0..voxels).map(|i| i >= near).collect(),
            random: 1,
            step: 0,
        };
        (0..voxels).for_each(|i| new.raw[i][0] = new.random());
        new
    }

    /// Uniform in [0, 1).
    fn random(&mut self) -> f64 {
        self.random =
            self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 11) as f64 / (1u64 << 53) as f64
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.n + x) * self.n + y
    }

    /// The voxels that are interpolated at a place, and their weights.
    fn corners(&self, place: [f64; 3]) -> Vec<(usize, f64)> {
        let corner = |c: usize| {
            let to = [0, 1, 2].map(|a| place[a].floor() as usize + (c >> a & 1));
            let weight: f64 = (0..3).map(|a| 1.0 - (place[a] - to[a] as f64).abs()).product();
            let inside = to[0] < self.n && to[1] < self.n && to[2] < self.layers;
            (inside && weight > 0.0).then(|| (self.index(to), weight))
        };
        (0..8).filter_map(corner).collect()
    }

    fn points(&mut self) -> Vec<Point> {
        let (n, layers) = (self.n, self.layers);
        let active: Vec<usize> = (0..self.active.len()).filter(|i| self.active[*i]).collect();
        let draw = |i: usize| {
            let centre = [i / n % n, i % n, i / (n * n)];
            let last = [n - 1, n - 1, layers - 1];
            let place =
                [0, 1, 2].map(|a| (centre[a] as f64 + self.random() - 0.5).clamp(0.0, last[a] as f64));
            let mut v = [0.0; 4];
            for (from, weight) in self.corners(place) {
                (0..4).for_each(|k| v[k] += weight * self.raw[from][k]);
            }
            let u = [v[1].tanh(), v[2].tanh(), v[3].tanh() - 1.0];
            let length = u.iter().map(|u| u * u).sum::<f64>().sqrt().max(1e-12);
            let across = |g: f64| (g / n as f64 - 0.5) * WALL;
            Point {
                place,
                at: [across(place[0]), across(place[1]), place[2] * WALL / layers as f64],
                albedo: if v[0] > 0.0 { v[0] } else { v[0].exp_m1() },
                normal: u.map(|u| u / length),
                length,
            }
        };
        active.into_iter().map(draw).collect()
    }

    /// Calls `hear` with every pair's cell that a point adds to, the direction to its wall point, the cosine and the
    /// falloff.
    fn light(&self, p: &Point, mut hear: impl FnMut(usize, [f64; 3], f64, f64)) {
        let Capture { bins, bin_width, .. } = *self.capture;
        let reference = 0.25 * bins as f64 * bin_width;
        for pair in 0..self.scan * self.scan {
            let [x, y] =
                [pair / self.scan, pair % self.scan].map(|i| (i as f64 / self.scan as f64 - 0.5) * WALL);
            let d = [x - p.at[0], y - p.at[1], -p.at[2]];
            let r = d.iter().map(|d| d * d).sum::<f64>().sqrt();
            let (bin, toward) = ((2.0 * r / bin_width).round() as usize, d.map(|d| d / r));
            let cosine: f64 = (0..3).map(|a| p.normal[a] * toward[a]).sum();
            if bin < bins && cosine > 0.0 {
                hear(pair * bins + bin, toward, cosine, (reference / r).powi(4));
            }
        }
    }

    /// One iteration; returns the data loss before it.
    fn iterate(&mut self, target: &[f64]) -> f64 {
        let points = self.points();
        let scale = 2.0 * (WALL / self.n as f64).powi(2);
        let mut light = vec![0.0; target.len()];
        for p in &points {
            self.light(p, |cell, _, cosine, falloff| light[cell] += scale * p.albedo * cosine * falloff);
        }
        let cells = target.len() as f64;
        let residual: Vec<f64> = light.iter().zip(target).map(|(a, b)| a - b).collect();
        let l1 = 0.001 / self.raw.len() as f64;
        let mut gradient = vec![[0.0; 4]; self.raw.len()];
        for p in &points {
            let (mut albedo, mut normal) = (l1 * p.albedo.signum(), [0.0; 3]);
            self.light(p, |cell, toward, cosine, _| {
                // Without the falloff.
                let g = 2.0 / cells * scale * residual[cell];
                albedo += g * cosine;
                (0..3).for_each(|a| normal[a] += g * p.albedo * toward[a]);
            });
            let along: f64 = (0..3).map(|a| normal[a] * p.normal[a]).sum();
            let raw = |k: usize| {
                let Some(a) = k.checked_sub(1) else {
                    return albedo * if p.albedo > 0.0 { 1.0 } else { p.albedo + 1.0 };
                };
                let tanh = p.normal[a] * p.length + if a == 2 { 1.0 } else { 0.0 };
                (normal[a] - p.normal[a] * along) / p.length * (1.0 - tanh * tanh)
            };
            let raw = [0, 1, 2, 3].map(raw);
            for (to, weight) in self.corners(p.place) {
                (0..4).for_each(|k| gradient[to][k] += weight * raw[k]);
            }
        }
        self.step += 1;
        let [unbias_first, unbias_second] = [0.9f64, 0.999].map(|b| 1.0 / (1.0 - b.powi(self.step)));
        let [first, second] = &mut self.moments;
        for (i, g) in gradient.iter().enumerate() {
            for k in 0..4 {
                first[i][k] = 0.9 * first[i][k] + 0.1 * g[k];
                second[i][k] = 0.999 * second[i][k] + 0.001 * g[k] * g[k];
                self.raw[i][k] -= first[i][k] * unbias_first / ((second[i][k] * unbias_second).sqrt() + 1e-8);
            }
        }
        residual.iter().map(|r| r * r).sum::<f64>() / cells
    }

    /// Keeps what is above a twentieth of the largest smoothed raw albedo.
    fn reduce(&mut self) {
        let taps = gaussian_weights(3.0, 4.0);
        let mut smooth: Vec<f64> =
            self.raw.iter().zip(&self.active).map(|(r, active)| if *active { r[0] } else { 0.0 }).collect();
        for [stride, length] in [[self.n * self.n, self.layers], [self.n, self.n], [1, self.n]] {
            let source = smooth.clone();
            for (i, value) in smooth.iter_mut().enumerate() {
                let c = i / stride % length;
                let near = c.saturating_sub(taps.len() - 1)..(c + taps.len()).min(length);
                *value = near.map(|at| taps[at.abs_diff(c)] * source[i + at * stride - c * stride]).sum();
            }
        }
        let least = 0.05 * smooth.iter().copied().fold(f64::MIN, f64::max);
        let near = (0.2 / WALL * self.layers as f64) as usize * self.n * self.n;
        self.active = smooth.iter().enumerate().map(|(i, v)| *v > least && i >= near).collect();
    }

    /// Doubles the lateral resolution, interpolated between centres.
    fn double(&mut self) {
        let (n, fine) = (self.n, 2 * self.n);
        let along = |c: usize| {
            let at = (0.5 * (c as f64 + 0.5) - 0.5).clamp(0.0, n as f64 - 1.0);
            [(at as usize, 1.0 - at.fract()), ((at as usize + 1).min(n - 1), at.fract())]
        };
        let voxel = |i: usize| [i / fine % fine, i % fine, i / (fine * fine)];
        let voxels = 0..self.layers * fine * fine;
        let interpolated = |i: usize| {
            let ([x, y, z], mut value) = (voxel(i), [0.0; 4]);
            for (from_x, wx) in along(x) {
                for (from_y, wy) in along(y) {
                    let from = self.raw[self.index([from_x, from_y, z])];
                    (0..4).for_each(|k| value[k] += wx * wy * from[k]);
                }
            }
            value
        };
        let raw = voxels.clone().map(interpolated).collect();
        let parent = |[x, y, z]: [usize; 3]| self.index([x / 2, y / 2, z]);
        let active = voxels.map(|i| self.active[parent(voxel(i))]).collect();
        (self.raw, self.active, self.n) = (raw, active, fine);
    }

    /// Puts Adam at rest.
    fn restart(&mut self) {
        self.moments = [0; 2].map(|_| vec![[0.0; 4]; self.raw.len()]);
        self.step = 0;
    }
}

#[test]
fn the_domain_is_as_small_and_the_loss_as_low_as_in_the_published_arithmetic() {
    let gpu = host();
    let mut scene = Scene::named("letter-Z").unwrap();
    (scene.scan, scene.bin_width) = (8, 0.02);
    let capture = simulate(&scene, &RenderOptions::default()).unwrap().capture;
    let o = PaperOptions::preset(Preset::Synthetic).with(|o| (o.lateral, o.iterations) = (16, 120));
    let grid = Grid::new(default_volume(&capture, o.domain.min_depth).unwrap(), o.lateral, capture.bin_width);
    let mut hear = |_: &_| ControlFlow::Continue(());
    let mut watch = Watch { hear: &mut hear, maps_every: Some(1), maps_at: &[] };
    let ours = o.solve(&gpu, &Problem::new(&capture, grid.unwrap()), &mut watch).unwrap();

    let most = capture.histograms.iter().copied().fold(0.0, f32::max);
    let target: Vec<f64> = capture.histograms.iter().map(|v| 10.0 * f64::from(*v / most)).collect();
    let mut published = Published::new(&capture);
    let mut seen = vec![];
    for done in 1..=o.iterations {
        let share = published.active.iter().filter(|a| **a).count() as f64 / published.raw.len() as f64;
        seen.push([share, published.iterate(&target)]);
        if done % 50 == 0 {
            published.reduce();
        }
        if done % 100 == 0 {
            published.double();
            published.restart();
        }
    }
    // The domains after the reductions at 50 and 100. An albedo that is smoothed after ELU leaves 1.5 times as many voxels.
    for done in [100, 120] {
        let (here, [share, _]) = (&ours.trace[done - 1], seen[done - 1]);
        assert_eq!(here.iteration, done);
        let ratio = here.active_ratio / share;
        assert!((ratio - 1.0).abs() < 0.1, "after {done}: {} of the voxels, not {share}", here.active_ratio);
    }
    let mean = |losses: &[f64]| losses.iter().sum::<f64>() / losses.len() as f64;
    for part in [90..100, 110..120] {
        let [ours, theirs] = [
            mean(&ours.trace[part.clone()].iter().map(|p| p.data_loss).collect::<Vec<_>>()),
            mean(&seen[part.clone()].iter().map(|[_, loss]| *loss).collect::<Vec<_>>()),
        ];
        assert!((ours / theirs - 1.0).abs() < 0.15, "{part:?}: a loss of {ours}, not {theirs}");
    }
}
