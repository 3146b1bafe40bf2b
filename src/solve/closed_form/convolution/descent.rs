//! The minimum of ½ xᵀ K x − bᵀ x and of what the prior adds, by accelerated proximal gradient with adaptive restart.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::operator::Convolution;
use crate::solve::option::words;

/// What is known of a volume beside the measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Prior {
    /// Nothing.
    None,
    /// No albedo is negative.
    Positive,
    /// None is negative, and most are zero: the sum of all counts.
    Sparse,
    /// None is negative, and few edges: the total variation counts, over neighbouring voxels.
    Variation,
}

words!(Prior);

impl Prior {
    /// Whether its strength is a matter of a weight.
    pub(super) fn has_weight(self) -> bool {
        matches!(self, Prior::Sparse | Prior::Variation)
    }
}

/// The root in the total variation is rounded where neighbours differ by less than this share of the brightest voxel: the
/// gradient is then bounded.
const ROUNDED: f32 = 0.05;

/// The largest eigenvalue of a Laplacian over neighbours along three axes.
const OF_LAPLACIAN: f32 = 12.0;

/// State of a descent.
pub(super) struct Descent<'k> {
    kernel: &'k Convolution,
    n: [usize; 3],
    prior: Prior,
    /// Weight of the prior, in the units of the back-projection.
    weight: f32,
    /// b: the back-projection.
    projection: Vec<f32>,
    /// x: the volume.
    pub volume: Vec<f32>,
    /// Where the next gradient is taken.
    ahead: Vec<f32>,
    momentum: f32,
}

impl<'k> Descent<'k> {
    /// Begins at an empty volume. `weight` is a share of the brightest voxel of the back-projection.
    pub fn new(
        kernel: &'k Convolution,
        n: [usize; 3],
        prior: Prior,
        weight: f64,
        projection: Vec<f32>,
    ) -> Descent<'k> {
        let most = projection.iter().copied().fold(0.0, f32::max);
        let empty = vec![0.0; projection.len()];
        let weight = weight as f32 * most;
        Descent { kernel, n, prior, weight, projection, volume: empty.clone(), ahead: empty, momentum: 1.0 }
    }

    /// One iteration.
    pub fn step(&mut self) {
        let mut gradient = self.kernel.of(&self.ahead);
        gradient.par_iter_mut().zip(&self.projection).for_each(|(g, b)| *g -= b);
        let mut bound = self.kernel.bound;
        if self.prior == Prior::Variation {
            let most = self.ahead.par_iter().copied().reduce(|| 0.0, f32::max);
            if most > 0.0 {
                let rounded = ROUNDED * most;
                add_variation(&self.ahead, self.n, rounded, self.weight, &mut gradient);
                bound += OF_LAPLACIAN * self.weight / rounded;
            }
        }
        let (least, dimmed) = match self.prior {
            Prior::None => (f32::NEG_INFINITY, 0.0),
            Prior::Positive | Prior::Variation => (0.0, 0.0),
            Prior::Sparse => (0.0, self.weight),
        };
        let next: Vec<f32> = self
            .ahead
            .par_iter()
            .zip(&gradient)
            .map(|(y, g)| (y - (g + dimmed) / bound).max(least))
            .collect();
        // Overshot: the step goes against the last one, so the momentum goes.
        let all = self.ahead.par_iter().zip(&next).zip(&self.volume);
        let against: f64 = all.map(|((y, x), before)| f64::from((y - x) * (x - before))).sum();
        let before = if against > 0.0 { 1.0 } else { self.momentum };
        self.momentum = 0.5 * (1.0 + (1.0 + 4.0 * before * before).sqrt());
        let further = (before - 1.0) / self.momentum;
        let both = self.ahead.par_iter_mut().zip(&next).zip(&self.volume);
        both.for_each(|((y, x), before)| *y = x + further * (x - before));
        self.volume = next;
    }
}

/// Adds the gradient of the total variation: the sum over voxels of √(squares of the differences to the next along each
/// axis + rounded²).
fn add_variation(volume: &[f32], n: [usize; 3], rounded: f32, weight: f32, gradient: &mut [f32]) {
    let strides = [n[1] * n[2], n[2], 1];
    let place = |i: usize, axis: usize| i / strides[axis] % n[axis];
    let next = |i: usize, axis: usize| {
        if place(i, axis) + 1 < n[axis] { volume[i + strides[axis]] - volume[i] } else { 0.0 }
    };
    let steep = |i: usize| {
        let squares: f32 = (0..3).map(|axis| next(i, axis).powi(2)).sum();
        (squares + rounded * rounded).sqrt()
    };
    gradient.par_iter_mut().enumerate().for_each(|(i, g)| {
        let mut sum = -(0..3).map(|axis| next(i, axis)).sum::<f32>() / steep(i);
        for axis in (0..3).filter(|axis| place(i, *axis) > 0) {
            let last = i - strides[axis];
            sum += next(last, axis) / steep(last);
        }
        *g += weight * sum;
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_of_the_variation_is_that_of_finite_differences() {
        let n = [3, 2, 4];
        let volume: Vec<f64> = (0..24).map(|i| (f64::from(i) * 1.7).sin()).collect();
        let strides = [8, 4, 1];
        let variation = |v: &[f64]| -> f64 {
            let of = |i: usize| {
                let next =
                    |a: usize| if i / strides[a] % n[a] + 1 < n[a] { v[i + strides[a]] - v[i] } else { 0.0 };
                ((0..3).map(|a| next(a).powi(2)).sum::<f64>() + 0.01).sqrt()
            };
            (0..24).map(of).sum()
        };
        let mut found = vec![1.0f32; 24];
        let single: Vec<f32> = volume.iter().map(|v| *v as f32).collect();
        add_variation(&single, n, 0.1, 2.0, &mut found);
        for (i, value) in found.iter().enumerate() {
            let moved = |by: f64| {
                let mut other = volume.clone();
                other[i] += by;
                variation(&other)
            };
            let wanted = 1.0 + 2.0 * (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!((f64::from(*value) - wanted).abs() < 1e-3, "{i}: {value}, {wanted}");
        }
    }
}
