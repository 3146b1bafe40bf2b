//! Shadow rays and first hits, one bounding volume hierarchy per object.

use super::{Mesh, Scene};
use glam::{DVec3, Vec3A};
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::{BvhBuildParams, triangle::Triangle};
use std::time::Duration;

/// The scene's surfaces, prepared for rays.
pub(super) struct Surfaces {
    objects: Vec<Surface>,
    /// Distance at which rays start from their surface, metres.
    offset: f64,
}

struct Surface {
    bvh: Bvh2,
    /// In the order of the hierarchy's leaves.
    triangles: Vec<Triangle>,
    self_occluding: bool,
}

/// First triangle hit by a ray.
pub(super) struct Hit {
    pub object: usize,
    pub triangle: usize,
    /// Distance in units of the ray's direction, single precision.
    pub distance: f64,
}

impl Surfaces {
    pub fn new(scene: &Scene) -> Surfaces {
        let objects: Vec<Surface> = scene.objects.iter().map(|o| Surface::new(&o.mesh)).collect();
        let bounds = scene.objects.iter().filter_map(|o| o.mesh.bounds());
        let size = bounds.map(|(lo, hi)| (hi - lo).length().max(hi.length())).fold(0.0, f64::max);
        Surfaces { objects, offset: 2e-5 * size }
    }

    /// Whether no surface lies between `from`, a point of `object` with outward normal `normal`, and `to`.
    pub fn visible(&self, from: DVec3, normal: DVec3, object: usize, to: DVec3) -> bool {
        let mut ray = None;
        for (i, surface) in self.objects.iter().enumerate() {
            if surface.triangles.is_empty() || (i == object && !surface.self_occluding) {
                continue;
            }
            let ray = *ray.get_or_insert_with(|| {
                let start = from + normal * self.offset;
                Ray::new(single(start), single(to - start), 0.0, 1.0)
            });
            if !surface.bvh.ray_traverse_miss(ray, |ray, id| surface.triangles[id].intersect(ray)) {
                return false;
            }
        }
        true
    }

    /// The first hit of the ray from `from` along `direction`.
    pub fn first_hit(&self, from: DVec3, direction: DVec3) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        for (object, surface) in self.objects.iter().enumerate() {
            if surface.triangles.is_empty() {
                continue;
            }
            let mut hit = RayHit::none();
            let ray = Ray::new_inf(single(from), single(direction));
            surface.bvh.ray_traverse(ray, &mut hit, |ray, id| surface.triangles[id].intersect(ray));
            let distance = hit.t as f64;
            if distance.is_finite() && nearest.as_ref().is_none_or(|n| distance < n.distance) {
                let triangle = surface.bvh.primitive_indices[hit.primitive_id as usize] as usize;
                nearest = Some(Hit { object, triangle, distance });
            }
        }
        nearest
    }
}

impl Surface {
    fn new(mesh: &Mesh) -> Surface {
        let [v0, v1, v2] = [0, 1, 2].map(|k| move |t: &[DVec3; 3]| single(t[k]));
        let mut triangles: Vec<Triangle> =
            mesh.triangles.iter().map(|t| Triangle { v0: v0(t), v1: v1(t), v2: v2(t) }).collect();
        let mut bvh = Bvh2::default();
        if !triangles.is_empty() {
            bvh = build_bvh2_from_tris(&triangles, BvhBuildParams::fast_build(), &mut Duration::default());
            triangles = bvh.primitive_indices.iter().map(|&i| triangles[i as usize]).collect();
        }
        Surface { bvh, triangles, self_occluding: mesh.self_occluding }
    }
}

fn single(p: DVec3) -> Vec3A {
    Vec3A::new(p.x as f32, p.y as f32, p.z as f32)
}
