//! What was found wrong with a capture: one record for report, notes and verdict.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::settings::Correction;

/// Where a correction comes from, which decides how much held-out pairs must say for it (`EvidenceGate`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FindingSource {
    /// A capture of the empty room.
    Empty,
    /// A calibration file.
    File,
    /// A device position in the settings.
    Set,
    /// A device position in the capture's file.
    Named,
    /// The search.
    Searched,
}

/// Something that is wrong with a capture, or may be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaptureFinding {
    pub source: FindingSource,
    /// What it is, in words.
    pub what: String,
    /// The option or edit that corrects it; empty: none is needed.
    pub hint: String,
    /// The law of the counts or points that is undone; `None` for the empty room, for a file, and where no law of a device is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<String>,
    /// Positions of laser and detector, metres, if they are given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<[Option<[f64; 3]>; 2]>,
    /// Least, mean and largest gain of the empty room.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<[f64; 3]>,
    /// The file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Its corrections.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub corrections: Vec<Correction>,
    /// Laws of a file that are of its own capture alone, or of another kind of scan.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
    /// For `none`, and for each version that was tried: the share of held-out pairs that is left beyond noise, and its standard error; null
    /// without a surface. Empty: nothing was tried.
    pub left: Vec<(String, Option<[f64; 2]>)>,
    /// Whether the capture is corrected.
    pub is_used: bool,
}

impl CaptureFinding {
    pub fn new(source: FindingSource, what: String, hint: &str) -> CaptureFinding {
        CaptureFinding {
            source,
            what,
            hint: hint.into(),
            law: None,
            at: None,
            gain: None,
            file: None,
            corrections: vec![],
            left_out: vec![],
            left: vec![],
            is_used: false,
        }
    }

    /// What is left by each trial, as text.
    fn shares(&self) -> String {
        let share = |left: &Option<[f64; 2]>| {
            left.map_or_else(|| "no surface".into(), |[share, _]| format!("{:.1} %", 100.0 * share))
        };
        let each = self.left.iter().map(|(of, left)| format!("{of} {}", share(left)));
        match self.left.len() {
            0 => "held-out pairs did not judge it".into(),
            _ => format!("left of held-out pairs beyond noise: {}", each.collect::<Vec<_>>().join(", ")),
        }
    }

    /// What was done, as a sentence of a run's notes; `None` for what a search found, which the verdict names.
    pub fn note(&self) -> Option<String> {
        let CaptureFinding { what, hint, .. } = self;
        let out = match &self.left_out[..] {
            [] => String::new(),
            all => format!(
                "; left out, as it is of that capture alone or of another kind of scan: {}",
                all.join(", ")
            ),
        };
        (self.source != FindingSource::Searched).then(|| match self.is_used {
            true => format!("{what} ({}){out}", self.shares()),
            false => format!("not used: {what} ({}; {hint}){out}", self.shares()),
        })
    }

    /// What it means for a result, as a sentence; `None` where nothing is doubtful.
    pub fn doubt(&self) -> Option<String> {
        let CaptureFinding { what, hint, .. } = self;
        match (self.source, self.is_used) {
            (FindingSource::Searched, true) => {
                Some(format!("{what} ({}): undone here; {hint}", self.shares()))
            }
            (FindingSource::Searched, false) => Some(format!(
                "perhaps {what} ({}, too little a difference to undo it): {hint}",
                self.shares()
            )),
            // What is subtracted in vain says that the counts, or those of the room, are of something else.
            (FindingSource::Empty, false) => self.note(),
            (FindingSource::Set | FindingSource::File, false) => Some(format!(
                "held-out pairs contradict it, so it is not used: {what} ({}): {hint}",
                self.shares()
            )),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_names_what_was_done_and_why() {
        let mut found =
            CaptureFinding::new(FindingSource::Searched, "points are sheared".into(), "give the points");
        found.left = vec![("none".into(), Some([0.3, 0.01])), ("shear".into(), None)];
        assert_eq!(found.note(), None);
        let doubt = found.doubt().unwrap();
        assert!(
            doubt.starts_with("perhaps points are sheared") && doubt.ends_with(": give the points"),
            "{doubt}"
        );
        assert!(doubt.contains("none 30.0 %, shear no surface"), "{doubt}");
        found.is_used = true;
        assert!(found.doubt().unwrap().contains("undone here"));
        let given = CaptureFinding {
            source: FindingSource::Set,
            is_used: false,
            left_out: vec!["record".into()],
            ..found.clone()
        };
        assert!(given.doubt().unwrap().contains("contradict"));
        assert!(given.note().unwrap().starts_with("not used") && given.note().unwrap().ends_with("record"));
        let room = CaptureFinding { source: FindingSource::Empty, ..given.clone() };
        assert!(room.doubt().unwrap().starts_with("not used"));
        assert_eq!(CaptureFinding { is_used: true, ..given }.doubt(), None);
        let text = serde_json::to_string(&found).unwrap();
        assert_eq!(serde_json::from_str::<CaptureFinding>(&text).unwrap(), found);
    }
}
