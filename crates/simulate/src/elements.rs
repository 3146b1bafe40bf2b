//! Cuts the scene's surfaces into small elements, the samples of the renderer.
//!
//! Triangles above the wanted area are halved across their longest edge until they are small and compact; each piece
//! becomes an element with one random point. Triangles much smaller than the wanted area are gathered into clusters of
//! about that area.

use super::Scene;
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// Least cosine (of 30°) between the normals of a cluster's triangles and the first one's.
const ALIKE: f64 = 0.866;

/// A small flat surface element.
pub(super) struct SurfaceElement {
    /// Random point of the element, at which light and visibility are evaluated.
    pub point: DVec3,
    /// Corners of the element: their path lengths define the spread of its light.
    pub corners: [DVec3; 3],
    /// Unit geometric normal: determines the wall points that the element faces.
    pub facing: DVec3,
    /// Shading normal for the cosine: at `point`, or the mean over a cluster.
    pub normal: DVec3,
    /// Albedo times area.
    pub weight: f64,
    pub object: usize,
}

/// A part of a triangle of the scene, with interpolated normals.
#[derive(Clone, Copy)]
struct Piece {
    corners: [DVec3; 3],
    normals: [DVec3; 3],
    facing: DVec3,
    object: usize,
}

/// Cuts the scene into elements: between `count` and about three times as many.
pub(super) fn elements(scene: &Scene, count: usize, seed: u64) -> Vec<SurfaceElement> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let total: f64 = scene.objects.iter().map(|o| o.mesh.total_area()).sum();
    let wanted = total / count.max(1) as f64;
    let mut cut = Vec::with_capacity(2 * count);
    let mut fine = Vec::new();
    for (object, body) in scene.objects.iter().enumerate().filter(|(_, o)| o.albedo > 0.0) {
        for (i, (&corners, &normals)) in body.mesh.triangles.iter().zip(&body.mesh.normals).enumerate() {
            let facing = body.mesh.geometric_normal(i);
            let piece = Piece { corners, normals, facing, object };
            if facing == DVec3::ZERO {
                continue;
            }
            if piece.area() < 0.25 * wanted {
                fine.push(piece);
            } else {
                halve(piece, wanted, &mut cut);
            }
        }
    }
    let mut elements: Vec<SurfaceElement> = Vec::with_capacity(cut.len() + count);
    elements.extend(cut.iter().map(|piece| {
        let (point, normal) = piece.random_point(&mut rng);
        let weight = scene.objects[piece.object].albedo * piece.area();
        SurfaceElement {
            point,
            corners: piece.corners,
            facing: piece.facing,
            normal,
            weight,
            object: piece.object,
        }
    }));
    gather(scene, fine, wanted, &mut rng, &mut elements);
    elements
}

/// Halves a triangle across its longest edge until it is small and compact.
fn halve(piece: Piece, wanted: f64, out: &mut Vec<Piece>) {
    let mut stack = vec![piece];
    while let Some(p) = stack.pop() {
        let edge = |k: usize| p.corners[k].distance_squared(p.corners[(k + 1) % 3]);
        let k = (0..3).max_by(|&i, &j| edge(i).total_cmp(&edge(j))).unwrap_or(0);
        if p.area() <= wanted && edge(k) <= 12.0 * wanted {
            out.push(p);
            continue;
        }
        let (a, b, c) = (k, (k + 1) % 3, (k + 2) % 3);
        let middle = 0.5 * (p.corners[a] + p.corners[b]);
        let normal = (p.normals[a] + p.normals[b]).normalize_or(p.facing);
        for (i, j) in [(a, c), (c, b)] {
            // Keeps the winding: (a, middle, c) and (middle, b, c).
            let (first, second) =
                if i == a { (p.at(a), (middle, normal)) } else { ((middle, normal), p.at(j)) };
            let third = p.at(c);
            stack.push(Piece {
                corners: [first.0, second.0, third.0],
                normals: [first.1, second.1, third.1],
                ..p
            });
        }
    }
}

/// Gathers triangles smaller than an element into clusters: neighbours on a space-filling curve with similar normals.
fn gather(scene: &Scene, mut fine: Vec<Piece>, wanted: f64, rng: &mut Pcg64, out: &mut Vec<SurfaceElement>) {
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for p in &fine {
        (lo, hi) = (lo.min(p.centre()), hi.max(p.centre()));
    }
    fine.sort_by_cached_key(|p| (p.object, side(p.facing), morton(p.centre(), lo, hi)));
    let mut rest = &fine[..];
    while let Some(first) = rest.first() {
        let mut area = 0.0;
        let joins = |p: &&Piece| {
            area += p.area();
            p.object == first.object
                && p.facing.dot(first.facing) > ALIKE
                && p.centre().distance_squared(first.centre()) < 6.0 * wanted
                && area <= wanted
        };
        let count = rest.iter().take_while(joins).count().max(1);
        let (cluster, others) = rest.split_at(count);
        out.push(merge(cluster, scene.objects[first.object].albedo, rng));
        rest = others;
    }
}

/// One element for a cluster: its whole area, one random point, its mean normal, and a triangle with the cluster's
/// centroid and second moments.
fn merge(cluster: &[Piece], albedo: f64, rng: &mut Pcg64) -> SurfaceElement {
    let area: f64 = cluster.iter().map(Piece::area).sum();
    let mut left = rng.random::<f64>() * area;
    let chosen = cluster.iter().find(|p| {
        left -= p.area();
        left <= 0.0
    });
    let chosen = chosen.unwrap_or(&cluster[0]);
    let (point, _) = chosen.random_point(rng);
    // Shorter than one where the cluster is curved: the cosine is then the mean of the triangles' cosines.
    let bent = |p: &Piece| (p.normals[0] + p.normals[1] + p.normals[2]) * (p.area() / 3.0);
    let normal = cluster.iter().map(bent).sum::<DVec3>() / area;
    let mean: DVec3 = cluster.iter().map(|p| p.centre() * p.area()).sum::<DVec3>() / area;
    let facing: DVec3 = cluster.iter().map(|p| p.facing * p.area()).sum();
    let (u, v) = facing.normalize_or(chosen.facing).any_orthonormal_pair();
    // Second moments in the tangent plane. A triangle's moments are those of its corners over twelve, plus those of
    // its centre.
    let [mut uu, mut uv, mut vv] = [0.0; 3];
    for p in cluster {
        let mut add = |d: DVec3, weight: f64| {
            uu += weight * d.dot(u) * d.dot(u);
            uv += weight * d.dot(u) * d.dot(v);
            vv += weight * d.dot(v) * d.dot(v);
        };
        add(p.centre() - mean, p.area() / area);
        p.corners.iter().for_each(|&c| add(c - p.centre(), p.area() / area / 12.0));
    }
    // Corners mean + a cos θ + b sin θ, θ a third of a turn apart, have the moments (a aᵀ + b bᵀ) / 8.
    let root = (8.0 * uu).sqrt().max(1e-12);
    let a = u * root + v * (8.0 * uv / root);
    let b = v * (8.0 * vv - (8.0 * uv / root).powi(2)).max(0.0).sqrt();
    let turn = rng.random::<f64>();
    let corners = [0.0, 1.0, 2.0].map(|k| {
        let (sin, cos) = ((turn + k / 3.0) * TAU).sin_cos();
        mean + a * cos + b * sin
    });
    SurfaceElement {
        point,
        corners,
        facing: chosen.facing,
        normal,
        weight: albedo * area,
        object: chosen.object,
    }
}

impl Piece {
    fn at(&self, k: usize) -> (DVec3, DVec3) {
        (self.corners[k], self.normals[k])
    }

    fn area(&self) -> f64 {
        let [a, b, c] = self.corners;
        0.5 * (b - a).cross(c - a).length()
    }

    fn centre(&self) -> DVec3 {
        (self.corners[0] + self.corners[1] + self.corners[2]) / 3.0
    }

    /// A point uniform over the triangle and the shading normal there.
    fn random_point(&self, rng: &mut Pcg64) -> (DVec3, DVec3) {
        let (s, t): (f64, f64) = (rng.random::<f64>().sqrt(), rng.random());
        let weights = [1.0 - s, s * (1.0 - t), s * t];
        let mix = |v: &[DVec3; 3]| v[0] * weights[0] + v[1] * weights[1] + v[2] * weights[2];
        (mix(&self.corners), mix(&self.normals).normalize_or(self.facing))
    }
}

/// The side of a cube, 0 to 5, that a direction points to.
fn side(n: DVec3) -> usize {
    let a = n.abs();
    let axis = if a.x >= a.y && a.x >= a.z {
        0
    } else if a.y >= a.z {
        1
    } else {
        2
    };
    2 * axis + usize::from(n[axis] < 0.0)
}

/// Position along a Morton curve through the box from `lo` to `hi`.
fn morton(p: DVec3, lo: DVec3, hi: DVec3) -> u64 {
    let top = DVec3::splat(65535.0);
    let cell = ((p - lo) / (hi - lo).max(DVec3::splat(1e-12)) * top).clamp(DVec3::ZERO, top);
    let spread = |v: f64| (0..16).fold(0u64, |code, bit| code | (((v as u64 >> bit) & 1) << (3 * bit)));
    spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2
}
