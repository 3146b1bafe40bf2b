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

use super::fourier::{Complex, Line, transpose};
use super::image::{Volume, on_grid};
use super::light_cone::{Cells, filter_planes};
use super::options::ImageOptions;
use super::{HostMethod, RegularScan, host_method};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Buffer;
use crate::solve::option::options;
use crate::transport::{Grid, Reflectance};

options! {
    /// Options of the light-cone transform.
    pub struct LctOptions(suit) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions,
        }
        "Light-cone transform" {
            /// Power of the signal over that of the noise, as the Wiener filter takes it: smaller values blur more
            // 0.8 is the published code's. Rendered histograms bear more (docs/methods.md).
            snr: f64 = if suit.captured() { 0.8 } else { 3.0 }, Range::Positive;
        }
    }
}

host_method!(LctOptions, "lct");

/// Spectra of all histograms over v.
const SPECTRA: Buffer = Buffer::named("spectra");
/// The same, frequency by frequency.
const BY_FREQUENCY: Buffer = Buffer::named("spectra_by_frequency");
/// The volume at the scan's points.
const AT_POINTS: Buffer = Buffer::named("volume_at_points");

impl HostMethod for LctOptions {
    fn image(&self) -> &ImageOptions {
        &self.image
    }

    fn scan(&self, capture: &Capture) -> Result<RegularScan> {
        RegularScan::confocal(capture, "the light-cone transform")
    }

    fn arrays(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Vec<(Buffer, u64)> {
        let spectra = 8 * (scan.points() * Cells::of(capture, scan).frequencies()) as u64;
        let at_points = 4 * (scan.points() * grid.n[2]) as u64;
        vec![(SPECTRA, spectra), (BY_FREQUENCY, spectra), (AT_POINTS, at_points)]
    }

    fn volume(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Volume {
        Volume { albedo: on_grid(scan, &self.at_points(capture, scan, grid), grid), normal: None }
    }
}

impl LctOptions {
    /// The albedo at the scan's points and the grid's depths, `[point * depths + depth]`.
    fn at_points(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Vec<f32> {
        let cells = Cells::of(capture, scan);
        // v^(3/2) τ or v^(1/2) τ, of the integral of τ dt = τ dv / √v over a cell.
        let power = match self.image.reflectance {
            Reflectance::Retroreflective => 1.0,
            _ => 2.0,
        };
        let size = [scan.points(), cells.frequencies()];
        let mut spectra = cells.spectra(capture, scan, power);
        let mut planes = vec![Complex::default(); spectra.len()];
        transpose(&spectra, &mut planes, size);
        self.invert(&cells, scan, &mut planes);
        transpose(&planes, &mut spectra, [size[1], size[0]]);
        drop(planes);
        cells.at_depths(scan, grid, &spectra, |z| 2.0 * z)
    }

    /// Divides each frequency's plane by the spectrum of the kernel, as the Wiener filter does.
    fn invert(&self, cells: &Cells, scan: &RegularScan, planes: &mut [Complex]) {
        let padded = scan.padded();
        let lines = padded.map(Line::forward);
        // The kernel's mean power over lateral frequencies, as in the published code: the number of its points.
        let points: f64 = scan.n.iter().map(|n| (2 * n - 1) as f64).product();
        let noise = (points / self.snr) as f32;
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
    use std::f64::consts::TAU;

    use super::super::reference::{Wide, error, random_capture, random_grid, wide_turn};
    use super::super::resample::Cumulative;
    use super::*;

    /// All of it by definition, in float64: counts integrated over cells, three-dimensional transforms term by term, the
    /// Wiener filter, interpolation at the depths.
    fn by_definition(o: &LctOptions, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Vec<f64> {
        let cells = Cells::of(capture, scan);
        let [lx, ly] = scan.padded();
        let (nx, ny, length) = (scan.n[0], scan.n[1], cells.length);
        let v = |k: usize| cells.low + (k as f64 + 0.5) * cells.step;
        let mut measured = vec![0.0; nx * ny * cells.count];
        for (i, m) in measured.iter_mut().enumerate() {
            let (point, k) = (i / cells.count, i % cells.count);
            let counts =
                Cumulative::of(capture.histogram(scan.pair_of[point]), capture.t_start, capture.bin_width);
            let until = |edge: usize| counts.until(2.0 * (cells.low + edge as f64 * cells.step).sqrt());
            *m = (until(k + 1) - until(k)) / cells.step * v(k).powi(2);
        }
        let omega = |k: usize| TAU * k as f64 / length as f64;
        let signed = |i: usize, l: usize| if 2 * i > l { i as f64 - l as f64 } else { i as f64 };
        let noise = ((2 * nx - 1) * (2 * ny - 1)) as f64 / o.snr;
        let mut columns = vec![vec![0.0; cells.count]; nx * ny];
        for kx in 0..lx {
            for ky in 0..ly {
                for k in 0..length {
                    let across =
                        |x: f64, y: f64| TAU * (kx as f64 * x / lx as f64 + ky as f64 * y / ly as f64);
                    let mut spectrum = Wide::default();
                    for (i, m) in measured.iter().enumerate() {
                        let (point, cell) = (i / cells.count, i % cells.count);
                        let angle = across((point / ny) as f64, (point % ny) as f64) + omega(k) * cell as f64;
                        spectrum += wide_turn(-angle) * *m;
                    }
                    // Frequencies above the middle are negative.
                    let w = signed(k, length) * TAU / length as f64 / cells.step;
                    let mut kernel = Wide::default();
                    for a in (1 - nx as isize)..nx as isize {
                        for b in (1 - ny as isize)..ny as isize {
                            let d = [a as f64 * scan.step[0], b as f64 * scan.step[1]];
                            if d.iter().any(|d| d * d > cells.count as f64 * cells.step) {
                                continue;
                            }
                            let mean = |d: f64, step: f64| {
                                let x = w * d * step;
                                if x == 0.0 { 1.0 } else { x.sin() / x }
                            };
                            let factor = mean(d[0], scan.step[0]) * mean(d[1], scan.step[1]);
                            kernel +=
                                wide_turn(-w * (d[0] * d[0] + d[1] * d[1]) - across(a as f64, b as f64))
                                    * factor;
                        }
                    }
                    let inverted = spectrum * kernel.conj() / (kernel.norm_sqr() + noise);
                    for (point, column) in columns.iter_mut().enumerate() {
                        let at = across((point / ny) as f64, (point % ny) as f64);
                        for (cell, value) in column.iter_mut().enumerate() {
                            *value += (inverted * wide_turn(at + omega(k) * cell as f64)).re;
                        }
                    }
                }
            }
        }
        let at_depth = |i: usize| {
            let z = grid.origin.z + (i % grid.n[2]) as f64 * grid.pitch.z - scan.z;
            let at = ((z * z - cells.low) / cells.step - 0.5).clamp(0.0, cells.count as f64 - 1.0);
            let low = (at as usize).min(cells.count - 2);
            let column = &columns[i / grid.n[2]];
            2.0 * z * (column[low] + (at - low as f64) * (column[low + 1] - column[low]))
        };
        (0..nx * ny * grid.n[2]).map(at_depth).collect()
    }

    #[test]
    fn it_is_the_wiener_filter_by_definition() {
        let capture = random_capture(None);
        let o = LctOptions::default();
        let scan = o.scan(&capture).unwrap();
        let grid = random_grid(&scan);
        let wanted = by_definition(&o, &capture, &scan, &grid);
        let off = error(&o.at_points(&capture, &scan, &grid), &wanted);
        assert!(off < 1e-4, "{off}");
    }
}
