//! Finds pairs that a detector's hot pixel measured, or a point of the wall with light of its own: a few of many, with far more
//! counts than the pairs around them. One of them outweighs a scan.

use glam::DVec3;

use crate::data::median::median;
use crate::data::nearest::Tree;
use crate::data::{Capture, PairKind};

/// Minimum ratio of a hot pair's counts to those of the surrounding pairs. Light from a hidden scene changes by less from one
/// point of a scan to the next.
pub(crate) const TIMES: f64 = 8.0;

/// Pairs around a pair: on a lattice all that surround it.
const AROUND: usize = 8;

/// Hot pairs are at most this share of all; if more seem to be, the scene is one that changes so.
const FEW: f64 = 0.05;

/// Counts that a pair may have by chance where there are hardly any.
const CHANCE: f64 = 100.0;

/// The hot pairs, by the counts of each measured pair. None of captures of exhaustive or irregular pairs: there the pairs around
/// one need not see the scene as it does.
pub(crate) fn pairs(capture: &Capture, totals: &[Option<f64>]) -> Vec<usize> {
    let known = || totals.iter().flatten().copied().filter(|t| t.is_finite());
    let usual = median(known()).unwrap_or(0.0);
    // Cheap for good data: without such a pair nothing else is done.
    let bright = |t: &f64| *t > TIMES * usual && (*t > CHANCE || !capture.integer_counts);
    if usual <= 0.0 || !known().any(|t| bright(&t)) {
        return vec![];
    }
    let measured: Vec<usize> = (0..totals.len()).filter(|pair| totals[*pair].is_some()).collect();
    let of_measured = capture.outline().keep(&measured, [measured.len(), 1]);
    if !matches!(of_measured.pair_kind(), PairKind::Confocal | PairKind::OneLaser | PairKind::OneSensor) {
        return vec![];
    }
    let points: &[DVec3] = of_measured.scanned_points();
    let tree = Tree::new(points);
    let total = |place: usize| totals[measured[place]].unwrap_or(0.0);
    let is_hot = |place: &usize| {
        let near = tree.nearest(points[*place], AROUND + 1);
        let around = near.iter().filter(|(_, other)| other != place).map(|(_, other)| total(*other));
        median(around).is_some_and(|beside| total(*place) > TIMES * beside)
    };
    let hot: Vec<usize> = (0..measured.len())
        .filter(|place| bright(&total(*place)))
        .filter(is_hot)
        .map(|p| measured[p])
        .collect();
    if hot.len() as f64 > FEW * measured.len() as f64 { vec![] } else { hot }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    /// A confocal scan of 16 x 16 points with these totals.
    fn found(total: impl Fn(usize, usize) -> f64) -> Vec<usize> {
        let at = |i: usize| (i as f64 - 7.5) / 16.0;
        let points: Vec<DVec3> = (0..256).map(|p| dvec3(at(p / 16), at(p % 16), 0.0)).collect();
        let capture = Capture::new([16, 16], points.clone(), points, 1, 0.01, vec![1.0; 256]);
        let totals: Vec<Option<f64>> = (0..256).map(|p| Some(total(p / 16, p % 16))).collect();
        pairs(&capture, &totals)
    }

    #[test]
    fn single_pairs_with_far_more_counts_are_hot() {
        let hot = |x: usize, y: usize| (x, y) == (3, 4) || (x, y) == (0, 0) || (x, y) == (15, 9);
        assert_eq!(found(|x, y| if hot(x, y) { 9000.0 } else { 1000.0 }), [0, 3 * 16 + 4, 15 * 16 + 9]);
        assert!(found(|x, y| if hot(x, y) { 7000.0 } else { 1000.0 }).is_empty(), "not enough more");
        // Two beside each other.
        assert_eq!(found(|x, y| if x == 5 && y / 2 == 2 { 1e5 } else { 1e3 }), [84, 85]);
    }

    #[test]
    fn light_that_falls_off_over_the_scan_is_none() {
        // A small bright thing 0.1 m before a corner of the wall: the nearest pair has 70 times the median's counts.
        let near = |x: usize, y: usize| {
            let [dx, dy] = [x, y].map(|i| i as f64 / 16.0);
            1e6 / (dx * dx + dy * dy + 0.01).powi(2)
        };
        assert!(near(0, 0) > 70.0 * near(8, 8));
        assert!(found(near).is_empty());
        // One pair in twelve: no hot pixels.
        assert!(found(|x, y| if (x * 16 + y) % 12 == 0 { 1e5 } else { 1e3 }).is_empty());
        assert!(found(|_, _| 0.0).is_empty());
    }
}
