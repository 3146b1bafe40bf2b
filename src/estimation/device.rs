//! The gain law of devices near the wall: whether the light of laser or detector weakens with the distance to the wall point.
//! Quick trials of the first model, with and without the division by a law, are judged on the same held-out pairs.

use std::ops::ControlFlow;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{EstimateRequest, Estimates, Left, shown};
use crate::Result;
use crate::capture::{Capture, GainLaw, gain};
use crate::gpu::Gpu;
use crate::settings::DevicePosition;
use crate::solve::{Progress, SolverOptions};

/// What held-out pairs say of a named device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundDevice {
    /// Positions of the laser and of the detector, metres.
    pub at: [Option<[f64; 3]>; 2],
    /// Whether the position was set, else it is the capture's.
    pub is_set: bool,
    /// The name of the law by which the counts are divided, if they are.
    pub law: Option<String>,
    /// For no law (`none`) and each law that was tried: the share of held-out pairs that is left beyond noise, and its standard error;
    /// null without a surface.
    pub left: Vec<(String, Option<[f64; 2]>)>,
    /// Why nothing was tried, if so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub untried: Option<String>,
    /// Whether held-out pairs speak against the law beyond chance.
    pub is_doubtful: bool,
}

impl FoundDevice {
    fn place(&self) -> String {
        let of = |at: [f64; 3]| gain::place(DVec3::from_array(at));
        match self.at {
            [Some(laser), Some(sensor)] if laser != sensor => {
                format!("{} (laser) and {} (detector)", of(laser), of(sensor))
            }
            [Some(at), _] | [None, Some(at)] => of(at),
            [None, None] => "unknown".into(),
        }
    }

    /// What is left by each trial, as text.
    fn shares(&self) -> String {
        let share = |left: &Option<[f64; 2]>| {
            left.map_or_else(|| "no surface".into(), |[share, _]| format!("{:.1} %", 100.0 * share))
        };
        let each = self.left.iter().map(|(law, left)| format!("{law} {}", share(left)));
        each.collect::<Vec<_>>().join(", ")
    }

    /// The result as a sentence.
    pub fn note(&self) -> String {
        let place = self.place();
        let tried = match &self.untried {
            Some(why) => why.clone(),
            None => format!("left of held-out pairs by law: {}", self.shares()),
        };
        match self.law.as_deref().and_then(|name| GainLaw::ALL.into_iter().find(|law| law.name() == name)) {
            Some(law) => format!(
                "{} weakens by cos / distance\u{b2} as from a device at {place}: the counts are divided by it ({tried}; set the device's \
                 position to none to keep the counts)",
                law.light()
            ),
            None => format!(
                "a device is named at {place}; the counts are not divided by cos / distance\u{b2} from there ({tried})"
            ),
        }
    }

    /// What speaks against a position that was set.
    pub fn doubt(&self) -> Option<String> {
        (self.is_doubtful && self.law.is_some()).then(|| {
            format!(
                "held-out pairs contradict the device at {}: of them is left, by law: {}; check the position, or set it to none",
                self.place(),
                self.shares()
            )
        })
    }
}

/// The laws that differ for this capture, with their divided captures.
fn divided(capture: &Capture) -> Vec<(GainLaw, Capture)> {
    let mut seen: Vec<Vec<f64>> = vec![];
    let mut all = vec![];
    for law in GainLaw::ALL {
        let Some(gains) = capture.gains(law).filter(|gains| !is_even(gains) && !seen.contains(gains)) else {
            continue;
        };
        all.extend(capture.without_gains(law).map(|divided| (law, divided)));
        seen.push(gains);
    }
    all
}

/// Least ratio of the largest gain to the least one: a law that changes less than this changes no maps.
const LEAST_RATIO: f64 = 1.02;

fn is_even(gains: &[f64]) -> bool {
    let [least, most] =
        [gains.iter().copied().fold(f64::INFINITY, f64::min), gains.iter().copied().fold(0.0, f64::max)];
    most < LEAST_RATIO * least
}

/// The least of some trials: its index, if it is less than no law beyond chance.
fn best(none: Option<&Left>, laws: &[Option<Left>]) -> Option<(usize, bool)> {
    let found = laws.iter().enumerate().filter_map(|(i, left)| Some((i, left.as_ref()?)));
    let (at, least) = found.min_by(|a, b| a.1.excess().total_cmp(&b.1.excess()))?;
    // Laws that come first are more usual.
    let (at, least) = laws[..at]
        .iter()
        .enumerate()
        .find_map(|(i, left)| left.as_ref().filter(|left| !least.is_less(left)).map(|left| (i, left)))
        .unwrap_or((at, least));
    Some((at, none.is_none_or(|none| least.is_less(none))))
}

/// Decides on the law of the devices that are `set`, else of those that the capture names. Returns what was found, and the capture that
/// is divided by the law. `None` if no device is known.
///
/// # Errors
/// A position that is set and not in front of the wall; the device fails, or `hear` cancels.
pub fn device(
    request: &EstimateRequest,
    capture: &Capture,
    set: Option<DevicePosition>,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Option<(FoundDevice, Option<Capture>)>> {
    let named = match set {
        Some(DevicePosition::None) => return Ok(None),
        Some(DevicePosition::At(at)) => capture.clone().with(|c| c.devices = [Some(at); 2]),
        None if capture.devices == [None; 2] => return Ok(None),
        None => capture.clone(),
    };
    let is_set = set.is_some();
    if is_set && named.gains(GainLaw::Laser).is_none() {
        return Err(named.behind(GainLaw::Laser));
    }
    let mut laws = divided(&named);
    let mut found = FoundDevice {
        at: named.devices.map(|at| at.map(|at| at.to_array())),
        is_set,
        law: None,
        left: vec![],
        untried: None,
        is_doubtful: false,
    };
    if laws.is_empty() {
        let is_even = GainLaw::ALL.into_iter().any(|law| named.gains(law).is_some());
        found.untried = Some(if is_even {
            format!("its gains differ by less than {:.0} %", 100.0 * (LEAST_RATIO - 1.0))
        } else {
            "it is not in front of every wall point".into()
        });
        return Ok(Some((found, None)));
    }
    let is_judged = matches!(request.solver, SolverOptions::Surface(_));
    let chosen = if is_judged {
        let mut trial = |capture: &Capture| {
            let shown = shown(request, &Estimates::default(), capture, gpu, hear)?;
            Ok::<_, crate::Error>(shown.map(|shown| shown.held.left()))
        };
        let none = trial(capture)?;
        let left = laws.iter().map(|(_, divided)| trial(divided)).collect::<Result<Vec<_>>>()?;
        let figures = |left: &Option<Left>| left.as_ref().map(|left| [left.excess(), left.standard_error()]);
        found.left.push(("none".into(), figures(&none)));
        found.left.extend(laws.iter().zip(&left).map(|((law, _), left)| (law.name().into(), figures(left))));
        let best = best(none.as_ref(), &left);
        let at = best.map_or(0, |(at, _)| at);
        found.is_doubtful =
            is_set && none.as_ref().zip(left[at].as_ref()).is_some_and(|(none, left)| none.is_less(left));
        best.filter(|(_, is_less)| *is_less || is_set).map(|(at, _)| at).or(is_set.then_some(0))
    } else {
        found.untried = Some("only the solver surface compares held-out pairs".into());
        is_set.then_some(0)
    };
    let kept = chosen.map(|at| laws.swap_remove(at));
    found.law = kept.as_ref().map(|(law, _)| law.name().into());
    Ok(Some((found, kept.map(|(_, divided)| divided))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 64 pairs that leave `mean`, every other one more and less by `noise`, of squares of 100.
    fn left(mean: f64, noise: f64) -> Option<Left> {
        let of = |i: usize| [mean + if i.is_multiple_of(2) { noise } else { -noise }, 100.0];
        Some(Left { pairs: (0..64).map(of).collect(), noise: 0.0 })
    }

    #[test]
    fn a_law_needs_to_leave_less_than_none_beyond_chance() {
        let none = left(5.0, 0.0);
        let of = |laws: &[Option<Left>]| best(none.as_ref(), laws);
        assert_eq!(of(&[left(4.0, 0.1), left(4.5, 0.1)]), Some((0, true)));
        assert_eq!(of(&[left(4.5, 0.1), left(4.0, 0.1)]), Some((1, true)));
        assert_eq!(of(&[left(4.0, 0.1), left(3.9, 2.0)]), Some((0, true)), "the usual one, but for chance");
        assert_eq!(of(&[left(4.0, 8.0)]), Some((0, false)), "less than two standard errors");
        assert_eq!(of(&[left(6.0, 0.1)]), Some((0, false)));
        assert_eq!(best(None, &[None, left(9.0, 0.1)]), Some((1, true)), "a surface is better than none");
        assert_eq!(of(&[None]), None);
    }

    #[test]
    fn the_note_names_law_place_and_shares() {
        let found = FoundDevice {
            at: [Some([-0.5, 0.0, 0.25]); 2],
            is_set: false,
            law: Some("laser".into()),
            left: vec![("none".into(), Some([0.12, 0.01])), ("laser".into(), Some([0.031, 0.01]))],
            untried: None,
            is_doubtful: true,
        };
        let note = found.note();
        assert!(
            note.contains("the laser's light on the wall weakens") && note.contains("(-0.5, 0, 0.25)"),
            "{note}"
        );
        assert!(note.contains("none 12.0 %, laser 3.1 %"), "{note}");
        assert!(found.doubt().unwrap().contains("contradict"));
        let kept = FoundDevice { law: None, left: vec![("none".into(), None)], ..found };
        assert!(kept.note().contains("not divided") && kept.note().contains("none no surface"));
        assert!(kept.doubt().is_none());
    }
}
