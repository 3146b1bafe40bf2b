//! Coarse renderings: few shadow rays, and light of a sample spread evenly over its path lengths. In single precision.

use super::Scene;
use super::elements::SurfaceElement;
use super::pairs::Pairs;
use super::visibility::Surfaces;
use crate::capture::Reflectance;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Histograms `[pair * bins + bin]` of all pairs, with shadows from `nodes` x `nodes` points of the wall.
pub(super) fn histograms(
    scene: &Scene,
    pairs: &Pairs,
    elements: &[SurfaceElement],
    nodes: usize,
    bins: usize,
) -> Vec<f32> {
    let shadows = Shadows::new(scene, nodes);
    let mut samples = Samples::default();
    // An element that faces no node is seen from nowhere.
    let seen: Vec<&SurfaceElement> = elements
        .iter()
        .filter(|e| shadows.nodes.iter().any(|node| (*node - e.point).dot(e.facing) > 0.0))
        .collect();
    let visible = shadows.traced(scene, &seen);
    seen.iter().for_each(|e| samples.push(e));
    let mut histograms = vec![0f32; pairs.laser.len() * bins];
    let confocal = pairs.is_confocal();
    let sensor_scans = pairs.sensor_scans();
    histograms.par_chunks_mut(bins).enumerate().for_each_init(
        || Light::new(seen.len(), bins),
        |light, (pair, histogram)| {
            let normal = |of: &Option<Vec<DVec3>>| of.as_ref().map_or(Vec3::Z, |n| n[pair].as_vec3());
            let ends = [pairs.laser[pair], pairs.sensor[pair]];
            let normals = [normal(&pairs.laser_normal), normal(&pairs.sensor_normal)];
            let sides = if confocal { 1 } else { 2 };
            for side in 0..sides {
                samples.distances(ends[side].as_vec3(), normals[side], &mut light.ends[side]);
                shadows.towards(ends[side], &visible, &mut light.ends[side].visible);
            }
            let scanned = usize::from(sensor_scans && !confocal);
            let [start, width] = [scene.t_start, scene.bin_width].map(|v| v as f32);
            samples.light(light, [0, sides - 1], scanned, scene.reflectance, [start, width]);
            light.deposit(histogram);
        },
    );
    histograms
}

/// Points of the wall from which shadows are traced: a grid over the wall, and the fixed point if the scan has one.
struct Shadows {
    nodes: Vec<DVec3>,
    /// Nodes per side of the grid.
    side: usize,
    wall: f64,
    fixed: Option<DVec3>,
}

impl Shadows {
    fn new(scene: &Scene, side: usize) -> Shadows {
        let at = |i: usize| (i as f64 / (side - 1) as f64 - 0.5) * scene.wall;
        let point = |x: f64, y: f64| scene.wall_shape.point(x, y, scene.wall);
        let fixed = scene.layout.point().map(|p| point(p.x, p.y));
        let grid = (0..side * side).map(|k| point(at(k / side), at(k % side)));
        Shadows { nodes: grid.chain(fixed).collect(), side, wall: scene.wall, fixed }
    }

    /// Visibility of the elements from the nodes, 0 or 1: [node][element].
    fn traced(&self, scene: &Scene, elements: &[&SurfaceElement]) -> Vec<Vec<f32>> {
        if !scene.occlusion {
            return vec![vec![1.0; elements.len()]; self.nodes.len()];
        }
        let surfaces = Surfaces::new(scene);
        let seen = |node: DVec3, e: &SurfaceElement| surfaces.visible(e.point, e.facing, e.object, node);
        let of = |node: &DVec3| elements.iter().map(|e| f32::from(u8::from(seen(*node, e)))).collect();
        self.nodes.par_iter().map(of).collect()
    }

    /// Visibility of all elements from a point of the wall, interpolated between nodes.
    fn towards(&self, point: DVec3, visible: &[Vec<f32>], to: &mut [f32]) {
        if self.fixed == Some(point) {
            to.copy_from_slice(&visible[self.nodes.len() - 1]);
            return;
        }
        let place = |v: f64| {
            let at = (v / self.wall + 0.5).clamp(0.0, 1.0) * (self.side - 1) as f64;
            let i = (at as usize).min(self.side - 2);
            (i, (at - i as f64) as f32)
        };
        let ((i, a), (j, b)) = (place(point.x), place(point.y));
        let [w, x, y, z] =
            [(i, j), (i, j + 1), (i + 1, j), (i + 1, j + 1)].map(|(i, j)| &visible[i * self.side + j]);
        let weights = [(1.0 - a) * (1.0 - b), (1.0 - a) * b, a * (1.0 - b), a * b];
        for (k, to) in to.iter_mut().enumerate() {
            *to = weights[0] * w[k] + weights[1] * x[k] + weights[2] * y[k] + weights[3] * z[k];
        }
    }
}

/// Elements, each quantity in a list of its own.
#[derive(Default)]
struct Samples {
    centre: [Vec<f32>; 3],
    normal: [Vec<f32>; 3],
    facing: [Vec<f32>; 3],
    /// Two edges, whose paths give the spread of the light.
    edges: [[Vec<f32>; 3]; 2],
    weight: Vec<f32>,
}

/// From the elements to an end of a pair.
struct End {
    /// Unit vectors.
    way: [Vec<f32>; 3],
    /// Distance, its inverse, and the cosines at surface and wall; 0 for elements that face away.
    distance: Vec<f32>,
    inverse: Vec<f32>,
    cosine: Vec<f32>,
    wall: Vec<f32>,
    visible: Vec<f32>,
}

/// Light of all elements for one pair.
struct Light {
    ends: [End; 2],
    value: Vec<f32>,
    /// First and last path of the light, bins.
    from: Vec<f32>,
    to: Vec<f32>,
    /// Differences of neighbouring bins.
    steps: Vec<f64>,
}

impl Light {
    fn new(count: usize, bins: usize) -> Light {
        let list = || vec![0.0f32; count];
        let end = || End {
            way: [list(), list(), list()],
            distance: list(),
            inverse: list(),
            cosine: list(),
            wall: list(),
            visible: list(),
        };
        Light { ends: [end(), end()], value: list(), from: list(), to: list(), steps: vec![0.0; bins + 2] }
    }

    /// Sums the light into bins.
    fn deposit(&mut self, histogram: &mut [f32]) {
        let (steps, bins) = (&mut self.steps, histogram.len());
        steps.fill(0.0);
        let mut step = |at: f32, height: f64| {
            let at = f64::from(at.clamp(0.0, bins as f32));
            let bin = at as usize;
            let share = at - bin as f64;
            steps[bin] += height * (1.0 - share);
            steps[bin + 1] += height * share;
        };
        for ((value, from), to) in self.value.iter().zip(&self.from).zip(&self.to) {
            if *value > 0.0 && *to > 0.0 && *from < bins as f32 {
                let height = f64::from(value / (to - from));
                step(*from, height);
                step(*to, -height);
            }
        }
        let mut sum = 0.0;
        for (value, step) in histogram.iter_mut().zip(&self.steps) {
            sum += step;
            *value = sum.max(0.0) as f32;
        }
    }
}

impl Samples {
    fn push(&mut self, e: &SurfaceElement) {
        let [a, b, c] = e.corners;
        let add = |to: &mut [Vec<f32>; 3], v: DVec3| {
            to.iter_mut().zip(v.to_array()).for_each(|(to, v)| to.push(v as f32));
        };
        add(&mut self.centre, (a + b + c) / 3.0);
        add(&mut self.normal, e.normal);
        add(&mut self.facing, e.facing);
        add(&mut self.edges[0], b - a);
        add(&mut self.edges[1], c - a);
        self.weight.push(e.weight as f32);
    }

    /// What an end of a pair is for all elements, but for shadows.
    fn distances(&self, end: Vec3, wall: Vec3, to: &mut End) {
        let [x, y, z] = [&self.centre[0], &self.centre[1], &self.centre[2]];
        for i in 0..self.weight.len() {
            let way = [end.x - x[i], end.y - y[i], end.z - z[i]];
            let distance = (way[0] * way[0] + way[1] * way[1] + way[2] * way[2]).sqrt().max(1e-9);
            let inverse = 1.0 / distance;
            let [u, v, w] = way.map(|v| v * inverse);
            let along = |n: &[Vec<f32>; 3]| u * n[0][i] + v * n[1][i] + w * n[2][i];
            let is_faced = if along(&self.facing) > 0.0 { 1.0 } else { 0.0 };
            (to.way[0][i], to.way[1][i], to.way[2][i]) = (u, v, w);
            (to.distance[i], to.inverse[i]) = (distance, inverse * is_faced);
            to.cosine[i] = along(&self.normal).max(0.0);
            to.wall[i] = -(u * wall.x + v * wall.y + w * wall.z).min(0.0);
        }
    }

    /// Light of all elements between two ends, and its paths. The formulas are those of [`super::render_pairs`].
    fn light(
        &self,
        light: &mut Light,
        [laser, sensor]: [usize; 2],
        scanned: usize,
        model: Reflectance,
        [start, width]: [f32; 2],
    ) {
        let Light { ends, value, from, to, .. } = light;
        let (l, s, scanned) = (&ends[laser], &ends[sensor], &ends[scanned].cosine);
        let per_bin = 1.0 / width;
        for i in 0..self.weight.len() {
            let falloff = l.inverse[i] * s.inverse[i];
            let g = match model {
                Reflectance::Cosine => scanned[i] * falloff * falloff,
                Reflectance::Lambertian => {
                    l.cosine[i] * s.cosine[i] * l.wall[i] * s.wall[i] * falloff * falloff
                }
                Reflectance::Retroreflective => falloff,
                Reflectance::Isotropic => falloff * falloff,
            };
            let shadow = if laser == sensor { l.visible[i] } else { l.visible[i] * s.visible[i] };
            value[i] = self.weight[i] * g * shadow;
            let path = (l.distance[i] + s.distance[i] - start) * per_bin;
            // The path is nearly linear on an element. An even spread with the deviation of a triangle's.
            let along = |e: &[Vec<f32>; 3]| {
                (l.way[0][i] + s.way[0][i]) * e[0][i]
                    + (l.way[1][i] + s.way[1][i]) * e[1][i]
                    + (l.way[2][i] + s.way[2][i]) * e[2][i]
            };
            let (a, b) = (along(&self.edges[0]), along(&self.edges[1]));
            let half = ((a * a + b * b - a * b) * (1.0 / 6.0)).sqrt() * per_bin;
            let half = half.max(0.05);
            (from[i], to[i]) = (path - half, path + half);
        }
    }
}
