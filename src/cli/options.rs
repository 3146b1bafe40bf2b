//! The solvers' options: each overrides the preset or the default, or what a comparison sets for all. Those that
//! both solvers have stand with the paper's.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde::de::DeserializeOwned;
use thirdbounce::solve::{Accumulation, Decay, NoiseTerm, PaperOptions, Sizes, VectorOptions};
use thirdbounce::transport::{Binning, Gradient, Sampling};

/// One of the words that `T` is written as in files.
pub fn word<T: DeserializeOwned + Clone + Send + Sync + 'static>(
    words: &'static [&'static str],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(words).try_map(|w| serde_json::from_value::<T>(serde_json::Value::String(w)))
}

#[derive(Args)]
pub struct PaperArgs {
    /// Lateral pixels of the maps, and voxels of the final grid where no finer surface follows it [default: 128]
    #[arg(long, value_name = "N", help_heading = "Solver")]
    lateral: Option<usize>,
    /// Steps of the optimiser [default: 1000; vector 60, or 80 where laser and sensor point differ]
    #[arg(long, value_name = "N", help_heading = "Solver")]
    iterations: Option<usize>,
    /// Seed of the initial albedo, of the samples and of --subset [default: 0]
    #[arg(long, value_name = "N", help_heading = "Solver")]
    pub seed: Option<u32>,
    /// The same bits on every run of the same seed and device: fixed-point accumulation
    #[arg(long, conflicts_with = "accumulation", help_heading = "Solver")]
    deterministic: bool,
    /// How contributions are added up [default: auto, the fastest of the device]
    #[arg(long, value_name = "HOW",
        value_parser = word::<Accumulation>(&["auto", "float", "fixed", "fixed32", "cas", "owned"]),
        help_heading = "Solver")]
    accumulation: Option<Accumulation>,
    /// How the work is cut: lanes=N,chunk=N,window=N of the forward pass, voxels=N,slices=N of the backward pass
    /// [default: what `profile --tune` has found for this device and kind of scene, else what suits its kind]
    #[arg(long, value_name = "NAME=N,...", help_heading = "Device")]
    sizes: Option<Sizes>,

    /// Adam's step [default: 1]
    #[arg(long, value_name = "X", help_heading = "Optimiser (defaults as published)")]
    learning_rate: Option<f64>,
    /// How the learning rate falls over all iterations [default: none]
    #[arg(long, value_name = "HOW", value_parser = word::<Decay>(&["none", "cosine"]),
        help_heading = "Optimiser (defaults as published)")]
    learning_rate_decay: Option<Decay>,
    /// Decay of Adam's first moment [default: 0.9]
    #[arg(long, value_name = "X", help_heading = "Optimiser (defaults as published)")]
    beta1: Option<f64>,
    /// Decay of Adam's second moment [default: 0.999]
    #[arg(long, value_name = "X", help_heading = "Optimiser (defaults as published)")]
    beta2: Option<f64>,
    /// What keeps Adam from dividing by zero [default: 1e-8]
    #[arg(long, value_name = "X", help_heading = "Optimiser (defaults as published)")]
    epsilon: Option<f64>,
    /// Adam forgets its moments after so many iterations [default: 100]
    #[arg(long, value_name = "N", help_heading = "Optimiser (defaults as published)")]
    restart_every: Option<usize>,
    /// Weight of the L1 term [default: synthetic 0.001, captured 0.8]
    #[arg(long, value_name = "X", help_heading = "Optimiser (defaults as published)")]
    l1: Option<f64>,
    /// The measurement is scaled to this largest value [default: 10]
    #[arg(long, value_name = "X", help_heading = "Optimiser (defaults as published)")]
    peak: Option<f64>,
    /// The albedo starts uniform in 0 to this [default: 1]
    #[arg(long, value_name = "X", help_heading = "Optimiser (defaults as published)")]
    initial_albedo: Option<f64>,

    /// What has a learnt noise weight [default: synthetic off, captured bin]
    #[arg(long, value_name = "WHAT", value_parser = word::<NoiseTerm>(&["off", "bin", "histogram"]),
        help_heading = "Light transport (defaults as published)")]
    noise: Option<NoiseTerm>,
    /// Constant part of the noise term, relative to the peak [default: 0.05]
    #[arg(long, value_name = "X", help_heading = "Light transport (defaults as published)")]
    noise_base: Option<f64>,
    /// Learnt part of the noise term, relative to the peak [default: 0.06]
    #[arg(long, value_name = "X", help_heading = "Light transport (defaults as published)")]
    noise_span: Option<f64>,
    /// Where in its voxel a sample lies: anew at random every iteration, or at the centre [default: continuous]
    #[arg(long, value_name = "HOW", value_parser = word::<Sampling>(&["continuous", "fixed"]),
        help_heading = "Light transport (defaults as published)")]
    sampling: Option<Sampling>,
    /// Into the bin of its path, or shared by the two nearest [default: nearest]
    #[arg(long, value_name = "HOW", value_parser = word::<Binning>(&["nearest", "linear"]),
        help_heading = "Light transport (defaults as published)")]
    binning: Option<Binning>,
    /// Without the distance falloff as published, or exact [default: published]
    #[arg(long, value_name = "WHICH", value_parser = word::<Gradient>(&["published", "exact"]),
        help_heading = "Light transport (defaults as published)")]
    gradient: Option<Gradient>,

    /// Nothing nearer than this is ever active, metres [default: 0.2]
    #[arg(long, value_name = "M", help_heading = "Domain (defaults as published)")]
    min_depth: Option<f64>,
    /// Start at the final resolution instead of the scan's
    #[arg(long, help_heading = "Domain (defaults as published)")]
    no_coarse_to_fine: bool,
    /// Double the lateral resolution after so many iterations [default: 100]
    #[arg(long, value_name = "N", help_heading = "Domain (defaults as published)")]
    double_every: Option<usize>,
    /// Keep all voxels active
    #[arg(long, help_heading = "Domain (defaults as published)")]
    no_reduce: bool,
    /// Reduce the domain after so many iterations [default: 50]
    #[arg(long, value_name = "N", help_heading = "Domain (defaults as published)")]
    reduce_every: Option<usize>,
    /// Keep voxels above this share of the smoothed albedo's maximum [default: 0.05]
    #[arg(long, value_name = "X", help_heading = "Domain (defaults as published)")]
    keep_above: Option<f64>,
    /// Gaussian that smooths the albedo for that, in voxels [default: 3]
    #[arg(long, value_name = "X", help_heading = "Domain (defaults as published)")]
    smooth_sigma: Option<f64>,
    /// Sigmas after which it is cut off [default: 4]
    #[arg(long, value_name = "X", help_heading = "Domain (defaults as published)")]
    smooth_truncate: Option<f64>,
    /// Share of the finest grid that may be active at once; of a larger domain the brightest voxels are kept. More
    /// takes more memory [default: the paper's solver a tenth, at least the first grid; the vector solver a sixteenth,
    /// at least half of it; both at least 262,144 voxels]
    #[arg(long, value_name = "X", help_heading = "Domain (defaults as published)")]
    room: Option<f64>,
}

impl PaperArgs {
    /// The first option given that only the paper's solver has.
    pub fn own(&self) -> Option<&'static str> {
        let given = [
            ("learning-rate", self.learning_rate.is_some()),
            ("learning-rate-decay", self.learning_rate_decay.is_some()),
            ("beta1", self.beta1.is_some()),
            ("beta2", self.beta2.is_some()),
            ("epsilon", self.epsilon.is_some()),
            ("restart-every", self.restart_every.is_some()),
            ("l1", self.l1.is_some()),
            ("initial-albedo", self.initial_albedo.is_some()),
            ("noise", self.noise.is_some()),
            ("noise-base", self.noise_base.is_some()),
            ("noise-span", self.noise_span.is_some()),
            ("sampling", self.sampling.is_some()),
            ("binning", self.binning.is_some()),
            ("gradient", self.gradient.is_some()),
            ("double-every", self.double_every.is_some()),
            ("no-reduce", self.no_reduce),
            ("smooth-sigma", self.smooth_sigma.is_some()),
            ("smooth-truncate", self.smooth_truncate.is_some()),
        ];
        given.into_iter().find(|g| g.1).map(|g| g.0)
    }

    /// These over others.
    pub fn over(&self, base: PaperOptions) -> PaperOptions {
        PaperOptions {
            lateral: self.lateral.unwrap_or(base.lateral),
            iterations: self.iterations.unwrap_or(base.iterations),
            coarse_to_fine: base.coarse_to_fine && !self.no_coarse_to_fine,
            double_every: self.double_every.unwrap_or(base.double_every),
            restart_every: self.restart_every.unwrap_or(base.restart_every),
            reduce: base.reduce && !self.no_reduce,
            reduce_every: self.reduce_every.unwrap_or(base.reduce_every),
            keep_above: self.keep_above.unwrap_or(base.keep_above),
            smooth_sigma: self.smooth_sigma.unwrap_or(base.smooth_sigma),
            smooth_truncate: self.smooth_truncate.unwrap_or(base.smooth_truncate),
            room: self.room.or(base.room),
            min_depth: self.min_depth.unwrap_or(base.min_depth),
            learning_rate: self.learning_rate.unwrap_or(base.learning_rate),
            learning_rate_decay: self.learning_rate_decay.unwrap_or(base.learning_rate_decay),
            beta1: self.beta1.unwrap_or(base.beta1),
            beta2: self.beta2.unwrap_or(base.beta2),
            epsilon: self.epsilon.unwrap_or(base.epsilon),
            l1: self.l1.unwrap_or(base.l1),
            noise: self.noise.unwrap_or(base.noise),
            noise_base: self.noise_base.unwrap_or(base.noise_base),
            noise_span: self.noise_span.unwrap_or(base.noise_span),
            peak: self.peak.unwrap_or(base.peak),
            initial_albedo: self.initial_albedo.unwrap_or(base.initial_albedo),
            sampling: self.sampling.unwrap_or(base.sampling),
            binning: self.binning.unwrap_or(base.binning),
            gradient: self.gradient.unwrap_or(base.gradient),
            reflectance: base.reflectance,
            general: base.general,
            accumulation: match self.accumulation {
                _ if self.deterministic => Accumulation::Fixed,
                Some(given) => given,
                None => base.accumulation,
            },
            sizes: self.sizes.unwrap_or(base.sizes),
            seed: self.seed.unwrap_or(base.seed),
        }
    }
}

#[derive(Args)]
pub struct VectorArgs {
    /// Iterations at each resolution below the last
    #[arg(long, value_name = "N", help_heading = "Vector solver")]
    coarse_iterations: Option<usize>,
    /// Iterations of the surface that the volume's maps begin, after the volume's; 0 leaves the maps as they are [default: 60, or
    /// 100 where laser and sensor point differ]
    #[arg(long, value_name = "N", help_heading = "Vector solver")]
    surface_iterations: Option<usize>,
    /// How many pixels of the surface, and so of the maps, are as wide as a voxel of the finest volume [default: 2 where that
    /// leaves the volume 64 lateral voxels or more, else 1]
    #[arg(long, value_name = "K", help_heading = "Vector solver")]
    pixels_per_voxel: Option<usize>,
    /// Points that a pixel of the surface consists of: 1 or 4 [default: 1 where it is no wider than two bins of path]
    #[arg(long, value_name = "N", help_heading = "Vector solver")]
    surface_points: Option<usize>,
    /// Gaussian over which the surface's residuals are averaged along time at first, as path in pixels of the first grid
    /// [default: 0.4 with the Lambertian model or where laser and sensor point differ, else 0]
    #[arg(long, value_name = "X", help_heading = "Vector solver")]
    surface_blur: Option<f64>,
    /// How much it costs the surface that many pixels are lit instead of few [default: 0.05 with the Lambertian model, 0.02
    /// where laser and sensor point differ, else 0]
    #[arg(long, value_name = "X", help_heading = "Vector solver")]
    surface_sparsity: Option<f64>,
    /// Keep voxels above this share of the first back-projection's maximum
    #[arg(long, value_name = "X", help_heading = "Vector solver")]
    start_above: Option<f64>,
    /// Weight of the group term in standard deviations of the gradient's photon noise
    #[arg(long, value_name = "X", help_heading = "Vector solver")]
    noise_factor: Option<f64>,
    /// Weight of the roughness term: more holds neighbours closer together where photons are few
    #[arg(long, value_name = "X", help_heading = "Vector solver")]
    roughness: Option<f64>,
    /// Iterations at the end in which pairs grow to all; those before take a part of them where there are more than
    /// 1,024
    #[arg(long, value_name = "N", help_heading = "Vector solver")]
    growth_iterations: Option<usize>,
    /// Take all pairs in every iteration, and no grid coarser than the scan
    #[arg(long, help_heading = "Vector solver")]
    all_pairs: bool,
    /// Renew the bounds that steps come from after so many iterations
    #[arg(long, value_name = "N", help_heading = "Vector solver")]
    bound_every: Option<usize>,
    /// Power of a voxel's brightness in the weights of its step's bound: 0 weighs all alike, more lets bright voxels
    /// take longer steps
    #[arg(long, value_name = "X", help_heading = "Vector solver")]
    bound_power: Option<f64>,
    /// Share of the bound that the first step divides by: 1 cannot overshoot, less goes faster
    #[arg(long, value_name = "X", help_heading = "Vector solver")]
    step_share: Option<f64>,
    /// Steepest surface: largest |n_xy| / |n_z|
    #[arg(long, value_name = "X", help_heading = "Vector solver")]
    cone: Option<f64>,
    /// Do not take off the background that is estimated behind the signal
    #[arg(long, help_heading = "Vector solver")]
    no_background: bool,
    /// When to stop: at the noise of the data (auto), or after all iterations (never) [default: auto]
    #[arg(long, value_name = "WHEN", value_parser = ["auto", "never"], help_heading = "Vector solver")]
    stop: Option<String>,
}

impl VectorArgs {
    /// The first option given that only the vector solver has.
    pub fn own(&self) -> Option<&'static str> {
        let given = [
            ("coarse-iterations", self.coarse_iterations.is_some()),
            ("surface-iterations", self.surface_iterations.is_some()),
            ("pixels-per-voxel", self.pixels_per_voxel.is_some()),
            ("surface-points", self.surface_points.is_some()),
            ("surface-blur", self.surface_blur.is_some()),
            ("surface-sparsity", self.surface_sparsity.is_some()),
            ("growth-iterations", self.growth_iterations.is_some()),
            ("all-pairs", self.all_pairs),
            ("start-above", self.start_above.is_some()),
            ("noise-factor", self.noise_factor.is_some()),
            ("roughness", self.roughness.is_some()),
            ("bound-every", self.bound_every.is_some()),
            ("bound-power", self.bound_power.is_some()),
            ("step-share", self.step_share.is_some()),
            ("cone", self.cone.is_some()),
            ("no-background", self.no_background),
            ("stop", self.stop.is_some()),
        ];
        given.into_iter().find(|g| g.1).map(|g| g.0)
    }

    /// These, and what `shared` has for this solver too, over others.
    pub fn over(&self, shared: &PaperArgs, base: VectorOptions) -> VectorOptions {
        VectorOptions {
            lateral: shared.lateral.unwrap_or(base.lateral),
            iterations: shared.iterations.unwrap_or(base.iterations),
            coarse_to_fine: base.coarse_to_fine && !shared.no_coarse_to_fine,
            reduce_every: shared.reduce_every.unwrap_or(base.reduce_every),
            keep_above: shared.keep_above.unwrap_or(base.keep_above),
            min_depth: shared.min_depth.unwrap_or(base.min_depth),
            peak: shared.peak.unwrap_or(base.peak),
            accumulation: match shared.accumulation {
                _ if shared.deterministic => Accumulation::Fixed,
                Some(given) => given,
                None => base.accumulation,
            },
            sizes: shared.sizes.unwrap_or(base.sizes),
            coarse_iterations: self.coarse_iterations.unwrap_or(base.coarse_iterations),
            surface_iterations: self.surface_iterations.unwrap_or(base.surface_iterations),
            pixels_per_voxel: self.pixels_per_voxel.or(base.pixels_per_voxel),
            surface_points: self.surface_points.or(base.surface_points),
            surface_blur: self.surface_blur.unwrap_or(base.surface_blur),
            surface_sparsity: self.surface_sparsity.unwrap_or(base.surface_sparsity),
            growth_iterations: self.growth_iterations.unwrap_or(base.growth_iterations),
            all_pairs: base.all_pairs || self.all_pairs,
            start_above: self.start_above.unwrap_or(base.start_above),
            noise_factor: self.noise_factor.unwrap_or(base.noise_factor),
            roughness: self.roughness.unwrap_or(base.roughness),
            bound_every: self.bound_every.unwrap_or(base.bound_every),
            bound_power: self.bound_power.unwrap_or(base.bound_power),
            step_share: self.step_share.unwrap_or(base.step_share),
            cone: self.cone.unwrap_or(base.cone),
            room: shared.room.or(base.room),
            background: base.background && !self.no_background,
            reflectance: base.reflectance,
            general: base.general,
            stop: self.stop.as_deref().map_or(base.stop, |s| s == "auto"),
        }
    }
}
