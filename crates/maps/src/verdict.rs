//! The verdict on a result, in the same words everywhere.

use std::fmt;

use serde::{Deserialize, Serialize};

/// How good a result is, from best to worst.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// Nothing speaks against it.
    Good,
    /// Parts of it may be wrong.
    Fair,
    /// Do not use it without looking at the reasons.
    Poor,
}

impl Grade {
    /// Its word.
    pub fn name(self) -> &'static str {
        match self {
            Grade::Good => "good",
            Grade::Fair => "fair",
            Grade::Poor => "poor",
        }
    }
}

/// The grade of a result, with the reasons for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The worst grade of the reasons.
    pub grade: Grade,
    /// Sentences; the first one has the worst grade.
    pub reasons: Vec<String>,
    /// What the surface leaves of held-out pairs beyond photon noise, as a share of the signal, and its standard error; null if no pairs
    /// are held out.
    pub left: Option<[f64; 2]>,
    /// Expected IoU of the mask, if a network gave the start.
    pub expected_iou: Option<f64>,
}

impl Verdict {
    /// A good result.
    pub const GOOD: Verdict = Verdict { grade: Grade::Good, reasons: vec![], left: None, expected_iou: None };

    /// Adds a reason. The grade is the worst one of all reasons.
    pub fn add(&mut self, grade: Grade, reason: impl Into<String>) {
        let at = if grade > self.grade { 0 } else { self.reasons.len() };
        self.reasons.insert(at, reason.into());
        self.grade = self.grade.max(grade);
    }
}

/// `poor: REASON; REASON`.
impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.grade.name())?;
        if !self.reasons.is_empty() {
            write!(f, ": {}", self.reasons.join("; "))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_reason_decides_and_comes_first() {
        let mut verdict = Verdict::GOOD;
        assert_eq!(verdict.to_string(), "good");
        verdict.add(Grade::Fair, "a");
        verdict.add(Grade::Poor, "b");
        verdict.add(Grade::Fair, "c");
        verdict.add(Grade::Poor, "d");
        assert_eq!(verdict.to_string(), "poor: b; a; c; d");
    }
}
