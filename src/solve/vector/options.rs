//! The vector solver's options.

use crate::Result;
use crate::solve::option::{Options, options, refused};
use crate::solve::plan::AMPLE;
use crate::solve::surface::SurfaceOptions;
use crate::solve::{Accumulation, Sizes};
use crate::transport::Reflectance;

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
            /// Lateral pixels of the maps (N of N × N), and lateral voxels of the finest volume unless pixels are finer
            lateral: usize = 128, Range::Count(1, 4096);
            /// Iterations of the optimiser
            // Where laser and sensor point differ, half of a path moves, and so half as fast (docs/scenes.md).
            iterations: usize = if suit.confocal { 60 } else { 80 }, Range::Count(1, 1_000_000);
            /// How rendered values are added up: auto takes the fastest that the device has
            accumulation: Accumulation = Accumulation::Auto,
                Range::Words(&["auto", "float", "fixed", "fixed32", "cas", "owned"]);
            /// Leave nothing out that this scene does not need: the most general kernels, to compare with
            general: bool = false, Range::Flag;
            /// How surfaces reflect
            reflectance: Reflectance = suit.reflectance, Range::Internal;
        }
        "Device" {
            /// Sizes of the work: lanes=N,chunk=N,window=N of the forward pass, voxels=N,slices=N of the backward pass
            /// [default: as found by `profile --tune` for this device and kind of scene, else by its kind]
            #[serde(default)]
            #[serde(skip_serializing_if = "Sizes::is_default")]
            sizes: Sizes = Sizes::default(), Range::Sizes;
        }
        "Optimiser" {
            /// The measurement is scaled to this largest value
            peak: f64 = 10.0, Range::Positive;
        }
        "Vector solver" {
            /// Iterations at the end in which the pairs grow fourfold until all are used; those before use a part of them
            /// if there are more than 1,024
            growth_iterations: usize = if suit.confocal { 30 } else { 40 }, Range::Count(1, 1_000_000);
            /// Use all pairs in every iteration, and no grid coarser than the scan
            all_pairs: bool = false, Range::Flag;
            /// Renew the bounds that give the steps after every N iterations; between, the domain may only shrink
            bound_every: usize = 15, Range::Count(1, 1_000_000);
            /// Power of a voxel's expected brightness in the weights of its bound: 0 weighs all voxels alike, more gives bright
            /// voxels longer steps
            // The cosine model of a confocal scan of matt surfaces would fit its own error sooner, and normals get worse.
            bound_power: f64 = if !suit.confocal || suit.lambertian() { 0.5 } else { 0.0 }, Range::NotNegative;
            /// Share of the bound that the first step divides by: 1 cannot overshoot, less is faster and grows when the
            /// objective rises
            step_share: f64 = 0.25, Range::Share;
            /// Weight λ of the group term, in standard deviations of the photon noise in a voxel's gradient
            noise_factor: f64 = 3.0, Range::NotNegative;
            /// Weight of the roughness term, which holds neighbours together where photons are few
            roughness: f64 = 30.0, Range::NotNegative;
            /// Steepest surface: largest |v_xy| / |v_z|
            cone: f64 = 2.0, Range::Positive;
            /// Subtract the background estimated after the signal
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
            /// Nothing nearer than this is ever active, metres
            min_depth: f64 = 0.2, Range::NotNegative;
            /// Start at the scan's resolution, or at 32 lateral voxels if it is finer, and double
            coarse_to_fine: bool = true, Range::Flag;
            /// Reduce the domain after every N iterations
            reduce_every: usize = 5, Range::Count(1, 1_000_000);
            /// Keep voxels above this share of the largest smoothed albedo
            keep_above: f64 = 0.05, Range::Fraction;
            /// Share of the finest grid that may be active at once: of a larger domain the brightest voxels are kept
            /// [default: paper a tenth, at least the first grid; vector a sixteenth, at least half of it; both at least 262,144
            /// voxels]
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

    /// Pixels of the maps side by side in a voxel of the finest volume.
    pub fn pixels_per_voxel(&self) -> usize {
        let halved = self.lateral.is_multiple_of(2) && self.lateral / 2 >= 2 * AMPLE;
        match self.surface.pixels_per_voxel {
            _ if self.surface.iterations == 0 => 1,
            Some(given) => given,
            None => 1 + usize::from(halved),
        }
    }

    /// Checks the options.
    ///
    /// # Errors
    /// The first option that makes no sense, by its name on the command line.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        let wide = self.pixels_per_voxel();
        if wide == 0 || !self.lateral.is_multiple_of(wide) {
            let want = format!("a whole number that divides {} (--lateral)", self.lateral);
            return Err(refused("pixels-per-voxel", wide, &want));
        }
        Ok(())
    }
}
