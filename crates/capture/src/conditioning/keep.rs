//! What is kept of a capture while it is read.

use super::Gate;
use crate::data::{Capture, PairKind};

/// The part of a capture that is kept while it is read; all of it by default.
///
/// The result is that of reading the whole file and then applying [`Capture::stride`], [`Capture::subset`] and
/// [`Capture::gated`], in this order, bit for bit. Formats that store one large array of counts need no more memory
/// than the part.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct Keep {
    /// Every Nth scan point in x and in y; `None` keeps all.
    pub stride: Option<usize>,
    /// This many pairs, drawn at random after the stride; `None` keeps all.
    pub subset: Option<usize>,
    /// Seed of the random draw.
    pub subset_seed: u64,
    /// The bins of these paths; `None` keeps all.
    pub gate: Option<Gate>,
}

impl Keep {
    /// With every `n`th scan point in x and in y.
    pub fn with_stride(self, n: impl Into<Option<usize>>) -> Keep {
        Keep { stride: n.into(), ..self }
    }

    /// With `count` pairs, drawn at random by `seed` after the stride.
    pub fn with_subset(self, count: impl Into<Option<usize>>, seed: u64) -> Keep {
        Keep { subset: count.into(), subset_seed: seed, ..self }
    }

    /// With the bins of these paths.
    pub fn with_gate(self, gate: impl Into<Option<Gate>>) -> Keep {
        Keep { gate: gate.into(), ..self }
    }
}

/// What a stride of `n` made of a capture.
pub(super) fn stride_note(n: usize, before: &Capture, after: &Capture) -> String {
    let (all, [x, y]) = (before.pair_count(), before.scan);
    let (kept, [to_x, to_y], nth) = (after.pair_count(), after.scan, ordinal(n));
    match before.pair_kind() {
        PairKind::Exhaustive { .. } => {
            format!("every {nth} laser and sensor point in x and y is used: {kept} of {all} pairs")
        }
        _ => format!("every {nth} of {x} x {y} scan points in x and y is used: {to_x} x {to_y}"),
    }
}

fn ordinal(n: usize) -> String {
    let ending = match (n % 10, n % 100) {
        (1, r) if r != 11 => "st",
        (2, r) if r != 12 => "nd",
        (3, r) if r != 13 => "rd",
        _ => "th",
    };
    format!("{n}{ending}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ordinals_end_as_spoken() {
        let all = [1, 2, 3, 4, 11, 12, 13, 21, 102, 111].map(ordinal);
        assert_eq!(all, ["1st", "2nd", "3rd", "4th", "11th", "12th", "13th", "21st", "102nd", "111th"]);
    }
}
