//! The gain law of devices near the wall: whether the light of laser or detector weakens with the distance to the wall point.
//! Quick trials of the first model, with and without the division by a law, are judged on the same held-out pairs.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::capture::{Capture, GainLaw, gain};
use crate::surface::Left;

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
pub(super) fn divided(capture: &Capture) -> Vec<(GainLaw, Capture)> {
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
pub(super) const LEAST_RATIO: f64 = 1.02;

fn is_even(gains: &[f64]) -> bool {
    let [least, most] =
        [gains.iter().copied().fold(f64::INFINITY, f64::min), gains.iter().copied().fold(0.0, f64::max)];
    most < LEAST_RATIO * least
}

/// The law that leaves least: its index. Laws that come first are more usual and stay where the difference is chance.
pub(super) fn best(laws: &[Option<Left>]) -> Option<usize> {
    let found = laws.iter().enumerate().filter_map(|(i, left)| Some((i, left.as_ref()?)));
    let (at, least) = found.min_by(|a, b| a.1.excess().total_cmp(&b.1.excess()))?;
    let is_alike = |left: &Option<Left>| left.as_ref().is_some_and(|left| !least.is_less(left));
    Some(laws[..at].iter().position(is_alike).unwrap_or(at))
}

/// Whether the division by these gains of the held-out pairs leaves less than none beyond chance, where pairs weigh between the divided
/// counts and the counts as they are, and less at all in each of these: a division alone makes other pairs weigh most, and of the counts
/// as they are, few pairs beside a device have most light.
pub(super) fn is_clear(divided: &Left, none: &Left, gains: &[f64]) -> bool {
    let weighed = |left: &Left, power: i32| Left {
        pairs: left.pairs.iter().zip(gains).map(|(pair, gain)| pair.map(|v| v * gain.powi(power))).collect(),
        noise: 0.0,
    };
    let errors = |power: i32| weighed(divided, power).errors_below(&weighed(none, power - 2));
    errors(0) > 0.0 && weighed(divided, 1).is_less(&weighed(none, -1)) && errors(2) > 0.0
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
    fn the_law_that_leaves_least_is_best_but_for_chance() {
        assert_eq!(best(&[left(4.0, 0.1), left(4.5, 0.1)]), Some(0));
        assert_eq!(best(&[left(4.5, 0.1), left(4.0, 0.1)]), Some(1));
        assert_eq!(best(&[left(4.0, 0.1), left(3.9, 2.0)]), Some(0), "the usual one, but for chance");
        assert_eq!(best(&[None, left(9.0, 0.1)]), Some(1));
        assert_eq!(best(&[None]), None);
    }

    #[test]
    fn a_law_needs_to_leave_less_than_none_in_both_weightings() {
        let even = vec![1.0; 64];
        let of = |law, gains: &[f64]| is_clear(&left(law, 0.1).unwrap(), &left(5.0, 0.1).unwrap(), gains);
        assert!(of(4.0, &even) && !of(6.0, &even));
        // Of the counts as they are, two pairs have most light: their mean proves nothing, whatever less is left.
        let gains: Vec<f64> = (0..64).map(|i| if i < 2 { 30.0 } else { 1.0 }).collect();
        let near = |share: f64| Left {
            pairs: gains.iter().map(|gain| [share * 100.0 * gain * gain, 100.0 * gain * gain]).collect(),
            noise: 0.0,
        };
        assert!(is_clear(&left(4.0, 0.1).unwrap(), &near(0.4), &gains));
        let noisy = is_clear(&left(4.0, 8.0).unwrap(), &left(5.0, 0.1).unwrap(), &even);
        assert!(!noisy, "less than two standard errors");
        // The surface is the same, and leaves much of the first half only: gains that make this half weigh less prove nothing.
        let gains: Vec<f64> = (0..64).map(|i| if i < 32 { 3.0 } else { 1.0 }).collect();
        let raw = Left {
            pairs: (0..64).map(|i| [if i < 32 { 50.0 + f64::from(i % 2) } else { 1.0 }, 100.0]).collect(),
            noise: 0.0,
        };
        let pairs =
            raw.pairs.iter().zip(&gains).map(|(pair, gain)| pair.map(|v| v / (gain * gain))).collect();
        let divided = Left { pairs, noise: 0.0 };
        assert!(divided.is_less(&raw), "the shares alone say so");
        assert!(!is_clear(&divided, &raw, &gains));
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
