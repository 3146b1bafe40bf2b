//! The fit of a calibration: damped Gauss-Newton steps with a robust cost (soft l1).

use glam::DVec3;
use rayon::prelude::*;
use thirdbounce_base::equations::solve_symmetric;

use crate::calibration::{CalibratedPair, Calibration, KnownPositions, check_scan};
use crate::capture::Capture;
use crate::constants::{
    DAMPING, DEVIATION_PRIOR, ITERATIONS, LEAST_CALIBRATION, PLACE_PRIOR, POWER_PRIORS, ROUNDS,
};
use crate::error::{Error, Result};
use crate::symmetric::Rows;

/// Numbers of a pair: shift of its sensor point along x and y, delay, logarithm of the light. A confocal laser point moves along.
const OF_PAIR: usize = 4;
/// Numbers of all pairs: logarithm of the deviation, powers of distances and cosines, shift of the other laser points along x and y.
const OF_ALL: usize = 5;
/// Residuals of more standard deviations than this count linearly.
const ROBUST: f64 = 2.0;
/// Step of the differences that stand for derivatives.
const SMALL: f64 = 1e-4;
/// Standard deviations beyond which a count is none in the first guess.
const FAR_OFF: f64 = 5.0;
/// A fit ends where the cost changes by less than this share.
const STILL: f64 = 1e-6;

/// Normal equations of a step.
struct CalibrationStep {
    matrix: Rows,
    score: Vec<f64>,
    cost: f64,
}

impl Calibration {
    /// By captures of one scan with an object at these places, metres. `has_direct`: bins up to the direct light are left out, and that
    /// light gives the first guess of the delays.
    ///
    /// # Errors
    /// Fewer than 20 positions; captures of different scans; a pair without bins behind its direct light; a fit that finds nothing.
    pub fn of(captures: &[Capture], at: &[DVec3], has_direct: bool) -> Result<Calibration> {
        let first = captures.first().filter(|_| captures.len() == at.len() && at.len() >= LEAST_CALIBRATION);
        let Some(first) = first else {
            return Err(Error::input(
                format!("{} captures and {} positions make no calibration", captures.len(), at.len()),
                format!("give one position per capture, {LEAST_CALIBRATION} or more"),
            ));
        };
        for capture in captures {
            check_scan(capture, first.pair_count(), first.bins, [first.t_start, first.bin_width])?;
        }
        let bins = first.bins;
        let counts = captures.iter().map(|capture| &capture.histograms[..]).collect();
        let measured = KnownPositions { counts, at, bins };
        let mut start = Calibration::start(first, &measured, has_direct)?;
        start.weigh(&measured);
        let (mut found, mut steps) = (start.clone(), None);
        for _ in 0..ROUNDS {
            (found, steps) = fitted(&start, steps, &measured);
            found.weigh(&measured);
            for (pair, now) in start.pairs.iter_mut().zip(&found.pairs) {
                (pair.weights, pair.room) = (now.weights.clone(), now.room.clone());
            }
        }
        let is_lit = |pair: &CalibratedPair| pair.delay.is_finite() && pair.light.is_finite();
        if !found.pairs.iter().all(is_lit) {
            return Err(Error::input(
                "the light of the captures does not follow the positions",
                "check that captures and positions have one order and one frame of coordinates",
            ));
        }
        Ok(found)
    }

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

    /// Light by linear least squares of each pair at the best of these further delays, and that delay; nearly none where it would be
    /// negative.
    fn guessed(&self, measured: &KnownPositions, delays: &[f64]) -> Vec<[f64; 2]> {
        let of_pair = |which: usize| {
            let mut own = self.clone();
            own.pairs[which].light = f64::NEG_INFINITY;
            let left = own.residuals(which, measured);
            let mut best = (0.0, [0.0, f64::NEG_INFINITY]);
            for delay in delays {
                let pair = CalibratedPair {
                    light: 0.0,
                    delay: self.pairs[which].delay + delay,
                    ..own.pairs[which].clone()
                };
                let shape = centred(self.templates(&pair, measured), measured.bins);
                let weights = pair.weights.iter().cycle().filter(|w| w.is_finite());
                let mut sums = [0.0; 2];
                for ((left, shape), weight) in left.iter().zip(&shape).zip(weights) {
                    // Single counts that are far off are no light.
                    let most = FAR_OFF / weight.max(f64::MIN_POSITIVE).sqrt();
                    sums[0] += weight * left.clamp(-most, most) * shape;
                    sums[1] += weight * shape * shape;
                }
                let light = (sums[0] / sums[1]).max(1e-3 / sums[1].sqrt());
                let drop = light * (2.0 * sums[0] - light * sums[1]);
                if drop > best.0 || best.1[1] == f64::NEG_INFINITY {
                    best = (drop, [*delay, light.ln()]);
                }
            }
            best.1
        };
        (0..self.pairs.len()).into_par_iter().map(of_pair).collect()
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
    let all = [DEVIATION_PRIOR[2], POWER_PRIORS[0][1], POWER_PRIORS[1][1], PLACE_PRIOR, PLACE_PRIOR];
    own.into_iter().cycle().take(OF_PAIR * pairs).chain(all).collect()
}

/// The best calibration from `start` on, and the steps to it; `before`: steps of an earlier fit.
pub fn fitted(
    start: &Calibration,
    before: Option<Vec<f64>>,
    measured: &KnownPositions,
) -> (Calibration, Option<Vec<f64>>) {
    let mut start = start.clone();
    start.pairs.iter_mut().for_each(|pair| pair.light = 0.0);
    let numbers = OF_PAIR * start.pairs.len() + OF_ALL;
    let mut steps = before.unwrap_or_else(|| {
        let step = (0.5 * start.deviation).max(PLACE_PRIOR / 40.0);
        let count = (2.0 * PLACE_PRIOR / step) as i32;
        let delays: Vec<f64> = (-count..=count).map(|at| f64::from(at) * step).collect();
        let guessed = start.guessed(measured, &delays);
        guessed.iter().flat_map(|[delay, light]| [0.0, 0.0, *delay, *light]).chain([0.0; OF_ALL]).collect()
    });
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

fn equations(start: &Calibration, steps: &[f64], measured: &KnownPositions) -> CalibrationStep {
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
        let mut sum = CalibrationStep {
            matrix: vec![vec![0.0; numbers]; numbers],
            score: vec![0.0; numbers],
            cost: 0.0,
        };
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
    let parts: Vec<CalibrationStep> = (0..start.pairs.len()).into_par_iter().map(of_pair).collect();
    let mut sum =
        CalibrationStep { matrix: vec![vec![0.0; numbers]; numbers], score: vec![0.0; numbers], cost: 0.0 };
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
