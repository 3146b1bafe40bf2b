//! Photon counts without most of their noise: histograms of one room are mixtures of few.
//!
//! Counts are divided by the root of what row and column make of them, so that all have the same variance, and keep the singular vectors
//! whose values noise alone does not reach (Gavish & Donoho 2014). The first ones are found by subspace iteration (Halko et al. 2011).

use rayon::prelude::*;

/// Most singular vectors, and iterations.
const RANK: usize = 24;
const ITERATIONS: usize = 4;
/// More values are left as they are.
const MOST: usize = 1 << 25;
/// Least share of the mean that a column counts as: columns without light would divide by zero.
const FAINT: f64 = 0.02;
/// Sweeps of Jacobi's method.
const SWEEPS: usize = 12;

/// The rows of `bins` counts with a variance of `per_count` a count, and the share of their noise that remains. `None` if more singular
/// vectors hold light than are looked for.
pub fn low_rank(counts: &[f32], bins: usize, per_count: f64) -> Option<(Vec<f32>, f64)> {
    let rows = counts.len() / bins.max(1);
    if rows <= RANK || bins <= RANK || counts.len() > MOST || per_count.is_nan() || per_count <= 0.0 {
        return None;
    }
    let mean = counts.iter().map(|v| f64::from(*v)).sum::<f64>() / counts.len() as f64;
    let mut column = vec![FAINT * mean; bins];
    for row in counts.chunks_exact(bins) {
        column.iter_mut().zip(row).for_each(|(sum, v)| *sum += f64::from(*v) / rows as f64);
    }
    let root = |v: f64| v.max(1e-9 * mean).sqrt();
    let across: Vec<f64> = column.iter().map(|v| root(*v)).collect();
    let of_row =
        |row: &[f32]| root(row.iter().map(|v| f64::from(*v)).sum::<f64>() / bins as f64 + 1e-3 * mean);
    let along: Vec<f64> = counts.chunks_exact(bins).map(|row| of_row(row) / mean.sqrt()).collect();
    let even: Vec<f32> = counts
        .par_chunks_exact(bins)
        .zip(&along)
        .flat_map_iter(|(row, along)| {
            row.iter().zip(&across).map(move |(v, across)| (f64::from(*v) / (along * across)) as f32)
        })
        .collect();
    // Any start that is not special does.
    let start = |i: usize| ((i as f64 * 12.9898).sin() * 43758.5453).fract() as f32;
    let mut right: Vec<Vec<f32>> =
        (0..RANK).map(|k| (0..bins).map(|b| start(k * bins + b + 1)).collect()).collect();
    let mut left = vec![];
    for _ in 0..ITERATIONS {
        left = orthonormal(times(&even, bins, &right));
        right = orthonormal(transposed_times(&even, bins, &left));
    }
    let projected = transposed_times(&even, bins, &left);
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
    let gram: Vec<Vec<f64>> =
        projected.iter().map(|a| projected.iter().map(|b| dot(a, b)).collect()).collect();
    let (values, vectors) = eigen(gram);
    let (small, large) = (rows.min(bins) as f64, rows.max(bins) as f64);
    let beta = small / large;
    let factor = 2.0 * (beta + 1.0) + 8.0 * beta / (beta + 1.0 + (beta * beta + 14.0 * beta + 1.0).sqrt());
    let least = factor * large * per_count;
    let most = (0..RANK).max_by(|a, b| values[*a].total_cmp(&values[*b]));
    let kept: Vec<usize> = (0..RANK).filter(|k| values[*k] > least || Some(*k) == most).collect();
    if kept.len() == RANK {
        return None;
    }
    let mix = |of: &[Vec<f32>], k: usize| -> Vec<f32> {
        let mut sum = vec![0.0f32; of[0].len()];
        for (j, vector) in of.iter().enumerate() {
            let weight = vectors[j][k] as f32;
            sum.iter_mut().zip(vector).for_each(|(sum, v)| *sum += weight * v);
        }
        sum
    };
    let pairs: Vec<(Vec<f32>, Vec<f32>)> =
        kept.iter().map(|k| (mix(&left, *k), mix(&projected, *k))).collect();
    let mut smooth = vec![0.0f32; counts.len()];
    smooth.par_chunks_exact_mut(bins).enumerate().for_each(|(row, to)| {
        for (left, right) in &pairs {
            to.iter_mut().zip(right).for_each(|(sum, v)| *sum += left[row] * v);
        }
        let along = along[row] as f32;
        to.iter_mut().zip(&across).for_each(|(v, across)| *v = (*v * along * *across as f32).max(0.0));
    });
    Some((smooth, kept.len() as f64 * (rows + bins) as f64 / (rows * bins) as f64))
}

/// The matrix times each vector of `bins` values.
fn times(matrix: &[f32], bins: usize, vectors: &[Vec<f32>]) -> Vec<Vec<f32>> {
    let of = |vector: &Vec<f32>| -> Vec<f32> {
        matrix.chunks_exact(bins).map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum()).collect()
    };
    vectors.par_iter().map(of).collect()
}

/// The transposed matrix times each vector of one value a row.
fn transposed_times(matrix: &[f32], bins: usize, vectors: &[Vec<f32>]) -> Vec<Vec<f32>> {
    let of = |vector: &Vec<f32>| -> Vec<f32> {
        let mut sum = vec![0.0f32; bins];
        for (row, weight) in matrix.chunks_exact(bins).zip(vector) {
            sum.iter_mut().zip(row).for_each(|(sum, v)| *sum += weight * v);
        }
        sum
    };
    vectors.par_iter().map(of).collect()
}

/// Orthonormal vectors of the same space, by Gram and Schmidt, twice.
fn orthonormal(mut vectors: Vec<Vec<f32>>) -> Vec<Vec<f32>> {
    for i in 0..vectors.len() {
        for _ in 0..2 {
            let (before, rest) = vectors.split_at_mut(i);
            for other in before.iter() {
                let dot: f64 = rest[0].iter().zip(other).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
                rest[0].iter_mut().zip(other).for_each(|(a, b)| *a -= dot as f32 * b);
            }
            let norm =
                rest[0].iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
            rest[0].iter_mut().for_each(|v| *v = (f64::from(*v) / norm) as f32);
        }
    }
    vectors
}

/// Eigenvalues of a symmetric matrix, and its eigenvectors as columns, by Jacobi's method.
fn eigen(mut a: Vec<Vec<f64>>) -> (Vec<f64>, Vec<Vec<f64>>) {
    let n = a.len();
    let mut v: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    for (p, q) in (0..SWEEPS).flat_map(|_| (0..n).flat_map(|p| (p + 1..n).map(move |q| (p, q)))) {
        if a[p][q] == 0.0 {
            continue;
        }
        let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
        let t = 1.0f64.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
        let c = 1.0 / (t * t + 1.0).sqrt();
        let s = t * c;
        for row in a.iter_mut().chain(v.iter_mut()) {
            (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
        }
        let (low, high) = a.split_at_mut(q);
        for (x, y) in low[p].iter_mut().zip(&mut high[0]) {
            (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
        }
    }
    ((0..n).map(|i| a[i][i]).collect(), v)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn three_mixed_histograms_lose_most_of_their_noise() {
        let (rows, bins) = (200, 120);
        let light = |row: usize, bin: usize| {
            let peak = |at: f64, width: f64| (-((bin as f64 - at) / width).powi(2)).exp();
            let share = row as f64 / rows as f64;
            1.0 + 30.0 * share * peak(30.0, 8.0)
                + 20.0 * (1.0 - share) * peak(60.0, 5.0)
                + 10.0 * (6.0 * share).sin().powi(2) * peak(80.0, 15.0)
        };
        let mut random = Pcg64::seed_from_u64(3);
        let means: Vec<f64> = (0..rows * bins).map(|i| light(i / bins, i % bins)).collect();
        let counts: Vec<f32> =
            means.iter().map(|m| Poisson::new(*m).unwrap().sample(&mut random) as f32).collect();
        let off =
            |values: &[f32]| values.iter().zip(&means).map(|(v, m)| (f64::from(*v) - m).powi(2)).sum::<f64>();
        let (smooth, share) = low_rank(&counts, bins, 1.0).unwrap();
        let left = off(&smooth) / off(&counts);
        assert!(left < 0.08 && share < 0.08, "{left} {share}");
        // Exact light has no noise to take away; noise alone has no light.
        let exact: Vec<f32> = means.iter().map(|m| *m as f32).collect();
        assert!(low_rank(&exact, bins, 0.0).is_none());
        let kept = low_rank(&exact, bins, 1e-6).map_or(exact.clone(), |(smooth, _)| smooth);
        assert!(off(&kept) < 1e-4 * off(&counts));
    }
}
