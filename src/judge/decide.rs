//! One question decides about every correction of a capture: do held-out pairs prefer the capture once it is undone?

use super::finding::FindingSource;
use crate::surface::{HeldOut, Left};

/// What undoing a correction must reach: at most this share of what is left without it, and less by more than these standard errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvidenceGate {
    pub factor: f64,
    pub errors: f64,
}

impl EvidenceGate {
    /// What the settings give stays unless held-out pairs contradict it.
    pub const GIVEN: EvidenceGate = EvidenceGate { factor: 1.01, errors: -2.0 };
    /// What the capture's file names is undone if that leaves less, beyond chance.
    pub const NAMED: EvidenceGate = EvidenceGate { factor: 1.0, errors: 2.0 };
    /// What a search found is undone only if a surface leaves far less: of 130 proper captures one has a correction that leaves .8, none one
    /// that leaves .6 (benches/NOTES.md, "Causes").
    pub const SEARCHED: EvidenceGate = EvidenceGate { factor: 0.6, errors: 4.0 };
    /// A doubt of the verdict: fits leave something of sharp captures whatever is undone.
    pub const DOUBT: EvidenceGate = EvidenceGate { factor: 0.75, errors: 4.0 };

    /// The gate of a source.
    pub fn of(source: FindingSource) -> EvidenceGate {
        match source {
            FindingSource::Empty | FindingSource::File | FindingSource::Set => EvidenceGate::GIVEN,
            FindingSource::Named => EvidenceGate::NAMED,
            FindingSource::Searched => EvidenceGate::SEARCHED,
        }
    }

    /// Whether what is left `after` passes, of what is left `before`, of the same pairs.
    pub fn passes(self, [after, before]: &[Left; 2]) -> bool {
        after.excess() < self.factor * before.excess() && after.errors_below(before) > self.errors
    }
}

/// What two fits leave of the pairs that both hold out. `gains`: by which the counts of every pair of the capture are divided in the
/// first one; pairs then weigh midway between both counts, as a division alone makes other pairs weigh most.
pub fn both(after: &HeldOut, before: &HeldOut, gains: Option<&[f64]>) -> [Left; 2] {
    let lefts = [after, before].map(HeldOut::left);
    let at = |pair: &usize| before.pairs.iter().position(|other| other == pair);
    let rows: Vec<[usize; 2]> =
        after.pairs.iter().enumerate().filter_map(|(row, pair)| Some([row, at(pair)?])).collect();
    std::array::from_fn(|side| {
        let left = &lefts[side];
        let weighed = |rows: &[usize; 2]| {
            let gain = gains.map_or(1.0, |gains| gains[after.pairs[rows[0]]]);
            left.pairs[rows[side]].map(|square| if side == 0 { square * gain } else { square / gain })
        };
        let share = if gains.is_some() { 0.0 } else { rows.len() as f64 / left.pairs.len().max(1) as f64 };
        Left { pairs: rows.iter().map(weighed).collect(), noise: share * left.noise }
    })
}

/// The same of versions of a capture that differ by light: squared differences in counts, in units of what the second one leaves.
pub fn both_in_counts(after: &HeldOut, before: &HeldOut) -> Option<[Left; 2]> {
    (after.pairs == before.pairs).then(|| {
        let unit = before.squared_counts().iter().sum::<f64>() / before.pairs.len().max(1) as f64;
        let of = |held: &HeldOut| Left {
            pairs: held.squared_counts().into_iter().map(|square| [square, unit]).collect(),
            noise: 0.0,
        };
        [of(after), of(before)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What 64 pairs leave: `mean` of 100 each, every other one more and less by `scatter`.
    fn left(mean: f64, scatter: f64) -> Left {
        let of = |i: usize| [mean + scatter * if i.is_multiple_of(2) { 1.0 } else { -1.0 }, 100.0];
        Left { pairs: (0..64).map(of).collect(), noise: 0.0 }
    }

    #[test]
    fn gates_are_stricter_the_less_is_known() {
        let gates =
            [FindingSource::File, FindingSource::Named, FindingSource::Searched].map(EvidenceGate::of);
        let passed = |after: f64, scatter: f64| {
            let both = [left(after, scatter), left(10.0, 0.0)];
            gates.iter().chain([&EvidenceGate::DOUBT]).filter(|gate| gate.passes(&both)).count()
        };
        // Given; named; a doubt; searched. Less by a factor is not enough where the difference is chance.
        assert_eq!([10.2, 10.05, 9.0, 7.0, 5.0].map(|after| passed(after, 0.1)), [0, 0, 2, 3, 4]);
        assert_eq!([9.99, 5.0].map(|after| passed(after, 30.0)), [1, 1]);
        assert!(
            EvidenceGate::GIVEN.passes(&[left(10.05, 3.0), left(10.0, 0.0)]),
            "chance contradicts nothing"
        );
    }
}
