//! Takes down what changes slowly along time, in the measurement and in what is rendered alike.
//!
//! Ambient light, tails, later bounces and surfaces beyond the box are smooth over time, and often larger than the light
//! of the hidden object. Least squares on raw histograms bend the surface to them. So the surface solver may minimise
//! |F S (A v - h)|², where S are the roots of the bins' weights and
//!
//! ```text
//! F = 1 - (1 - floor) (1 + κ L)⁻¹,
//! ```
//!
//! with L the second difference of a histogram with free ends and κ = σ² / 2 for a length σ in bins. (1 + κ L)⁻¹ is the
//! smoother of Whittaker (1923) with first differences: a two-sided exponential of standard deviation σ. F is symmetric
//! and its eigenvalues lie between the floor and 1. So whatever bounds the curvature of |S (A v - h)|² bounds that of
//! the filtered objective, and F loses nothing but weight.
//!
//! The smoother's output y for a row x of N bins is computed in two ways, by factors that all rows share ([`HighPass::factors`]).
//!
//! *Elimination* (`glsl/residual_rows.comp`): 1 + κ L is tridiagonal, with -κ beside its diagonal of 1 + κ times the number of
//! neighbours. With pivots p and f = κ / p,
//!
//! ```text
//! p_i = 1 + κ (neighbours_i - f_(i-1)),   e_i = x_i / p_i + f_i e_(i-1),   y_i = e_i + f_i y_(i+1).
//! ```
//!
//! *Recurrences* (`glsl/residual_scan.comp`): free ends are those of a row that its mirror images continue, with period 2 N. Of a
//! row without ends, κ (1 - a)² = a makes y a sum with weights a^|i - j|:
//!
//! ```text
//! y_i = (1 - a) / (1 + a) (c_i + d_i - x_i),   c_i = x_i + a c_(i-1),   d_i = x_i + a d_(i+1).
//! ```
//!
//! With c and d from zero at the row's ends, the images add aⁱ⁺¹ w (d_0 + a^N c_(N-1)) to c_i and a^(N-i) w (c_(N-1) + a^N d_0) to
//! d_i: what one period gives, times w = 1 + a^(2N) + a^(4N) + … = 1 / (1 - a^(2N)) for all before it.

use super::kernels::SurfaceData;

/// A high-pass filter along time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HighPass {
    /// Standard deviation of the smoother whose output is taken off, metres of path.
    pub length: f64,
    /// What is left of light that does not change along time, as a share of its amplitude.
    pub floor: f64,
}

impl HighPass {
    /// Decay of the smoother from one bin to the next.
    pub fn decay(&self, bin_width: f64) -> f64 {
        let half = (bin_width / self.length).powi(2);
        1.0 + half - (half * (half + 2.0)).sqrt()
    }

    /// The block of the kernels that filter rows of `bins` bins.
    pub fn block(&self, bins: usize, bin_width: f64) -> SurfaceData {
        let slow_decay = self.decay(bin_width) as f32;
        // Of the rounded decay, whose powers the kernels sum.
        let over_both = f64::from(slow_decay).powi(2 * bins as i32);
        SurfaceData {
            slow_decay,
            slow_share: (1.0 - self.floor) as f32,
            slow_wrap: (1.0 - over_both).recip() as f32,
        }
    }

    /// What all rows of bins with these weights share (`glsl/include/compared.glsl`): by bin the root of its weight, 1 / p, f and
    /// aⁱ, and a^N for their end.
    pub fn factors(&self, weights: &[f64], bin_width: f64) -> Vec<[f32; 4]> {
        let decay = f64::from(self.decay(bin_width) as f32);
        let steps = self.rows_of(weights.len(), bin_width).steps;
        let of_bins =
            weights.iter().zip(steps).map(|(weight, [inverse, factor])| [weight.sqrt(), inverse, factor]);
        let all = of_bins.chain([[0.0; 3]]).enumerate();
        all.map(|(i, [root, inverse, factor])| {
            [root, inverse, factor, decay.powi(i as i32)].map(|v| v as f32)
        })
        .collect()
    }

    /// Filters a row in place.
    pub fn apply(&self, row: &mut [f64], bin_width: f64) {
        self.rows_of(row.len(), bin_width).apply(row);
    }

    /// The filter for rows of `bins` bins.
    pub fn rows_of(&self, bins: usize, bin_width: f64) -> RowFilter {
        let kappa = 0.5 * (self.length / bin_width).powi(2);
        let neighbours = |i: usize| f64::from(u8::from(i > 0) + u8::from(i + 1 < bins));
        let (mut steps, mut factor) = (Vec::with_capacity(bins), 0.0);
        for i in 0..bins {
            let inverse = 1.0 / (1.0 + kappa * (neighbours(i) - factor));
            factor = kappa * inverse;
            steps.push([inverse, factor]);
        }
        RowFilter { kappa, steps, share: 1.0 - self.floor }
    }

    /// Mean squares per bin of what changes slowly in `rows` of `bins` bins, and of the rest, each divided by what
    /// white noise of unit variance has there.
    pub fn bands(&self, rows: &[f64], bins: usize, bin_width: f64) -> [f64; 2] {
        let filter = self.rows_of(bins, bin_width);
        let of_row = |row: &[f64]| {
            let slow = filter.smoothed(row);
            let squares = row.iter().zip(slow).map(|(v, s)| [s * s, (v - s) * (v - s)]);
            squares.fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
        };
        let sums = rows.chunks_exact(bins).map(of_row).fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        let of_noise = |gain: &dyn Fn(f64) -> f64| {
            (0..bins).map(|k| gain(self.slow_gain(k, bins, bin_width)).powi(2)).sum::<f64>() / bins as f64
        };
        let count = rows.len().max(1) as f64;
        [sums[0] / of_noise(&|slow| slow) / count, sums[1] / of_noise(&|slow| 1.0 - slow) / count]
    }

    /// The smoother's gain at frequency number `k` of `bins` bins.
    fn slow_gain(&self, k: usize, bins: usize, bin_width: f64) -> f64 {
        let half = (bin_width / self.length).powi(2);
        // Eigenvalues of L: 2 - 2 cos.
        half / (half + 1.0 - (std::f64::consts::PI * k as f64 / bins as f64).cos())
    }

    /// What is left of white noise over `bins` bins, as a share of its squares: the mean of F².
    pub fn of_noise(&self, bins: usize, bin_width: f64) -> f64 {
        let gain = |k: usize| 1.0 - (1.0 - self.floor) * self.slow_gain(k, bins, bin_width);
        (0..bins).map(|k| gain(k).powi(2)).sum::<f64>() / bins.max(1) as f64
    }
}

/// Rows that are filtered side by side.
pub const LANES: usize = 8;

/// A high-pass for rows of one length.
#[derive(Debug, Clone)]
pub struct RowFilter {
    kappa: f64,
    /// Of the elimination, by bin: the inverse of the pivot, and that times κ.
    steps: Vec<[f64; 2]>,
    /// Share of the smoother's output that is taken off.
    share: f64,
}

impl RowFilter {
    /// Filters a row in place.
    pub fn apply(&self, row: &mut [f64]) {
        let smoothed = self.smoothed(row);
        row.iter_mut().zip(smoothed).for_each(|(v, slow)| *v -= self.share * slow);
    }

    /// The sum of squares of each of up to [`LANES`] rows of `bins` bins once they are filtered; `of` returns the value of a row and a bin.
    /// Side by side, rows do not wait for their recurrences; each has the bits of [`RowFilter::apply`].
    pub fn squares(
        &self,
        rows: usize,
        of: impl Fn(usize, usize) -> f64,
        spare: &mut Vec<[f64; LANES]>,
    ) -> [f64; LANES] {
        let value = |bin: usize| std::array::from_fn(|row| if row < rows { of(row, bin) } else { 0.0 });
        spare.clear();
        let mut before = [0.0; LANES];
        for (bin, [inverse, _]) in self.steps.iter().enumerate() {
            let values: [f64; LANES] = value(bin);
            before = std::array::from_fn(|row| inverse * (values[row] + self.kappa * before[row]));
            spare.push(before);
        }
        for i in (1..spare.len()).rev() {
            let (next, factor) = (spare[i], self.steps[i - 1][1]);
            spare[i - 1].iter_mut().zip(next).for_each(|(slow, next)| *slow += factor * next);
        }
        let mut sums = [0.0; LANES];
        for (bin, slow) in spare.iter().enumerate() {
            let values: [f64; LANES] = value(bin);
            for ((sum, value), slow) in sums.iter_mut().zip(values).zip(slow) {
                let left = value - self.share * slow;
                *sum += left * left;
            }
        }
        sums
    }

    /// (1 + κ L)⁻¹ of a row, by elimination.
    fn smoothed(&self, row: &[f64]) -> Vec<f64> {
        let mut answer: Vec<f64> = Vec::with_capacity(row.len());
        let mut before = 0.0;
        for (value, [inverse, _]) in row.iter().zip(&self.steps) {
            before = inverse * (value + self.kappa * before);
            answer.push(before);
        }
        for i in (1..answer.len()).rev() {
            answer[i - 1] += self.steps[i - 1][1] * answer[i];
        }
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILTER: HighPass = HighPass { length: 0.07, floor: 0.1 };

    fn through(of: impl Fn(usize) -> f64, count: usize) -> Vec<f64> {
        let mut row: Vec<f64> = (0..count).map(of).collect();
        FILTER.apply(&mut row, 0.01);
        row
    }

    #[test]
    fn what_does_not_change_keeps_the_floor() {
        assert!(through(|_| 3.0, 40).iter().all(|v| (v - 0.3).abs() < 1e-12));
        assert!((through(|_| 5.0, 1)[0] - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_step_of_light_loses_an_exponential_of_this_length() {
        let row = through(|i| if i == 200 { 1.0 } else { 0.0 }, 401);
        let slow: Vec<f64> = (0..401).map(|i| f64::from(u8::from(i == 200)) - row[i]).collect();
        let sum: f64 = slow.iter().sum();
        let squares: f64 = slow.iter().enumerate().map(|(i, v)| v * (i as f64 - 200.0).powi(2)).sum();
        assert!((sum - 0.9).abs() < 1e-9 && ((squares / sum).sqrt() / 7.0 - 1.0).abs() < 1e-6);
        let decay = FILTER.decay(0.01);
        assert!((slow[230] / slow[229] - decay).abs() < 1e-9, "{decay}");
    }

    #[test]
    fn rows_side_by_side_have_the_squares_of_each() {
        let bins = 37;
        let of = |row: usize, bin: usize| ((row * bins + bin) as f64 * 0.7).sin();
        let filter = FILTER.rows_of(bins, 0.01);
        let found = filter.squares(5, of, &mut vec![]);
        for (row, found) in found.into_iter().enumerate() {
            let row = through(|bin| if row < 5 { of(row, bin) } else { 0.0 }, bins);
            assert_eq!(found, row.iter().fold(0.0, |sum, v| sum + v * v));
        }
    }

    #[test]
    fn the_filter_is_symmetric_and_its_squares_have_the_share_of_noise() {
        let count = 23;
        let columns: Vec<Vec<f64>> =
            (0..count).map(|k| through(|i| f64::from(u8::from(i == k)), count)).collect();
        let mut squares = 0.0;
        for (i, column) in columns.iter().enumerate() {
            for (k, value) in column.iter().enumerate() {
                assert!((value - columns[k][i]).abs() < 1e-12);
                squares += value * value;
            }
        }
        assert!((FILTER.of_noise(count, 0.01) / (squares / count as f64) - 1.0).abs() < 1e-9);
    }
}
