//! How surfaces reflect.

use serde::{Deserialize, Serialize};

use crate::error::{Result, unknown};

/// How hidden surfaces reflect light: the factors of a value besides albedo and falloff.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reflectance {
    /// One cosine, toward the scanned point (the paper).
    Cosine,
    /// Both cosines of the surface and both of the wall: matt surfaces.
    Lambertian,
    /// No cosine, and the root of the falloff: surfaces that send light back to where it came from.
    Retroreflective,
    /// No cosine: albedo only.
    Isotropic,
}

impl Reflectance {
    /// The power of the distance with which a confocal value falls off.
    #[doc(hidden)] // of the objective's weights
    pub fn falloff_power(self) -> i32 {
        if self == Reflectance::Retroreflective { 2 } else { 4 }
    }

    /// All of them.
    pub const ALL: [Reflectance; 4] =
        [Reflectance::Cosine, Reflectance::Lambertian, Reflectance::Retroreflective, Reflectance::Isotropic];

    /// Its name, on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Reflectance::Cosine => "cosine",
            Reflectance::Lambertian => "lambertian",
            Reflectance::Retroreflective => "retroreflective",
            Reflectance::Isotropic => "isotropic",
        }
    }

    /// The reflectance of that name.
    ///
    /// # Errors
    /// The name is not known.
    #[doc(hidden)]
    pub fn named(name: &str) -> Result<Reflectance> {
        let is = |known: &Reflectance| known.name() == name;
        let names = || Self::ALL.map(Reflectance::name);
        Self::ALL.into_iter().find(is).ok_or_else(|| unknown("model", name, &names()))
    }

    /// True if the light depends on the surface's normal.
    pub fn has_normals(self) -> bool {
        matches!(self, Reflectance::Cosine | Reflectance::Lambertian)
    }

    /// The number that kernels use (`glsl/include/reflectance.glsl`).
    #[doc(hidden)]
    pub fn number(self) -> u32 {
        self as u32
    }
}
