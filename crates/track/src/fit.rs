//! The fit of all numbers: damped Gauss-Newton steps (Levenberg 1944, Marquardt 1963) with the variances of the present guess.

use glam::{DMat3, DVec3};
use thirdbounce_base::equations::solve_symmetric;

use crate::blob::{BlobShape, NUMBERS};
use crate::constants::{DAMPING, ENDS, EXTENT, ITERATIONS, ROUNDNESS};
use crate::information::{Blobs, Information, information};
use crate::sight::Sight;
use crate::symmetric::{Rows, inverse};

/// What is known before the counts: a place and its information for each blob, and mean and standard deviation of the other numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Expected {
    pub places: Vec<(DVec3, DMat3)>,
    pub extent: [f64; 2],
    pub roundness: [f64; 2],
}

impl Expected {
    /// Blobs anywhere in a box.
    pub fn within([low, high]: [DVec3; 2], blobs: usize, shape: BlobShape, unit: f64) -> Expected {
        let spread = (high - low) / 12f64.sqrt();
        let information = DMat3::from_diagonal((spread * spread).recip());
        Expected {
            places: vec![(low.midpoint(high), information); blobs],
            extent: [(EXTENT[0] * unit).ln(), EXTENT[1]],
            roundness: shape.roundness(),
        }
    }

    /// Adds what is known, and returns its squares.
    fn add(&self, guess: &Blobs, matrix: &mut Rows, score: &mut [f64]) -> f64 {
        let mut squares = 0.0;
        for (at, (blob, (place, sure))) in guess.blobs.iter().zip(&self.places).enumerate() {
            let first = NUMBERS * at;
            let off = *place - blob.at;
            let pull = *sure * off;
            squares += off.dot(pull);
            for i in 0..3 {
                score[first + i] += pull[i];
                (0..3).for_each(|j| matrix[first + i][first + j] += sure.col(j)[i]);
            }
            for (number, value, [mean, deviation]) in
                [(4, blob.extent, self.extent), (5, blob.roundness, self.roundness)]
            {
                let off = (mean - value) / deviation;
                squares += off * off;
                score[first + number] += off / deviation;
                matrix[first + number][first + number] += deviation.powi(-2);
            }
        }
        squares
    }
}

/// A fit.
#[derive(Debug, Clone)]
pub struct FittedBlobs {
    pub guess: Blobs,
    /// −2 times the logarithm of the likelihood, and of what was known.
    pub objective: f64,
    /// Information of the counts, and with the prior.
    counted: Rows,
    matrix: Rows,
    /// Information of the roundness that errors do not have.
    sure_of_roundness: f64,
    score: Vec<f64>,
    pub squares: f64,
    pub expected: f64,
}

impl FittedBlobs {
    /// At a guess.
    pub fn at(sight: &Sight, guess: Blobs, known: &Expected, has_errors: bool) -> FittedBlobs {
        let Information { mut matrix, mut score, squares, log_variance, expected } =
            information(sight, &guess, has_errors);
        let counted = matrix.clone();
        let prior = known.add(&guess, &mut matrix, &mut score);
        let deviation = known.roundness[1];
        let is_unknown = deviation == ROUNDNESS[1];
        let sure_of_roundness = if is_unknown { deviation.powi(-2) - ENDS.powi(-2) } else { 0.0 };
        FittedBlobs {
            sure_of_roundness,
            guess,
            objective: squares + log_variance + prior,
            counted,
            matrix,
            score,
            squares,
            expected,
        }
    }

    /// Squared residuals over those to expect, at least 1.
    pub fn excess(&self) -> f64 {
        let free = self.expected - self.guess.numbers() as f64;
        if free >= 1.0 { (self.squares / free).max(1.0) } else { 1.0 }
    }

    /// The covariance of all numbers: the information of the counts is divided by the excess of the residuals.
    pub fn covariance(&self) -> Option<Rows> {
        let less = 1.0 - self.excess().recip();
        let mut matrix = self.matrix.clone();
        for blob in 0..self.guess.blobs.len() {
            let roundness = NUMBERS * blob + 5;
            matrix[roundness][roundness] -= self.sure_of_roundness;
        }
        matrix
            .iter_mut()
            .flatten()
            .zip(self.counted.iter().flatten())
            .for_each(|(sum, counted)| *sum -= less * counted);
        inverse(&matrix)
    }
}

/// Largest step of a position, in units of length, and of other numbers of a blob.
const STEP: [f64; 2] = [0.25, 0.7];
/// A fit ends where the objective changes by less, or where the damping is at its largest.
const STILL: f64 = 1e-2;
/// The objective also has the variances, whose derivatives steps do not know: it may rise by this.
const RISE: f64 = 0.2;

/// Fits all numbers, beginning with a guess; `iterations`: the most.
pub fn fit(sight: &Sight, guess: Blobs, known: &Expected, iterations: usize) -> FittedBlobs {
    let mut best = FittedBlobs::at(sight, guess, known, true);
    let mut damping = DAMPING[0];
    for _ in 0..iterations.min(ITERATIONS) {
        let Some(step) = step(&best, damping, sight.unit) else { break };
        let next = FittedBlobs::at(sight, best.guess.stepped(&step, sight.is_counted), known, true);
        if next.objective < best.objective + RISE {
            let change = (best.objective - next.objective).abs();
            best = next;
            damping = (damping / 5.0).max(1e-9);
            if change < STILL {
                break;
            }
        } else {
            damping *= 8.0;
            if damping > DAMPING[1] {
                break;
            }
        }
    }
    best
}

/// A damped step; `None` if nothing determines it.
fn step(from: &FittedBlobs, damping: f64, unit: f64) -> Option<Vec<f64>> {
    let mut matrix = from.matrix.clone();
    (0..matrix.len()).for_each(|i| matrix[i][i] *= 1.0 + damping);
    let mut step = from.score.clone();
    solve_symmetric(&mut matrix, &mut step, 1e-13);
    let blobs = from.guess.blobs.len();
    let longest = |step: &[f64]| {
        let way = DVec3::from_slice(step).length() / (STEP[0] * unit);
        step[3..NUMBERS].iter().fold(way, |most, v| most.max(v.abs() / STEP[1]))
    };
    let most = step.chunks_exact(NUMBERS).take(blobs).map(longest).fold(1.0, f64::max);
    step.iter_mut().for_each(|v| *v /= most);
    step.iter().all(|v| v.is_finite()).then_some(step)
}
