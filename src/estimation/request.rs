//! What the settings make of a capture before anything is estimated.

use std::borrow::Cow;
use std::ops::ControlFlow;

use super::FindPulse;
use super::model::possible_models;
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Gpu;
use crate::maps::Maps;
use crate::settings::{ImpulseResponse, ReflectanceSetting, Settings};
use crate::solve::closed_form::LctOptions;
use crate::solve::option::SceneTraits;
use crate::solve::{
    Accumulation, Discretisation, Method, Preset, Problem, Progress, Ready, SolverOptions, Watch,
    enough_pairs, pixel_of,
};
use crate::transport::{Grid, Reflectance};

use super::LEAST_FOR_PULSE;

/// The solver with its options for a capture, and the hypotheses that short fits compare.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimateRequest {
    /// The preset in force.
    pub preset: Preset,
    /// The reason for the preset, if it is not set.
    pub why: Option<&'static str>,
    /// The solver with its options, for the usual model.
    pub solver: SolverOptions,
    /// The options for each model of reflectance, the usual one first; empty if the model is known.
    pub models: Vec<SolverOptions>,
    /// Whether to estimate the impulse response, if the capture holds none.
    pub find_pulse: FindPulse,
    /// Bins, depth of voxels and box of the solve. Fits have pixels of their own.
    pub discretisation: Discretisation,
    /// Largest amount of device memory to use, bytes.
    pub memory: Option<u64>,
}

impl EstimateRequest {
    /// What the defaults of a closed form depend on.
    pub fn traits(&self, capture: &Capture) -> SceneTraits {
        let reflectance = self.solver.common().reflectance;
        SceneTraits { preset: self.preset, reflectance, ..SceneTraits::of(capture) }
    }

    /// A light-cone transform of at most `most` lateral pixels.
    pub fn light_cone(&self, capture: &Capture, most: usize) -> LctOptions {
        let common = self.solver.common();
        LctOptions::defaults_for(&self.traits(capture)).with(|o| {
            o.lateral = common.lateral.min(most);
            o.image.min_depth = common.min_depth;
        })
    }

    /// The maps of a closed-form method, with voxels that are cubes.
    ///
    /// # Errors
    /// As its solve.
    pub fn closed_form(&self, solver: SolverOptions, capture: &Capture, gpu: &Gpu) -> Result<Maps> {
        let pitch = pixel_of(capture, self.discretisation.volume, solver.common().lateral);
        let how = Discretisation { depth_pitch: Some(pitch), ..self.discretisation };
        let Ready { capture, grid, .. } = how.ready(&solver, Cow::Borrowed(capture))?;
        let mut hear = |_: &Progress| ControlFlow::Continue(());
        let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
        let problem = Problem { memory: self.memory, ..Problem::new(&capture, grid) };
        Ok(solver.solve(gpu, &problem, &mut watch)?.maps)
    }

    /// The defaults for `capture` under `settings`.
    pub fn new(settings: &Settings, capture: &Capture) -> EstimateRequest {
        let preset = settings.preset.unwrap_or_else(|| preset_for(capture));
        let why = settings.preset.is_none().then_some(match preset {
            _ if capture.integer_counts => "the counts are whole numbers",
            Preset::Captured => "some counts are negative",
            Preset::Synthetic => "the counts are not whole numbers",
        });
        let scene = SceneTraits { preset, pairs: enough_pairs(capture), ..SceneTraits::of(capture) };
        let of_model = |reflectance| {
            let options = settings.method.options(&SceneTraits { reflectance, ..scene });
            let mut options = options.with_reflectance(reflectance);
            if let SolverOptions::Paper(paper) = &mut options {
                paper.seed = settings.seed();
            }
            match settings.deterministic {
                Some(true) => options.with_accumulation(Accumulation::Repeatable),
                _ => options,
            }
        };
        let estimates = matches!(settings.method, Method::Surface(_));
        let known = match settings.model {
            Some(ReflectanceSetting::Known(reflectance)) => Some(reflectance),
            // The method of the paper has the paper's model, and closed-form methods use the reflectance as given.
            None if !estimates => Some(Reflectance::Cosine),
            _ => None,
        };
        let models = match known {
            Some(_) => vec![],
            None => possible_models(capture.is_nearly_confocal()).map(of_model).collect(),
        };
        let find_pulse = match (&settings.pulse, preset) {
            (Some(ImpulseResponse::Auto), _) => FindPulse::Always,
            (Some(_), _) => FindPulse::Never,
            (None, Preset::Captured) if estimates => FindPulse::Always,
            (None, Preset::Synthetic) if estimates => FindPulse::IfItShows,
            (None, _) => FindPulse::Never,
        };
        EstimateRequest {
            preset,
            why,
            solver: of_model(known.unwrap_or(Reflectance::Cosine)),
            models,
            find_pulse,
            discretisation: settings.discretisation(),
            memory: settings.memory,
        }
    }

    /// The capture in the bins of the solver, and the grid.
    ///
    /// # Errors
    /// Those of [`Discretisation::ready`].
    pub fn ready<'c>(&self, capture: Cow<'c, Capture>) -> Result<Ready<'c>> {
        self.discretisation.ready(&self.solver, capture)
    }

    /// The grid for a capture whose bins are those of the solver.
    ///
    /// # Errors
    /// Those of [`Discretisation::grid`].
    pub fn grid(&self, capture: &Capture) -> Result<Grid> {
        self.discretisation.grid(&self.solver, capture)
    }

    /// The solve of a capture on a grid, without the volume.
    pub fn problem<'c>(&self, capture: &'c Capture, grid: Grid) -> Problem<'c> {
        Problem { memory: self.memory, ..Problem::new(capture, grid) }
    }

    /// Whether to estimate the high-pass of the objective.
    pub fn finds_high_pass(&self) -> bool {
        matches!(&self.solver, SolverOptions::Surface(options) if options.high_pass.is_none())
    }

    /// Whether to estimate the impulse response of this capture: it holds none, and only fits of several models can show one.
    pub fn find_pulse(&self, capture: &Capture) -> FindPulse {
        match (self.find_pulse, &capture.pulse) {
            (_, Some(_)) => FindPulse::Never,
            (FindPulse::IfItShows, None)
                if self.models.len() < 2 || capture.pair_count() < 2 * LEAST_FOR_PULSE =>
            {
                FindPulse::Never
            }
            (asked, None) => asked,
        }
    }
}

/// The published set of parameters that fits the capture: if all counts are whole numbers, or some are negative, a
/// detector made them.
pub fn preset_for(capture: &Capture) -> Preset {
    if capture.is_measured() { Preset::Captured } else { Preset::Synthetic }
}
