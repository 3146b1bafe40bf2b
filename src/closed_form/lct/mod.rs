//! The light-cone transform (O'Toole, Lindell, Wetzstein: *Confocal non-line-of-sight imaging based on the light-cone
//! transform*, Nature 2018).
//!
//! With v = (t/2)² of a path t, and u = z² of a depth z, a confocal transient of diffuse surfaces is a convolution:
//! v^(3/2) τ(x', y', t) = ∫ ρ(x, y, z) / (2 z) δ((x' − x)² + (y' − y)² + u − v) dx dy du. Retroreflective ones fall off
//! by the square of the distance, so the power is 1/2. The kernel is inverted by a Wiener filter.
//!
//! Here counts are integrated over cells of v, so no shift of half a bin arises, and v begins with the first bin. The
//! spectrum of the kernel is known in closed form: at a frequency ω of v it is exp(−iω s) with s = dx² + dy², a product
//! of one factor for x and one for y. Each frequency is a plane of its own, so memory holds the counts' spectrum
//! without padding.

use super::fourier::{Complex, Line, SpareSpectra, resize, transpose};
use super::image::{AlbedoVolume, on_grid};
use super::light_cone::{ConeCells, SNR, filter_planes};
use super::method::{By, ClosedForm, HostMethod};
use super::options::{ImageOptions, ImageSettings};
use super::scan::RegularScan;
use super::sharpness::Ladder;
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Buffer;
use crate::options::options;
use crate::transport::{Grid, Reflectance};

options! {
    /// Options of the light-cone transform.
    pub struct LctOptions: LctSettings(scene) {
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
            // 0.8 is the published code's. Rendered histograms bear more (docs/methods.md).
            snr: Option<f64> = (!scene.captured()).then_some(3.0), Range::Positive;
        }
    }
}

/// Spectra of all histograms over v.
const SPECTRA: Buffer = Buffer::named("spectra");
/// The same, frequency by frequency.
const BY_FREQUENCY: Buffer = Buffer::named("spectra_by_frequency");
/// The volume at the scan's points.
const AT_POINTS: Buffer = Buffer::named("volume_at_points");

impl ClosedForm for LctOptions {
    const NAME: &'static str = "lct";
    const MASK_SHARE: f64 = 0.66;

    const BY: By<Self> =
        By::Host(HostMethod { scan: Self::scan, arrays: Self::arrays, volume: Self::volume });

    fn shared(&self) -> (usize, &ImageOptions) {
        (self.lateral, &self.image)
    }

    fn sharpness(&mut self) -> Option<(Ladder, &mut Option<f64>)> {
        Some((SNR, &mut self.snr))
    }
}

impl LctOptions {
    fn scan(&self, capture: &Capture) -> Result<RegularScan> {
        RegularScan::confocal(capture, "the light-cone transform")
    }

    fn arrays(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Vec<(Buffer, u64)> {
        let spectra = 8 * (scan.points() * ConeCells::of(capture, scan).frequencies()) as u64;
        let at_points = 4 * (scan.points() * grid.n[2]) as u64;
        vec![(SPECTRA, spectra), (BY_FREQUENCY, spectra), (AT_POINTS, at_points)]
    }

    fn volume(
        &self,
        capture: &Capture,
        scan: &RegularScan,
        grid: &Grid,
        spare: &mut SpareSpectra,
    ) -> AlbedoVolume {
        AlbedoVolume {
            albedo: on_grid(scan, &self.at_points(capture, scan, grid, spare), grid),
            normal: None,
        }
    }
}

impl LctOptions {
    /// The albedo at the scan's points and the grid's depths, `[point * depths + depth]`.
    fn at_points(
        &self,
        capture: &Capture,
        scan: &RegularScan,
        grid: &Grid,
        SpareSpectra([spectra, planes]): &mut SpareSpectra,
    ) -> Vec<f32> {
        let cells = ConeCells::of(capture, scan);
        // v^(3/2) τ or v^(1/2) τ, of the integral of τ dt = τ dv / √v over a cell.
        let power = match self.image.reflectance {
            Reflectance::Retroreflective => 1.0,
            _ => 2.0,
        };
        let size = [scan.points(), cells.frequencies()];
        cells.spectra(capture, scan, power, spectra);
        resize(planes, spectra.len());
        transpose(spectra, planes, size);
        self.invert(&cells, scan, planes);
        transpose(planes, spectra, [size[1], size[0]]);
        cells.at_depths(scan, grid, spectra, |z| 2.0 * z)
    }

    /// Divides each frequency's plane by the spectrum of the kernel, as the Wiener filter does.
    fn invert(&self, cells: &ConeCells, scan: &RegularScan, planes: &mut [Complex]) {
        let padded = scan.padded();
        let lines = padded.map(Line::forward);
        // The kernel's mean power over lateral frequencies, as in the published code: the number of its points.
        let points: f64 = scan.n.iter().map(|n| (2 * n - 1) as f64).product();
        let noise = (points / self.snr.unwrap_or(SNR.values[0])) as f32;
        filter_planes(scan, planes, |k, spectrum| {
            let sides = |a: usize| [scan.n[a], padded[a]];
            let factor = |a: usize| cells.kernel(&lines[a], sides(a), scan.step[a], cells.omega(k), |_| 1.0);
            let [of_x, of_y] = [factor(0), factor(1)];
            for (row, y) in spectrum.chunks_mut(padded[0]).zip(&of_y) {
                for (value, x) in row.iter_mut().zip(&of_x) {
                    let kernel = x * y;
                    *value *= kernel.conj() / (kernel.norm_sqr() + noise);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::light_cone::definition;
    use super::super::reference::{error, random_capture, random_grid};
    use super::*;

    #[test]
    fn it_is_the_wiener_filter_by_definition() {
        let capture = random_capture(None);
        for (reflectance, power) in [(Reflectance::Cosine, 2.0), (Reflectance::Retroreflective, 1.0)] {
            let mut o = LctOptions::default();
            o.image.reflectance = reflectance;
            let scan = o.scan(&capture).unwrap();
            let grid = random_grid(&scan);
            let columns = definition::least_squares(&capture, &scan, power, &[&|_, _| 1.0], o.snr.unwrap());
            let wanted = definition::at_depths(&capture, &scan, &grid, &columns[0], |z| 2.0 * z);
            let off = error(&o.at_points(&capture, &scan, &grid, &mut SpareSpectra::default()), &wanted);
            assert!(off < 1e-4, "{off}");
        }
    }
}
