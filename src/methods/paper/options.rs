//! The paper solver's options, with the published defaults (ECCV 2024, section 4 and supplementary; published code).

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::engine::Accumulation;
use crate::options::{Options, Preset, SceneTraits, options, refused, words};
use crate::transport::{Binning, Gradient, Reflectance, Sampling};

/// What the noise term has a weight for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NoiseTerm {
    /// Nothing: no noise term.
    Off,
    /// Every bin of every histogram (the published code).
    Bin,
    /// Every histogram (the supplementary material).
    Histogram,
}

/// How the learning rate changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Decay {
    /// It stays (the paper).
    None,
    /// It falls as half a cosine, to zero at the last iteration.
    Cosine,
}

words!(NoiseTerm, Decay);

options! {
    /// Options of the paper's solver.
    pub struct PaperOptions: PaperSettings(scene) {
        nested {
            /// The active voxels.
            domain: Domain / DomainSettings,
            /// The learnt noise term.
            noise: Noise / NoiseSettings,
        }
        "Solver" {
            /// Lateral pixels of the maps, and voxels of the final grid
            lateral: usize = 128, Range::Count(1, 4096);
            /// Iterations of the optimiser
            iterations: usize = 1000, Range::Count(1, 1_000_000);
            /// Seed of the initial albedo, of the samples and of --subset
            seed: u32 = 0, Range::Internal;
            /// How rendered values are added up: auto takes the fastest that the device has, repeatable the fastest that
            /// gives the same bits in any order
            accumulation: Accumulation = Accumulation::Auto,
                Range::Words(&["auto", "repeatable"]);
            /// Use the most general kernels, for comparison: leave nothing out, even if this scene does not need it
            general: bool = false, Range::Flag;
            /// How surfaces reflect
            reflectance: Reflectance = scene.reflectance, Range::Internal;
        }
        "Optimiser" {
            /// Step size of Adam
            learning_rate: f64 = 1.0, Range::Positive;
            /// How the learning rate falls over all iterations
            learning_rate_decay: Decay = Decay::None, Range::Words(&["none", "cosine"]);
            /// Decay of Adam's first moment
            beta1: f64 = 0.9, Range::Fraction;
            /// Decay of Adam's second moment
            beta2: f64 = 0.999, Range::Fraction;
            /// Adam's term that prevents a division by zero
            epsilon: f64 = 1e-8, Range::Positive;
            /// Set Adam's moments to zero after every N iterations
            restart_every: usize = 100, Range::Count(1, 1_000_000);
            /// Weight α of the L1 term
            l1: f64 = if scene.captured() { 0.8 } else { 0.001 }, Range::NotNegative;
            /// Scale the measurement to this largest value
            peak: f64 = 10.0, Range::Positive;
            /// The initial albedo is random, uniform from 0 to this
            initial_albedo: f64 = 1.0, Range::NotNegative;
        }
        "Light transport" {
            /// Position of a sample in its voxel: random in every iteration (continuous), or the centre (fixed)
            sampling: Sampling = Sampling::Continuous, Range::Words(&["continuous", "fixed"]);
            /// Light goes into the bin of its path (nearest), or is shared by the two nearest bins (linear)
            binning: Binning = Binning::Nearest, Range::Words(&["nearest", "linear"]);
            /// The gradient without the distance falloff (published), or exact
            gradient: Gradient = Gradient::Published, Range::Words(&["published", "exact"]);
        }
    }
}

options! {
    /// Which voxels are active.
    pub struct Domain: DomainSettings(scene) {
        nested {}
        "Domain" {
            /// Voxels nearer than this are never active, metres [default: 0.2, times the wall's width in metres if that is
            /// below 0.25 or above 8]
            min_depth: f64 = 0.2 * scene.unit, Range::Length;
            /// Start at the scan's resolution, and double it in steps
            coarse_to_fine: bool = true, Range::Flag;
            /// Double the lateral resolution after every N iterations
            double_every: usize = 100, Range::Count(1, 1_000_000);
            /// Reduce the domain to the bright voxels
            reduce: bool = true, Range::Flag;
            /// Reduce the domain after every N iterations
            reduce_every: usize = 50, Range::Count(1, 1_000_000);
            /// Keep voxels above this share of the largest smoothed albedo
            keep_above: f64 = if scene.confocal { 0.05 } else { 0.03 }, Range::Fraction;
            /// Gaussian that smooths the albedo for the reduction: sigma in voxels
            smooth_sigma: f64 = 3.0, Range::Positive;
            /// The Gaussian is cut off after this many sigmas
            smooth_truncate: f64 = 4.0, Range::Positive;
            /// Share of the finest grid that may be active at once; of a larger domain, only the brightest voxels are
            /// kept [default: a tenth, at least the first grid and 262,144 voxels]
            // All voxels, if the first grid is half of the finest or more, or if doublings come without a reduction.
            room: Option<f64> = None, Range::Share;
        }
    }
}

options! {
    /// The noise term.
    pub struct Noise: NoiseSettings(scene) {
        nested {}
        "Light transport" {
            /// What the noise term has learnt weights for: nothing (off), every bin, or every histogram
            term as "noise": NoiseTerm = if scene.captured() { NoiseTerm::Bin } else { NoiseTerm::Off },
                Range::Words(&["off", "bin", "histogram"]);
            /// Constant part b of the noise term, relative to the peak
            base as "noise_base": f64 = if scene.retroreflective() { 0.004 } else { 0.05 }, Range::NotNegative;
            /// Learnt part λ of the noise term, relative to the peak
            span as "noise_span": f64 = if scene.retroreflective() { 0.0012 } else { 0.06 }, Range::NotNegative;
        }
    }
}

impl PaperOptions {
    /// Its name on the command line.
    pub const NAME: &'static str = "paper";

    /// The published defaults.
    pub fn preset(preset: Preset) -> PaperOptions {
        PaperOptions::defaults_for(&SceneTraits { preset, ..SceneTraits::DEFAULT })
    }

    /// Checks the options.
    ///
    /// # Errors
    /// The first option out of its range, by its name on the command line.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        let Domain { smooth_sigma, smooth_truncate, .. } = self.domain;
        if smooth_sigma * smooth_truncate > 1000.0 {
            let want = "a Gaussian that reaches at most 1000 voxels";
            return Err(refused("smooth_sigma", smooth_sigma, want));
        }
        Ok(())
    }
}
