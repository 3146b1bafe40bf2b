//! A solver and its options as somebody chooses them: what is not chosen follows from the capture.

use std::borrow::Cow;
use std::ops::ControlFlow;

use super::model::possible_models;
use super::{EstimateRequest, Estimates, FindPulse};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Gpu;
use crate::solve::option::{OptionValue, Suit};
use crate::solve::{
    Discretisation, Preset, Progress, SolverOptions, check_solver, enough_pairs, reflectance,
};
use crate::transport::Reflectance;

/// The choice of a solver and of its options; nothing is chosen by default.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Choice {
    /// The solver's name.
    pub solver: Option<String>,
    /// The model's name, or `auto`.
    pub model: Option<String>,
    /// The published parameters to start from.
    pub preset: Option<Preset>,
    /// Options by their keys.
    pub options: Vec<(&'static str, OptionValue)>,
}

/// What a choice makes of a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Resolved {
    /// The preset in force.
    pub preset: Preset,
    /// Why, if nobody chose it.
    pub why: Option<&'static str>,
    /// The solver with its options.
    pub solver: SolverOptions,
    /// The options for each model, if trials choose it.
    pub models: Vec<SolverOptions>,
}

impl Choice {
    /// This choice, and that of `base` where this one leaves something open.
    #[must_use]
    pub fn over(self, base: &Choice) -> Choice {
        Choice {
            solver: self.solver.or_else(|| base.solver.clone()),
            model: self.model.or_else(|| base.model.clone()),
            preset: self.preset.or(base.preset),
            options: base.options.iter().cloned().chain(self.options).collect(),
        }
    }

    /// This choice with the value of an option, if it leaves that open.
    #[must_use]
    pub fn with_usual(mut self, key: &'static str, value: &OptionValue) -> Choice {
        if self.options.iter().all(|(known, _)| *known != key) {
            self.options.push((key, value.clone()));
        }
        self
    }

    /// Refuses unknown names and values out of range. The ranges do not depend on the capture.
    ///
    /// # Errors
    /// `Kind::Options`.
    pub fn check(&self) -> Result<()> {
        self.solver.as_deref().map_or(Ok(()), check_solver)?;
        if let Some(model) = self.model.as_deref().filter(|m| *m != "auto") {
            reflectance(model)?;
        }
        self.options(&Suit::USUAL).check()
    }

    /// The seed that was chosen, else 0.
    pub fn seed(&self) -> u64 {
        match self.options.iter().find(|(key, _)| *key == "seed") {
            Some((_, OptionValue::Count(seed))) => *seed as u64,
            _ => 0,
        }
    }

    /// The solver's name.
    pub fn solver_name(&self) -> &str {
        self.solver.as_deref().unwrap_or(SolverOptions::DEFAULT)
    }

    /// The key of the first option that only other solvers have. The seed fits every solver: it also draws pairs.
    pub fn foreign(&self) -> Option<&'static str> {
        let options = SolverOptions::suited_to(self.solver_name(), &Suit::USUAL)?;
        let lacks = |key: &&str| *key != "seed" && options.get(key).is_none();
        self.options.iter().map(|(key, _)| *key).find(lacks)
    }

    /// What the choice makes of `capture`.
    pub fn resolve(&self, capture: &Capture) -> Resolved {
        let preset = self.preset.unwrap_or_else(|| preset_for(capture));
        let why = self.preset.is_none().then_some(match preset {
            _ if capture.integer_counts => "the counts are whole numbers",
            Preset::Captured => "some counts are negative",
            Preset::Synthetic => "the counts are not whole numbers",
        });
        let suit = Suit { preset, pairs: enough_pairs(capture), ..Suit::of(capture) };
        let of_model = |reflectance| self.options(&Suit { reflectance, ..suit });
        // `check` has refused unknown names.
        let named = self.model.as_deref().and_then(|name| reflectance(name).ok());
        let solver = of_model(named.unwrap_or(Reflectance::Cosine));
        // The paper's solver has the paper's model, and closed-form methods take the reflectance as given.
        let usual = self.model.is_none() && !solver.has_trials();
        let all = possible_models(capture.is_confocal()).map(of_model);
        let models = if named.is_some() || usual { vec![] } else { all.collect() };
        Resolved { preset, why, solver, models }
    }

    /// The defaults for such scenes, then the options that were chosen. Later ones replace earlier ones.
    fn options(&self, suit: &Suit) -> SolverOptions {
        // `check` has refused unknown names.
        let mut options = SolverOptions::suited_to(self.solver_name(), suit)
            .or_else(|| SolverOptions::suited_to(SolverOptions::DEFAULT, suit))
            .expect("the default solver");
        self.options.iter().for_each(|(key, value)| {
            options.set(key, value);
        });
        options
    }
}

impl Resolved {
    /// Whether to find the pulse of a capture that has none, if nobody says so: for a solve with a surface, always if
    /// the values are captured counts. The paper's solver takes paths as sharp.
    pub fn find_pulse(&self) -> FindPulse {
        match (&self.solver, self.preset) {
            (o, Preset::Captured) if o.has_trials() => FindPulse::Always,
            (o, Preset::Synthetic) if o.has_trials() => FindPulse::IfItShows,
            _ => FindPulse::Never,
        }
    }

    /// What quick solves of a part of `capture` find, the solver that follows, and the capture with the pulse: what a run of the
    /// command solves with. Without light in it model and pulse stay as they are. `hear` may cancel.
    ///
    /// # Errors
    /// The device fails, or `hear` cancels.
    pub fn settled<'c>(
        &self,
        gpu: &Gpu,
        capture: &'c Capture,
        (discretisation, memory): (Discretisation, Option<u64>),
        hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<(Estimates, SolverOptions, Cow<'c, Capture>)> {
        let ask = EstimateRequest {
            solver: &self.solver,
            models: &self.models,
            find_pulse: self.find_pulse(),
            discretisation,
            memory,
        };
        let has_light = capture.histograms.iter().any(|v| *v > 0.0);
        let found = if has_light { super::estimate(&ask, capture, gpu, hear)? } else { Estimates::default() };
        let (solver, capture) = found.settle(&self.solver, &self.models, capture)?;
        Ok((found, solver, capture))
    }

    /// [`Resolved::settled`] for a session of such frames, with the usual box and bins.
    ///
    /// # Errors
    /// Those of [`Resolved::settled`].
    pub fn tune(
        &self,
        gpu: &Gpu,
        frame: &Capture,
        memory: Option<u64>,
        hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Tuned> {
        let (found, solver, scan) = self.settled(gpu, frame, (Discretisation::default(), memory), hear)?;
        Ok(Tuned { solver, scan: scan.into_owned(), found })
    }
}

/// A solver and a scan for a session.
#[derive(Debug, Clone)]
pub struct Tuned {
    /// The solver with its options.
    pub solver: SolverOptions,
    /// The frame, with the pulse.
    pub scan: Capture,
    /// What was found.
    pub found: Estimates,
}

/// The published set of parameters that fits the capture: if all counts are whole numbers, or some are negative, a
/// detector made them.
pub fn preset_for(capture: &Capture) -> Preset {
    if capture.is_measured() { Preset::Captured } else { Preset::Synthetic }
}
