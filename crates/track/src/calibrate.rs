//! The fit of a calibration: damped Gauss-Newton steps with a robust cost (soft l1).

use glam::DVec3;
use rayon::prelude::*;
use thirdbounce_base::equations::solve_symmetric;

use crate::calibration::{CalibratedPair, Calibration, Measured};
use crate::constants::{DAMPING, DEVIATION_PRIOR, ITERATIONS, PLACE_PRIOR, POWER_PRIORS};
use crate::symmetric::Rows;

/// Numbers of a pair: shift of its sensor point along x and y, delay, logarithm of the light. A confocal laser point moves along.
const OF_PAIR: usize = 4;
/// Numbers of all pairs: logarithm of the deviation, powers of distances and cosines, shift of the other laser points along x and y.
const OF_ALL: usize = 5;
/// Residuals of more standard deviations than this count linearly.
const ROBUST: f64 = 2.0;
/// Step of the differences that stand for derivatives.
const SMALL: f64 = 1e-4;
/// A fit ends where the cost changes by less than this share.
const STILL: f64 = 1e-6;

/// Normal equations of a step.
struct Equations {
    matrix: Rows,
    score: Vec<f64>,
    cost: f64,
}

impl Calibration {
    /// This one after steps of all numbers.
    fn moved(&self, steps: &[f64]) -> Calibration {
        let (own, all) = steps.split_at(OF_PAIR * self.pairs.len());
        let pair = |(pair, own): (&CalibratedPair, &[f64])| {
            let shift = DVec3::new(own[0], own[1], 0.0);
            let [laser, sensor] = pair.points;
            let of_laser = if laser == sensor { shift } else { DVec3::new(all[3], all[4], 0.0) };
            CalibratedPair {
                points: [laser + of_laser, sensor + shift],
                delay: pair.delay + own[2],
                light: pair.light + own[3],
                ..pair.clone()
            }
        };
        Calibration {
            pairs: self.pairs.iter().zip(own.chunks(OF_PAIR)).map(pair).collect(),
            deviation: self.deviation * all[0].exp(),
            powers: [self.powers[0] + all[1], self.powers[1] + all[2]],
            ..self.clone()
        }
    }

    /// Sets the light of pairs that have none by linear least squares.
    fn lit(&mut self, measured: &Measured) {
        for which in 0..self.pairs.len() {
            self.pairs[which].light = f64::NEG_INFINITY;
            let left = self.residuals(which, measured);
            self.pairs[which].light = 0.0;
            let shape = centred(self.templates(&self.pairs[which], measured), measured.bins);
            let weights = self.pairs[which].weights.iter().cycle();
            let [of_left, of_shape] = left
                .iter()
                .zip(&shape)
                .zip(weights)
                .fold([0.0; 2], |[a, b], ((left, shape), w)| [a + w * left * shape, b + w * shape * shape]);
            self.pairs[which].light = (of_left / of_shape).max(1e-3 * of_shape.sqrt().recip()).ln();
        }
    }
}

/// Values less their mean over positions.
fn centred(mut values: Vec<f64>, bins: usize) -> Vec<f64> {
    for bin in 0..bins {
        let count = (values.len() / bins) as f64;
        let mean = values.iter().skip(bin).step_by(bins).sum::<f64>() / count;
        values.iter_mut().skip(bin).step_by(bins).for_each(|v| *v -= mean);
    }
    values
}

/// Standard deviations of all numbers before the positions.
fn priors(pairs: usize) -> Vec<f64> {
    let own = [PLACE_PRIOR, PLACE_PRIOR, PLACE_PRIOR, f64::INFINITY];
    let all = [DEVIATION_PRIOR[1], POWER_PRIORS[0][1], POWER_PRIORS[1][1], PLACE_PRIOR, PLACE_PRIOR];
    own.into_iter().cycle().take(OF_PAIR * pairs).chain(all).collect()
}

/// The best calibration from `start` on, and the steps to it; `before`: steps of an earlier fit.
pub fn fitted(
    start: &Calibration,
    before: Option<Vec<f64>>,
    measured: &Measured,
) -> (Calibration, Option<Vec<f64>>) {
    let mut start = start.clone();
    start.lit(measured);
    let numbers = OF_PAIR * start.pairs.len() + OF_ALL;
    let mut steps = before.unwrap_or_else(|| vec![0.0; numbers]);
    // The light is that of the present points.
    let mut now = start.moved(&steps);
    now.lit(measured);
    for (at, (pair, origin)) in now.pairs.iter().zip(&start.pairs).enumerate() {
        steps[OF_PAIR * at + 3] = pair.light - origin.light;
    }
    let mut best = equations(&start, &steps, measured);
    let mut damping = DAMPING[0];
    for _ in 0..ITERATIONS {
        let (mut matrix, mut step) = (best.matrix.clone(), best.score.clone());
        (0..numbers).for_each(|i| matrix[i][i] *= 1.0 + damping);
        solve_symmetric(&mut matrix, &mut step, 1e-13);
        let next: Vec<f64> = steps.iter().zip(&step).map(|(a, b)| a + b.clamp(-0.5, 0.5)).collect();
        let tried = equations(&start, &next, measured);
        if tried.cost < best.cost {
            let change = best.cost - tried.cost;
            (steps, best) = (next, tried);
            damping = (damping / 5.0).max(1e-9);
            if change < STILL * best.cost {
                break;
            }
        } else {
            damping *= 8.0;
            if damping > DAMPING[1] {
                break;
            }
        }
    }
    (start.moved(&steps), Some(steps))
}

fn equations(start: &Calibration, steps: &[f64], measured: &Measured) -> Equations {
    let now = start.moved(steps);
    let (numbers, bins) = (steps.len(), measured.bins);
    let all = OF_PAIR * start.pairs.len();
    let of_pair = |which: usize| {
        let left = now.residuals(which, measured);
        let base = now.templates(&now.pairs[which], measured);
        let own = (OF_PAIR * which..OF_PAIR * (which + 1)).chain(all..numbers);
        let columns: Vec<(usize, Vec<f64>)> = own
            .map(|number| {
                let mut moved = steps.to_vec();
                moved[number] += SMALL;
                let moved = start.moved(&moved);
                let mut slope = moved.templates(&moved.pairs[which], measured);
                slope.iter_mut().zip(&base).for_each(|(a, b)| *a = (*a - b) / SMALL);
                (number, centred(slope, bins))
            })
            .collect();
        let weights = &now.pairs[which].weights;
        let mut sum = Equations { matrix: vec![vec![0.0; numbers]; numbers], score: vec![0.0; numbers], cost: 0.0 };
        for (at, left) in left.iter().enumerate() {
            let weight = weights[at % bins];
            let grown = (1.0 + left * left * weight / (ROBUST * ROBUST)).sqrt();
            sum.cost += 2.0 * ROBUST * ROBUST * (grown - 1.0);
            let weight = weight / grown;
            if weight == 0.0 {
                continue;
            }
            for (k, (i, of_i)) in columns.iter().enumerate() {
                sum.score[*i] += weight * of_i[at] * left;
                for (j, of_j) in &columns[..=k] {
                    sum.matrix[*i][*j] += weight * of_i[at] * of_j[at];
                }
            }
        }
        sum
    };
    let parts: Vec<Equations> = (0..start.pairs.len()).into_par_iter().map(of_pair).collect();
    let mut sum = Equations { matrix: vec![vec![0.0; numbers]; numbers], score: vec![0.0; numbers], cost: 0.0 };
    for part in parts {
        sum.matrix.iter_mut().flatten().zip(part.matrix.iter().flatten()).for_each(|(a, b)| *a += b);
        sum.score.iter_mut().zip(&part.score).for_each(|(a, b)| *a += b);
        sum.cost += part.cost;
    }
    for (i, deviation) in priors(start.pairs.len()).into_iter().enumerate() {
        let sure = deviation.powi(-2);
        sum.matrix[i][i] += sure;
        sum.score[i] -= sure * steps[i];
        sum.cost += sure * steps[i] * steps[i];
    }
    sum
}
