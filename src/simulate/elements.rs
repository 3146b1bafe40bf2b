//! Cuts the scene's surfaces into small elements, the samples of the renderer.
//!
//! Triangles above the wanted area are halved across their longest edge until they are small and compact;
//! each piece is an element with one random point. Meshes finer than that are not cut: their small
//! triangles are strung along a space-filling curve and picked evenly by area, and a pick stands for its
//! share of the area as an equilateral triangle in the surface.

use super::Scene;
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A small flat piece of surface.
pub(super) struct Element {
    /// A random point of the piece: light and visibility are evaluated here.
    pub point: DVec3,
    /// The piece's corners: they say how its light spreads over path lengths.
    pub corners: [DVec3; 3],
    /// Unit geometric normal: decides what the element faces.
    pub facing: DVec3,
    /// Unit shading normal at `point`: enters the cosine.
    pub normal: DVec3,
    /// Albedo times area.
    pub weight: f64,
    pub object: usize,
}

/// A triangle of the scene with a share of its own corners' normals.
#[derive(Clone, Copy)]
struct Piece {
    corners: [DVec3; 3],
    normals: [DVec3; 3],
    facing: DVec3,
    object: usize,
}

/// Cuts the scene into `count` to about three times as many elements.
pub(super) fn elements(scene: &Scene, count: usize, seed: u64) -> Vec<Element> {
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
    let mut elements: Vec<Element> = Vec::with_capacity(cut.len() + count);
    elements.extend(cut.iter().map(|piece| {
        let (point, normal) = piece.random_point(&mut rng);
        let weight = scene.objects[piece.object].albedo * piece.area();
        Element { point, corners: piece.corners, facing: piece.facing, normal, weight, object: piece.object }
    }));
    pick(scene, fine, wanted, &mut rng, &mut elements);
    elements
}

/// Halves a triangle across its longest edge until it is neither large nor long.
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

/// Picks points evenly by area from triangles that are smaller than an element.
fn pick(scene: &Scene, mut fine: Vec<Piece>, wanted: f64, rng: &mut Pcg64, out: &mut Vec<Element>) {
    let total: f64 = fine.iter().map(Piece::area).sum();
    if total <= 0.0 {
        return;
    }
    let bounds = fine
        .iter()
        .flat_map(|p| p.corners)
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi): (DVec3, DVec3), p| (lo.min(p), hi.max(p)));
    fine.sort_by_cached_key(|p| (p.object, morton(p.corners.iter().sum::<DVec3>() / 3.0, bounds)));
    let picks = (total / wanted).ceil().max(1.0) as usize;
    let share = total / picks as f64;
    // Equilateral triangle of this area: distance from its centre to the corners.
    let reach = (share * 4.0 / (3.0 * 3f64.sqrt())).sqrt();
    let (mut passed, mut at) = (0.0, 0);
    for i in 0..picks {
        let target = (i as f64 + rng.random::<f64>()) * share;
        while at + 1 < fine.len() && passed + fine[at].area() < target {
            passed += fine[at].area();
            at += 1;
        }
        let piece = &fine[at];
        let (point, normal) = piece.random_point(rng);
        let (u, v) = piece.facing.any_orthonormal_pair();
        let turn = rng.random::<f64>() * std::f64::consts::TAU;
        let corners = [0.0, 1.0, 2.0].map(|k: f64| {
            let angle = turn + k * std::f64::consts::TAU / 3.0;
            point + (u * angle.cos() + v * angle.sin()) * reach
        });
        let weight = scene.objects[piece.object].albedo * share;
        out.push(Element { point, corners, facing: piece.facing, normal, weight, object: piece.object });
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

    /// A point uniform over the triangle and the shading normal there.
    fn random_point(&self, rng: &mut Pcg64) -> (DVec3, DVec3) {
        let (s, t): (f64, f64) = (rng.random::<f64>().sqrt(), rng.random());
        let weights = [1.0 - s, s * (1.0 - t), s * t];
        let mix = |v: &[DVec3; 3]| v[0] * weights[0] + v[1] * weights[1] + v[2] * weights[2];
        (mix(&self.corners), mix(&self.normals).normalize_or(self.facing))
    }
}

/// Position along a Morton curve through the box `bounds`.
fn morton(p: DVec3, (lo, hi): (DVec3, DVec3)) -> u64 {
    let cell =
        ((p - lo) / (hi - lo).max(DVec3::splat(1e-12)) * 65535.0).clamp(DVec3::ZERO, DVec3::splat(65535.0));
    let spread = |v: f64| (0..16).fold(0u64, |code, bit| code | ((v as u64 >> bit & 1) << (3 * bit)));
    spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2
}
