//! What short fits found: estimates, with their evidence.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::decide::{CaptureFinding, EvidenceGate, FindingSource};
use super::pulse::{Shape, three_digits};
use super::response::ResponseSamples;
use crate::Result;
use crate::capture::{METRES_PER_PICOSECOND, Pulse};
use crate::surface::{Begun, HeldOut, LEAST_FLOOR, Left, Starts};
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
#[derive(Debug, Clone, Default)]
pub struct Estimates {
    /// What was found wrong with the capture, in its order.
    pub findings: Vec<CaptureFinding>,
    /// How surfaces reflect, if it was estimated.
    pub model: Option<FoundModel>,
    /// The high-pass of the objective, if it was estimated.
    pub high_pass: Option<FoundHighPass>,
    /// The instrument's impulse response, if it was estimated.
    pub pulse: Option<FoundPulse>,
    /// The share of the union of the network's mask and the true one that both have, as the network expects, if the surface begins
    /// with what it sees.
    pub expected_iou: Option<f64>,
    /// A surface of sharp paths for each model, with what judges it.
    pub candidates: Vec<FoundSurface>,
    /// Seconds of all fits.
    pub seconds: f64,
    /// The same by what was estimated.
    pub stages: EstimateSeconds,
    /// The pairs that the surface by the chosen model and impulse response does not take, and what its fits began with.
    pub(crate) at_hand: Option<(HeldOut, Arc<Starts>)>,
    /// Whether fits were tried and none found a surface.
    pub finds_none: bool,
    /// Whether the fits begin with what the network and a light-cone transform show together.
    pub is_union: bool,
    /// Width of the box in walls, where held-out pairs want a wider one than the wall.
    pub walls: Option<f64>,
    /// Layers of the surface that the fits found, and of its start, on coarse pixels.
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
        let beside = if self.is_union { " and what a light-cone transform shows beside it" } else { "" };
        let start = self.expected_iou.map(|iou| {
            format!(
                "the surface begins with what the network sees{beside}; it expects an IoU of {iou:.2} (begin with lct or fbp for a \
                 closed form)"
            )
        });
        let wide = self.walls.map(|walls| {
            format!(
                "objects reach beyond the scanned part of the wall: the box is {walls:.2} walls wide, which leaves less of pairs that no \
                 fit has seen (give the volume for another one)"
            )
        });
        let physics = [
            wide,
            start,
            self.high_pass.as_ref().map(FoundHighPass::note),
            self.model.as_ref().map(FoundModel::note),
            self.pulse.as_ref().map(FoundPulse::note),
        ];
        self.findings.iter().filter_map(CaptureFinding::note).chain(physics.into_iter().flatten()).collect()
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
        self.at_hand.as_ref().map(|(held, _)| held.left())
    }
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

/// The models that trials choose among; the first stands where there are no trials.
pub const MODELS: [Reflectance; 3] =
    [Reflectance::Cosine, Reflectance::Lambertian, Reflectance::Retroreflective];

/// The models that can be true of a capture. What sends light back to where it came from sends none to other points of the
/// wall.
pub fn possible_models(confocal: bool) -> impl Iterator<Item = Reflectance> {
    MODELS.into_iter().filter(move |model| confocal || *model != Reflectance::Retroreflective)
}

/// How surfaces reflect: the model whose surface predicts other pairs best.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundModel {
    /// How surfaces reflect.
    pub reflectance: Reflectance,
    /// The trials that began alike: the model, the width of its pulse in metres (0: sharp paths, or the known pulse), and
    /// the share of other pairs' squares that its surface leaves.
    pub trials: Vec<(Reflectance, f64, Option<f64>)>,
    /// Whether cosine stays because photon noise alone makes what Lambertian leaves less.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_by_chance: bool,
    /// Why the trials failed, if they did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

impl FoundModel {
    /// The result as a sentence.
    pub fn note(&self) -> String {
        let name = self.reflectance.name();
        if let Some(why) = &self.failed {
            return format!(
                "the model of reflectance is not known, {name} is taken: {why} (name it if known)"
            );
        }
        // The least of each model.
        let mut each: Vec<(Reflectance, f64)> = vec![];
        for (model, _, left) in &self.trials {
            let Some(left) = *left else { continue };
            match each.iter_mut().find(|e| e.0 == *model) {
                Some(known) => known.1 = known.1.min(left),
                None => each.push((*model, left)),
            }
        }
        let reported: Vec<String> =
            each.iter().map(|(m, left)| format!("{} {:.2} %", m.name(), 100.0 * left)).collect();
        let least = each.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let bound = match self.is_by_chance {
            true => format!("{BY_CHANCE:.0} standard errors that photon noise makes"),
            false => {
                let margin = 100.0 * (1.0 - EvidenceGate::OTHER_FALLOFF.factor);
                format!("two standard errors or {margin:.0} % of what is beyond noise")
            }
        };
        let other = least.filter(|(model, _)| *model != self.reflectance).map(|(model, _)| model.name());
        let why =
            other.map(|other| format!("; {other} leaves less, but by less than {bound}, so {name} is kept"));
        let why = why.unwrap_or_default();
        format!(
            "the model of reflectance: {name}, by trials; of pairs that it has not seen, each leaves: {}{why} (name a \
             model to skip the trials)",
            reported.join(", ")
        )
    }
}

/// Lambertian is taken in place of cosine beyond these standard errors of the difference that photon noise of the held-out pairs alone
/// makes; that of the fitted pairs makes as much. Evidence: benches/NOTES.md, "Masks and models at few photons".
pub const BY_CHANCE: f64 = 4.0;

/// With a floor above this the high-pass changes too little to be worth its kernel.
const HIGHEST: f64 = 0.7;

/// Exact values have no noise, and files of state no infinite numbers.
const MOST: f64 = 1e6;

/// How much light counts that changes slowly along time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FoundHighPass {
    /// Length of the high-pass, metres of path; 0: there is none.
    pub length: f64,
    /// What it leaves of the amplitude of light that does not change.
    pub floor: f64,
    /// What a volume without it leaves of slow and of fast light in pairs that it has not seen, over photon noise there:
    /// amplitudes, so 1 is noise alone.
    pub left: [f64; 2],
}

impl FoundHighPass {
    /// What a fit leaves of pairs that it has not seen is photon noise, which is white, and what the model does not explain, which is slow.
    /// Least squares want both alike in every bin. So slow light counts as much less as more of it is left than of fast light:
    /// generalised least squares (Aitken 1936) with a spectrum of two steps. Where photons are few, noise is most of what is left, and all
    /// light counts alike.
    ///
    /// Of what a volume leaves, over photon noise: mean squares of slow light, and of fast light.
    pub(super) fn of(length: f64, bands: [f64; 2]) -> FoundHighPass {
        let left = bands.map(|band| band.sqrt().min(MOST));
        let floor = (1.0 / left[0]).max(LEAST_FLOOR);
        match floor <= HIGHEST {
            true => FoundHighPass { length, floor, left },
            // No light, or none that changes slowly.
            false => FoundHighPass { length: 0.0, floor: 1.0, left },
        }
    }

    /// The result as a sentence.
    pub fn note(&self) -> String {
        let FoundHighPass { length, floor, left: [slow, _] } = self;
        let beside = match *slow < MOST {
            true => format!(": {slow:.1} times photon noise remains of them"),
            false => String::new(),
        };
        match *length {
            0.0 => format!(
                "no high-pass: slow parts of the histograms fit as well as others do{beside} (give the length of the high-pass to skip the \
                 trial)"
            ),
            _ => format!(
                "high-pass: slow parts of the histograms, over more than {length:.3} m of path, are weighed {floor:.2}, as they fit badly \
                 in held-out pairs{beside} (a high-pass of length 0 turns this off)"
            ),
        }
    }
}

/// The instrument's impulse response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundPulse {
    /// Full width at half maximum of its Gaussian, metres of path; 0: no width is better than sharp paths.
    pub fwhm: f64,
    /// Length over which its tail falls to 1/e, metres of path; 0: none.
    #[serde(default)]
    pub tail: f64,
    /// Its samples, if no such shape is right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples: Option<ResponseSamples>,
    /// What was tried: width and tail, metres, and the share of other pairs' squares that was left.
    pub trials: Vec<[f64; 3]>,
    /// Seconds that the trials took.
    pub seconds: f64,
    /// Why the trials failed, if they did; paths are then taken as sharp.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

impl FoundPulse {
    /// The pulse; `None` if paths are sharp.
    ///
    /// # Errors
    /// The width makes no pulse. This does not happen with a width that was found.
    pub fn pulse(&self) -> Result<Option<Pulse>> {
        match &self.samples {
            Some(samples) => Ok(Some(samples.pulse())),
            None => Shape { fwhm: self.fwhm, tail: self.tail }.pulse(),
        }
    }

    /// The result as a sentence.
    pub fn note(&self) -> String {
        if let Some(why) = &self.failed {
            return format!(
                "the instrument's pulse is not known, paths are taken as sharp: {why} (give it if known)"
            );
        }
        let how = format!("of {} shapes tried in {:.1} s,", self.trials.len(), self.seconds);
        if let Some(samples) = &self.samples {
            let peak = |[at, height]: &[f64; 2]| format!("{height:.2} at {:.0} mm", 1e3 * at);
            let peaks: Vec<String> = samples.peaks().iter().map(peak).collect();
            return format!(
                "the instrument's pulse: {how} none explains the data as {} samples do, whose peaks over the largest one are {} of path \
                 (measure the impulse response, and give it as a file)",
                samples.samples.len(),
                peaks.join(", ")
            );
        }
        if self.fwhm == 0.0 {
            return format!("the instrument's pulse: {how} none explains the data better than sharp paths");
        }
        let of = |metres: f64| format!("{metres} m ({} ps)", three_digits(metres / METRES_PER_PICOSECOND));
        let tail = match self.tail {
            0.0 => String::new(),
            tail => format!(" and a tail of {}", of(tail)),
        };
        format!(
            "the instrument's pulse: {how} {} full width at half maximum{tail} explains the data best \
             (give this pulse, or none, to skip the trials)",
            of(self.fwhm)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Reflectance::{Cosine, Lambertian, Retroreflective};

    #[test]
    fn the_note_tells_the_least_of_each_model() {
        let trials = vec![
            (Cosine, 0.0, Some(0.05)),
            (Lambertian, 0.0, Some(0.08)),
            (Retroreflective, 0.0, None),
            (Lambertian, 0.02, Some(0.03)),
        ];
        let found = FoundModel { reflectance: Lambertian, trials, is_by_chance: false, failed: None };
        let note = found.note();
        assert!(
            note.contains("lambertian, by trials") && note.contains("cosine 5.00 %, lambertian 3.00 %"),
            "{note}"
        );
        assert!(!note.contains("retroreflective") && !note.contains("is kept"), "{note}");
        let simple = FoundModel { reflectance: Cosine, ..found.clone() }.note();
        assert!(simple.contains("lambertian leaves less, but by less than two standard errors"), "{simple}");
        let by_chance = FoundModel { reflectance: Cosine, is_by_chance: true, ..found.clone() }.note();
        assert!(by_chance.contains("less than 4 standard errors that photon noise makes"), "{by_chance}");
        let failed = FoundModel { failed: Some("no surface".into()), ..found };
        assert!(
            failed.note().contains("is not known") && failed.note().contains("no surface"),
            "{}",
            failed.note()
        );
    }

    #[test]
    fn the_floor_follows_what_is_left_over_noise() {
        let of = |slow: f64| FoundHighPass::of(0.1, [slow * slow, 1.0]);
        assert_eq!((of(1.0).length, of(1.3).length), (0.0, 0.0), "noise alone");
        assert!((of(4.0).floor - 0.25).abs() < 1e-12 && of(4.0).length == 0.1);
        assert_eq!(of(1e3).floor, LEAST_FLOOR);
        // Without noise, and without light: what is kept can be read again.
        for bands in [[f64::INFINITY; 2], [f64::NAN; 2]] {
            let found = FoundHighPass::of(0.1, bands);
            let text = serde_json::to_string(&found).unwrap();
            assert_eq!(serde_json::from_str::<FoundHighPass>(&text).unwrap(), found);
        }
    }
}
