//! What short fits found: estimates, with their evidence.

use serde::{Deserialize, Serialize};

use super::calibration::FoundCalibration;
use super::device::FoundDevice;
use super::high_pass::FoundHighPass;
use super::model::FoundModel;
use super::pulse::FoundPulse;
use super::room::FoundEmpty;
use super::sense::Sense;
use super::suspects::Suspects;
use super::trial::Fitted;
use crate::Result;
use crate::capture::Pulse;
use crate::methods::SolverOptions;
use crate::surface::{Begun, HeldOut};
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
    /// What was undone of the instrument, and a calibration that was given.
    #[serde(default)]
    pub calibration: Option<FoundCalibration>,
    /// The gain law of devices near the wall, if their positions are known.
    #[serde(default)]
    pub device: Option<FoundDevice>,
    /// The subtraction of the empty room, if there is a capture of it.
    #[serde(default)]
    pub empty: Option<FoundEmpty>,
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
    /// What the surface of the chosen model shows of the pairs.
    #[serde(skip)]
    pub shown: Option<Shown>,
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
        let device = self.device.iter().map(FoundDevice::note);
        let empty = self.empty.iter().map(FoundEmpty::note);
        let calibration = self.calibration.iter().filter_map(FoundCalibration::note);
        empty
            .chain(calibration)
            .chain(device)
            .chain(start)
            .chain(high_pass)
            .chain(self.model.iter().map(FoundModel::note))
            .chain(self.pulse.iter().map(FoundPulse::note))
            .collect()
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

/// What a short fit of a capture shows of its pairs.
#[derive(Debug, Clone)]
pub struct Shown {
    /// The pairs that it does not take.
    pub held: HeldOut,
    /// All pairs, if much of those that are held out is left.
    pub all: Option<HeldOut>,
    /// What it shows of gains.
    pub(crate) sense: Option<Sense>,
    /// The causes that it suggests.
    pub(crate) suspects: Suspects,
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
