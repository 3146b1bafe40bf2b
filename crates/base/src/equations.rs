//! Systems of linear equations.

/// Solves symmetric equations, of which the lower half is given, by Cholesky's method: `sides` become the unknowns. An unknown whose
/// pivot is at most the share `least` of its square is undetermined: it is 0. Returns whether all are determined.
pub fn solve_symmetric<R: AsRef<[f64]> + AsMut<[f64]>>(
    rows: &mut [R],
    sides: &mut [f64],
    least: f64,
) -> bool {
    let count = sides.len();
    let mut known = vec![true; count]; // bounded: the equations of the caller
    for i in 0..count {
        let all = rows[i].as_ref()[i];
        for j in 0..=i {
            let [of_i, of_j] = [&rows[i], &rows[j]].map(AsRef::as_ref);
            let before: f64 = (0..j).filter(|k| known[*k]).map(|k| of_i[k] * of_j[k]).sum();
            let (rest, pivot) = (of_i[j] - before, of_j[j]);
            rows[i].as_mut()[j] = if i == j {
                known[i] = rest > least * all;
                if known[i] { rest.sqrt() } else { 1.0 }
            } else if known[j] {
                rest / pivot
            } else {
                0.0
            };
        }
    }
    let at = |i: usize, j: usize| rows[i].as_ref()[j];
    for i in 0..count {
        let before = (0..i).map(|k| at(i, k) * sides[k]).sum::<f64>();
        sides[i] = if known[i] { (sides[i] - before) / at(i, i) } else { 0.0 };
    }
    for i in (0..count).rev().filter(|i| known[*i]) {
        sides[i] = (sides[i] - (i + 1..count).map(|k| at(k, i) * sides[k]).sum::<f64>()) / at(i, i);
    }
    !known.contains(&false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_are_solved_and_what_nothing_determines_is_0() {
        const COUNT: usize = 14;
        let at = |i: usize, j: usize| if i == j { 2.0 + i as f64 } else { 1.0 / (1.0 + (i + j) as f64) };
        let mut sums: [[f64; COUNT]; COUNT] = std::array::from_fn(|i| std::array::from_fn(|j| at(i, j)));
        // Nothing is known of the fourth one.
        (0..COUNT).for_each(|i| (sums[i][3], sums[3][i]) = (0.0, 0.0));
        let want: [f64; COUNT] = std::array::from_fn(|i| if i == 3 { 0.0 } else { i as f64 - 4.0 });
        let mut sides: [f64; COUNT] = std::array::from_fn(|i| (0..COUNT).map(|j| sums[i][j] * want[j]).sum());
        assert!(!solve_symmetric(&mut sums, &mut sides, 1e-9));
        for (found, want) in sides.into_iter().zip(want) {
            assert!((found - want).abs() < 1e-9, "{found} {want}");
        }
        let mut sides = [3.0, 4.0];
        assert!(solve_symmetric(&mut [[2.0, f64::NAN], [1.0, 3.0]], &mut sides, 0.0));
        assert!((sides[0] - 1.0).abs() < 1e-12 && (sides[1] - 1.0).abs() < 1e-12, "{sides:?}");
    }
}
