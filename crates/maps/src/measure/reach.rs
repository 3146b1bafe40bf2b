//! Time at which a method reaches another's accuracy.

use serde::{Deserialize, Serialize};

/// Time at which a metric reaches a target: solve seconds at points of the trace, late by up to one step and never
/// early. `None`: not within the run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Reach {
    /// The target; `None` if there is none, or if several were required together.
    pub target: Option<f64>,
    /// Seconds at the first point that reaches the target. Later points may be worse, e.g. if it had few pixels.
    pub first_s: Option<f64>,
    /// Seconds at the point after which all points reach the target, inclusive.
    pub kept_s: Option<f64>,
}

/// First and lasting point of a trace of (seconds, target reached).
pub fn reach(target: Option<f64>, trace: &[(f64, bool)]) -> Reach {
    let first = trace.iter().find(|(_, good)| *good);
    let bad = trace.iter().rposition(|(_, good)| !good).map_or(0, |last_bad| last_bad + 1);
    Reach { target, first_s: first.map(|p| p.0), kept_s: trace.get(bad).map(|p| p.0) }
}

/// The middle value, or the mean of the two middle values; `None` without values.
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let n = sorted.len();
    (n > 0).then(|| 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_passing_success_is_not_kept() {
        let at = |good: [bool; 4]| {
            let trace: Vec<_> = good.iter().enumerate().map(|(i, g)| (i as f64 + 1.0, *g)).collect();
            let r = reach(None, &trace);
            (r.first_s, r.kept_s)
        };
        assert_eq!(at([false, true, false, true]), (Some(2.0), Some(4.0)));
        assert_eq!(at([true, true, true, true]), (Some(1.0), Some(1.0)));
        assert_eq!(at([false, true, true, false]), (Some(2.0), None));
        assert_eq!(at([false; 4]), (None, None));
        assert_eq!(reach(None, &[]), Reach::default());
    }

    #[test]
    fn medians() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0]), Some(3.0));
        assert_eq!(median(&[4.0, 1.0]), Some(2.5));
        assert_eq!(median(&[9.0, 1.0, 2.0]), Some(2.0));
    }
}
