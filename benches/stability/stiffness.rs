//! How stiff a scene is: the spectrum of its weighted normal operator, and iterations to a given residual.

use thirdbounce::transport::twin::{self, Sample};
use thirdbounce::transport::{Model, Reflectance};

use crate::extreme::{Case, solve};

/// Condition of the normal operator on albedos, by itself and scaled by the bound D that steps divide by.
pub struct Condition {
    pub voxels: usize,
    pub plain: f64,
    pub scaled: f64,
    /// Largest over smallest D.
    pub spread: f64,
}

/// Eigenvalues below this share of the largest are rounding errors of the operator.
const RANK: f64 = 1e-12;
/// Voxels of the largest operator that is taken apart.
const MOST: usize = 220;

/// Of the isotropic model (albedos alone, so the operator is linear) on so many of the case's voxels.
pub fn condition(case: &Case) -> Condition {
    let mut case = case.clone();
    let every = case.active.len().div_ceil(MOST).max(1);
    case.active = case.active.iter().copied().step_by(every).collect();
    let reflectance = match case.model.reflectance {
        Reflectance::Retroreflective => Reflectance::Retroreflective,
        _ => Reflectance::Isotropic,
    };
    case.model = Model { reflectance, ..case.model };
    let twin = case.twin();
    let points = twin::points(&twin, &case.active);
    let columns: Vec<Vec<f64>> =
        points.iter().map(|p| twin::forward(&twin, std::slice::from_ref::<Sample>(p))).collect();
    let weight: Vec<f64> = (0..case.model.bins).map(|b| case.model.bin_weight(b)).collect();
    let dot = |a: &[f64], b: &[f64]| -> f64 {
        a.iter().zip(b).enumerate().map(|(i, (x, y))| weight[i % weight.len()] * x * y).sum()
    };
    let n = columns.len();
    let mut m = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            m[i][j] = dot(&columns[i], &columns[j]);
            m[j][i] = m[i][j];
        }
    }
    // All kernels are nonnegative: D is the sum of a row.
    let d: Vec<f64> = m.iter().map(|row| row.iter().sum()).collect();
    let scaled = (0..n).map(|i| (0..n).map(|j| m[i][j] / (d[i] * d[j]).sqrt()).collect()).collect();
    let seen = d.iter().copied().filter(|d| *d > 0.0);
    let [low, high] = seen.fold([f64::MAX, 0.0], |[a, b]: [f64; 2], d| [a.min(d), b.max(d)]);
    Condition {
        voxels: n,
        plain: ratio(eigenvalues(m)),
        scaled: ratio(eigenvalues(scaled)),
        spread: high / low,
    }
}

/// Largest over smallest of those that are not rounding errors.
fn ratio(values: Vec<f64>) -> f64 {
    let largest = values.iter().fold(0.0f64, |a, b| a.max(*b));
    values.iter().filter(|v| **v > RANK * largest).fold(0.0, |a: f64, v| a.max(largest / v))
}

/// Eigenvalues of a symmetric matrix by cyclic Jacobi rotations (Golub & Van Loan, section 8.5).
fn eigenvalues(mut m: Vec<Vec<f64>>) -> Vec<f64> {
    let n = m.len();
    for _ in 0..12 {
        for p in 0..n {
            for q in p + 1..n {
                if m[p][q].abs() <= 1e-17 * (m[p][p] * m[q][q]).abs().sqrt() {
                    continue;
                }
                let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let t = if theta == 0.0 { 1.0 } else { t };
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for row in m.iter_mut() {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                let (low, high) = m.split_at_mut(q);
                for (a, b) in low[p].iter_mut().zip(&mut high[0]) {
                    (*a, *b) = (c * *a - s * *b, s * *a + c * *b);
                }
            }
        }
    }
    (0..n).map(|i| m[i][i]).collect()
}

/// Iterations until the weighted residual is a tenth and a hundredth of the first one's; None within `most`.
pub fn iterations_to(case: &Case, most: usize, scalar: bool) -> [Option<usize>; 2] {
    // Without the group term, whose minimum is not at the data's.
    let mut case = case.clone();
    case.model.noise_factor = 0.0;
    let state = solve::by_twin(&case, &solve::centres(&case), most, scalar);
    assert!(state.objective.iter().all(|v| v.is_finite()), "{} diverges", case.name);
    [1e-2, 1e-4].map(|share| state.data.iter().position(|d| *d <= share * state.data[0]))
}
