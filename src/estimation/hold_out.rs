//! The residual of a fit on the hold-out set: pairs that the fit has not seen.

use super::spread::Rows;
use crate::capture::PulseTaps;
use crate::solve::weighted_sum;
use crate::transport::{Grid, HighPass, Model};

/// Standard errors beyond which a difference is no chance.
const BEYOND_CHANCE: f64 = 2.0;

/// Pairs that a fit has not seen, compared with what it renders for them: bins with a weight.
#[derive(Debug, Clone)]
pub struct Unseen {
    /// Differences, and measured values, `[pair * bins + bin]`.
    rows: [Vec<f64>; 2],
    /// Roots of the bins' weights.
    roots: Vec<f64>,
    bin_width: f64,
    high_pass: Option<HighPass>,
    /// Weighted photon variance of a bin, in the mean.
    noise: f64,
}

/// Weighted photon variance of a bin with a weight, in the mean over all pairs.
fn noise_of(model: &Model) -> f64 {
    let [per_value, floor] = model.variance;
    let with_weight = (0..model.bins).filter(|b| model.bin_weight(*b) > 0.0).count();
    weighted_sum(model, model.pairs(), [floor, per_value, 0.0]) / (model.pairs() * with_weight).max(1) as f64
}

impl Unseen {
    /// From the residual of plain differences: the derivative of the weighted squares by what is accumulated.
    pub fn of(held: &Model, residual: &[f32], grid: &Grid) -> Unseen {
        let elements = held.elements.max(1) as f64;
        let unit = elements / (2.0 * f64::from(held.scene(grid).render_scale));
        let all: Vec<f64> = (0..held.bins).map(|b| held.bin_weight(b)).collect();
        let with_weight = |row: &[f32], of: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
            row.iter().zip(&all).filter(|(_, w)| **w > 0.0).map(|(v, w)| of(f64::from(*v), *w)).collect()
        };
        let residual = held.bins_of(residual);
        let differences = residual.chunks(held.bins).flat_map(|row| with_weight(row, &|r, w| r * unit / w));
        let measured = held.measured.chunks(held.bins).flat_map(|row| with_weight(row, &|m, _| m));
        Unseen {
            rows: [differences.collect(), measured.collect()],
            roots: all.iter().filter(|w| **w > 0.0).map(|w| w.sqrt()).collect(),
            bin_width: held.bin_width,
            high_pass: held.high_pass,
            noise: noise_of(held),
        }
    }

    /// The rows with the weights of the objective, through its filter if there is one.
    fn weighted(&self, rows: &[f64]) -> Vec<f64> {
        let mut rows: Vec<f64> =
            rows.iter().zip(self.roots.iter().cycle()).map(|(v, root)| v * root).collect();
        if let Some(filter) = self.high_pass {
            rows.chunks_mut(self.roots.len().max(1)).for_each(|row| filter.apply(row, self.bin_width));
        }
        rows
    }

    /// Of pulses for what was rendered with sharp paths, the one that leaves the least ([`Rows::best`]), and what it leaves.
    pub fn spread(&self, pulses: &[PulseTaps]) -> Option<(usize, Left)> {
        let rendered: Vec<f64> = self.rows[0].iter().zip(&self.rows[1]).map(|(d, m)| m + d).collect();
        let [rendered, measured] = [&rendered, &self.rows[1]].map(|rows| self.weighted(rows));
        let rows = Rows { rendered: &rendered, measured: &measured, bins: self.roots.len().max(1) };
        let (at, pairs) = rows.best(pulses)?;
        Some((at, Left { pairs, noise: self.noise_left() }))
    }

    /// Squared differences of all pairs that photon noise alone makes.
    fn noise_left(&self) -> f64 {
        let (cells, bins) = (self.rows[0].len() as f64, self.roots.len());
        self.noise * cells * self.high_pass.map_or(1.0, |f| f.of_noise(bins, self.bin_width))
    }

    /// Squares of each pair.
    pub fn left(&self) -> Left {
        let bins = self.roots.len().max(1);
        let rows = self.rows.each_ref().map(|rows| self.weighted(rows));
        let of = |row: &[f64]| row.iter().map(|v| v * v).sum::<f64>();
        let pairs = rows[0].chunks(bins).zip(rows[1].chunks(bins)).map(|(d, m)| [of(d), of(m)]).collect();
        Left { pairs, noise: self.noise_left() }
    }

    /// [`HighPass::bands`] of the weighted differences, over photon noise.
    pub fn bands(&self, length: f64) -> [f64; 2] {
        let weighted = self.weighted(&self.rows[0]);
        let bands = HighPass { length, floor: 0.0 }.bands(&weighted, self.roots.len().max(1), self.bin_width);
        bands.map(|band| band / self.noise)
    }
}

/// What a trial's surface leaves of the pairs that it has not seen.
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

    /// The share of the squares that is left beyond photon noise.
    pub fn excess(&self) -> f64 {
        ((self.pairs.iter().map(|p| p[0]).sum::<f64>() - self.noise) / self.squares()).max(0.0)
    }

    fn squares(&self) -> f64 {
        self.pairs.iter().map(|p| p[1]).sum()
    }

    /// Whether this is less than what another trial leaves of the same pairs, beyond chance: the mean difference over
    /// pairs is more than two of its standard errors.
    pub fn is_less(&self, other: &Left) -> bool {
        let differences = || self.pairs.iter().zip(&other.pairs).map(|(own, other)| other[0] - own[0]);
        let count = self.pairs.len().max(2) as f64;
        let mean = differences().sum::<f64>() / count;
        let variance = differences().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0);
        mean > BEYOND_CHANCE * (variance / count).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is left of each pair, of squares of 100.
    fn left(pairs: impl IntoIterator<Item = f64>) -> Left {
        Left { pairs: pairs.into_iter().map(|p| [p, 100.0]).collect(), noise: 0.0 }
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
