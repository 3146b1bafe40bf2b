//! True maps of a scene, seen from the wall.

use super::Scene;
use super::visibility::{Hit, Surfaces};
use crate::maps::{Layer, Truth};
use crate::{Error, Result};
use glam::DVec3;
use rayon::prelude::*;

/// Default side of the maps, pixels.
pub const DEFAULT_RESOLUTION: usize = 128;

/// Surfaces closer to each other than this share of the wall's side belong to one object, e.g. a limb in front of its
/// body.
const APART: f64 = 0.1;

/// True depth, normals, albedo and mask over the wall's extent at n × n pixels: the first hit along +z from each pixel's
/// centre on the wall. Normals are unit vectors toward the wall, smooth where the mesh is. The second layer is the
/// next surface facing the wall at least a tenth of the wall's side farther.
///
/// # Errors
/// A scene refused by [`Scene::check`], or a resolution of 0 or above 16384.
pub fn truth(scene: &Scene, n: usize) -> Result<Truth> {
    scene.check()?;
    if n == 0 || n > 16384 {
        return Err(Error::options(
            format!("true maps of {n} x {n} pixels cannot be made"),
            format!("give a resolution of 1 to 16384, such as {DEFAULT_RESOLUTION}"),
        ));
    }
    let surfaces = Surfaces::new(scene);
    let at = |i: usize| ((i as f64 + 0.5) / n as f64 - 0.5) * scene.wall;
    let pixels: Vec<[Option<SeenPoint>; 2]> = (0..n * n)
        .into_par_iter()
        .map(|k| {
            let from = DVec3::new(at(k / n), at(k % n), 0.0);
            let first = hit(scene, &surfaces, from).and_then(|hit| refine(scene, from, &hit));
            [first, first.and_then(|p| behind(scene, &surfaces, from, p.depth))]
        })
        .collect();
    let layer = |l: usize| Layer {
        albedo: pixels.iter().map(|p| if p[l].is_some() { 1.0 } else { 0.0 }).collect(),
        depth: pixels.iter().map(|p| p[l].map_or(f32::NAN, |p| p.depth as f32)).collect(),
        normal: pixels
            .iter()
            .map(|p| p[l].map_or([f32::NAN; 3], |p| p.normal.as_vec3().to_array()))
            .collect(),
        mask: pixels.iter().map(|p| p[l].is_some()).collect(),
        depth_error: None,
    };
    let (Layer { depth, normal, mask, .. }, second) = (layer(0), layer(1));
    let albedo = pixels.iter().map(|p| p[0].map_or(f32::NAN, |p| p.albedo as f32)).collect();
    let behind = second.mask.contains(&true).then_some(second);
    Ok(Truth { nx: n, ny: n, extent: scene.extent(), depth, normal, mask, albedo: Some(albedo), behind })
}

/// A point of a surface.
#[derive(Clone, Copy)]
struct SeenPoint {
    depth: f64,
    normal: DVec3,
    albedo: f64,
}

/// The first hit along +z.
fn hit(scene: &Scene, surfaces: &Surfaces, from: DVec3) -> Option<Hit> {
    // A ray exactly along an edge may pass between two triangles; a slightly offset ray does not.
    let beside = DVec3::new(1.7e-6, 2.9e-6, 0.0) * scene.wall;
    surfaces.first_hit(from, DVec3::Z).or_else(|| surfaces.first_hit(from + beside, DVec3::Z))
}

/// The next surface that faces the wall, behind the depth `first` on the ray along +z.
fn behind(scene: &Scene, surfaces: &Surfaces, from: DVec3, first: f64) -> Option<SeenPoint> {
    let mut start = first + APART * scene.wall;
    loop {
        let from = from.with_z(start);
        let next = hit(scene, surfaces, from)?;
        let faces = |n: &[DVec3; 3]| n.iter().sum::<DVec3>().z < 0.0;
        if faces(&scene.objects[next.object].mesh.normals[next.triangle]) {
            return refine(scene, from, &next).map(|p| SeenPoint { depth: start + p.depth, ..p });
        }
        // Back of an object: continue beyond it.
        start += next.distance + 1e-6 * scene.wall;
    }
}

/// The point of a hit in double precision, its depth from `from`.
fn refine(scene: &Scene, from: DVec3, hit: &Hit) -> Option<SeenPoint> {
    let mesh = &scene.objects[hit.object].mesh;
    let ([a, b, c], [na, nb, nc]) = (mesh.triangles[hit.triangle], mesh.normals[hit.triangle]);
    let plane = (b - a).cross(c - a);
    let depth = (a - from).dot(plane) / plane.z;
    // The plane's depth is unreliable for triangles seen edge-on.
    let depth = if (depth - hit.distance).abs() < 1e-3 * scene.wall { depth } else { hit.distance };
    let p = from + DVec3::Z * depth;
    let area = plane.length_squared();
    if area == 0.0 {
        return None;
    }
    let (u, v) = ((c - b).cross(p - b).dot(plane) / area, (a - c).cross(p - c).dot(plane) / area);
    let normal = (na * u + nb * v + nc * (1.0 - u - v)).try_normalize().unwrap_or(plane.normalize());
    // Toward the wall, for either winding.
    let normal = if plane.z > 0.0 { -normal } else { normal };
    Some(SeenPoint { depth, normal: towards_wall(normal), albedo: scene.objects[hit.object].albedo })
}

/// A smooth normal at a silhouette may point slightly away from the wall; its z component is then zero.
fn towards_wall(n: DVec3) -> DVec3 {
    if n.z <= 0.0 { n } else { DVec3::new(n.x, n.y, 0.0).try_normalize().unwrap_or(-DVec3::Z) }
}
