//! A capture, and what the settings make of it.

use std::borrow::Cow;
use std::sync::Arc;

use super::estimates::{Estimates, FindPulse, FoundPulse, possible_models};
use crate::capture::{Capture, Pulse};
use crate::engine::{Accumulation, Problem, enough_pairs};
use crate::methods::{Method, SolverOptions};
use crate::options::{Preset, SceneTraits};
use crate::settings::{Calibrate, DevicePosition, ImpulseResponse, ReflectanceSetting, Settings};
use crate::transport::{Grid, Reflectance};
use crate::{Result, Verdict};

/// Minimum hold-out size for an impulse response of exact values, pairs: with fewer, it only hides errors of the depths.
const LEAST_FOR_PULSE: usize = 64;

/// A capture with everything that its reconstruction needs: what is set, else defaults, else what short fits found.
#[derive(Debug, Clone)]
pub struct Job<'c> {
    /// The capture: as it was measured, and in the bins of the solver, with its impulse response, once that is known.
    pub capture: Cow<'c, Capture>,
    /// The settings that it comes from.
    pub settings: Settings,
    /// The preset in force.
    pub preset: Preset,
    /// The reason for the preset, if it is not set.
    pub why: Option<&'static str>,
    /// The solver with its options, for the usual model or the one that was found.
    pub solver: SolverOptions,
    /// The options for each model of reflectance, the usual one first; empty if the model is known.
    pub models: Vec<SolverOptions>,
    /// Whether to estimate the impulse response, if the capture holds none.
    pub find_pulse: FindPulse,
    /// Number of bins of the measurement that are one of `capture`.
    pub sum: usize,
    /// Estimates, with their evidence.
    pub estimates: Estimates,
    /// The verdict by estimates and held-out pairs, without what the maps say.
    pub verdict: Arc<Verdict>,
    /// What looks wrong with the capture, and what is wrong for certain, as sentences.
    pub warnings: Vec<String>,
    pub faults: Vec<String>,
}

impl<'c> Job<'c> {
    /// The defaults for a capture under `settings`.
    pub fn of(settings: &Settings, capture: Cow<'c, Capture>) -> Job<'c> {
        let preset = settings.preset.unwrap_or_else(|| preset_for(&capture));
        let why = settings.preset.is_none().then_some(match preset {
            _ if capture.integer_counts => "the counts are whole numbers",
            Preset::Captured => "some counts are negative",
            Preset::Synthetic => "the counts are not whole numbers",
        });
        let scene = SceneTraits { preset, pairs: enough_pairs(&capture), ..SceneTraits::of(&capture) };
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
        let solver = of_model(known.unwrap_or(Reflectance::Cosine));
        Job::before_estimates(capture, settings.clone(), (preset, why), solver, models, find_pulse)
    }

    fn before_estimates(
        capture: Cow<'c, Capture>,
        settings: Settings,
        (preset, why): (Preset, Option<&'static str>),
        solver: SolverOptions,
        models: Vec<SolverOptions>,
        find_pulse: FindPulse,
    ) -> Job<'c> {
        Job {
            capture,
            settings,
            preset,
            why,
            solver,
            models,
            find_pulse,
            sum: 1,
            estimates: Estimates::default(),
            verdict: Arc::new(Verdict::GOOD),
            warnings: vec![],
            faults: vec![],
        }
    }

    /// Checks the settings and the box.
    ///
    /// # Errors
    /// The first value out of its range, and those of [`Settings::grid`].
    pub fn check(&self) -> Result<()> {
        self.settings.check()?;
        self.grid().map(drop)
    }

    /// The same options, before estimates, for another version of the capture.
    pub fn with_capture<'d>(&self, capture: Cow<'d, Capture>) -> Job<'d> {
        let (settings, why) = (self.settings.clone(), (self.preset, self.why));
        let (solver, models) = (self.solver.clone(), self.models.clone());
        Job::before_estimates(capture, settings, why, solver, models, self.find_pulse)
    }

    /// The job of a corrected capture, which knows what was found in the other one.
    pub fn again<'d>(&self, capture: Cow<'d, Capture>) -> Job<'d> {
        let Estimates { findings, seconds, walls, .. } = &self.estimates;
        let (findings, seconds, walls) = (findings.clone(), *seconds, *walls);
        let estimates = Estimates { findings, seconds, walls, ..Estimates::default() };
        let (warnings, faults) = (self.warnings.clone(), self.faults.clone());
        Job { estimates, warnings, faults, ..Job::of(&self.settings, capture) }
    }

    /// The same job with another solver.
    pub fn with_solver(&self, solver: SolverOptions) -> Job<'_> {
        Job { solver, ..self.with_capture(Cow::Borrowed(&self.capture)) }
    }

    /// The solver with its options for the estimated model and high-pass, and the estimated impulse response, if there is one.
    ///
    /// # Errors
    /// A width that makes no impulse response. This does not happen with an estimated width.
    pub fn estimated(&self) -> Result<(SolverOptions, Option<Pulse>)> {
        let Estimates { model, high_pass, pulse, .. } = &self.estimates;
        let reflectance = model.as_ref().map(|found| found.reflectance);
        let of_model = self.models.iter().find(|o| Some(o.common().reflectance) == reflectance);
        let mut solver = of_model.unwrap_or(&self.solver).clone();
        if let (SolverOptions::Surface(options), Some(found)) = (&mut solver, high_pass) {
            (options.high_pass, options.high_pass_floor) = (Some(found.length), found.floor);
        }
        Ok((solver, pulse.as_ref().map(FoundPulse::pulse).transpose()?.flatten()))
    }

    /// The job with the estimated model, high-pass and impulse response.
    ///
    /// # Errors
    /// Those of [`Job::estimated`].
    pub fn settle(mut self) -> Result<Job<'c>> {
        let (solver, pulse) = self.estimated()?;
        self.solver = solver;
        if pulse.is_some() {
            self.capture.to_mut().pulse = pulse;
        }
        Ok(self)
    }

    /// The job with the capture in the bins of the solver.
    ///
    /// # Errors
    /// Those of [`Settings::summed`].
    pub fn summed(mut self) -> Result<Job<'c>> {
        (self.capture, self.sum) = self.settings.summed(&self.solver, self.capture)?;
        Ok(self)
    }

    /// The grid for the capture, whose bins are those of the solver; its lateral cells are the pixels of the maps.
    ///
    /// # Errors
    /// Those of [`Settings::grid`].
    pub fn grid(&self) -> Result<Grid> {
        self.settings.grid(&self.solver, &self.capture)
    }

    /// A pixel is surface above this share of the brightest albedo; `None`: the mask of the method.
    pub fn mask_fraction(&self) -> Option<f64> {
        self.settings.mask_fraction.or(self.solver.usual_mask())
    }

    /// Whether the capture has light.
    pub fn has_light(&self) -> bool {
        self.capture.histograms.iter().any(|v| *v > 0.0)
    }

    /// Whether what held-out pairs prove of the instrument is undone.
    pub fn calibrates(&self) -> bool {
        self.settings.calibrate != Some(Calibrate::None)
    }

    /// Whether to estimate the high-pass of the objective.
    pub fn finds_high_pass(&self) -> bool {
        matches!(&self.solver, SolverOptions::Surface(options) if options.high_pass.is_none())
    }

    /// Whether the solve begins with the surface of short fits: its support may leave that of the start.
    pub fn finds_start(&self) -> bool {
        matches!(&self.solver, SolverOptions::Surface(options) if options.grow)
    }

    /// Whether to estimate the impulse response of the capture: it holds none, and only fits of several models can show one.
    pub fn find_pulse(&self) -> FindPulse {
        match (self.find_pulse, &self.capture.pulse) {
            (_, Some(_)) => FindPulse::Never,
            (FindPulse::IfItShows, None)
                if self.models.len() < 2 || self.capture.pair_count() < 2 * LEAST_FOR_PULSE =>
            {
                FindPulse::Never
            }
            (asked, None) => asked,
        }
    }

    /// The problem that the solver takes.
    ///
    /// # Errors
    /// Those of [`Job::grid`].
    pub fn problem(&self) -> Result<Problem<'_>> {
        let Settings { memory, keep_volume, .. } = self.settings;
        let with_volume = keep_volume == Some(true);
        Ok(Problem { memory, with_volume, ..Problem::new(&self.capture, self.grid()?) })
    }

    /// Settings with the estimates in their places: they need no fits.
    pub fn settled(&self) -> Settings {
        Settings {
            preset: Some(self.preset),
            model: Some(ReflectanceSetting::Known(self.solver.common().reflectance)),
            pulse: Some(ImpulseResponse::None),
            device_at: Some(DevicePosition::None),
            method: Method::of(&self.solver),
            ..self.settings.clone()
        }
    }

    /// The estimates, and the bins that are summed, as sentences.
    pub fn notes(&self) -> Vec<String> {
        let preset = self.preset_note();
        preset.into_iter().chain(self.estimates.notes()).chain(self.summed_note()).collect()
    }

    /// The note on a preset that is not set.
    pub fn preset_note(&self) -> Option<String> {
        self.why.map(|why| format!("{why}: the preset {} is used", self.preset.name()))
    }

    /// The note on bins that were summed.
    pub fn summed_note(&self) -> Option<String> {
        let Job { sum, capture, .. } = self;
        (*sum > 1).then(|| {
            format!(
                "{sum} bins are summed into one of {:.3} mm, as pixels and impulse response blur more",
                1e3 * capture.bin_width
            )
        })
    }
}

/// The published set of parameters that fits the capture: if all counts are whole numbers, or some are negative, a
/// detector made them.
pub fn preset_for(capture: &Capture) -> Preset {
    if capture.is_measured() { Preset::Captured } else { Preset::Synthetic }
}
