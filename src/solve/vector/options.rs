//! Everything the vector solver can be told, and what suits which scenes.

use serde::{Deserialize, Serialize};

use crate::solve::plan::AMPLE;
use crate::solve::{Accumulation, Sizes};
use crate::transport::Reflectance;
use crate::{Error, Result};

/// Everything the vector solver can be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VectorOptions {
    /// Lateral pixels of the maps (N of N × N), and lateral voxels of the finest volume where no surface is made of it or
    /// [`Self::pixels_per_voxel`] is one.
    pub lateral: usize,
    pub iterations: usize,
    /// Start at the scan's resolution, or at 32 lateral voxels where it is finer, and double; or start at `lateral`.
    pub coarse_to_fine: bool,
    /// Iterations at each resolution below the last.
    pub coarse_iterations: usize,
    /// Iterations of the surface that the volume's maps begin, after those of the volume; none leaves the maps as they are.
    pub surface_iterations: usize,
    /// How many pixels of the surface, and so of the maps, are as wide as a voxel of the finest volume. `None`: two, where
    /// that leaves the volume 64 lateral voxels or more, else one.
    pub pixels_per_voxel: Option<usize>,
    /// Points that a pixel of the surface consists of, 1 or 4. `None`: 1 where it is no wider than two bins of path.
    pub surface_points: Option<usize>,
    /// Gaussian over which the surface's residuals are averaged along time at first, as path in pixels of the first grid, or of
    /// one with 32 a side where that is coarser; 0 leaves it out. It narrows to nothing in half of the iterations.
    pub surface_blur: f64,
    /// Weight of the term by which the surface's light gathers in few pixels, the mean over them of log(1 + 10 a / a_max) / 10
    /// for albedos a, as a share of what it explains of the data; 0 leaves it out.
    pub surface_sparsity: f64,
    /// Iterations at the end in which the pairs grow fourfold until they are all, where the others have a part of them.
    pub growth_iterations: usize,
    /// All pairs in every iteration, and no level coarser than the scan.
    pub all_pairs: bool,
    pub reduce_every: usize,
    /// Renew the bounds that steps come from after so many iterations; between, the domain may only shrink.
    pub bound_every: usize,
    /// Power of a voxel's expected brightness in the weights of the bound: 0 weighs all alike, more lets bright voxels
    /// take longer steps and dim ones shorter.
    pub bound_power: f64,
    /// Share of the bound that the first step divides by. 1 cannot overshoot; less goes faster, and grows where the
    /// objective rises.
    pub step_share: f64,
    /// Keep voxels above this share of the smoothed albedo's maximum.
    pub keep_above: f64,
    /// The same for the back-projection that the first domain is taken from.
    pub start_above: f64,
    /// λ in standard deviations of the photon noise in a voxel's gradient.
    pub noise_factor: f64,
    /// Weight of the roughness term, which holds neighbours together as λ² does.
    pub roughness: f64,
    /// Largest |v_xy| / |v_z| of a surface.
    pub cone: f64,
    pub reflectance: Reflectance,
    /// Leave nothing out: every pair with two points, normals of every wall.
    pub general: bool,
    /// Subtract the background estimated behind the signal.
    pub background: bool,
    /// Share of the finest grid that may be active at once, as memory has room; of a larger domain the brightest are kept.
    /// `None`: a sixteenth, and at least half of the first grid or 262,144 voxels.
    pub room: Option<f64>,
    /// Stop once what is left of the data is no more than its noise.
    pub stop: bool,
    /// Nothing nearer than this is ever active, metres.
    pub min_depth: f64,
    /// The measurement is scaled so that this is its largest value.
    pub peak: f64,
    pub accumulation: Accumulation,
    /// Sizes of workgroups and the like, instead of those that suit the kind of device.
    #[serde(default, skip_serializing_if = "Sizes::is_default")]
    pub sizes: Sizes,
}

impl Default for VectorOptions {
    fn default() -> VectorOptions {
        VectorOptions {
            lateral: 128,
            iterations: 60,
            coarse_to_fine: true,
            coarse_iterations: 15,
            surface_iterations: 60,
            pixels_per_voxel: None,
            surface_points: None,
            surface_blur: 0.0,
            surface_sparsity: 0.0,
            growth_iterations: 30,
            all_pairs: false,
            reduce_every: 5,
            bound_every: 15,
            bound_power: 0.0,
            step_share: 0.25,
            keep_above: 0.05,
            start_above: 0.02,
            noise_factor: 3.0,
            roughness: 30.0,
            cone: 2.0,
            reflectance: Reflectance::Cosine,
            general: false,
            background: true,
            room: None,
            stop: true,
            min_depth: 0.2,
            peak: 10.0,
            accumulation: Accumulation::Auto,
            sizes: Sizes::default(),
        }
    }
}

/// Iterations where laser and sensor point differ: half of a path moves, and so half as fast (docs/scenes.md).
const ITERATIONS_OF_TWO_POINTS: usize = 80;

/// And those of the surface.
const SURFACE_OF_TWO_POINTS: usize = 100;

/// And of the volume's the last, in which pairs grow.
const GROWTH_OF_TWO_POINTS: usize = 40;

/// Power of the bound's weights where the model is right for the scene, or iterations are many. The cosine model of a
/// confocal scan of matt surfaces fits its own error sooner, too, and normals get worse.
const BOUND_POWER: f64 = 0.5;

/// What helps a surface there to find its place, and a wrong model to be fitted (docs/surface.md).
const SURFACE_BLUR: f64 = 0.4;
const SURFACE_SPARSITY: f64 = 0.02;
const SURFACE_SPARSITY_OF_LAMBERTIAN: f64 = 0.05;

impl VectorOptions {
    /// These with what suits other scenes.
    pub fn suited(mut self, confocal: bool, reflectance: Reflectance) -> VectorOptions {
        self.reflectance = reflectance;
        if !confocal {
            self.iterations = ITERATIONS_OF_TWO_POINTS;
            self.growth_iterations = GROWTH_OF_TWO_POINTS;
            self.surface_iterations = SURFACE_OF_TWO_POINTS;
        }
        if !confocal || reflectance == Reflectance::Lambertian {
            self.bound_power = BOUND_POWER;
            self.surface_blur = SURFACE_BLUR;
            self.surface_sparsity = SURFACE_SPARSITY;
        }
        if reflectance == Reflectance::Lambertian {
            self.surface_sparsity = SURFACE_SPARSITY_OF_LAMBERTIAN;
        }
        self
    }

    /// How many pixels of the maps are as wide as a voxel of the finest volume.
    pub fn pixels_per_voxel(&self) -> usize {
        let halved = self.lateral.is_multiple_of(2) && self.lateral / 2 >= 2 * AMPLE;
        match self.pixels_per_voxel {
            _ if self.surface_iterations == 0 => 1,
            Some(given) => given,
            None => 1 + usize::from(halved),
        }
    }

    /// Errors: the first option that makes no sense, by its name on the command line.
    pub fn check(&self) -> Result<()> {
        let bad = |option: &str, value: String, want: &str| {
            Err(Error::options(format!("--{option} is {value}"), format!("give {want}")))
        };
        for (name, value, most) in [
            ("lateral", self.lateral, 4096),
            ("iterations", self.iterations, 1_000_000),
            ("coarse-iterations", self.coarse_iterations, 1_000_000),
            ("growth-iterations", self.growth_iterations, 1_000_000),
            ("reduce-every", self.reduce_every, 1_000_000),
            ("bound-every", self.bound_every, 1_000_000),
        ] {
            if value == 0 || value > most {
                return bad(name, value.to_string(), &format!("a whole number from 1 to {most}"));
            }
        }
        for (name, value) in [("cone", self.cone), ("peak", self.peak), ("step-share", self.step_share)] {
            if !(value.is_finite() && value > 0.0) {
                return bad(name, value.to_string(), "a positive number");
            }
        }
        if self.step_share > 1.0 {
            return bad("step-share", self.step_share.to_string(), "a positive number up to 1");
        }
        for (name, value) in [
            ("bound-power", self.bound_power),
            ("surface-blur", self.surface_blur),
            ("surface-sparsity", self.surface_sparsity),
            ("noise-factor", self.noise_factor),
            ("roughness", self.roughness),
            ("min-depth", self.min_depth),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return bad(name, value.to_string(), "zero or a positive number");
            }
        }
        if self.surface_iterations > 1_000_000 {
            let most = "a whole number from 0 to 1000000";
            return bad("surface-iterations", self.surface_iterations.to_string(), most);
        }
        let wide = self.pixels_per_voxel();
        if wide == 0 || !self.lateral.is_multiple_of(wide) {
            let want = format!("a whole number that divides {} (--lateral)", self.lateral);
            return bad("pixels-per-voxel", wide.to_string(), &want);
        }
        if let Some(points) = self.surface_points.filter(|p| ![1, 4].contains(p)) {
            return bad("surface-points", points.to_string(), "1 or 4");
        }
        if let Some(room) = self.room.filter(|r| !(*r > 0.0 && *r <= 1.0)) {
            return bad("room", room.to_string(), "a positive number up to 1");
        }
        for (name, value) in [("keep-above", self.keep_above), ("start-above", self.start_above)] {
            if !(0.0..1.0).contains(&value) {
                return bad(name, value.to_string(), "a number from 0 to below 1");
            }
        }
        Ok(())
    }
}
