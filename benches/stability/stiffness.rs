//! Stiffness of a scene: the spectrum of its weighted normal operator, and the iterations to a given error.

use glam::DVec3;
use thirdbounce::transport::twin::{self, Sample};

use fixtures::extreme::{Case, cases, solve};

/// Condition of the normal operator on albedos.
pub struct Condition {
    /// Voxels of the operator.
    pub voxels: usize,
    /// Condition of the operator.
    pub plain: f64,
    /// Condition of the operator scaled by the bound D that steps divide by.
    pub scaled: f64,
    /// Largest over smallest D.
    pub spread: f64,
}

/// Eigenvalues below this share of the largest are rounding errors of the operator.
const RANK: f64 = 1e-12;
/// Most voxels of an operator whose eigenvalues are computed.
const MOST: usize = 220;

/// The condition for the isotropic model (albedos alone, so the operator is linear) on at most [`MOST`] of the case's
/// voxels.
pub fn condition(case: &Case) -> Condition {
    let mut case = cases::as_albedos(case);
    let every = case.active.len().div_ceil(MOST).max(1);
    case.active = case.active.iter().copied().step_by(every).collect();
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
    let scaled = (0..n)
        .map(|i| (0..n).map(|j| m[i][j] / (d[i] * d[j]).sqrt().max(f64::MIN_POSITIVE)).collect())
        .collect();
    let seen = d.iter().copied().filter(|d| *d > 0.0);
    let [low, high] = seen.fold([f64::MAX, 0.0], |[a, b]: [f64; 2], d| [a.min(d), b.max(d)]);
    Condition {
        voxels: n,
        plain: ratio(eigenvalues(m)),
        scaled: ratio(eigenvalues(scaled)),
        spread: high / low,
    }
}

/// Largest over smallest of the values that are not rounding errors.
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

/// Iterations until the albedos are within a tenth and a hundredth of the truth; `None` if not within `most`. The error
/// is the root of the mean squared relative error over voxels: dim and far ones count as much as bright and near ones.
pub fn iterations_to(case: &Case, most: usize, scalar: bool) -> [Option<usize>; 2] {
    let case = cases::as_albedos(case);
    let points = solve::centres(&case);
    // Voxels that no bin sees cannot be reconstructed.
    let seen = case.active.iter().zip(solve::bounds(&case, &points)).filter(|(_, b)| b[0] > 0.0);
    let lit: Vec<usize> = seen.map(|(i, _)| *i as usize).filter(|i| case.truth[*i] != DVec3::ZERO).collect();
    let mut reached = [None; 2];
    solve::by_twin_heard(&case, &points, most, scalar, &mut |n, v, objective| {
        assert!(objective.is_finite(), "{} diverges", case.name);
        let off =
            lit.iter().map(|i| (v[*i] - case.truth[*i]).length_squared() / case.truth[*i].length_squared());
        let error = (off.sum::<f64>() / lit.len() as f64).sqrt();
        for (r, goal) in reached.iter_mut().zip([0.1, 0.01]) {
            if r.is_none() && error <= goal {
                *r = Some(n);
            }
        }
    });
    reached
}
