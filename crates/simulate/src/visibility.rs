//! Shadow rays and first hits, in one bounding volume hierarchy of all objects.

use super::Scene;
use glam::{DVec3, Vec3A};
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::{BvhBuildParams, triangle::Triangle};
use std::time::Duration;

/// The scene's surfaces, prepared for rays.
pub(super) struct Surfaces {
    bvh: Bvh2,
    /// In the order of the hierarchy's leaves, with object and triangle of each.
    triangles: Vec<Triangle>,
    owners: Vec<[usize; 2]>,
    /// Whether the objects hide parts of themselves.
    self_occluding: Vec<bool>,
    /// Distance at which rays start from their surface, metres.
    offset: f64,
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
        let bounds = scene.objects.iter().filter_map(|o| o.mesh.bounds());
        let size = bounds.map(|(lo, hi)| (hi - lo).length().max(hi.length())).fold(0.0, f64::max);
        let objects = || scene.objects.iter().enumerate();
        let owners: Vec<[usize; 2]> =
            objects().flat_map(|(i, o)| (0..o.mesh.triangles.len()).map(move |t| [i, t])).collect();
        let corners = objects().flat_map(|(_, o)| &o.mesh.triangles).map(|t| t.map(single));
        let triangles: Vec<Triangle> = corners.map(|[v0, v1, v2]| Triangle { v0, v1, v2 }).collect();
        let bvh = match triangles.is_empty() {
            true => Bvh2::default(),
            false => build_bvh2_from_tris(&triangles, BvhBuildParams::fast_build(), &mut Duration::default()),
        };
        let order = || bvh.primitive_indices.iter().map(|&i| i as usize);
        Surfaces {
            triangles: order().map(|i| triangles[i]).collect(),
            owners: order().map(|i| owners[i]).collect(),
            bvh,
            self_occluding: scene.objects.iter().map(|o| o.mesh.self_occluding).collect(),
            offset: 2e-5 * size,
        }
    }

    /// Whether no surface lies between `from`, a point of `object` with outward normal `normal`, and `to`.
    pub fn visible(&self, from: DVec3, normal: DVec3, object: usize, to: DVec3) -> bool {
        let start = from + normal * self.offset;
        let ray = Ray::new(single(start), single(to - start), 0.0, 1.0);
        let ignored = if self.self_occluding[object] { usize::MAX } else { object };
        self.bvh.ray_traverse_miss(ray, |ray, id| match self.owners[id][0] == ignored {
            true => f32::INFINITY,
            false => self.triangles[id].intersect(ray),
        })
    }

    /// The first hit of the ray from `from` along `direction`.
    pub fn first_hit(&self, from: DVec3, direction: DVec3) -> Option<Hit> {
        let mut hit = RayHit::none();
        let ray = Ray::new_inf(single(from), single(direction));
        self.bvh.ray_traverse(ray, &mut hit, |ray, id| self.triangles[id].intersect(ray));
        let [object, triangle] = *self.owners.get(hit.primitive_id as usize)?;
        Some(Hit { object, triangle, distance: f64::from(hit.t) })
    }
}

fn single(p: DVec3) -> Vec3A {
    Vec3A::new(p.x as f32, p.y as f32, p.z as f32)
}
