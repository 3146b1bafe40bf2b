//! Options of the surface solver.

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::engine::Accumulation;
use crate::engine::noise::MOST_PAIRS;
use crate::learned::PIXELS;
use crate::options::{Options, options, words};
use crate::transport::{Grid, HighPass, Reflectance};

/// The least floor of a high-pass. With none, the amount of slowly changing light would be undetermined.
pub const LEAST_FLOOR: f64 = 0.1;

/// What initialises the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Begin {
    /// The network where it sees a surface; else the light-cone transform where the capture allows it, and the filtered
    /// back-projection where it does not.
    Auto,
    /// The network.
    Learned,
    /// The light-cone transform.
    Lct,
    /// The filtered back-projection.
    Fbp,
    /// A plane at the depth of the first returns.
    Plane,
}

words!(Begin);

options! {
    /// Options of the surface solver.
    pub struct SurfaceOptions: SurfaceSettings(scene) {
        nested {}
        "Solver" {
            /// Lateral pixels of the maps (N of N × N)
            lateral: usize = 128, Range::Count(1, 4096);
            /// Iterations at the resolution of the maps, after those that find the support
            iterations: usize = 60, Range::Count(1, 1_000_000);
            /// How rendered values are added up: auto takes the fastest that the device has, repeatable the fastest that
            /// gives the same bits in any order
            accumulation: Accumulation = Accumulation::Auto,
                Range::Words(&["auto", "repeatable"]);
            /// Use the most general kernels, for comparison: leave nothing out, even if this scene does not need it
            general: bool = false, Range::Flag;
            /// How surfaces reflect
            reflectance: Reflectance = scene.reflectance, Range::Internal;
        }
        "Domain" {
            /// No surface is nearer than this, metres
            min_depth: f64 = scene.near(), Range::Length;
        }
        "Surface" {
            /// What initialises the surface: learned (a network that looks at back-projections), lct, fbp, or a plane at the
            /// depth of the first returns. auto is learned where the network sees a surface, else lct or fbp
            begin: Begin = Begin::Auto, Range::Words(&["auto", "learned", "lct", "fbp", "plane"]);
            /// Support of the surface: auto grows and shrinks it by the evidence of the data, fixed keeps the pixels that
            /// the closed form shows
            grow as "support": bool = true, Range::Words(&["fixed", "auto"]);
            /// Largest number of laser-sensor pairs that the fit uses [default: 4,096, or more where photons are few]
            pairs: usize = scene.pairs, Range::Count(4, MOST_PAIRS);
            /// Points that render a pixel: 1 or 4 [default: 1 if a pixel is no wider than 2.2 bins of path, else 4]
            points: Option<usize> = None, Range::OneOf(&[1, 4]);
            /// Reduce the weight of light that changes over more than this length along time, metres of path; 0: all
            /// light has the same weight [default: estimated]
            high_pass: Option<f64> = None, Range::Length;
            /// Share of the amplitude of constant light that the high-pass keeps
            high_pass_floor: f64 = LEAST_FLOOR, Range::Share;
            /// Weight of the term that gathers the light in few pixels, as a share of the data that the surface
            /// explains. The term is the mean of log(1 + 10 a / a_max) / 10 over albedos a
            sparsity: f64 = 0.05, Range::NotNegative;
            /// Subtract the background, estimated from the bins after the signal
            background: bool = true, Range::Flag;
        }
    }
}

impl SurfaceOptions {
    /// Its name on the command line.
    pub const NAME: &'static str = "surface";

    /// The high-pass of the objective; `None` if it changes nothing.
    pub fn filter(&self) -> Option<HighPass> {
        let HighPass { length, floor } = HighPass { length: self.high_pass?, floor: self.high_pass_floor };
        (length > 0.0 && floor < 1.0).then_some(HighPass { length, floor })
    }

    /// Whether the network may have the last word on a fit on this grid: on maps as it was trained on, which began with what the first
    /// network sees. Without trials (`is_tried`) they do only where that is asked for.
    pub(super) fn concludes(&self, grid: &Grid, is_tried: bool) -> bool {
        let is_seen = self.begin == Begin::Learned || self.begin == Begin::Auto && is_tried;
        is_seen && [grid.n[0], grid.n[1]] == [PIXELS; 2]
    }

    /// Checks the options.
    ///
    /// # Errors
    /// The first option out of its range, by its name on the command line.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.filter().is_some() && self.high_pass_floor < LEAST_FLOOR {
            return Err(crate::options::refused(
                "high_pass_floor",
                self.high_pass_floor,
                &format!("a share from {LEAST_FLOOR} to 1"),
            ));
        }
        Ok(())
    }
}
