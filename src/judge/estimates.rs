//! What short fits found: estimates, with their evidence.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::finding::{CaptureFinding, FindingSource};
use super::high_pass::FoundHighPass;
use super::model::FoundModel;
use super::pulse::FoundPulse;
use super::trial::Fitted;
use crate::Result;
use crate::capture::Pulse;
use crate::methods::SolverOptions;
use crate::surface::{Begun, HeldOut, Left, Starts};
use crate::transport::Reflectance;

/// Whether the instrument's impulse response is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FindPulse {
    /// Paths are sharp, unless the capture holds an impulse response.
    Never,
    /// If a fit with an impulse response of two bins has a smaller residual than one with sharp paths.
    IfItShows,
    /// In any case.
    Always,
}

/// The estimates of a run.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Estimates {
    /// What was found wrong with the capture, in its order.
    #[serde(default)]
    pub findings: Vec<CaptureFinding>,
    /// How surfaces reflect, if it was estimated.
    #[serde(default)]
    pub model: Option<FoundModel>,
    /// The high-pass of the objective, if it was estimated.
    #[serde(default)]
    pub high_pass: Option<FoundHighPass>,
    /// The instrument's impulse response, if it was estimated.
    #[serde(default)]
    pub pulse: Option<FoundPulse>,
    /// The share of the union of the network's mask and the true one that both have, as the network expects, if the surface begins
    /// with what it sees.
    #[serde(default)]
    pub expected_iou: Option<f64>,
    /// A surface of sharp paths for each model, with what judges it.
    #[serde(default)]
    pub candidates: Vec<FoundSurface>,
    /// Seconds of all fits.
    pub seconds: f64,
    /// The same by what was estimated.
    #[serde(skip)]
    pub stages: EstimateSeconds,
    /// The surface by the chosen model and impulse response.
    #[serde(skip)]
    pub(crate) at_hand: Option<AtHand>,
    /// Whether fits were tried and none found a surface.
    #[serde(skip)]
    pub finds_none: bool,
    /// Whether the fits begin with what the network and a light-cone transform show together.
    #[serde(skip)]
    pub is_union: bool,
    /// Layers of the surface that the fits found, and of its start, on coarse pixels.
    #[serde(skip)]
    pub(crate) begun: Option<Begun>,
}

/// Seconds of estimates.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct EstimateSeconds {
    /// What was tried of the instrument, with the estimates before the last ones.
    pub search: f64,
    /// The network or the closed form that fits begin with.
    pub start: f64,
    /// The high-pass.
    pub high_pass: f64,
    /// The reflectance, and the start of the surface.
    pub model: f64,
    /// The impulse response.
    pub pulse: f64,
}

impl Estimates {
    /// The estimates as sentences.
    pub fn notes(&self) -> Vec<String> {
        let start = self.expected_iou.map(|iou| {
            format!(
                "the surface begins with what the network sees{}; it expects an IoU of {iou:.2} (begin with lct or fbp for a \
                 closed form)",
                if self.is_union { " and what a light-cone transform shows beside it" } else { "" }
            )
        });
        let high_pass = self.high_pass.iter().map(FoundHighPass::note);
        let given = self.findings.iter().filter_map(CaptureFinding::note);
        given
            .chain(start)
            .chain(high_pass)
            .chain(self.model.iter().map(FoundModel::note))
            .chain(self.pulse.iter().map(FoundPulse::note))
            .collect()
    }

    /// The finding of this source, the first one.
    pub fn finding(&self, source: FindingSource) -> Option<&CaptureFinding> {
        self.findings.iter().find(|finding| finding.source == source)
    }

    /// Adds seconds of a search.
    pub(super) fn add_search(&mut self, seconds: f64) {
        self.seconds += seconds;
        self.stages.search += seconds;
    }

    /// Whether the impulse response is estimated by samples.
    pub fn has_samples(&self) -> bool {
        self.pulse.as_ref().is_some_and(|pulse| pulse.samples.is_some())
    }

    /// What the surface by the chosen physics leaves of held-out pairs.
    pub fn left(&self) -> Option<Left> {
        self.at_hand.as_ref().map(|at_hand| at_hand.held.left())
    }

    /// The solver with its options for the estimated model and high-pass, and the estimated impulse response, if there is one.
    ///
    /// # Errors
    /// A width that makes no impulse response. This does not happen with an estimated width.
    pub fn settle(
        &self,
        solver: &SolverOptions,
        models: &[SolverOptions],
    ) -> Result<(SolverOptions, Option<Pulse>)> {
        let of_model =
            |found: &FoundModel| models.iter().find(|o| o.common().reflectance == found.reflectance).cloned();
        let mut solver = self.model.as_ref().and_then(of_model).unwrap_or_else(|| solver.clone());
        if let (SolverOptions::Surface(options), Some(found)) = (&mut solver, self.high_pass) {
            (options.high_pass, options.high_pass_floor) = (Some(found.length), found.floor);
        }
        Ok((solver, self.pulse.as_ref().map(FoundPulse::pulse).transpose()?.flatten()))
    }
}

/// A surface of the estimates, by the model and the impulse response that they chose.
#[derive(Debug, Clone)]
pub(crate) struct AtHand {
    /// The pairs that it does not take.
    pub held: HeldOut,
    /// What fits begin with.
    pub starts: Arc<Starts>,
}

/// A surface that short fits found, judged on the pairs that are held out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundSurface {
    /// How it reflects.
    pub reflectance: Reflectance,
    /// What it began with.
    pub start: Origin,
    /// Share of the squares of held-out pairs that it leaves, its standard error, and the share beyond photon noise.
    pub left: [f64; 3],
    /// Logarithm of what is left beyond noise, with the price of its pixels.
    pub cost: f64,
    /// Seconds of its fits.
    pub seconds: f64,
    /// The solve begins with it.
    pub kept: bool,
}

/// A start of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// The network.
    Learned,
    /// The closed form.
    Closed,
    /// The network and, where it sees nothing, a light-cone transform.
    Union,
}

impl FoundSurface {
    pub(crate) fn of(reflectance: Reflectance, start: Origin, fitted: &Fitted, seconds: f64) -> FoundSurface {
        let left = fitted.surface.left.as_ref();
        FoundSurface {
            reflectance,
            start,
            left: left.map_or([f64::NAN; 3], |l| [l.share(), l.standard_error(), l.excess()]),
            cost: fitted.surface.cost(),
            seconds,
            kept: false,
        }
    }
}
