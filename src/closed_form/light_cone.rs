//! The coordinates of light cones, in which confocal light is a convolution: v = (t/2)² of a path t and u = z² of a depth
//! z. What the light-cone transform and the directional one share.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::fourier::{Complex, Line, Planes, Spare, fast_length, resize, transpose, turn};
use super::resample::{Cumulative, PathPlace, linear};
use super::scan::RegularScan;
use super::sharpness::Ladder;
use crate::capture::Capture;
use crate::transport::Grid;

/// Ratios of signal to noise to choose from.
pub const SNR: Ladder = Ladder { setting: "snr", values: &[0.8, 0.3, 0.1, 0.03, 0.01, 0.003] };

/// Cells of v = (t/2)² and of u = z², which lie at the same places.
pub(super) struct ConeCells {
    /// Lower edge of the first cell, m².
    pub low: f64,
    /// Width of a cell, m².
    pub step: f64,
    /// Number of cells.
    pub count: usize,
    /// Length of the transform. No light of a cell comes back at the beginning.
    pub length: usize,
}

impl ConeCells {
    pub fn of(capture: &Capture, scan: &RegularScan) -> ConeCells {
        let [low, high] = [capture.t_start, capture.t_end()].map(|t| (0.5 * t.max(0.0)).powi(2));
        let count = capture.bins.max(2);
        let step = (high - low) / count as f64;
        let farthest = scan.size().map(|s| s * s).iter().sum::<f64>() / step;
        // Offsets along one axis that leave the cells are left out, so two axes reach twice the cells.
        let beyond = farthest.ceil().min(2.0 * count as f64) as usize;
        ConeCells { low, step, count, length: 2 * fast_length((count + beyond).div_ceil(2)) }
    }

    /// Radians per square metre of frequency `k`.
    pub fn omega(&self, k: usize) -> f64 {
        TAU * k as f64 / (self.length as f64 * self.step)
    }

    /// Frequencies from 0 to the highest.
    pub fn frequencies(&self) -> usize {
        self.length / 2 + 1
    }

    /// The factor of one axis in a kernel's spectrum: the Fourier transform over `length` places of weight(d) exp(−iω d²)
    /// at the distances d of `n` points, averaged over the cell of a point.
    pub fn kernel(
        &self,
        line: &Line,
        [n, length]: [usize; 2],
        distance: f64,
        omega: f64,
        weight: impl Fn(f64) -> f64,
    ) -> Vec<Complex> {
        let mut all = vec![Complex::default(); length];
        for i in 0..n {
            let d = i as f64 * distance;
            if d * d > self.count as f64 * self.step {
                break;
            }
            let across = omega * d * distance;
            let mean = if across.abs() < 1e-6 { 1.0 } else { across.sin() / across };
            let value = turn(-omega * d * d) * mean as f32;
            all[i] = value * weight(d) as f32;
            if i > 0 {
                all[length - i] = value * weight(-d) as f32;
            }
        }
        line.run(&mut all, &mut vec![]);
        all
    }

    /// Counts per square metre of v, times v to the power, as spectra over v: `[point * frequencies + k]`. Two points are the real and
    /// the imaginary part of one transform.
    pub fn spectra(&self, capture: &Capture, scan: &RegularScan, power: f64, spectra: &mut Vec<Complex>) {
        let (frequencies, length) = (self.frequencies(), self.length);
        let Capture { bins, t_start, bin_width, .. } = *capture;
        let path = |edge: usize| 2.0 * (self.low + edge as f64 * self.step).sqrt();
        let edges: Vec<PathPlace> =
            (0..=self.count).map(|edge| PathPlace::of(path(edge), bins, t_start, bin_width)).collect();
        let weight = |k: usize| (self.low + (k as f64 + 0.5) * self.step).powf(power);
        let weights: Vec<f64> = (0..self.count).map(weight).collect();
        let densities = |pair: usize, put: &mut dyn FnMut(usize, f32)| {
            let counts = Cumulative::of(capture.histogram(pair));
            let mut before = counts.until(edges[0]);
            for (k, (edge, weight)) in edges[1..].iter().zip(&weights).enumerate() {
                let until = counts.until(*edge);
                put(k, ((until - before) / self.step * weight) as f32);
                before = until;
            }
        };
        resize(spectra, scan.points() * frequencies);
        let line = Line::forward(length);
        spectra.par_chunks_mut(2 * frequencies).zip(scan.pair_of.par_chunks(2)).for_each_init(
            Default::default,
            |s, (to, pairs)| {
                let (values, spare): &mut (Vec<Complex>, Vec<Complex>) = s;
                values.clear();
                values.resize(length, Complex::default());
                densities(pairs[0], &mut |k, value| values[k].re = value);
                if let [_, second] = pairs {
                    densities(*second, &mut |k, value| values[k].im = value);
                }
                line.run(values, spare);
                let (first, second) = to.split_at_mut(frequencies);
                let both = |k: usize| (values[k], values[(length - k) % length].conj());
                first.iter_mut().enumerate().for_each(|(k, to)| {
                    let (value, mirrored) = both(k);
                    *to = (value + mirrored) * 0.5;
                });
                second.iter_mut().enumerate().for_each(|(k, to)| {
                    let (value, mirrored) = both(k);
                    let difference = (value - mirrored) * 0.5;
                    *to = Complex::new(difference.im, -difference.re);
                });
            },
        );
    }

    /// What spectra over u are at the depths of `grid`, times `factor` of the depth: `[point * depths + depth]`. Two points are the
    /// real and the imaginary part of one transform.
    pub fn at_depths(
        &self,
        scan: &RegularScan,
        grid: &Grid,
        spectra: &[Complex],
        factor: impl Fn(f64) -> f64 + Sync,
    ) -> Vec<f32> {
        let (line, frequencies) = (Line::backward(self.length), self.frequencies());
        let deep = grid.n[2];
        let place = |k: usize| {
            let z = grid.origin.z + k as f64 * grid.pitch.z - scan.z;
            (z > 0.0).then(|| ((z * z - self.low) / self.step - 0.5, factor(z) as f32))
        };
        let places: Vec<Option<(f64, f32)>> = (0..deep).map(place).collect();
        let mut values = vec![0.0f32; scan.points() * deep];
        values.par_chunks_mut(2 * deep).zip(spectra.par_chunks(2 * frequencies)).for_each_init(
            Default::default,
            |s, (to, spectra)| {
                let (column, spare): &mut (Vec<Complex>, Vec<Complex>) = s;
                let (first, second) = spectra.split_at(frequencies);
                column.clear();
                column.extend_from_slice(first);
                let above = self.length - frequencies;
                column.extend(first[1..=above].iter().rev().map(|v| v.conj()));
                // A column is real: of the mean and of the highest frequency, the real part.
                let ends = [0, frequencies - 1];
                ends.iter().for_each(|k| column[*k].im = 0.0);
                if !second.is_empty() {
                    let turned = |v: Complex| Complex::new(-v.im, v.re);
                    let (low, high) = column.split_at_mut(frequencies);
                    for (k, (to, from)) in low.iter_mut().zip(second).enumerate() {
                        *to += if ends.contains(&k) { Complex::new(0.0, from.re) } else { turned(*from) };
                    }
                    let mirrored = second[1..=above].iter().rev().map(|v| turned(v.conj()));
                    high.iter_mut().zip(mirrored).for_each(|(to, from)| *to += from);
                }
                line.run(column, spare);
                let (first, second) = to.split_at_mut(deep);
                let put = |to: &mut [f32], part: fn(&Complex) -> f32| {
                    for (value, place) in to.iter_mut().zip(&places) {
                        let Some((at, factor)) = place else { continue };
                        *value = factor * linear(|i| part(&column[i]), self.count, *at);
                    }
                };
                put(first, |v| v.re);
                put(second, |v| v.im);
            },
        );
        values
    }
}

/// Transforms planes of one frequency each, in place: their spectra go through `filter`, which receives the frequency.
/// A spectrum lies as [`Planes::spectrum`] leaves it.
pub(super) fn filter_planes(
    scan: &RegularScan,
    planes: &mut [Complex],
    filter: impl Fn(usize, &mut [Complex]) + Sync,
) {
    let padded = scan.padded();
    let [forward, backward] = [Planes::forward(padded), Planes::backward(padded)];
    planes.par_chunks_mut(scan.points()).enumerate().for_each_init(Default::default, |s, (k, plane)| {
        let (wide, spare): &mut (Vec<Complex>, Spare) = s;
        in_wide(plane, scan.n, padded, wide);
        forward.spectrum(wide, scan.n[0], spare);
        filter(k, wide);
        backward.plane(wide, scan.n[0], spare);
        out_of_wide(wide, padded, plane, scan.n);
    });
}

/// The spectra over the padded scan of points' spectra `[point * frequencies + frequency]`:
/// `[(frequency * padded[1] + ky) * padded[0] + kx]`.
pub(super) fn plane_waves(scan: &RegularScan, of_points: Vec<Complex>) -> Vec<Complex> {
    let (points, padded) = (scan.points(), scan.padded());
    let frequencies = of_points.len() / points;
    let mut of_frequencies = vec![Complex::default(); of_points.len()];
    transpose(&of_points, &mut of_frequencies, [points, frequencies]);
    drop(of_points);
    let forward = Planes::forward(padded);
    let mut all = vec![Complex::default(); padded[0] * padded[1] * frequencies];
    all.par_chunks_mut(padded[0] * padded[1]).zip(of_frequencies.par_chunks(points)).for_each_init(
        Default::default,
        |s, (to, plane)| {
            let (wide, spare): &mut (Vec<Complex>, Spare) = s;
            in_wide(plane, scan.n, padded, wide);
            forward.spectrum(wide, scan.n[0], spare);
            to.copy_from_slice(wide);
        },
    );
    all
}

/// Puts a plane of `n` places into the corner of one of `padded` places.
pub(super) fn in_wide(plane: &[Complex], n: [usize; 2], padded: [usize; 2], wide: &mut Vec<Complex>) {
    wide.clear();
    wide.resize(padded[0] * padded[1], Complex::default());
    for (to, from) in wide.chunks_mut(padded[1]).zip(plane.chunks(n[1])) {
        to[..n[1]].copy_from_slice(from);
    }
}

/// Takes the corner of `n` places out of a plane of `padded` places.
pub(super) fn out_of_wide(wide: &[Complex], padded: [usize; 2], plane: &mut [Complex], n: [usize; 2]) {
    for (to, from) in plane.chunks_mut(n[1]).zip(wide.chunks(padded[1])) {
        to.copy_from_slice(&from[..n[1]]);
    }
}

/// The same by definition, in float64, for tests.
#[cfg(test)]
pub(super) mod definition {
    use super::super::reference::{Wide, wide_turn};
    use super::*;

    /// The weight of a kernel at a distance along x and y, metres.
    pub type Weight<'w> = &'w dyn Fn(f64, f64) -> f64;

    /// Solves min |Σ_c K_c ∗ A_c − G|² + (points of the kernel / snr) Σ_c |A_c|²: three-dimensional transforms term by
    /// term, and the block of every frequency by elimination. `[component][point][cell]`.
    pub fn least_squares(
        capture: &Capture,
        scan: &RegularScan,
        power: f64,
        weights: &[Weight<'_>],
        snr: f64,
    ) -> Vec<Vec<Vec<f64>>> {
        let cells = ConeCells::of(capture, scan);
        let [lx, ly] = scan.padded();
        let [nx, ny] = scan.n;
        let measured = measured(capture, scan, &cells, power);
        let noise = ((2 * nx - 1) * (2 * ny - 1)) as f64 / snr;
        let mut all = vec![vec![vec![0.0; cells.count]; nx * ny]; weights.len()];
        for frequency in 0..lx * ly * cells.length {
            let (k, kx, ky) =
                (frequency % cells.length, frequency / cells.length % lx, frequency / cells.length / lx);
            let across = |x: f64, y: f64| TAU * (kx as f64 * x / lx as f64 + ky as f64 * y / ly as f64);
            let at = |point: usize, cell: usize| {
                across((point / ny) as f64, (point % ny) as f64)
                    + TAU * (k * cell) as f64 / cells.length as f64
            };
            let mut light = Wide::default();
            for (i, m) in measured.iter().enumerate() {
                light += wide_turn(-at(i / cells.count, i % cells.count)) * *m;
            }
            // Frequencies above the middle are negative.
            let signed = if 2 * k > cells.length { k as f64 - cells.length as f64 } else { k as f64 };
            let omega = TAU * signed / (cells.length as f64 * cells.step);
            let kernels: Vec<Wide> =
                weights.iter().map(|weight| kernel(scan, &cells, omega, &across, *weight)).collect();
            for (found, columns) in block(&kernels, light, noise).into_iter().zip(&mut all) {
                for (point, column) in columns.iter_mut().enumerate() {
                    for (cell, value) in column.iter_mut().enumerate() {
                        *value += (found * wide_turn(at(point, cell))).re;
                    }
                }
            }
        }
        all
    }

    /// Counts per square metre of v, times v to the power, `[point * count + cell]`.
    fn measured(capture: &Capture, scan: &RegularScan, cells: &ConeCells, power: f64) -> Vec<f64> {
        let of = |i: usize| {
            let (point, k) = (i / cells.count, i % cells.count);
            let histogram = capture.histogram(scan.pair_of[point]);
            let counts = Cumulative::of(histogram);
            let path = |edge: usize| 2.0 * (cells.low + edge as f64 * cells.step).sqrt();
            let place = |path: f64| PathPlace::of(path, capture.bins, capture.t_start, capture.bin_width);
            let until = |edge: usize| counts.until(place(path(edge)));
            let v = cells.low + (k as f64 + 0.5) * cells.step;
            (until(k + 1) - until(k)) / cells.step * v.powf(power)
        };
        (0..scan.points() * cells.count).map(of).collect()
    }

    /// The spectrum of a kernel at one frequency: a sum over all distances.
    fn kernel(
        scan: &RegularScan,
        cells: &ConeCells,
        omega: f64,
        across: &dyn Fn(f64, f64) -> f64,
        weight: Weight<'_>,
    ) -> Wide {
        let mut sum = Wide::default();
        for a in 1 - scan.n[0] as isize..scan.n[0] as isize {
            for b in 1 - scan.n[1] as isize..scan.n[1] as isize {
                let d = [a as f64 * scan.step[0], b as f64 * scan.step[1]];
                if d.iter().any(|d| d * d > cells.count as f64 * cells.step) {
                    continue;
                }
                let mean = |axis: usize| {
                    let x = omega * d[axis] * scan.step[axis];
                    if x == 0.0 { 1.0 } else { x.sin() / x }
                };
                let angle = -omega * (d[0] * d[0] + d[1] * d[1]) - across(a as f64, b as f64);
                sum += wide_turn(angle) * (mean(0) * mean(1) * weight(d[0], d[1]));
            }
        }
        sum
    }

    /// Solves (conj(k) kᵀ + noise) a = conj(k) g by elimination.
    fn block(kernels: &[Wide], light: Wide, noise: f64) -> Vec<Wide> {
        let n = kernels.len();
        let mut rows: Vec<Vec<Wide>> = (0..n)
            .map(|i| {
                let mut row: Vec<Wide> = kernels.iter().map(|k| kernels[i].conj() * k).collect();
                row[i] += noise;
                row.push(kernels[i].conj() * light);
                row
            })
            .collect();
        for i in 0..n {
            let pivot = rows[i].clone();
            for row in rows.iter_mut().enumerate().filter(|(j, _)| *j != i).map(|(_, row)| row) {
                let share = row[i] / pivot[i];
                row.iter_mut().zip(&pivot).for_each(|(v, p)| *v -= share * p);
            }
        }
        (0..n).map(|i| rows[i][n] / rows[i][i]).collect()
    }

    /// Columns at the depths of `grid`, interpolated linearly in z², times `factor`.
    pub fn at_depths(
        capture: &Capture,
        scan: &RegularScan,
        grid: &Grid,
        columns: &[Vec<f64>],
        factor: impl Fn(f64) -> f64,
    ) -> Vec<f64> {
        let cells = ConeCells::of(capture, scan);
        let of = |i: usize| {
            let z = grid.origin.z + (i % grid.n[2]) as f64 * grid.pitch.z - scan.z;
            let at = ((z * z - cells.low) / cells.step - 0.5).clamp(0.0, cells.count as f64 - 1.0);
            let low = (at as usize).min(cells.count - 2);
            let column = &columns[i / grid.n[2]];
            factor(z) * (column[low] + (at - low as f64) * (column[low + 1] - column[low]))
        };
        (0..scan.points() * grid.n[2]).map(of).collect()
    }
}
