//! Symmetric matrices: inverse, and axes of 3 × 3 ones.

use glam::{DMat3, DVec3};
use thirdbounce_base::equations::solve_symmetric;

/// A square matrix by rows.
pub type Rows = Vec<Vec<f64>>;

/// The inverse of a positive definite matrix; `None` if it is not.
pub fn inverse(matrix: &Rows) -> Option<Rows> {
    let count = matrix.len();
    let mut columns = Vec::with_capacity(count);
    for at in 0..count {
        let mut side = vec![0.0; count];
        side[at] = 1.0;
        if !solve_symmetric(&mut matrix.clone(), &mut side, 1e-13) || side.iter().any(|v| !v.is_finite()) {
            return None;
        }
        columns.push(side);
    }
    Some(columns)
}

/// Three rows and columns from `at` on.
pub fn block(matrix: &Rows, at: usize) -> DMat3 {
    let column = |j: usize| DVec3::new(matrix[at][at + j], matrix[at + 1][at + j], matrix[at + 2][at + j]);
    DMat3::from_cols(column(0), column(1), column(2))
}

/// Sweeps of [`axes`].
const SWEEPS: usize = 24;

/// Variances along the axes of a symmetric matrix, the largest first, and the axes (Jacobi's rotations).
pub fn axes(matrix: DMat3) -> [(f64, DVec3); 3] {
    let (mut rest, mut turned) = (matrix, DMat3::IDENTITY);
    for sweep in 0..SWEEPS {
        let (i, j) = [(0, 1), (0, 2), (1, 2)][sweep % 3];
        let (across, apart) = (rest.col(j)[i], rest.col(j)[j] - rest.col(i)[i]);
        if across == 0.0 {
            continue;
        }
        let angle = 0.5 * (2.0 * across).atan2(apart);
        let (sine, cosine) = angle.sin_cos();
        let mut turn = DMat3::IDENTITY;
        turn.col_mut(i)[i] = cosine;
        turn.col_mut(j)[j] = cosine;
        turn.col_mut(i)[j] = -sine;
        turn.col_mut(j)[i] = sine;
        rest = turn.transpose() * rest * turn;
        turned *= turn;
    }
    let mut all = [0, 1, 2].map(|k| (rest.col(k)[k], turned.col(k)));
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    all
}

/// The product of a vector with itself.
pub fn square(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_and_inverse_of_a_known_matrix() {
        let [a, b] = [DVec3::new(1.0, 2.0, 2.0) / 3.0, DVec3::new(2.0, 1.0, -2.0) / 3.0];
        let c = a.cross(b);
        let made = 9.0 * square(a) + 4.0 * square(b) + 0.25 * square(c);
        let found = axes(made);
        for ((variance, axis), (want, along)) in found.into_iter().zip([(9.0, a), (4.0, b), (0.25, c)]) {
            assert!((variance - want).abs() < 1e-9 && axis.dot(along).abs() > 1.0 - 1e-9, "{found:?}");
        }
        let rows: Rows = (0..3).map(|i| (0..3).map(|j| made.col(j)[i]).collect()).collect();
        let product = block(&inverse(&rows).unwrap(), 0) * made;
        assert!((product - DMat3::IDENTITY).to_cols_array().iter().all(|v| v.abs() < 1e-9), "{product}");
        assert!(inverse(&vec![vec![1.0, 1.0], vec![1.0, 1.0]]).is_none());
    }
}
