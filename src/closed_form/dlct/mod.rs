//! The directional light-cone transform (Young, Lindell, Girod, Taubman, Wetzstein: *Non-line-of-sight surface
//! reconstruction using the directional light-cone transform*, CVPR 2020).
//!
//! A surface sends light by the cosine between its normal and the way to the wall. With the vector albedo a = ρ n, the
//! value at the wall point x' is a · (x' − x) / r^5, so that v² τ = Σ_c K_c ∗ A_c: three convolutions in the coordinates
//! of the light-cone transform ([`crate::closed_form::light_cone`]). The kernels of x and y are that of the light-cone transform times
//! dx and dy; that of z is it, with the depth in the unknown.
//!
//! The least-squares problem with a penalty on |a|² is solved exactly. At every frequency the block of the three unknowns
//! is k k* + λ: its solution is conj(k_c) g / (λ + Σ |k_c|²), which is what a factorisation of each block gives. A block
//! has one equation, and the penalty shares the light among the components by the power of their kernels. So distances
//! along x and y are scaled until all three kernels have the same power: else normals would lean toward the strongest
//! kernel, that of z (benches/NOTES.md).

use rayon::prelude::*;

use super::fourier::{Complex, Line, SpareSpectra, transpose};
use super::image::{AlbedoVolume, on_grid_signed};
use super::light_cone::{ConeCells, SNR, filter_planes};
use super::method::{By, ClosedForm, HostMethod};
use super::options::{ImageOptions, ImageSettings};
use super::scan::RegularScan;
use super::sharpness::Ladder;
use crate::capture::Capture;
use crate::gpu::Buffer;
use crate::options::options;
use crate::transport::{Grid, Reflectance};
use crate::{Error, Result};

options! {
    /// Options of the directional light-cone transform.
    pub struct DlctOptions: DlctSettings(scene) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions / ImageSettings,
        }
        "Solver" {
            /// Lateral pixels of the maps
            lateral: usize = 128, Range::Count(1, 4096);
        }
        "Light-cone transform" {
            /// Power of the signal over that of the noise, as the Wiener filter takes it: smaller values blur more. For photon
            /// counts, it is chosen by their noise, at most 0.8
            snr: Option<f64> = (!scene.captured()).then_some(3.0), Range::Positive;
        }
    }
}

/// Spectra of all histograms over v, frequency by frequency.
const BY_FREQUENCY: Buffer = Buffer::named("spectra_by_frequency");
/// One component of the vector, frequency by frequency, and then point by point.
const COMPONENT: Buffer = Buffer::named("component");
/// The components at the scan's points.
const AT_POINTS: Buffer = Buffer::named("components_at_points");
/// The components at the voxels.
const VECTORS: Buffer = Buffer::named("vectors");

impl ClosedForm for DlctOptions {
    const NAME: &'static str = "dlct";
    const MASK_SHARE: f64 = 0.70;

    const BY: By<Self> =
        By::Host(HostMethod { scan: Self::scan, arrays: Self::arrays, volume: Self::volume });

    fn shared(&self) -> (usize, &ImageOptions) {
        (self.lateral, &self.image)
    }

    fn sharpness(&mut self) -> Option<(Ladder, &mut Option<f64>)> {
        Some((SNR, &mut self.snr))
    }
}

impl DlctOptions {
    fn scan(&self, capture: &Capture) -> Result<RegularScan> {
        if self.image.reflectance == Reflectance::Retroreflective {
            return Err(Error::input(
                "the directional light-cone transform needs light by the cosine of the normal, and retroreflective \
                 surfaces have none",
                "choose a method without normals: lct, fk or phasor",
            ));
        }
        RegularScan::confocal(capture, "the directional light-cone transform")
    }

    fn arrays(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Vec<(Buffer, u64)> {
        let spectra = 8 * (scan.points() * ConeCells::of(capture, scan).frequencies()) as u64;
        let at_points = 4 * (scan.points() * grid.n[2]) as u64;
        let at_voxels = 4 * grid.voxels() as u64;
        vec![
            (BY_FREQUENCY, spectra),
            (COMPONENT, 2 * spectra),
            (AT_POINTS, 3 * at_points),
            (VECTORS, 6 * at_voxels),
        ]
    }

    fn volume(
        &self,
        capture: &Capture,
        scan: &RegularScan,
        grid: &Grid,
        _: &mut SpareSpectra,
    ) -> AlbedoVolume {
        let [x, y, z] = self.at_points(capture, scan, grid).map(|values| on_grid_signed(scan, &values, grid));
        let vector = |i: usize| [x[i], y[i], z[i]];
        let normal: Vec<[f32; 3]> = (0..z.len()).into_par_iter().map(vector).collect();
        // A surface that faces away from the wall is none.
        let length = |v: &[f32; 3]| {
            if v[2] < 0.0 { v.iter().map(|c| c * c).sum::<f32>().sqrt() } else { 0.0 }
        };
        AlbedoVolume { albedo: normal.par_iter().map(length).collect(), normal: Some(normal) }
    }
}

impl DlctOptions {
    /// The vector albedo at the scan's points and the grid's depths, `[point * depths + depth]` for each component.
    fn at_points(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> [Vec<f32>; 3] {
        let cells = ConeCells::of(capture, scan);
        let usual = usual_distances(&cells, scan);
        let size = [scan.points(), cells.frequencies()];
        // v² τ, of the integral of τ dt = τ dv / √v over a cell.
        let mut spectra = vec![];
        cells.spectra(capture, scan, 2.5, &mut spectra);
        let mut planes = vec![Complex::default(); spectra.len()];
        transpose(&spectra, &mut planes, size);
        drop(spectra);
        [0, 1, 2].map(|component| {
            let mut own = planes.clone();
            self.invert(&cells, scan, &mut own, component);
            let mut spectra = vec![Complex::default(); own.len()];
            transpose(&own, &mut spectra, [size[1], size[0]]);
            drop(own);
            match component {
                2 => cells.at_depths(scan, grid, &spectra, |_| -2.0),
                _ => cells.at_depths(scan, grid, &spectra, |z| 2.0 * z / usual[component]),
            }
        })
    }

    /// Turns each frequency's plane into that of one component.
    fn invert(&self, cells: &ConeCells, scan: &RegularScan, planes: &mut [Complex], component: usize) {
        let padded = scan.padded();
        let lines = padded.map(Line::forward);
        let usual = usual_distances(cells, scan);
        let points: f64 = scan.n.iter().map(|n| (2 * n - 1) as f64).product();
        let noise = (points / self.snr.unwrap_or(SNR.values[0])) as f32;
        filter_planes(scan, planes, |k, spectrum| {
            let factor = |a: usize, weight: &dyn Fn(f64) -> f64| {
                cells.kernel(&lines[a], [scan.n[a], padded[a]], scan.step[a], cells.omega(k), weight)
            };
            let even = [0, 1].map(|a| factor(a, &|_| 1.0));
            let odd = [0, 1].map(|a| factor(a, &|d| d / usual[a]));
            for (ky, row) in spectrum.chunks_mut(padded[0]).enumerate() {
                for (kx, value) in row.iter_mut().enumerate() {
                    let kernels =
                        [odd[0][kx] * even[1][ky], even[0][kx] * odd[1][ky], even[0][kx] * even[1][ky]];
                    let power: f32 = kernels.iter().map(|k| k.norm_sqr()).sum();
                    *value *= kernels[component].conj() / (power + noise);
                }
            }
        });
    }
}

/// Root mean square of the distances in the kernel along x and along y, metres.
fn usual_distances(cells: &ConeCells, scan: &RegularScan) -> [f64; 2] {
    [0, 1].map(|a| {
        let squares = (0..scan.n[a]).map(|i| (i as f64 * scan.step[a]).powi(2));
        let within: Vec<f64> = squares.take_while(|s| *s <= cells.count as f64 * cells.step).collect();
        // Every distance but the first, 0, is there on both sides. Two points are a scan at least.
        let mean = 2.0 * within.iter().sum::<f64>() / (2 * within.len()).saturating_sub(1).max(1) as f64;
        if mean > 0.0 { mean.sqrt() } else { scan.step[a] }
    })
}

#[cfg(test)]
mod tests {
    use super::super::light_cone::definition;
    use super::super::reference::{error, random_capture, random_grid};
    use super::*;

    #[test]
    fn it_solves_the_blocks_by_definition() {
        let capture = random_capture(None);
        let o = DlctOptions::default();
        let scan = o.scan(&capture).unwrap();
        let grid = random_grid(&scan);
        let usual = usual_distances(&ConeCells::of(&capture, &scan), &scan);
        let (x, y) = (|x: f64, _: f64| x / usual[0], |_: f64, y: f64| y / usual[1]);
        let columns = definition::least_squares(&capture, &scan, 2.5, &[&x, &y, &|_, _| 1.0], o.snr.unwrap());
        let found = o.at_points(&capture, &scan, &grid);
        for (component, found) in found.iter().enumerate() {
            let factor = |z: f64| if component == 2 { -2.0 } else { 2.0 * z / usual[component] };
            let wanted = definition::at_depths(&capture, &scan, &grid, &columns[component], factor);
            let off = error(found, &wanted);
            assert!(off < 1e-4, "{component}: {off}");
        }
    }

    #[test]
    fn retroreflective_surfaces_are_refused() {
        let mut o = DlctOptions::default();
        o.image.reflectance = Reflectance::Retroreflective;
        let error = o.scan(&random_capture(None)).unwrap_err();
        assert!(error.what.contains("retroreflective") && error.hint.to_string().contains("lct"));
    }
}
