//! What held-out pairs say of the subtraction of an empty room.

use serde::{Deserialize, Serialize};

/// What held-out pairs say of the empty capture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundEmpty {
    /// Least, mean and largest gain over the pairs; null if none fits.
    pub gain: Option<[f64; 3]>,
    /// Share of the capture's counts that is the room's.
    pub share: f64,
    /// Squares of counts that trials leave of held-out pairs, without and with the subtraction, in units of the former, and the standard
    /// error of the difference; null without two trials.
    pub left: Option<[f64; 3]>,
    /// Whether it is subtracted.
    pub is_used: bool,
    /// Why nothing was tried, if so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub untried: Option<String>,
}

impl FoundEmpty {
    /// The result as a sentence.
    pub fn note(&self) -> String {
        let tried = match (&self.untried, self.left) {
            (Some(why), _) => why.clone(),
            (None, Some([_, with, error])) => {
                format!(
                    "it leaves {with:.3} \u{b1} {error:.3} times the squares of held-out pairs that are left without it"
                )
            }
            (None, None) => "a trial without it finds no surface".into(),
        };
        match (self.is_used, self.gain) {
            (true, Some([least, mean, most])) => format!(
                "the empty capture is subtracted with the gain {mean:.3} ({least:.3} to {most:.3} over the pairs): {:.1} % of the counts \
                 ({tried})",
                100.0 * self.share
            ),
            _ => format!(
                "the empty capture is not used: {tried} (measure the empty room for longer, at the same place and with the same exposure)"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_note_says_what_was_done_and_why() {
        let found = FoundEmpty {
            gain: Some([0.95, 0.97, 0.99]),
            share: 0.4,
            left: Some([1.0, 0.5, 0.02]),
            is_used: true,
            untried: None,
        };
        assert!(found.note().contains("subtracted with the gain 0.970 (0.950 to 0.990"), "{}", found.note());
        let unused = FoundEmpty { is_used: false, left: Some([1.0, 1.5, 0.02]), ..found };
        assert!(unused.note().contains("not used: it leaves 1.500"), "{}", unused.note());
    }
}
