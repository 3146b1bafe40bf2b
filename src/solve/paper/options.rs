//! The paper solver's settings and its two published sets.

use serde::{Deserialize, Serialize};

use crate::solve::{Accumulation, Sizes};
use crate::transport::{Binning, Gradient, Reflectance, Sampling};
use crate::{Error, Result};

/// A published set of parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Rendered histograms: α = 0.001, no noise term.
    Synthetic,
    /// Captured histograms: α = 0.8 and the noise term.
    Captured,
}

/// What the noise term has a weight for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NoiseTerm {
    Off,
    /// One weight per bin of every histogram (the published code).
    Bin,
    /// One weight per histogram (the supplementary material).
    Histogram,
}

/// What becomes of the learning rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Decay {
    /// It stays (the paper).
    None,
    /// It falls as half a cosine, to nothing at the last iteration.
    Cosine,
}

/// Everything the paper's solver can be told. [`PaperOptions::preset`] gives the published values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PaperOptions {
    /// Lateral voxels of the final grid (N of N × N × Z).
    pub lateral: usize,
    pub iterations: usize,
    /// Start at the scan's resolution and double, or start at `lateral`.
    pub coarse_to_fine: bool,
    pub double_every: usize,
    /// Adam forgets its moments after so many iterations.
    pub restart_every: usize,
    /// Prune the domain at all.
    pub reduce: bool,
    pub reduce_every: usize,
    /// Keep voxels above this share of the smoothed albedo's maximum.
    pub keep_above: f64,
    /// Gaussian of the reduction, in voxels.
    pub smooth_sigma: f64,
    /// The Gaussian is cut off after so many sigmas.
    pub smooth_truncate: f64,
    /// Share of the finest grid that may be active at once, as memory has room, and no less than the first grid; of a larger
    /// domain the brightest are kept. `None`: a tenth, and at least the first grid or 262,144 voxels; all where that is half of
    /// it or more, or doublings come without a reduction.
    pub room: Option<f64>,
    /// Nothing nearer than this is ever active, metres.
    pub min_depth: f64,
    pub learning_rate: f64,
    pub learning_rate_decay: Decay,
    pub beta1: f64,
    pub beta2: f64,
    pub epsilon: f64,
    /// Weight α of the L1 term.
    pub l1: f64,
    pub noise: NoiseTerm,
    /// Constant part b of the noise term, relative to the peak.
    pub noise_base: f64,
    /// Learnt part λ of the noise term, relative to the peak.
    pub noise_span: f64,
    /// The measurement is scaled so that this is its largest value.
    pub peak: f64,
    /// Initial albedo is uniform in [0, this).
    pub initial_albedo: f64,
    pub sampling: Sampling,
    pub binning: Binning,
    pub gradient: Gradient,
    pub reflectance: Reflectance,
    /// Leave nothing out: every pair with two points, normals of every wall.
    pub general: bool,
    pub accumulation: Accumulation,
    /// Sizes of workgroups and the like, instead of those that suit the kind of device.
    #[serde(default, skip_serializing_if = "Sizes::is_default")]
    pub sizes: Sizes,
    pub seed: u32,
}

impl PaperOptions {
    /// The published defaults (ECCV 2024, section 4 and supplementary; published code).
    pub fn preset(preset: Preset) -> PaperOptions {
        let captured = preset == Preset::Captured;
        PaperOptions {
            lateral: 128,
            iterations: 1000,
            coarse_to_fine: true,
            double_every: 100,
            restart_every: 100,
            reduce: true,
            reduce_every: 50,
            keep_above: 0.05,
            smooth_sigma: 3.0,
            smooth_truncate: 4.0,
            room: None,
            min_depth: 0.2,
            learning_rate: 1.0,
            learning_rate_decay: Decay::None,
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-8,
            l1: if captured { 0.8 } else { 0.001 },
            noise: if captured { NoiseTerm::Bin } else { NoiseTerm::Off },
            noise_base: 0.05,
            noise_span: 0.06,
            peak: 10.0,
            initial_albedo: 1.0,
            sampling: Sampling::Continuous,
            binning: Binning::Nearest,
            gradient: Gradient::Published,
            reflectance: Reflectance::Cosine,
            general: false,
            accumulation: Accumulation::Auto,
            sizes: Sizes::default(),
            seed: 0,
        }
    }

    /// These with the published values for other scenes: a lower threshold of the reduction where laser and sensor
    /// point differ, a weaker noise term for captures of retroreflective surfaces.
    pub fn suited(mut self, confocal: bool, reflectance: Reflectance) -> PaperOptions {
        self.reflectance = reflectance;
        if !confocal {
            self.keep_above = 0.03;
        }
        if reflectance == Reflectance::Retroreflective {
            (self.noise_base, self.noise_span) = (0.004, 0.0012);
        }
        self
    }

    /// Errors: the first option that makes no sense, by its name on the command line.
    pub fn check(&self) -> Result<()> {
        let bad = |option: &str, value: String, want: &str| {
            Err(Error::options(format!("--{option} is {value}"), format!("give {want}")))
        };
        let counts = [
            ("lateral", self.lateral, 4096),
            ("iterations", self.iterations, 1_000_000),
            ("double-every", self.double_every, 1_000_000),
            ("restart-every", self.restart_every, 1_000_000),
            ("reduce-every", self.reduce_every, 1_000_000),
        ];
        for (name, value, most) in counts {
            if value == 0 || value > most {
                return bad(name, value.to_string(), &format!("a whole number from 1 to {most}"));
            }
        }
        let positive = [
            ("learning-rate", self.learning_rate),
            ("peak", self.peak),
            ("smooth-sigma", self.smooth_sigma),
            ("smooth-truncate", self.smooth_truncate),
            ("epsilon", self.epsilon),
        ];
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return bad(name, value.to_string(), "a positive number");
            }
        }
        if self.smooth_sigma * self.smooth_truncate > 1000.0 {
            return bad(
                "smooth-sigma",
                self.smooth_sigma.to_string(),
                "a Gaussian that reaches at most 1000 voxels",
            );
        }
        let not_negative = [
            ("min-depth", self.min_depth),
            ("l1", self.l1),
            ("noise-base", self.noise_base),
            ("noise-span", self.noise_span),
            ("initial-albedo", self.initial_albedo),
        ];
        for (name, value) in not_negative {
            if !(value.is_finite() && value >= 0.0) {
                return bad(name, value.to_string(), "zero or a positive number");
            }
        }
        if let Some(room) = self.room.filter(|r| !(*r > 0.0 && *r <= 1.0)) {
            return bad("room", room.to_string(), "a positive number up to 1");
        }
        for (name, value) in [("beta1", self.beta1), ("beta2", self.beta2), ("keep-above", self.keep_above)] {
            if !(0.0..1.0).contains(&value) {
                return bad(name, value.to_string(), "a number from 0 to below 1");
            }
        }
        Ok(())
    }
}
