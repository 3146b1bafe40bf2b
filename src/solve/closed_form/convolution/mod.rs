//! The convolutional approximation (Ahn, Dave, Veeraraghavan, Gkioulekas, Sankaranarayanan: *Convolutional Approximations to
//! the General Non-Line-of-Sight Imaging Operator*, ICCV 2019).
//!
//! Ellipsoidal tomography asks for the albedo ρ with the least |A ρ − τ|², whose normal equations are AᵀA ρ = Aᵀτ. The right
//! side is a back-projection. The Gram operator AᵀA is nearly a convolution: its kernel is the back-projection of the light
//! of one voxel in the middle. So Fourier transforms invert it ([`gram`]): with a Tikhonov term, and with priors by ADMM.
//!
//! Back-projection here divides the falloff out, as the weights of the vector solver do: far and near voxels then have kernels
//! of about the same strength. Two things are only nearly true: a far voxel sees the scan under smaller angles than
//! a near one, and so does one at the rim. Where the wall is not flat, kernels differ more; a note in the report says so.

use serde::{Deserialize, Serialize};

use super::backproject::{Projection, middle, projection};
use super::options::ImageOptions;
use crate::advice::{Remedy, advice};
use crate::capture::Capture;
use crate::gpu::Gpu;
use crate::solve::option::{options, words};
use crate::transport::Grid;
use crate::{Error, Result};

mod gram;

use gram::{Gram, Wanted};

/// What is known of the albedo beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Prior {
    /// Nothing.
    None,
    /// It is not negative.
    Positive,
    /// It is not negative, and its total variation is small.
    Tv,
}

words!(Prior);

options! {
    /// Options of the convolutional approximation.
    pub struct ConvOptions(suit) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions,
        }
        "Solver" {
            /// Lateral pixels of the maps; from 128 on, a voxel is two pixels wide
            lateral: usize = 128, Range::Count(1, 4096);
        }
        "Light-cone transform" {
            /// Power of the signal over that of the noise, as the Wiener filter takes it: smaller values blur more
            snr: f64 = if suit.captured() { 0.8 } else { 3.0 }, Range::Positive;
        }
        "Convolutional approximation" {
            /// What is known of the albedo: nothing (none), that it is not negative (positive), or that its total variation
            /// is small as well (tv)
            prior: Prior = Prior::Positive, Range::Words(&["none", "positive", "tv"]);
            /// Iterations of ADMM with a prior
            prior_iterations: usize = 20, Range::Count(1, 10_000);
            /// Weight of the total variation, as a share of the largest back-projected value
            variation: f64 = 0.01, Range::NotNegative;
        }
    }
}

projection!(ConvOptions, "conv");

/// Histograms are averaged by a Gaussian of so many voxels' depths: surfaces between two voxels then look like those in them.
const BLUR: f64 = 0.5;

impl Projection for ConvOptions {
    const MASK_SHARE: f64 = 0.66;
    const WITH_POINT: bool = true;

    fn image(&self) -> &ImageOptions {
        &self.image
    }

    fn filters(&self, bins: usize, bin: f64, _step: f64, grid: &Grid) -> Vec<Vec<f32>> {
        let sigma = gram::knob("T_BLUR", BLUR) * 2.0 * grid.pitch.z / bin;
        let radius = ((3.0 * sigma).ceil() as usize).min(bins - 1);
        let weight = |i: usize| (-0.5 * (i as f64 / sigma).powi(2)).exp() as f32;
        vec![std::iter::once(radius as f32).chain((0..=radius).map(weight)).collect()]
    }

    fn fits(&self, grid: &Grid, gpu: &Gpu, memory: Option<u64>) -> Result<()> {
        let asked = Gram::bytes(grid.n, self.wanted());
        let available = memory.unwrap_or(u64::MAX).min(gpu.memory().free[1]);
        if asked <= available {
            return Ok(());
        }
        let remedy = Remedy::SmallerJob { asked: Some(asked), available: Some(available) };
        Err(Error::memory(
            format!("the arrays take {} MiB, and there are {} MiB", asked >> 20, available >> 20),
            advice!["choose " {remedy} ", a narrower " Gate " or more " Memory],
        ))
    }

    fn doubts(&self, capture: &Capture) -> Option<String> {
        let flat = capture.is_planar();
        (!flat).then(|| {
            "the wall is not flat: the convolutional approximation takes what it sees of a voxel in the middle for what it \
             sees of all, which holds only roughly here"
                .into()
        })
    }

    fn join(&self, projected: Vec<Vec<f32>>, grid: &Grid, _step: f64) -> Vec<f32> {
        let [measured, of_point] = &projected[..] else { return vec![] };
        Gram::new(grid.n, middle(grid), of_point)
            .map_or_else(|| vec![0.0; grid.voxels()], |gram| gram.solve(measured, self.wanted()))
    }
}

impl ConvOptions {
    fn wanted(&self) -> Wanted {
        Wanted {
            noise: 1.0 / self.snr,
            prior: self.prior,
            iterations: self.prior_iterations,
            variation: self.variation,
        }
    }
}
