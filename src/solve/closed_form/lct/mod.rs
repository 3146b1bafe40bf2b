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

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::fourier::{Complex, Line, Planes, Spare, fast_length, transpose, turn};
use super::image::{Volume, on_grid};
use super::options::ImageOptions;
use super::resample::{Cumulative, linear};
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
            snr: f64 = 0.8, Range::Positive;
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

/// Cells of v = (t/2)² and of u = z², which lie at the same places.
struct Cells {
    /// Lower edge of the first cell, m².
    low: f64,
    /// Width of a cell, m².
    step: f64,
    /// Number of cells.
    count: usize,
    /// Length of the transform. No light of a cell comes back at the beginning.
    length: usize,
}

impl Cells {
    fn of(capture: &Capture, scan: &RegularScan) -> Cells {
        let [low, high] = [capture.t_start, capture.t_end()].map(|t| (0.5 * t.max(0.0)).powi(2));
        let count = capture.bins.max(2);
        let step = (high - low) / count as f64;
        let farthest = scan.size().map(|s| s * s).iter().sum::<f64>() / step;
        // Offsets along one axis that leave the cells are left out, so two axes reach twice the cells.
        let beyond = farthest.ceil().min(2.0 * count as f64) as usize;
        Cells { low, step, count, length: 2 * fast_length((count + beyond).div_ceil(2)) }
    }

    /// Frequencies from 0 to the highest.
    fn frequencies(&self) -> usize {
        self.length / 2 + 1
    }

    /// The factor of one axis in the kernel's spectrum: the Fourier transform over `length` places of exp(−iω d²) at
    /// the distances d of `n` points, averaged over the cell of a point.
    fn kernel(&self, line: &Line, [n, length]: [usize; 2], distance: f64, omega: f64) -> Vec<Complex> {
        let mut all = vec![Complex::default(); length];
        for i in 0..n {
            let d = i as f64 * distance;
            if d * d > self.count as f64 * self.step {
                break;
            }
            let across = omega * d * distance;
            let mean = if across.abs() < 1e-6 { 1.0 } else { across.sin() / across };
            let value = turn(-omega * d * d) * mean as f32;
            all[i] = value;
            all[(length - i) % length] = value;
        }
        line.run(&mut all, &mut vec![]);
        all
    }
}

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
        let cells = Cells::of(capture, scan);
        let power = match self.image.reflectance {
            Reflectance::Retroreflective => 1,
            _ => 2,
        };
        let points = scan.points();
        let frequencies = cells.frequencies();
        let mut spectra = vec![Complex::default(); points * frequencies];
        let line = Line::forward(cells.length);
        spectra.par_chunks_mut(frequencies).zip(&scan.pair_of).for_each_init(
            Default::default,
            |s, (to, pair)| {
                let (line_of, spare): &mut (Vec<Complex>, Vec<Complex>) = s;
                line_of.clear();
                line_of.resize(cells.length, Complex::default());
                let counts = Cumulative::of(capture.histogram(*pair), capture.t_start, capture.bin_width);
                let path = |edge: usize| 2.0 * (cells.low + edge as f64 * cells.step).sqrt();
                let mut before = counts.until(path(0));
                for (k, value) in line_of[..cells.count].iter_mut().enumerate() {
                    let until = counts.until(path(k + 1));
                    // Of the integral of τ dt over the cell, with dt = dv / √v.
                    let v = cells.low + (k as f64 + 0.5) * cells.step;
                    *value = Complex::from(((until - before) / cells.step * v.powi(power)) as f32);
                    before = until;
                }
                line.run(line_of, spare);
                to.copy_from_slice(&line_of[..frequencies]);
            },
        );
        let mut planes = vec![Complex::default(); points * frequencies];
        transpose(&spectra, &mut planes, [points, frequencies]);
        self.invert(&cells, scan, &mut planes);
        transpose(&planes, &mut spectra, [frequencies, points]);
        drop(planes);
        let values = depths(&cells, scan, grid, &spectra);
        drop(spectra);
        Volume { albedo: on_grid(scan, &values, grid), normal: None }
    }
}

impl LctOptions {
    /// Divides each frequency's plane by the spectrum of the kernel, as the Wiener filter does.
    fn invert(&self, cells: &Cells, scan: &RegularScan, planes: &mut [Complex]) {
        let padded = scan.padded();
        let [forward, backward] = [Planes::forward(padded), Planes::backward(padded)];
        let lines = padded.map(Line::forward);
        // The kernel's mean power over lateral frequencies, as in the published code: the number of its points.
        let points: f64 = scan.n.iter().map(|n| (2 * n - 1) as f64).product();
        let noise = (points / self.snr) as f32;
        planes.par_chunks_mut(scan.points()).enumerate().for_each_init(Default::default, |s, (k, plane)| {
            let (wide, spare): &mut (Vec<Complex>, Spare) = s;
            let omega = TAU * k as f64 / (cells.length as f64 * cells.step);
            let factor = |a: usize| cells.kernel(&lines[a], [scan.n[a], padded[a]], scan.step[a], omega);
            let [of_x, of_y] = [factor(0), factor(1)];
            in_wide(plane, scan.n, padded, wide);
            forward.spectrum(wide, scan.n[0], spare);
            for (row, y) in wide.chunks_mut(padded[0]).zip(&of_y) {
                for (value, x) in row.iter_mut().zip(&of_x) {
                    let kernel = x * y;
                    *value *= kernel.conj() / (kernel.norm_sqr() + noise);
                }
            }
            backward.plane(wide, scan.n[0], spare);
            for (to, from) in plane.chunks_mut(scan.n[1]).zip(wide.chunks(padded[1])) {
                to.copy_from_slice(&from[..scan.n[1]]);
            }
        });
    }
}

/// Puts a plane of `n` places into the corner of one of `padded` places.
pub(super) fn in_wide(plane: &[Complex], n: [usize; 2], padded: [usize; 2], wide: &mut Vec<Complex>) {
    wide.clear();
    wide.resize(padded[0] * padded[1], Complex::default());
    for (to, from) in wide.chunks_mut(padded[1]).zip(plane.chunks(n[1])) {
        to[..n[1]].copy_from_slice(from);
    }
}

/// Albedo at the depths of `grid` from spectra over u, `[point * frequencies + k]`.
fn depths(cells: &Cells, scan: &RegularScan, grid: &Grid, spectra: &[Complex]) -> Vec<f32> {
    let line = Line::backward(cells.length);
    let deep = grid.n[2];
    let mut values = vec![0.0f32; scan.points() * deep];
    values.par_chunks_mut(deep).zip(spectra.par_chunks(cells.frequencies())).for_each_init(
        Default::default,
        |s, (to, spectrum)| {
            let (column, spare): &mut (Vec<Complex>, Vec<Complex>) = s;
            column.clear();
            column.extend_from_slice(spectrum);
            column.extend(spectrum[1..cells.length - spectrum.len() + 1].iter().rev().map(|v| v.conj()));
            line.run(column, spare);
            for (k, value) in to.iter_mut().enumerate() {
                let z = grid.origin.z + k as f64 * grid.pitch.z - scan.z;
                if z > 0.0 {
                    let at = (z * z - cells.low) / cells.step - 0.5;
                    *value = 2.0 * z as f32 * linear(|i| column[i].re, cells.count, at);
                }
            }
        },
    );
    values
}
