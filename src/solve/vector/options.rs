//! The vector solver's options.

use crate::Result;
use crate::solve::estimate::MOST_PAIRS;
use crate::solve::option::{Options, options, refused};
use crate::solve::plan::AMPLE;
use crate::solve::surface::SurfaceOptions;
use crate::solve::{Accumulation, Plan, Sizes};
use crate::transport::{HighPass, Reflectance};

/// The least floor of a high-pass. Without one, nothing would say how much slow light there is, and solves would not
/// converge.
pub const LEAST_FLOOR: f64 = 0.1;

options! {
    /// Options of the vector solver.
    pub struct VectorOptions(suit) {
        nested {
            /// The active voxels.
            domain: Domain,
            /// The surface after the volume.
            surface: SurfaceOptions,
        }
        "Solver" {
            /// Lateral pixels of the maps (N of N × N). The finest volume has as many lateral voxels, unless a voxel
            /// has several pixels
            lateral: usize = 128, Range::Count(1, 4096);
            /// Iterations of the optimiser
            // Pairs of two points need more iterations: one fixed point halves the information of a path
            // (docs/scenes.md).
            iterations: usize = if suit.confocal { 60 } else { 80 }, Range::Count(1, 1_000_000);
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
            /// [default: those that `profile --tune` found for this device and kind of scene, else those for the
            /// device's kind]
            #[serde(default)]
            #[serde(skip_serializing_if = "Sizes::is_default")]
            sizes: Sizes = Sizes::default(), Range::Sizes;
        }
        "Optimiser" {
            /// Scale the measurement to this largest value
            peak: f64 = 10.0, Range::Positive;
        }
        "Vector solver" {
            /// Pairs that the last iterations and the surface use, of more if there are; the iterations before them use a
            /// quarter. Volumes of more than 64 lateral voxels use more, in proportion to their area [default: 1,024, or
            /// more where photons are few]
            pairs: usize = suit.pairs, Range::Count(4, MOST_PAIRS);
            /// Iterations at the end that use all these pairs
            growth_iterations: usize = if suit.confocal { 8 } else { 12 }, Range::Count(1, 1_000_000);
            /// Use all pairs in every iteration, and no grid coarser than the scan
            all_pairs: bool = false, Range::Flag;
            /// Let the volume use all bins of the capture, even if they are narrower than its voxels are deep
            all_bins: bool = false, Range::Flag;
            /// Renew the bounds, which give the step lengths, after every N iterations. In between, the domain only
            /// shrinks
            bound_every: usize = 15, Range::Count(1, 1_000_000);
            /// Power of a voxel's expected brightness in the weights of its bound: 0 weights all voxels equally, larger
            /// values give bright voxels longer steps [default: 0.5 where laser and sensor point differ or the volume
            /// has two cosines, else 0]
            // With one cosine in a confocal scan, longer steps would fit the model's error on matt surfaces sooner:
            // normals would get worse and rims darker.
            bound_power: Option<f64> = match (suit.confocal, suit.lambertian()) {
                (false, _) => Some(0.5),
                (true, false) => Some(0.0),
                (true, true) => None,
            }, Range::NotNegative;
            /// The first step is divided by this share of the bound. 1 cannot overshoot. A smaller share is faster, and
            /// it grows when the objective rises
            step_share: f64 = 0.25, Range::Share;
            /// Weight λ of the group term, in standard deviations of the photon noise in a voxel's gradient
            noise_factor: f64 = 3.0, Range::NotNegative;
            /// Weight of the roughness term, which keeps neighbours similar where photons are few
            roughness: f64 = 30.0, Range::NotNegative;
            /// Steepest surface: largest |v_xy| / |v_z|
            cone: f64 = 2.0, Range::Positive;
            /// How surfaces reflect in the volume before the surface, if the model is lambertian: as in the surface
            /// (same), or with one cosine
            // Two cosines fit a skirt of steep, dim voxels around everything, which the surface does not leave
            // (benches/NOTES.md).
            cosine_volume as "volume_model": bool = suit.lambertian(), Range::Words(&["same", "cosine"]);
            /// Reduce the weight of light that changes over more than this length along time, metres of path; 0: all
            /// light has the same weight [default: found by a quick solve, or a tenth of the wall's width]
            high_pass: Option<f64> = None, Range::Length;
            /// Share of the amplitude of constant light that the high-pass keeps
            high_pass_floor: f64 = LEAST_FLOOR, Range::Share;
            /// Subtract the background, estimated from the bins after the signal
            background: bool = true, Range::Flag;
            /// When to stop: at the noise of the data (auto), or after all iterations (never)
            stop: bool = true, Range::Words(&["never", "auto"]);
        }
    }
}

options! {
    /// Which voxels are active.
    pub struct Domain(suit) {
        nested {}
        "Domain" {
            /// Voxels nearer than this are never active, metres [default: 0.2, times the wall's width in metres if that is
            /// below 0.25 or above 8]
            min_depth: f64 = 0.2 * suit.unit, Range::Length;
            /// Start at the scan's resolution, or at 32 lateral voxels if the scan is finer, and double it in steps
            coarse_to_fine: bool = true, Range::Flag;
            /// Reduce the domain after every N iterations
            reduce_every: usize = 5, Range::Count(1, 1_000_000);
            /// Keep voxels above this share of the largest smoothed albedo
            keep_above: f64 = 0.05, Range::Fraction;
            /// Share of the finest grid that may be active at once; of a larger domain, only the brightest voxels are
            /// kept [default: paper a tenth, at least the first grid; vector a sixteenth, at least half of the first
            /// grid; both at least 262,144 voxels]
            room: Option<f64> = None, Range::Share;
        }
        "Vector solver" {
            /// Iterations at each resolution below the last
            coarse_iterations: usize = 15, Range::Count(1, 1_000_000);
            /// Keep voxels above this share of the largest value of the first back-projection
            start_above: f64 = 0.02, Range::Fraction;
        }
    }
}

impl VectorOptions {
    /// Its name on the command line.
    pub const NAME: &'static str = "vector";

    /// Lateral pixels of the maps per lateral voxel of the finest volume.
    pub fn pixels_per_voxel(&self) -> usize {
        let halved = self.lateral.is_multiple_of(2) && self.lateral / 2 >= 2 * AMPLE;
        match self.surface.pixels_per_voxel {
            _ if self.surface.iterations == 0 => 1,
            Some(given) => given,
            None => 1 + usize::from(halved),
        }
    }

    /// The filter of the objective: [`HighPass`].
    pub fn filter(&self) -> Option<HighPass> {
        self.high_pass
            .filter(|length| *length > 0.0)
            .map(|length| HighPass { length, floor: self.high_pass_floor })
    }

    /// The power of a voxel's expected brightness in its bound, in a plan made for these options.
    pub fn bound_power_in(&self, plan: &Plan) -> f64 {
        let two_cosines = plan.scene.volume_reflectance == Reflectance::Lambertian;
        self.bound_power.unwrap_or(if two_cosines { 0.5 } else { 0.0 })
    }

    /// Checks the options.
    ///
    /// # Errors
    /// The first option out of its range, by its name on the command line.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        let wide = self.pixels_per_voxel();
        if wide == 0 || !self.lateral.is_multiple_of(wide) {
            let want = format!("a whole number that divides the lateral pixels, {}", self.lateral);
            return Err(refused("pixels-per-voxel", wide, &want));
        }
        Ok(())
    }
}
