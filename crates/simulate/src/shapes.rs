//! Procedural meshes of smooth solids and rectangles.

use super::Mesh;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// A parametric surface: `point(u, v)` returns position and outward unit normal, u and v in [0, 1].
fn surface(nu: usize, nv: usize, point: impl Fn(f64, f64) -> (DVec3, DVec3)) -> Mesh {
    let at = |i: usize, j: usize| point(i as f64 / nu as f64, j as f64 / nv as f64);
    let mut mesh = Mesh::default();
    for i in 0..nu {
        for j in 0..nv {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            mesh.push([a.0, b.0, c.0], [a.1, b.1, c.1]);
            mesh.push([a.0, c.0, d.0], [a.1, c.1, d.1]);
        }
    }
    mesh
}

fn on_sphere(u: f64, v: f64) -> DVec3 {
    // Exact poles: the degenerate triangles around them are dropped.
    let ring = if u == 0.0 || u == 1.0 { 0.0 } else { (PI * u).sin() };
    let turn = if v == 1.0 { 0.0 } else { TAU * v };
    DVec3::new(ring * turn.cos(), (PI * u).cos(), ring * turn.sin())
}

/// A sphere: centre and radius in metres. The facets stay within 0.3 % of the radius.
pub fn sphere(centre: DVec3, radius: f64) -> Mesh {
    round(centre, DVec3::splat(radius), 48, 80)
}

/// An ellipsoid with half axes `radii` along x, y, z in metres, coarser than [`sphere`].
pub fn ellipsoid(centre: DVec3, radii: DVec3) -> Mesh {
    round(centre, radii, 24, 40)
}

fn round(centre: DVec3, radii: DVec3, rings: usize, segments: usize) -> Mesh {
    surface(rings, segments, |u, v| {
        let n = on_sphere(u, v);
        (centre + radii * n, (n / radii).normalize())
    })
}

/// The convex hull of two spheres (a capsule, tapered if the radii differ), in metres.
pub fn capsule(from: DVec3, from_radius: f64, to: DVec3, to_radius: f64) -> Mesh {
    let span = to - from;
    let length = span.length();
    if length <= (from_radius - to_radius).abs() {
        let (centre, radius) = if from_radius > to_radius { (from, from_radius) } else { (to, to_radius) };
        return sphere(centre, radius);
    }
    let axis = span / length;
    let (across, along) = axis.any_orthonormal_pair();
    // Angle between the axis and the normals where the sphere at `to` meets the cone.
    let turn = ((from_radius - to_radius) / length).clamp(-1.0, 1.0).acos();
    let rings = 5;
    surface(2 * rings + 1, 28, |u, v| {
        let ring = (u * (2 * rings + 1) as f64).round() as usize;
        let (polar, centre, radius) = if ring <= rings {
            (turn * ring as f64 / rings as f64, to, to_radius)
        } else {
            (turn + (PI - turn) * (ring - rings - 1) as f64 / rings as f64, from, from_radius)
        };
        let wide = if ring == 0 || ring == 2 * rings + 1 { 0.0 } else { polar.sin() };
        let angle = if v == 1.0 { 0.0 } else { TAU * v };
        let n = axis * polar.cos() + (across * angle.cos() + along * angle.sin()) * wide;
        (centre + n * radius, n)
    })
}

/// A torus whose ring lies in the plane through `centre` perpendicular to `axis`: `ring` is the distance
/// of the tube's centre line from `centre`, `tube` the tube's radius, both in metres.
pub fn torus(centre: DVec3, axis: DVec3, ring: f64, tube: f64) -> Mesh {
    let axis = axis.normalize_or(DVec3::Z);
    let (a, b) = axis.any_orthonormal_pair();
    let mut mesh = surface(96, 48, |u, v| {
        let (around, over) = (TAU * u, TAU * v);
        let out = a * around.cos() + b * around.sin();
        let n = out * over.cos() + axis * over.sin();
        (centre + out * ring + n * tube, n)
    });
    mesh.self_occluding = true;
    mesh
}

/// A flat rectangle around `centre` with half sides `half_u` and `half_v` (perpendicular vectors in
/// metres), facing along half_u × half_v.
pub fn rectangle(centre: DVec3, half_u: DVec3, half_v: DVec3) -> Mesh {
    let n = half_u.cross(half_v).normalize_or_zero();
    surface(1, 1, |u, v| (centre + half_u * (2.0 * u - 1.0) + half_v * (2.0 * v - 1.0), n))
}
