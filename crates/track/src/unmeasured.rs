//! Mean and covariance of a position along directions that the pairs hardly determine: a sphere around one scan point, a circle about a
//! line of them. The likelihood along these directions is not Gaussian: it is integrated over fits at fixed places along them.

use glam::{DMat3, DVec3};

use crate::blob::NUMBERS;
use crate::fit::{Expected, FittedBlobs, fit};
use crate::sight::Sight;
use crate::symmetric::{axes, block, square};

/// Curvature of the likelihood's ridge from which on a direction counts as undetermined: displacement over the least standard deviation.
const CURVED: f64 = 0.5;
/// Number of places along one direction, and along each of two; their reach in standard deviations; the standard deviation, as a share of
/// the distance, from which on they cover the whole circle.
const PLACES: [usize; 2] = [41, 17];
const FAR: f64 = 2.5;
const ALL_ROUND: f64 = 0.3;
/// Iterations of a fit at a place.
const ITERATIONS: usize = 6;
/// Standard deviation by which a place is held, as a share of the distance.
const HELD: f64 = 1e-4;

/// Mean and covariance of blob `which` of a fit; `linear` is its covariance by the fit. `None` where that holds.
pub fn spread(
    sight: &Sight,
    fitted: &FittedBlobs,
    which: usize,
    linear: DMat3,
    known: &Expected,
    [low, high]: [DVec3; 2],
) -> Option<(DVec3, DMat3)> {
    let at = fitted.guess.blobs[which].at;
    let all = axes(linear);
    let least = all[2].0.max(0.0).sqrt();
    let distance = at.distance(sight.middle()).max(1e-6 * sight.unit);
    let curved = |variance: f64| variance / (2.0 * distance) > CURVED * least;
    // Along the wall, where every place has one point in front of it at its distance.
    let mut weak: Vec<DVec3> = vec![];
    for (variance, axis) in &all[..2] {
        let axis = weak.iter().fold(axis.with_z(0.0), |left, other| left - *other * other.dot(left));
        match axis.try_normalize() {
            Some(axis) if curved(*variance) => weak.push(axis),
            _ => {}
        }
    }
    let places = *PLACES.get(weak.len().checked_sub(1)?)?;
    let middle = sight.middle();
    let ranges: Vec<[f64; 2]> = weak
        .iter()
        .map(|axis| {
            let deviation = axis.dot(linear * *axis).max(0.0).sqrt();
            let (centre, reach) = match deviation > ALL_ROUND * distance {
                true => (middle.dot(*axis), distance),
                false => (at.dot(*axis), FAR * deviation),
            };
            [centre - reach, centre + reach]
        })
        .collect();
    let along = |which: usize, i: usize| {
        let [from, to] = ranges[which];
        from + (to - from) * (i as f64 + 0.5) / places as f64
    };
    let (mut known, excess) = (known.clone(), fitted.excess());
    let mut nodes: Vec<(f64, DVec3, DMat3)> = vec![];
    let held = HELD * distance;
    let hold = weak.iter().fold(known.places[which].1, |sum, axis| sum + square(*axis) * held.powi(-2));
    let mut visit = |ways: &[f64]| {
        let lateral = weak.iter().zip(ways).fold(at, |p, (axis, way)| p + *axis * (way - at.dot(*axis)));
        let left = distance * distance - (lateral - middle).with_z(0.0).length_squared();
        let place = lateral.with_z(middle.z + left.max(0.0).sqrt());
        known.places[which] = (place, hold);
        let mut start = fitted.guess.clone();
        start.blobs[which].at = place;
        let found = fit(sight, start, &known, ITERATIONS);
        let here = found.guess.blobs[which].at;
        let is_inside = here.cmpge(low).all() && here.cmple(high).all();
        if let (true, Some(covariance)) = (is_inside, found.covariance()) {
            let inner = block(&covariance, NUMBERS * which);
            let full = weak.iter().fold(inner, |sum, axis| sum + square(*axis));
            let log_weight = -0.5 * found.objective / excess + 0.5 * full.determinant().max(1e-300).ln();
            nodes.push((log_weight, here, inner));
        }
    };
    for i in 0..places {
        match weak.len() {
            1 => visit(&[along(0, i)]),
            _ => (0..places).for_each(|j| visit(&[along(0, i), along(1, j)])),
        }
    }
    let most = nodes.iter().map(|n| n.0).fold(f64::NEG_INFINITY, f64::max);
    let (mut sum, mut mean, mut moment) = (0.0, DVec3::ZERO, DMat3::ZERO);
    for (log_weight, here, inner) in nodes {
        let weight = (log_weight - most).exp();
        sum += weight;
        mean += weight * here;
        moment += weight * (inner + square(here));
    }
    let mean = mean / sum;
    let covariance = moment * (1.0 / sum) - square(mean);
    (sum > 0.0 && covariance.is_finite()).then_some((mean, covariance))
}
