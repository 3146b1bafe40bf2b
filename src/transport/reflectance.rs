//! How surfaces reflect.

use serde::{Deserialize, Serialize};

/// How hidden surfaces send light back: what stands beside albedo and falloff (METHOD, light transport).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reflectance {
    /// One cosine, toward the scanned point (the paper).
    Cosine,
    /// Both cosines of the surface and both of the wall: matt surfaces.
    Lambertian,
    /// No cosine, and the root of the falloff: what sends light back to where it came from.
    Retroreflective,
    /// No cosine: albedo only.
    Isotropic,
}

impl Reflectance {
    /// Whether a surface's direction matters.
    pub fn has_normals(self) -> bool {
        matches!(self, Reflectance::Cosine | Reflectance::Lambertian)
    }

    /// As kernels count them (`glsl/include/reflectance.glsl`).
    pub fn number(self) -> u32 {
        self as u32
    }
}
