//! What was undone of an instrument.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::capture::Capture;
use crate::settings::Correction;

/// What was undone of the instrument.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FoundCalibration {
    /// Every correction in its order: those of the file, then what was found.
    pub corrections: Vec<Correction>,
    /// The file, if one is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// How many of the corrections it holds.
    pub given: usize,
    /// Laws of the file that were left out: of its own capture alone, or of another kind of scan.
    pub left_out: Vec<String>,
    /// Shares of held-out pairs beyond noise without and with the corrections of the file, each with its standard error, if fits judged
    /// them.
    pub left: Option<[[f64; 2]; 2]>,
    /// Whether held-out pairs speak against the file beyond chance: then it is left out.
    pub is_doubtful: bool,
    /// What the corrections of the file are, in words.
    #[serde(skip)]
    pub(super) what: Vec<String>,
}

/// A capture without a cause, and the correction.
#[derive(Debug, Clone)]
pub struct Undone {
    pub capture: Capture,
    pub correction: Correction,
}

impl FoundCalibration {
    /// What was undone by the file, as a sentence; `None` without a file, or if it is left out.
    pub fn note(&self) -> Option<String> {
        let file = self.file.as_ref().filter(|_| !self.is_doubtful)?.display();
        let out = match &self.left_out[..] {
            [] => String::new(),
            all => format!(
                "; left out, as it is of that capture alone or of another kind of scan: {}",
                all.join(", ")
            ),
        };
        if self.what.is_empty() {
            return Some(format!("the calibration {file} undoes nothing{out}"));
        }
        let shares = self.shares().map_or_else(String::new, |shares| format!(" ({shares})"));
        Some(format!("undone by the calibration {file}: {}{shares}{out}", self.what.join("; ")))
    }

    fn shares(&self) -> Option<String> {
        let [without, with] = self.left?.map(|[share, _]| 100.0 * share);
        Some(format!("of held-out pairs {without:.1} % is left beyond noise without it, {with:.1} % with it"))
    }

    /// What speaks against the file, where it is left out.
    pub fn doubt(&self) -> Option<String> {
        let file = self.file.as_ref().filter(|_| self.is_doubtful)?.display();
        let shares = self.shares().unwrap_or_else(|| "with it, no fit finds a surface".into());
        Some(format!(
            "held-out pairs contradict the calibration {file}, which is left out: {shares}: is it of this rig?"
        ))
    }
}
