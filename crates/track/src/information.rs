//! Normal equations of a step: Fisher information and score of the numbers of blobs and of the background.
//!
//! The residual of a pair has the variance of its counts, and that of what a blob does not describe: a factor of its light and a shift
//! of its path, independent from pair to pair, and errors of its profile, independent from bin to bin. Light and path are directions in
//! the space of bins, so each is one update of rank 1 of the pair's sums of products.

use rayon::prelude::*;

use crate::blob::{Blob, NUMBERS};
use crate::constants::{LIGHT_ERROR, PATH_ERROR, PROFILE_ERROR};
use crate::sight::{Ray, Sight};
use crate::symmetric::Rows;

/// Blobs, and counts of every bin without light.
#[derive(Debug, Clone, PartialEq)]
pub struct Blobs {
    pub blobs: Vec<Blob>,
    pub background: f64,
}

impl Blobs {
    /// Numbers: those of each blob, and last the background.
    pub fn numbers(&self) -> usize {
        NUMBERS * self.blobs.len() + 1
    }

    /// The guess after a step of all numbers.
    pub fn stepped(&self, step: &[f64], is_counted: bool) -> Blobs {
        let parts = self.blobs.iter().zip(step.chunks(NUMBERS));
        let background = self.background + step[step.len() - 1];
        Blobs {
            blobs: parts.map(|(blob, step)| blob.stepped(step)).collect(),
            background: if is_counted { background.max(0.0) } else { background },
        }
    }
}

/// Information of the counts.
#[derive(Debug, Clone, PartialEq)]
pub struct Information {
    /// Fisher information of all numbers.
    pub matrix: Rows,
    /// Score: half the derivative of −χ².
    pub score: Vec<f64>,
    /// Squared residuals in their covariance.
    pub squares: f64,
    /// Logarithm of the determinant of that covariance, so that `squares + log_variance` is −2 times the logarithm of the likelihood.
    pub log_variance: f64,
    /// Squared residuals to expect: fewer than bins, as bins have a least variance.
    pub expected: f64,
}

impl Information {
    fn none(numbers: usize) -> Information {
        Information {
            matrix: vec![vec![0.0; numbers]; numbers],
            score: vec![0.0; numbers],
            squares: 0.0,
            log_variance: 0.0,
            expected: 0.0,
        }
    }

    fn plus(mut self, other: &Information) -> Information {
        self.matrix.iter_mut().flatten().zip(other.matrix.iter().flatten()).for_each(|(a, b)| *a += b);
        self.score.iter_mut().zip(&other.score).for_each(|(a, b)| *a += b);
        self.squares += other.squares;
        self.log_variance += other.log_variance;
        self.expected += other.expected;
        self
    }
}

/// Pairs of a task.
const TASK: usize = 32;

/// Buffers of a task: rendered bins of each blob, spare bins, sums of products.
#[derive(Default)]
struct PairSums {
    rendered: Vec<Vec<[f64; 3]>>,
    spare: Vec<[f64; 3]>,
    columns: Vec<f64>,
    products: Rows,
}

/// Information of the counts at a guess. `has_errors`: with the model errors of a blob.
pub fn information(sight: &Sight, guess: &Blobs, has_errors: bool) -> Information {
    let of_task = |first: usize| {
        let mut bench = PairSums::default();
        let mut sum = Information::none(guess.numbers());
        (first..(first + TASK).min(sight.pairs()))
            .for_each(|pair| add(sight, pair, guess, has_errors, &mut bench, &mut sum));
        sum
    };
    // In the order of tasks, whatever thread does them.
    let tasks: Vec<Information> = if sight.pairs() > TASK {
        (0..sight.pairs()).step_by(TASK).collect::<Vec<_>>().into_par_iter().map(of_task).collect()
    } else {
        vec![of_task(0)]
    };
    let mut sum = tasks.iter().fold(Information::none(guess.numbers()), Information::plus);
    for i in 0..guess.numbers() {
        for j in i + 1..guess.numbers() {
            sum.matrix[i][j] = sum.matrix[j][i];
        }
    }
    sum
}

/// Adds the information of one pair.
fn add(
    sight: &Sight,
    pair: usize,
    guess: &Blobs,
    has_errors: bool,
    bench: &mut PairSums,
    sum: &mut Information,
) {
    let parts = sight.parts;
    let rays: Vec<Ray> = guess.blobs.iter().flat_map(|blob| sight.rays(pair, blob)).collect();
    // Per ray: counts, derivatives by path and variance; then the background, and the residual.
    let (background, residual) = (3 * rays.len(), 3 * rays.len() + 1);
    let count = residual + 1;
    bench.rendered.resize(rays.len(), vec![]);
    bench.products.resize(count, vec![]);
    bench.products.iter_mut().for_each(|row| {
        row.clear();
        row.resize(count, 0.0);
    });
    bench.columns.resize(count, 0.0);
    let mut window = [sight.bins, 0];
    for (ray, into) in rays.iter().zip(&mut bench.rendered) {
        into.clear();
        into.resize(sight.bins, [0.0; 3]);
        let [first, end] = sight.render(ray, &mut bench.spare, into);
        if first < end {
            window = [window[0].min(first), window[1].max(end)];
        }
    }
    let (products, columns) = (&mut bench.products, &mut bench.columns);
    let counts = &sight.counts[pair * sight.bins..(pair + 1) * sight.bins];
    let [dark, of_dark] = sight.variance(guess.background);
    let of_blob =
        |rendered: &[Vec<[f64; 3]>], bin: usize| rendered.iter().map(|bins| bins[bin][0]).sum::<f64>();
    let strongest = |rendered: &[Vec<[f64; 3]>]| {
        (window[0]..window[1]).fold(0.0, |most: f64, bin| most.max(of_blob(rendered, bin)))
    };
    let peak: f64 = bench.rendered.chunks(parts).map(strongest).sum();
    let misshapen = if has_errors { (PROFILE_ERROR * peak).powi(2) } else { 0.0 };
    let (mut outside, mut log) = ([0.0; 3], 0.0);
    for (bin, count_of_bin) in counts.iter().enumerate() {
        if !(window[0]..window[1]).contains(&bin) {
            let rest = count_of_bin - guess.background;
            outside = [outside[0] + 1.0, outside[1] + rest, outside[2] + rest * rest];
            continue;
        }
        let mut mean = guess.background;
        for (at, rendered) in bench.rendered.iter().enumerate() {
            columns[3 * at..3 * at + 3].copy_from_slice(&rendered[bin]);
            mean += rendered[bin][0];
        }
        let [of_noise, share] = sight.variance(mean);
        let variance = of_noise + misshapen;
        log += variance.ln();
        sum.expected += (share * of_noise + misshapen) / variance;
        (columns[background], columns[residual]) = (1.0, count_of_bin - mean);
        for i in 0..count {
            let weighted = columns[i] / variance;
            (0..=i).for_each(|j| products[i][j] += weighted * columns[j]);
        }
    }
    log += outside[0] * dark.ln();
    sum.expected += outside[0] * of_dark;
    products[background][background] += outside[0] / dark;
    products[residual][background] += outside[1] / dark;
    products[residual][residual] += outside[2] / dark;
    for (i, j) in (0..count).flat_map(|i| (0..i).map(move |j| (i, j))) {
        products[j][i] = products[i][j];
    }
    for (at, blob) in guess.blobs.iter().enumerate().filter(|_| has_errors) {
        for (first, error) in [(0, LIGHT_ERROR), (1, 2.0 * PATH_ERROR * blob.extent.exp())] {
            let variance = error * error;
            // One error of all rays of a blob.
            let of_blob = || (at * parts..(at + 1) * parts).map(|ray| 3 * ray + first);
            let along: Vec<f64> =
                (0..count).map(|row| of_blob().map(|column| products[column][row]).sum()).collect();
            let grown = 1.0 + variance * of_blob().map(|column| along[column]).sum::<f64>();
            log += grown.ln();
            let share = variance / grown;
            for (row, a) in products.iter_mut().zip(&along) {
                row.iter_mut().zip(&along).for_each(|(value, b)| *value -= share * a * b);
            }
        }
    }
    sum.squares += products[residual][residual];
    sum.log_variance += log;
    chain(guess, parts, &rays, products, sum);
}

/// Derivatives of a column of sums by the numbers of a blob: weights of counts, of the derivatives by path and by variance.
fn weights(blob: &Blob, ray: &Ray) -> [[f64; 3]; NUMBERS] {
    use crate::constants::{BEHIND, SPREAD};
    let radius = blob.extent.exp();
    let along = |axis: usize| [ray.by_light[axis], ray.by_path[axis], ray.by_variance[axis]];
    let shift = -2.0 * BEHIND * radius;
    [
        along(0),
        along(1),
        along(2),
        [1.0, 0.0, 0.0],
        [ray.by_extent, shift * blob.roundness, 2.0 * (2.0 * SPREAD * radius).powi(2)],
        [0.0, shift, 0.0],
    ]
}

/// Adds the sums of a pair to those of all numbers.
fn chain(guess: &Blobs, parts: usize, rays: &[Ray], products: &Rows, sum: &mut Information) {
    let blobs = guess.blobs.len();
    let (background, residual) = (3 * rays.len(), 3 * rays.len() + 1);
    let blob_of = |ray: usize| ray / parts;
    let all: Vec<_> =
        rays.iter().enumerate().map(|(at, ray)| weights(&guess.blobs[blob_of(at)], ray)).collect();
    let last = NUMBERS * blobs;
    for (a, of_a) in all.iter().enumerate() {
        for (i, weight) in of_a.iter().enumerate() {
            let row = NUMBERS * blob_of(a) + i;
            let combined =
                |column: usize| (0..3).map(|k| weight[k] * products[3 * a + k][column]).sum::<f64>();
            sum.score[row] += combined(residual);
            sum.matrix[last][row] += combined(background);
            for (b, of_b) in all.iter().enumerate().take((blob_of(a) + 1) * parts) {
                let columns = [combined(3 * b), combined(3 * b + 1), combined(3 * b + 2)];
                for (j, other) in of_b.iter().enumerate() {
                    sum.matrix[row][NUMBERS * blob_of(b) + j] +=
                        (0..3).map(|k| other[k] * columns[k]).sum::<f64>();
                }
            }
        }
    }
    sum.score[last] += products[residual][background];
    sum.matrix[last][last] += products[background][background];
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::capture::{Capture, Pulse, Reflectance};
    use crate::edge::Edge;

    fn sight() -> Sight {
        let points = |shift: f64| {
            (0..6).map(move |i| DVec3::new(0.2 * f64::from(i % 3) - shift, 0.3 * f64::from(i / 3), 0.0))
        };
        let counts = (0..6 * 90).map(|i| (i % 7) as f32).collect();
        let mut capture =
            Capture::new([3, 2], points(0.2).collect(), points(0.15).collect(), 90, 0.03, counts);
        (capture.laser_spot, capture.sensor_spot) = (Some(0.05), Some(0.12));
        capture.pulse = Some(Pulse::gaussian(0.06).unwrap().with_tail(0.05).unwrap());
        capture.integer_counts = true;
        Sight::of(&capture, Reflectance::Lambertian, [1.0, 0.0]).unwrap()
    }

    fn guess() -> Blobs {
        let blob = |at, roundness| Blob { at, light: 5.0, extent: -2.4, roundness };
        let blobs = vec![blob(DVec3::new(0.1, 0.22, 0.7), 0.6), blob(DVec3::new(-0.2, 0.0, 0.9), 0.3)];
        Blobs { blobs, background: 0.7 }
    }

    /// Mean counts of all pairs and bins.
    fn means(sight: &Sight, guess: &Blobs) -> Vec<f64> {
        let of_pair = |pair: usize| {
            let mut rendered = vec![[0.0; 3]; sight.bins];
            for blob in &guess.blobs {
                sight.rays(pair, blob).for_each(|ray| _ = sight.render(&ray, &mut vec![], &mut rendered));
            }
            rendered.into_iter().map(|r| r[0] + guess.background).collect::<Vec<_>>()
        };
        (0..sight.pairs()).flat_map(of_pair).collect()
    }

    #[test]
    fn derivatives_are_finite_differences() {
        check_derivatives(&sight());
    }

    #[test]
    fn derivatives_of_upright_objects_behind_an_edge_are_finite_differences() {
        check_derivatives(&sight().past(Some(Edge::new([-0.05, 0.12], -170.0))).upright());
    }

    fn check_derivatives(sight: &Sight) {
        let guess = guess();
        let numbers = guess.numbers();
        let small = 1e-5;
        let slopes: Vec<Vec<f64>> = (0..numbers)
            .map(|number| {
                let side = |sign: f64| {
                    let mut step = vec![0.0; numbers];
                    step[number] = sign * small;
                    means(sight, &guess.stepped(&step, false))
                };
                side(1.0).iter().zip(side(-1.0)).map(|(a, b)| (a - b) / (2.0 * small)).collect()
            })
            .collect();
        let mean = means(sight, &guess);
        let found = information(sight, &guess, false);
        let weights: Vec<f64> = mean.iter().map(|m| 1.0 / sight.variance(*m)[0]).collect();
        for i in 0..numbers {
            let score: f64 =
                (0..mean.len()).map(|k| slopes[i][k] * weights[k] * (sight.counts[k] - mean[k])).sum();
            let size = found.matrix[i][i].sqrt() * found.squares.sqrt();
            assert!((found.score[i] - score).abs() < 1e-5 * size, "score {i}: {} {score}", found.score[i]);
            for j in 0..numbers {
                let product: f64 = (0..mean.len()).map(|k| slopes[i][k] * weights[k] * slopes[j][k]).sum();
                let size = (found.matrix[i][i] * found.matrix[j][j]).sqrt();
                assert!(
                    (found.matrix[i][j] - product).abs() < 1e-5 * size,
                    "{i} {j}: {} {product}",
                    found.matrix[i][j]
                );
            }
        }
    }

    #[test]
    fn errors_of_the_model_are_those_of_the_full_covariance_of_a_pair() {
        check_errors(&sight());
        check_errors(&sight().upright());
    }

    fn check_errors(sight: &Sight) {
        let mut guess = guess();
        guess.blobs.truncate(1);
        let found = information(sight, &guess, true);
        // The same by dense matrices.
        let (mut squares, mut log) = (0.0, 0.0);
        let radius = guess.blobs[0].extent.exp();
        for pair in 0..sight.pairs() {
            let mut rendered = vec![[0.0; 3]; sight.bins];
            sight
                .rays(pair, &guess.blobs[0])
                .for_each(|ray| _ = sight.render(&ray, &mut vec![], &mut rendered));
            let mean = |bin: usize| rendered[bin][0] + guess.background;
            let peak = rendered.iter().fold(0.0, |most: f64, b| most.max(b[0]));
            let is_lit = |bin: usize| rendered[bin][0] > 0.0;
            let of_bin = |bin: usize| {
                let profile = if is_lit(bin) { (PROFILE_ERROR * peak).powi(2) } else { 0.0 };
                sight.variance(mean(bin))[0] + profile
            };
            let entry = |i: usize, j: usize| {
                let own = if i == j { of_bin(i) } else { 0.0 };
                own + LIGHT_ERROR.powi(2) * rendered[i][0] * rendered[j][0]
                    + (2.0 * PATH_ERROR * radius).powi(2) * rendered[i][1] * rendered[j][1]
            };
            let rows: Rows =
                (0..sight.bins).map(|i| (0..sight.bins).map(|j| entry(i, j)).collect()).collect();
            let rest: Vec<f64> =
                (0..sight.bins).map(|bin| sight.counts[pair * sight.bins + bin] - mean(bin)).collect();
            let (mut factor, mut solved) = (rows, rest.clone());
            thirdbounce_base::equations::solve_symmetric(&mut factor, &mut solved, 0.0);
            squares += rest.iter().zip(&solved).map(|(a, b)| a * b).sum::<f64>();
            log += (0..sight.bins).map(|i| 2.0 * factor[i][i].ln()).sum::<f64>();
        }
        assert!((found.squares / squares - 1.0).abs() < 1e-9, "{} {squares}", found.squares);
        assert!((found.log_variance / log - 1.0).abs() < 1e-9, "{} {log}", found.log_variance);
    }
}
