//! The judge: the residual of pairs that no fit takes, with its standard error.

use rayon::prelude::*;

use crate::engine::Level;
use crate::transport::{HighPass, LANES, Model};

/// Standard errors beyond which a difference is no chance.
const BEYOND_CHANCE: f64 = 2.0;

/// Least share of the signal in the squares of a measurement.
const LEAST_SIGNAL: f64 = 0.01;

/// Pairs that are held out, compared with what a surface shows of them: bins with a weight.
#[derive(Debug, Clone)]
pub struct HeldOut {
    /// The pair of the capture for each row.
    pub pairs: Vec<usize>,
    /// Differences, and measured values, `[pair * bins + bin]`.
    rows: [Vec<f64>; 2],
    /// Paths of the bins in units of the model, and the photon variance of a bin in the mean over pairs.
    paths: Vec<f64>,
    variances: Vec<f64>,
    bin_width: f64,
    high_pass: Option<HighPass>,
    /// Counts per unit of the values.
    counts_per_unit: f64,
    /// Power of the path in the weights of the objective.
    power: i32,
}

impl HeldOut {
    /// From the residual of plain differences of the pairs of `level`, which are these `pairs` of the capture: the derivative of the weighted squares by what is accumulated.
    pub fn of(model: &Model, level: &Level, pairs: &[usize], residual: &[f32]) -> HeldOut {
        let scene = model.scene_of(&level.grid, level.pairs);
        let unit = 1.0 / (2.0 * f64::from(scene.loss_scale) * f64::from(scene.render_scale));
        let weights: Vec<f64> = (0..model.bins).map(|b| model.bin_weight(b)).collect();
        let lit = || (0..model.bins).filter(|b| weights[*b] > 0.0);
        let residual = model.bins_of(residual);
        let differences =
            residual.chunks(model.bins).flat_map(|row| lit().map(|b| f64::from(row[b]) * unit / weights[b]));
        let counts = &model.measured[level.first * model.bins..(level.first + level.pairs) * model.bins];
        let measured = counts.chunks(model.bins).flat_map(|row| lit().map(|b| f64::from(row[b])));
        let [per_value, floor] = model.variance;
        let mut sums = vec![0.0; model.bins];
        for row in counts.chunks(model.bins) {
            sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += f64::from(*v));
        }
        HeldOut {
            pairs: pairs.to_vec(),
            rows: [differences.collect(), measured.collect()],
            paths: lit().map(|b| weights[b].powf(1.0 / f64::from(model.falloff_power()))).collect(),
            variances: lit().map(|b| floor + per_value * (sums[b] / level.pairs as f64)).collect(),
            bin_width: model.bin_width,
            high_pass: model.high_pass,
            counts_per_unit: model.counts_per_unit,
            power: model.falloff_power(),
        }
    }

    /// Number of bins of a row.
    pub fn bins(&self) -> usize {
        self.paths.len().max(1)
    }

    /// Width of a bin, metres of path.
    pub fn bin_width(&self) -> f64 {
        self.bin_width
    }

    fn root(&self, bin: usize) -> f64 {
        self.paths[bin].powf(0.5 * f64::from(self.power))
    }

    /// Rows with the weights of the objective, through the filter of the objective if there is one.
    fn weighted(&self, rows: &[f64]) -> Vec<f64> {
        let roots: Vec<f64> = (0..self.paths.len()).map(|bin| self.root(bin)).collect();
        let mut rows: Vec<f64> = rows.iter().zip(roots.iter().cycle()).map(|(v, root)| v * root).collect();
        if let Some(filter) = self.high_pass.map(|f| f.rows_of(self.bins(), self.bin_width)) {
            rows.par_chunks_mut(self.bins()).for_each(|row| filter.apply(row));
        }
        rows
    }

    /// Sums of squares of [`HeldOut::weighted`] by row.
    fn squares(&self, rows: &[f64]) -> Vec<f64> {
        let bins = self.bins();
        let roots: Vec<f64> = (0..self.paths.len()).map(|bin| self.root(bin)).collect();
        let Some(filter) = self.high_pass.map(|f| f.rows_of(bins, self.bin_width)) else {
            let of = |row: &[f64]| row.iter().zip(&roots).map(|(v, root)| (v * root) * (v * root)).sum();
            return rows.par_chunks(bins).with_min_len(LANES).map(of).collect();
        };
        let of_lanes = |spare: &mut Vec<[f64; LANES]>, some: &[f64]| {
            filter.squares(some.len() / bins, |row, bin| some[row * bins + bin] * roots[bin], spare)
        };
        let lanes: Vec<[f64; LANES]> = rows.par_chunks(LANES * bins).map_init(Vec::new, of_lanes).collect();
        lanes.into_iter().flatten().take(rows.len() / bins).collect()
    }

    /// What is rendered, and what is measured, as the objective weighs it.
    pub fn sides(&self) -> [Vec<f64>; 2] {
        [self.rendered(), self.weighted(&self.rows[1])]
    }

    fn rendered(&self) -> Vec<f64> {
        let rendered: Vec<f64> = self.rows[0].iter().zip(&self.rows[1]).map(|(d, m)| m + d).collect();
        self.weighted(&rendered)
    }

    /// What is rendered of every `step`th pair, late by each of these lags in bins, and what is measured, as the objective weighs it.
    pub fn late(&self, lags: std::ops::RangeInclusive<i64>, step: usize) -> (Vec<Vec<f64>>, Vec<f64>) {
        let bins = self.bins();
        let of = |rows: &[f64]| rows.chunks(bins).step_by(step).flatten().copied().collect::<Vec<f64>>();
        let [differences, measured] = self.rows.each_ref().map(|rows| of(rows));
        let rendered: Vec<f64> = differences.iter().zip(&measured).map(|(d, m)| m + d).collect();
        let moved = |lag: i64| {
            let mut rows = vec![0.0; rendered.len()];
            let by = (lag.unsigned_abs() as usize).min(bins);
            for (to, from) in rows.chunks_mut(bins).zip(rendered.chunks(bins)) {
                match lag {
                    0.. => to[by..].copy_from_slice(&from[..bins - by]),
                    _ => to[..bins - by].copy_from_slice(&from[by..]),
                }
            }
            self.weighted(&rows)
        };
        let late: Vec<i64> = lags.collect();
        (late.into_par_iter().map(moved).collect(), self.weighted(&measured))
    }

    /// Standard error that photon noise alone gives the difference of what this surface and another one leave, as a share of the
    /// signal.
    pub fn chance(&self, other: &HeldOut) -> f64 {
        let bins = self.bins();
        let between: Vec<f64> = self.rows[0].iter().zip(&other.rows[0]).map(|(a, b)| a - b).collect();
        let variances = |bin: usize| self.variances[bin] * self.root(bin).powi(2);
        let weighted = self.weighted(&between);
        let squares: f64 = weighted
            .chunks(bins)
            .flat_map(|row| row.iter().enumerate())
            .map(|(b, d)| d * d * variances(b))
            .sum();
        2.0 * squares.sqrt() / self.left().signal()
    }

    /// Weighted squared differences of all pairs that photon noise alone makes.
    fn noise(&self) -> f64 {
        let bins = self.paths.len();
        let of_pair: f64 = self.variances.iter().enumerate().map(|(b, v)| v * self.root(b).powi(2)).sum();
        let passed = self.high_pass.map_or(1.0, |f| f.of_noise(bins, self.bin_width));
        of_pair * passed * (self.rows[0].len() / self.bins()) as f64
    }

    /// Squares of each pair, as the objective weighs them.
    pub fn left(&self) -> Left {
        let [differences, measured] = self.rows.each_ref().map(|rows| self.squares(rows));
        Left {
            pairs: differences.into_iter().zip(measured).map(|(d, m)| [d, m]).collect(),
            noise: self.noise(),
        }
    }

    /// The factor of the rendered light that suits the measured one best, and what is left with it.
    pub fn scaled(&self) -> (f64, Left) {
        let (factors, left) = HeldOut::mixed(&[self]);
        (factors[0], left)
    }

    /// The factors of what one surface or two show of the same pairs that together suit the measured light best, and what is left with them.
    pub fn mixed(shown: &[&HeldOut]) -> (Vec<f64>, Left) {
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let first = shown[0];
        let measured = first.weighted(&first.rows[1]);
        let rendered: Vec<Vec<f64>> = shown.iter().map(|of| of.rendered()).collect();
        let factors = match &rendered[..] {
            [a] => vec![product(a, &measured) / product(a, a).max(f64::MIN_POSITIVE)],
            [a, b, ..] => {
                let [aa, ab, bb] = [product(a, a), product(a, b), product(b, b)];
                let [am, bm] = [product(a, &measured), product(b, &measured)];
                let determinant = (aa * bb - ab * ab).max(f64::MIN_POSITIVE);
                vec![(bb * am - ab * bm) / determinant, (aa * bm - ab * am) / determinant]
            }
            [] => vec![],
        };
        let bins = first.bins();
        let of_pair = |pair: usize| {
            let of_bin = |i: usize| {
                let light: f64 = rendered.iter().zip(&factors).map(|(of, factor)| factor * of[i]).sum();
                (light - measured[i]).powi(2)
            };
            let row = pair * bins..(pair + 1) * bins;
            [row.clone().map(of_bin).sum(), row.map(|i| measured[i] * measured[i]).sum()]
        };
        let left = first.left_with((0..measured.len() / bins).map(of_pair).collect());
        (factors, left)
    }

    /// Squared differences of each pair in counts, as the objective weighs them: of versions of a capture that differ by light.
    pub fn squared_counts(&self) -> Vec<f64> {
        let unit = self.counts_per_unit * self.counts_per_unit;
        self.squares(&self.rows[0]).into_iter().map(|d| d * unit).collect()
    }

    /// These squares of pairs, as the objective weighs them.
    pub fn left_with(&self, pairs: Vec<[f64; 2]>) -> Left {
        Left { pairs, noise: self.noise() }
    }

    /// [`HighPass::bands`] of the weighted differences, over photon noise.
    pub fn bands(&self, length: f64) -> [f64; 2] {
        let weighted = self.weighted(&self.rows[0]);
        let bands = HighPass { length, floor: 0.0 }.bands(&weighted, self.bins(), self.bin_width);
        let noise = self.noise() / self.rows[0].len().max(1) as f64;
        bands.map(|band| band / noise)
    }
}

/// What a surface leaves of the pairs that are held out.
#[derive(Debug, Clone, PartialEq)]
pub struct Left {
    /// For each pair: squared differences, and squared values, summed over bins.
    pub pairs: Vec<[f64; 2]>,
    /// Squared differences of all pairs that photon noise alone makes: no fit leaves less. 0 if it is not known.
    pub noise: f64,
}

impl Left {
    /// The share of the squares that is left.
    pub fn share(&self) -> f64 {
        self.pairs.iter().map(|p| p[0]).sum::<f64>() / self.squares()
    }

    /// What is left beyond photon noise, as a share of the signal: so surfaces whose objectives weigh the noise differently compare.
    pub fn excess(&self) -> f64 {
        self.beyond_noise().sum::<f64>().max(0.0)
    }

    /// The share that is left beyond noise, and its standard error.
    pub fn figures(&self) -> [f64; 2] {
        [self.excess(), self.standard_error()]
    }

    /// The share that is left beyond noise and beyond chance: less two standard errors.
    pub fn certain(&self) -> f64 {
        self.excess() - 2.0 * self.standard_error()
    }

    /// What is left beyond noise by pair.
    fn beyond_noise(&self) -> impl Iterator<Item = f64> + Clone {
        let signal = self.signal();
        let noise = self.noise / self.pairs.len().max(1) as f64;
        self.pairs.iter().map(move |p| (p[0] - noise) / signal)
    }

    /// Squares of the measurement without noise; all of them where noise is most of them.
    fn signal(&self) -> f64 {
        let squares = self.squares();
        (squares - self.noise).max(LEAST_SIGNAL * squares)
    }

    fn squares(&self) -> f64 {
        self.pairs.iter().map(|p| p[1]).sum()
    }

    /// Standard error of [`Left::excess`], by the scatter of pairs.
    pub fn standard_error(&self) -> f64 {
        let count = self.pairs.len().max(2) as f64;
        let mean = self.beyond_noise().sum::<f64>() / count;
        let variance = self.beyond_noise().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
        (variance * count).sqrt()
    }

    /// Whether this is less than what another trial leaves of the same pairs, beyond chance: the mean difference over
    /// pairs is more than two of its standard errors.
    pub fn is_less(&self, other: &Left) -> bool {
        let [mean, error] = self.below(other);
        mean > BEYOND_CHANCE * error
    }

    /// By how many standard errors of the difference this is less than what another trial leaves of the same pairs.
    pub fn errors_below(&self, other: &Left) -> f64 {
        let [mean, error] = self.below(other);
        mean / error.max(f64::MIN_POSITIVE)
    }

    /// The mean difference of another trial of the same pairs and this one, and its standard error.
    fn below(&self, other: &Left) -> [f64; 2] {
        mean_and_error(self.beyond_noise().zip(other.beyond_noise()).map(|(own, other)| other - own))
    }
}

/// The mean of values of pairs, of two at least, and its standard error by their scatter.
pub fn mean_and_error(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let count = values.clone().count().max(2) as f64;
    let mean = values.clone().sum::<f64>() / count;
    let variance = values.map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
    [mean, (variance / count).sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is left of each pair, of squares of 100.
    fn left(pairs: impl IntoIterator<Item = f64>) -> Left {
        Left { pairs: pairs.into_iter().map(|p| [p, 100.0]).collect(), noise: 0.0 }
    }

    #[test]
    fn factors_of_two_surfaces_are_those_of_their_light() {
        // Two pairs of two bins: measured is 3 times the first surface's light and 2 times the second's.
        let shown = |rendered: [f64; 4]| {
            let measured = [3.0, 5.0, 0.0, 4.0];
            let differences = rendered.iter().zip(measured).map(|(r, m)| r - m).collect();
            HeldOut {
                pairs: vec![0, 1],
                rows: [differences, measured.to_vec()],
                paths: vec![1.0; 2],
                variances: vec![0.0; 2],
                bin_width: 1.0,
                high_pass: None,
                counts_per_unit: 1.0,
                power: 2,
            }
        };
        let (first, second) = (shown([1.0, 1.0, 0.0, 0.0]), shown([0.0, 1.0, 0.0, 2.0]));
        let (factors, left) = HeldOut::mixed(&[&first, &second]);
        assert!((factors[0] - 3.0).abs() < 1e-12 && (factors[1] - 2.0).abs() < 1e-12, "{factors:?}");
        assert!(left.share() < 1e-20);
        // Alone: 8 of 2 squares, and what is left is 2 (1 and 1) and 16 of 50.
        let (factor, left) = first.scaled();
        assert!(
            (factor - 4.0).abs() < 1e-12 && (left.share() - 18.0 / 50.0).abs() < 1e-12,
            "{factor} {left:?}"
        );
    }

    #[test]
    fn the_share_is_that_of_all_squares() {
        let of = Left { pairs: vec![[1.0, 10.0], [3.0, 90.0]], noise: 0.0 };
        assert_eq!(of.share(), 0.04);
    }

    #[test]
    fn less_is_less_only_beyond_chance() {
        // Differences with mean 1 and variance 1 (n - 1 of n): 16 pairs have a standard error of about 1/4.
        let other = left([10.0; 16]);
        let by = |mean: f64| left((0..16).map(|i| 10.0 - mean + if i % 2 == 0 { 1.0 } else { -1.0 }));
        let error = (16.0f64 / 15.0 / 16.0).sqrt();
        assert!(by(2.05 * error).is_less(&other));
        assert!(!by(1.95 * error).is_less(&other), "within two standard errors");
        assert!(!by(-2.05 * error).is_less(&other), "more is not less");
        assert!(other.is_less(&by(-2.05 * error)));
        // The same from every pair is no chance; nothing is.
        assert!(left([9.9; 16]).is_less(&other) && !other.is_less(&other));
        // One pair that says otherwise: the mean is less, but hangs on it.
        let mut one = [10.0; 16];
        one[3] = 2.0;
        assert!(left(one).share() < other.share() && !left(one).is_less(&other));
    }
}
