//! Options of the surface alone.

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::solve::option::{options, refused, words};
use crate::solve::surface::SurfaceOptions;
use crate::solve::{Accumulation, Sizes, VectorOptions};
use crate::transport::Reflectance;

/// What the surface begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Begin {
    /// The light-cone transform where the capture allows it, else the filtered back-projection.
    Auto,
    /// The light-cone transform.
    Lct,
    /// The filtered back-projection.
    Fbp,
    /// A plane.
    Plane,
}

words!(Begin);

options! {
    /// Options of the surface without a volume before it.
    pub struct SurfaceAloneOptions(suit) {
        nested {
            /// The surface.
            surface: SurfaceOptions,
        }
        "Solver" {
            /// Lateral pixels of the maps (N of N × N)
            lateral: usize = 128, Range::Count(1, 4096);
            /// How rendered values are added up: auto takes the fastest that the device has, repeatable the fastest that
            /// gives the same bits in any order
            accumulation: Accumulation = Accumulation::Auto,
                Range::Words(&["auto", "repeatable", "float", "fixed", "fixed32", "cas", "owned"]);
            /// Use the most general kernels, for comparison: leave nothing out, even if this scene does not need it
            general: bool = false, Range::Flag;
            /// How surfaces reflect
            reflectance: Reflectance = suit.reflectance, Range::Internal;
        }
        "Device" {
            /// Sizes of the work: lanes=N,chunk=N,window=N of the forward pass, voxels=N,slices=N of the backward pass
            #[serde(default)]
            #[serde(skip_serializing_if = "Sizes::is_default")]
            sizes: Sizes = Sizes::default(), Range::Sizes;
        }
        "Optimiser" {
            /// Scale the measurement to this largest value
            peak: f64 = 10.0, Range::Positive;
        }
        "Domain" {
            /// No surface is nearer than this, metres
            min_depth: f64 = 0.2 * suit.unit, Range::Length;
        }
        "Vector solver" {
            /// Subtract the background, estimated from the bins after the signal
            background: bool = true, Range::Flag;
        }
        "Surface alone" {
            /// What the surface begins with: the depths of lct or fbp, or a plane at the depth of the first returns. auto is
            /// lct where the capture allows it, else fbp
            begin: Begin = Begin::Auto, Range::Words(&["auto", "lct", "fbp", "plane"]);
        }
        "Light-cone transform" {
            /// Power of the signal over that of the noise, as the Wiener filter takes it: smaller values blur more. For photon
            /// counts, it is chosen by their noise, at most 0.8
            snr: Option<f64> = (!suit.captured()).then_some(3.0), Range::Positive;
        }
    }
}

impl SurfaceAloneOptions {
    /// Its name on the command line.
    pub const NAME: &'static str = "surface";

    /// The options of a vector solve with this surface: its model and its surface are the same.
    pub(super) fn as_vector(&self) -> VectorOptions {
        VectorOptions::default().with(|o| {
            o.lateral = self.lateral;
            o.accumulation = self.accumulation;
            o.general = self.general;
            o.reflectance = self.reflectance;
            o.sizes = self.sizes;
            o.peak = self.peak;
            o.background = self.background;
            o.domain.min_depth = self.min_depth;
            o.surface = self.surface.clone();
        })
    }

    /// Checks the options.
    ///
    /// # Errors
    /// The first option out of its range, by its name on the command line.
    pub(super) fn check(&self) -> Result<()> {
        if self.surface.iterations == 0 {
            return Err(refused(
                "surface-iterations",
                0,
                "a whole number from 1: there is no volume to keep",
            ));
        }
        crate::solve::option::Options::check_ranges(self)?;
        self.as_vector().check()
    }
}
