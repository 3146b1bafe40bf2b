//! Triangle meshes with a normal per corner, and their placement.

use crate::{Error, Result};
use glam::{DMat3, DVec3, EulerRot};

/// Triangles in metres, one-sided: counter-clockwise seen from the outside.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Corners per triangle, in metres.
    pub triangles: Vec<[DVec3; 3]>,
    /// Unit shading normals per corner, same length as `triangles`.
    pub normals: Vec<[DVec3; 3]>,
    /// True if a part of the mesh can occlude another part that faces the same wall point. False for convex solids
    /// and flat shapes, which need no shadow rays against themselves.
    pub self_occluding: bool,
}

/// Where the mesh of a file is.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshPlace {
    /// Where the file has it.
    OfFile,
    /// Turned so that its +z side faces the wall, and its centre at (0, 0, 0.8 m).
    Centred,
}

/// Placement of a mesh in the scene, applied in the order: fit, rotate, translate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Length of the largest side of the bounding box after scaling, metres, centred at the origin.
    pub fit: Option<f64>,
    /// Scale about the origin, after `fit`.
    pub scale: f64,
    /// Rotations about x, y, z in degrees, applied in this order.
    pub rotate: [f64; 3],
    /// Shift in metres.
    pub translate: DVec3,
}

impl Default for Placement {
    /// Identity placement.
    fn default() -> Self {
        Placement { fit: None, scale: 1.0, rotate: [0.0; 3], translate: DVec3::ZERO }
    }
}

impl Mesh {
    /// Unit geometric normal of triangle `i`; zero if the triangle has no area.
    pub fn geometric_normal(&self, i: usize) -> DVec3 {
        let [a, b, c] = self.triangles[i];
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Area of triangle `i` in square metres.
    pub fn area(&self, i: usize) -> f64 {
        let [a, b, c] = self.triangles[i];
        0.5 * (b - a).cross(c - a).length()
    }

    /// Area of all triangles in square metres.
    pub fn total_area(&self) -> f64 {
        (0..self.triangles.len()).map(|i| self.area(i)).sum()
    }

    /// Lowest and highest corner of the bounding box; `None` for an empty mesh.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut corners = self.triangles.iter().flatten().copied();
        let first = corners.next()?;
        Some(corners.fold((first, first), |(lo, hi), p| (lo.min(p), hi.max(p))))
    }

    /// The mesh shifted by `offset` metres.
    pub fn translated(mut self, offset: DVec3) -> Mesh {
        self.triangles.iter_mut().flatten().for_each(|p| *p += offset);
        self
    }

    /// The mesh after `placement`.
    ///
    /// # Errors
    /// A fit, scale, rotation or shift that is not finite, or a fit or scale that is not positive.
    pub fn placed(mut self, placement: &Placement) -> Result<Mesh> {
        let Placement { fit, scale, rotate, translate } = *placement;
        let positive = |v: f64| v.is_finite() && v > 0.0;
        if !positive(scale) || fit.is_some_and(|f| !positive(f)) {
            return Err(Error::options(
                format!("the mesh's scale {scale} or fit {fit:?} is not a positive number"),
                "give a scale above 0, or the size in metres to fit the mesh to",
            ));
        }
        if !rotate.iter().all(|a| a.is_finite()) || !translate.is_finite() {
            return Err(Error::options(
                format!("the mesh's rotation {rotate:?} or shift {translate} is not finite"),
                "give rotations in degrees and shifts in metres",
            ));
        }
        let (mut factor, mut centre) = (scale, DVec3::ZERO);
        if let (Some(size), Some((lo, hi))) = (fit, self.bounds()) {
            let extent = (hi - lo).max_element();
            if extent > 0.0 {
                factor *= size / extent;
                centre = 0.5 * (lo + hi);
            }
        }
        let [rx, ry, rz] = rotate.map(f64::to_radians);
        let turn = DMat3::from_euler(EulerRot::ZYX, rz, ry, rx);
        self.triangles.iter_mut().flatten().for_each(|p| *p = turn * ((*p - centre) * factor) + translate);
        self.normals.iter_mut().flatten().for_each(|n| *n = turn * *n);
        Ok(self)
    }

    /// Adds the triangles of `other`.
    pub fn extend(&mut self, other: Mesh) {
        self.triangles.extend(other.triangles);
        self.normals.extend(other.normals);
        self.self_occluding |= other.self_occluding;
    }

    /// Adds a triangle, wound to face along its normals. Degenerate triangles are dropped.
    pub(super) fn push(&mut self, [a, b, c]: [DVec3; 3], [na, nb, nc]: [DVec3; 3]) {
        let cross = (b - a).cross(c - a);
        if cross.length_squared() < 1e-24 * (b - a).length_squared().max((c - a).length_squared()) {
            return;
        }
        if cross.dot(na + nb + nc) >= 0.0 {
            self.triangles.push([a, b, c]);
            self.normals.push([na, nb, nc]);
        } else {
            self.triangles.push([a, c, b]);
            self.normals.push([na, nc, nb]);
        }
    }
}
