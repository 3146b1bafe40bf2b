//! Back-projection on the device, of any pairs and any wall: every voxel sums the histograms of all pairs at its path,
//! times the inverse falloff and the cosine toward the wall (the kernel `backproject`).
//!
//! - `bp`: the sums themselves (Velten, Willwacher, Gupta, Veeraraghavan, Bawendi, Raskar: *Recovering three-dimensional
//!   shape around a corner using ultrafast time-of-flight imaging*, Nature Communications 2012).
//! - `fbp`: filtered by a Laplacian as there, or by a Laplacian of Gaussian (Laurenzis and Velten 2014): of the volume,
//!   or of the histograms along their paths.
//! - `phasor-bp`: histograms filtered by the cosine and the sine of a virtual pulse, each projected; the image is the
//!   strength of both (Liu and others, Nature 2019). This is the phasor field without a transform.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::method::{By, ClosedForm, Projection};
use super::options::{ImageOptions, ImageSettings};
use super::sharpness::Ladder;
use crate::options::{options, words};
use crate::transport::Grid;
pub use hat::hat;
pub use projecting::plan_of;
pub(super) use projecting::{Projecting, pixels_per_voxel, to_refine};

mod hat;
pub mod passes;
mod projecting;

/// What is filtered, and how.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filter {
    /// The volume, by a Laplacian.
    Laplacian,
    /// The volume, by the Laplacian of a Gaussian.
    Log,
    /// The histograms, by the second derivative of a Gaussian along the path.
    Path,
}

words!(Filter);

options! {
    /// Options of the back-projection.
    pub struct BpOptions: BpSettings(scene) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions / ImageSettings,
        }
        "Solver" {
            /// Lateral pixels of the maps; from 128 on, a voxel is two pixels wide
            lateral: usize = 128, Range::Count(1, 4096);
        }
    }
}

options! {
    /// Options of the filtered back-projection.
    pub struct FbpOptions: FbpSettings(scene) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions / ImageSettings,
        }
        "Solver" {
            /// Lateral pixels of the maps; from 128 on, a voxel is two pixels wide
            lateral: usize = 128, Range::Count(1, 4096);
        }
        "Filtered back-projection" {
            /// What is filtered: the volume by a Laplacian or by the Laplacian of a Gaussian (log), or the histograms by
            /// the second derivative of a Gaussian along the path (path)
            filter: Filter = Filter::Path, Range::Words(&["laplacian", "log", "path"]);
            /// Standard deviation of the filter's Gaussian, in distances of scan points [default: 0.5; path and photon
            /// counts: chosen by their noise, at least 0.5]
            filter_width: Option<f64> = None, Range::Positive;
        }
    }
}

options! {
    /// Options of the phasor field by back-projection.
    pub struct PhasorBpOptions: PhasorBpSettings(scene) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions / ImageSettings,
        }
        "Solver" {
            /// Lateral pixels of the maps; from 128 on, a voxel is two pixels wide
            lateral: usize = 128, Range::Count(1, 4096);
        }
        "Phasor field" {
            /// Wavelength of the virtual wave, as a path, in distances of scan points [default: 3; for photon counts, chosen
            /// by their noise, at least 3]
            wavelength: Option<f64> = None, Range::Positive;
            /// Wavelengths that the virtual pulse is long
            cycles: f64 = 5.0, Range::Positive;
        }
    }
}

/// Wavelengths of the back-projected phasor field to choose from, in distances of scan points.
const BP_WAVELENGTHS: Ladder = Ladder { setting: "wavelength", values: &[3.0, 4.0, 6.0, 8.0, 12.0] };

/// Widths of the filter to choose from.
const WIDTHS: Ladder = Ladder { setting: "filter_width", values: &[0.5, 0.7, 1.0, 1.4, 2.0, 2.8] };

impl ClosedForm for BpOptions {
    const NAME: &'static str = "bp";
    const MASK_SHARE: f64 = 1.0;

    const BY: By<Self> = By::Device(Projection { filters: Self::filters, join: Self::join });

    fn shared(&self) -> (usize, &ImageOptions) {
        (self.lateral, &self.image)
    }
}

impl BpOptions {
    fn filters(&self, _bins: usize, _bin: f64, _step: f64) -> Vec<Vec<f32>> {
        vec![vec![0.0, 1.0]]
    }

    fn join(&self, projected: Vec<Vec<f32>>, _grid: &Grid, _step: f64) -> Vec<f32> {
        projected.into_iter().flatten().collect()
    }
}

impl ClosedForm for FbpOptions {
    const NAME: &'static str = "fbp";
    const MASK_SHARE: f64 = 0.66;

    const BY: By<Self> = By::Device(Projection { filters: Self::filters, join: Self::join });

    fn shared(&self) -> (usize, &ImageOptions) {
        (self.lateral, &self.image)
    }

    // A standard deviation of the filter. Peaks that are sampled coarser have no place between voxels.
    fn finest_detail(&self) -> Option<f64> {
        (self.filter == Filter::Path).then_some(0.5 * self.width())
    }

    // A few columns cannot tell what a filter of the volume does.
    fn sharpness(&mut self) -> Option<(Ladder, &mut Option<f64>)> {
        (self.filter == Filter::Path).then_some((WIDTHS, &mut self.filter_width))
    }
}

impl FbpOptions {
    fn filters(&self, bins: usize, bin: f64, step: f64) -> Vec<Vec<f32>> {
        match self.filter {
            Filter::Path => vec![hat(self.width() * step / bin, bins)],
            _ => vec![vec![0.0, 1.0]],
        }
    }

    fn join(&self, projected: Vec<Vec<f32>>, grid: &Grid, step: f64) -> Vec<f32> {
        let mut all: Vec<f32> = projected.into_iter().flatten().collect();
        if self.filter == Filter::Log {
            let sigma = grid.pitch.to_array().map(|pitch| self.width() * step / pitch);
            (0..3).for_each(|axis| smooth(&mut all, grid.n, axis, sigma[axis]));
        }
        if self.filter == Filter::Path { all } else { laplacian(&all, grid) }
    }
}

impl FbpOptions {
    /// Standard deviation of the filter's Gaussian, in distances of scan points.
    fn width(&self) -> f64 {
        self.filter_width.unwrap_or(WIDTHS.values[0])
    }
}

impl ClosedForm for PhasorBpOptions {
    const NAME: &'static str = "phasor-bp";
    const MASK_SHARE: f64 = 0.70;

    const BY: By<Self> = By::Device(Projection { filters: Self::filters, join: Self::join });

    fn shared(&self) -> (usize, &ImageOptions) {
        (self.lateral, &self.image)
    }

    fn sharpness(&mut self) -> Option<(Ladder, &mut Option<f64>)> {
        Some((BP_WAVELENGTHS, &mut self.wavelength))
    }
}

impl PhasorBpOptions {
    fn filters(&self, bins: usize, bin: f64, step: f64) -> Vec<Vec<f32>> {
        let wavelength = self.wavelength.unwrap_or(BP_WAVELENGTHS.values[0]);
        super::phasor::pulse(wavelength * step / bin, self.cycles, bins).into()
    }

    fn join(&self, projected: Vec<Vec<f32>>, _grid: &Grid, _step: f64) -> Vec<f32> {
        let parts = projected[0].par_iter().zip(&projected[1]);
        parts.map(|(cos, sin)| cos.hypot(*sin)).collect()
    }
}

/// The negative Laplacian of a volume, per square metre. Beyond the volume lie the values of its faces.
fn laplacian(volume: &[f32], grid: &Grid) -> Vec<f32> {
    let [nx, ny, nz] = grid.n;
    let weight = grid.pitch.to_array().map(|pitch| (1.0 / (pitch * pitch)) as f32);
    let strides = [ny * nz, nz, 1];
    let of = |i: usize| {
        let at = [i / (ny * nz), i / nz % ny, i % nz];
        let bend = |axis: usize| {
            let low = if at[axis] > 0 { volume[i - strides[axis]] } else { volume[i] };
            let high = if at[axis] + 1 < [nx, ny, nz][axis] { volume[i + strides[axis]] } else { volume[i] };
            weight[axis] * (2.0 * volume[i] - low - high)
        };
        bend(0) + bend(1) + bend(2)
    };
    (0..volume.len()).into_par_iter().map(of).collect()
}

/// A Gaussian of `sigma` voxels along an axis, in place. Beyond the volume lie the values of its faces.
fn smooth(volume: &mut Vec<f32>, n: [usize; 3], axis: usize, sigma: f64) {
    let reach = (3.0 * sigma).ceil() as isize;
    let taps: Vec<f32> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp() as f32).collect();
    let sum: f32 = taps.iter().sum();
    let stride: usize = n[axis + 1..].iter().product();
    let of = |i: usize| {
        let at = (i / stride % n[axis]) as isize;
        let place = |k: isize| (at + k).clamp(0, n[axis] as isize - 1);
        let value = |k: isize| volume[(i as isize + (place(k) - at) * stride as isize) as usize];
        (-reach..=reach).zip(&taps).map(|(k, tap)| tap * value(k)).sum::<f32>() / sum
    };
    *volume = (0..volume.len()).into_par_iter().map(of).collect();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::Volume as Box;
    use glam::{DVec3, dvec3};

    fn grid() -> Grid {
        Grid::new(Box { min: dvec3(0.0, 0.0, 0.4), max: dvec3(0.6, 0.9, 1.3) }, 6, 0.05).unwrap()
    }

    fn volume(of: impl Fn(DVec3) -> f64) -> Vec<f32> {
        let (grid, [_, ny, nz]) = (grid(), grid().n);
        let at = |i: usize| dvec3((i / (ny * nz)) as f64, (i / nz % ny) as f64, (i % nz) as f64);
        (0..grid.voxels()).map(|i| of(grid.position(at(i))) as f32).collect()
    }

    #[test]
    fn the_laplacian_of_a_square_is_two_along_each_axis() {
        let grid = grid();
        let [_, ny, nz] = grid.n;
        let all = laplacian(&volume(|p| p.x * p.x + 2.0 * p.y * p.y - 4.0 * p.z * p.z), &grid);
        for (i, value) in all.iter().enumerate() {
            let at = [i / (ny * nz), i / nz % ny, i % nz];
            if (0..3).all(|a| at[a] > 0 && at[a] + 1 < grid.n[a]) {
                assert!((value - 2.0).abs() < 0.01, "{value}");
            }
        }
    }

    #[test]
    fn a_gaussian_keeps_planes_and_blurs_along_its_axis_only() {
        let n = grid().n;
        let mut plane = volume(|p| p.x + p.y);
        let before = plane.clone();
        smooth(&mut plane, n, 2, 1.5);
        assert!(plane.iter().zip(&before).all(|(a, b)| (a - b).abs() < 1e-5));
        let mut point = vec![0.0; plane.len()];
        let middle = (3 * n[1] + 3) * n[2] + 8;
        point[middle] = 1.0;
        smooth(&mut point, n, 2, 1.0);
        assert!((point.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        assert!((point[middle + 1] / point[middle] - (-0.5f32).exp()).abs() < 1e-5);
        assert_eq!(point[middle + n[2]], 0.0);
    }
}
