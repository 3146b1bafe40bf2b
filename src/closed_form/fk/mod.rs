//! f-k migration (Lindell, Wetzstein, O'Toole: *Wave-based non-line-of-sight imaging using fast f-k migration*, ACM
//! Transactions on Graphics 2019).
//!
//! Confocal light is like a wave that leaves every hidden point at time 0 with half the speed of light: over half the
//! path r = t/2, ψ(x, y, r) obeys the wave equation with speed 1. The root of the transient, corrected for the falloff,
//! stands for the wave at the wall. The wave at r = 0 is the image. In frequencies, that is Stolt's change of
//! variables: Ψ(kx, ky, kz) = kz / k · Φ(kx, ky, k) with k = √(kx² + ky² + kz²).
//!
//! Here the depths of the image are half the centres of the bins, wherever the first bin begins: the spectrum over r is
//! taken about the middle of the bins, which also keeps its phase slow, and is interpolated by a windowed sinc.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::fourier::{Complex, Line, Planes, Spare, SpareSpectra, fast_length, transpose, turn, wave_number};
use super::image::{AlbedoVolume, on_grid};
use super::light_cone::plane_waves;
use super::method::{By, ClosedForm, HostMethod};
use super::options::{ImageOptions, ImageSettings};
use super::resample::linear;
use super::scan::RegularScan;
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Buffer;
use crate::options::options;
use crate::transport::{Grid, Reflectance};

options! {
    /// Options of f-k migration.
    pub struct FkOptions: FkSettings(scene) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions / ImageSettings,
        }
        "Solver" {
            /// Lateral pixels of the maps
            lateral: usize = 128, Range::Count(1, 4096);
        }
    }
}

/// The wave's spectra, frequency by frequency, and later depth by depth.
const WAVE: Buffer = Buffer::named("wave");
/// The same, column by column.
const BY_COLUMN: Buffer = Buffer::named("wave_by_column");
/// The volume at the scan's points.
const AT_POINTS: Buffer = Buffer::named("volume_at_points");

/// Half paths, and their transform.
struct HalfPaths {
    /// Number of bins.
    count: usize,
    /// Half of a bin, metres.
    step: f64,
    /// Half of the path at the centre of the first bin, metres.
    first: f64,
    /// The bin in the middle: phases are those about its centre.
    middle: usize,
    /// Length of the transform.
    length: usize,
}

impl HalfPaths {
    fn of(capture: &Capture) -> HalfPaths {
        let step = 0.5 * capture.bin_width;
        HalfPaths {
            count: capture.bins,
            step,
            first: 0.5 * capture.t_start + 0.5 * step,
            middle: capture.bins / 2,
            length: 2 * fast_length(capture.bins),
        }
    }

    fn frequencies(&self) -> usize {
        self.length / 2 + 1
    }

    /// The place of bin `b` in a transform about the middle.
    fn place(&self, b: usize) -> usize {
        (b + self.length - self.middle) % self.length
    }
}

impl ClosedForm for FkOptions {
    const NAME: &'static str = "fk";
    const MASK_SHARE: f64 = 0.64;

    const BY: By<Self> =
        By::Host(HostMethod { scan: Self::scan, arrays: Self::arrays, volume: Self::volume });

    fn shared(&self) -> (usize, &ImageOptions) {
        (self.lateral, &self.image)
    }
}

impl FkOptions {
    fn scan(&self, capture: &Capture) -> Result<RegularScan> {
        RegularScan::confocal(capture, "f-k migration")
    }

    fn arrays(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Vec<(Buffer, u64)> {
        let half = HalfPaths::of(capture);
        let [wide, deep] = [scan.padded().iter().product::<usize>(), half.frequencies().max(half.count)];
        let wave = 8 * (wide * deep) as u64;
        let at_points = 4 * (scan.points() * grid.n[2]) as u64;
        vec![(WAVE, wave), (BY_COLUMN, wave), (AT_POINTS, at_points)]
    }

    fn volume(
        &self,
        capture: &Capture,
        scan: &RegularScan,
        grid: &Grid,
        _: &mut SpareSpectra,
    ) -> AlbedoVolume {
        let half = HalfPaths::of(capture);
        let intensity = self.intensity(capture, scan, &half);
        let deep = grid.n[2];
        let points = scan.points();
        let mut values = vec![0.0f32; points * deep];
        values.par_chunks_mut(deep).enumerate().for_each(|(point, column)| {
            for (k, value) in column.iter_mut().enumerate() {
                let z = grid.origin.z + k as f64 * grid.pitch.z - scan.z;
                let at = (z - half.first) / half.step;
                *value = linear(|i| intensity[i * points + point], half.count, at);
            }
        });
        AlbedoVolume { albedo: on_grid(scan, &values, grid), normal: None }
    }
}

impl FkOptions {
    /// The migrated wave's power at the scan's points and the depths of the bins, `[bin * points + point]`.
    fn intensity(&self, capture: &Capture, scan: &RegularScan, half: &HalfPaths) -> Vec<f32> {
        let spectra = self.spectra(capture, scan, half);
        let wide: usize = scan.padded().iter().product();
        let frequencies = half.frequencies();
        // Column by column, [(ky * padded + kx) * frequencies + k].
        let mut columns = vec![Complex::default(); wide * frequencies];
        transpose(&spectra, &mut columns, [frequencies, wide]);
        drop(spectra);
        migrate(scan, half, &mut columns);
        let mut planes = vec![Complex::default(); wide * half.count];
        for_depths(&columns, &mut planes, [wide, frequencies, half.count]);
        drop(columns);
        intensities(scan, half, planes)
    }

    /// Spectra of the wave at the wall, `[(k * padded[1] + ky) * padded[0] + kx]`.
    fn spectra(&self, capture: &Capture, scan: &RegularScan, half: &HalfPaths) -> Vec<Complex> {
        // A wave's power falls off by the square of the distance.
        let power = match self.image.reflectance {
            Reflectance::Retroreflective => 0,
            _ => 1,
        };
        let points = scan.points();
        let frequencies = half.frequencies();
        let mut of_points = vec![Complex::default(); points * frequencies];
        let line = Line::forward(half.length);
        of_points.par_chunks_mut(frequencies).zip(&scan.pair_of).for_each_init(
            Default::default,
            |s, (to, pair)| {
                let (values, spare): &mut (Vec<Complex>, Vec<Complex>) = s;
                values.clear();
                values.resize(half.length, Complex::default());
                for (b, count) in capture.histogram(*pair).iter().enumerate() {
                    let r = (half.first + b as f64 * half.step).max(0.0);
                    let wave = count.max(0.0).sqrt() * r.powi(power) as f32;
                    values[half.place(b)] = wave.into();
                }
                line.run(values, spare);
                to.copy_from_slice(&values[..frequencies]);
            },
        );
        plane_waves(scan, of_points)
    }
}

/// Turns each column's spectrum over half paths into the wave at the depths of the bins' centres, in place.
fn migrate(scan: &RegularScan, half: &HalfPaths, columns: &mut [Complex]) {
    let padded = scan.padded();
    let frequencies = half.frequencies();
    let line = Line::backward(half.length);
    let taps = Taps::new();
    let unit = wave_number(1, half.length, half.step);
    let centre = half.first + half.middle as f64 * half.step;
    columns.par_chunks_mut(frequencies).enumerate().for_each_init(Default::default, |s, (i, column)| {
        let (values, spare): &mut (Vec<Complex>, Vec<Complex>) = s;
        let [kx, ky] = [i % padded[0], i / padded[0]];
        let across = wave_number(kx, padded[0], scan.step[0]).powi(2)
            + wave_number(ky, padded[1], scan.step[1]).powi(2);
        values.clear();
        values.resize(half.length, Complex::default());
        for (j, value) in values[..frequencies].iter_mut().enumerate().skip(1) {
            let kz = j as f64 * unit;
            let k = (across + kz * kz).sqrt();
            if k / unit > (frequencies - 1) as f64 {
                break;
            }
            let found = taps.between(column, k / unit);
            *value = found * turn((kz - k) * centre) * (kz / k) as f32;
        }
        line.run(values, spare);
        for (b, to) in column.iter_mut().enumerate().take(half.count) {
            *to = values[half.place(b)];
        }
    });
}

/// Collects the depths of all columns, `[depth * wide + column]`.
fn for_depths(columns: &[Complex], planes: &mut [Complex], [wide, stride, count]: [usize; 3]) {
    planes.par_chunks_mut(wide).enumerate().for_each(|(depth, plane)| {
        for (column, to) in plane.iter_mut().enumerate() {
            *to = columns[column * stride + depth];
        }
    });
    debug_assert_eq!(planes.len(), wide * count);
}

/// The wave's power at the scan's points, `[depth * points + point]`.
fn intensities(scan: &RegularScan, half: &HalfPaths, mut planes: Vec<Complex>) -> Vec<f32> {
    let padded = scan.padded();
    let backward = Planes::backward(padded);
    let mut all = vec![0.0f32; half.count * scan.points()];
    planes.par_chunks_mut(padded[0] * padded[1]).zip(all.par_chunks_mut(scan.points())).for_each_init(
        Spare::default,
        |spare, (plane, to)| {
            backward.plane(plane, scan.n[0], spare);
            for (to, from) in to.chunks_mut(scan.n[1]).zip(plane.chunks(padded[1])) {
                to.iter_mut().zip(from).for_each(|(t, f)| *t = f.norm_sqr());
            }
        },
    );
    all
}

/// Interpolation of a spectrum by a sinc with a Kaiser window.
struct Taps(Vec<[f32; Taps::COUNT]>);

impl Taps {
    const COUNT: usize = 8;
    /// Resolution of fractions of a step.
    const SHARES: usize = 1024;
    const BETA: f64 = 6.0;

    fn new() -> Taps {
        let half = Taps::COUNT as f64 / 2.0;
        let bessel = |x: f64| {
            (1..30)
                .fold((1.0, 1.0), |(sum, term): (f64, f64), k| {
                    let next = term * (0.5 * x / f64::from(k)).powi(2);
                    (sum + next, next)
                })
                .0
        };
        let weight = |d: f64| {
            let sinc = if d.abs() < 1e-9 { 1.0 } else { (PI * d).sin() / (PI * d) };
            let window = (1.0 - (d / half).powi(2)).max(0.0).sqrt();
            sinc * bessel(Taps::BETA * window) / bessel(Taps::BETA)
        };
        let of_share = |share: usize| {
            let at = share as f64 / Taps::SHARES as f64;
            std::array::from_fn(|i| weight(i as f64 - (half - 1.0) - at) as f32)
        };
        Taps((0..=Taps::SHARES).map(of_share).collect())
    }

    /// The value at place `at` of a column's spectrum. Below 0 the conjugates of the column itself stand in: exact where
    /// kx = ky = 0, the only column that is read so near to 0.
    fn between(&self, spectrum: &[Complex], at: f64) -> Complex {
        let low = at.floor();
        let taps = &self.0[((at - low) * Taps::SHARES as f64 + 0.5) as usize];
        let first = low as isize - (Taps::COUNT as isize / 2 - 1);
        let value = |i: usize| match first + i as isize {
            below if below < 0 => spectrum[-below as usize].conj(),
            at => spectrum.get(at as usize).copied().unwrap_or_default(),
        };
        (0..Taps::COUNT).map(|i| value(i) * taps[i]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::super::reference::{Wide, error, random_capture, wide_turn};
    use super::*;

    /// The migration by definition, in float64: every plane wave of every depth frequency, whose amplitude is the sum over
    /// all bins and points, without interpolation.
    fn by_definition(capture: &Capture, scan: &RegularScan, half: &HalfPaths) -> Vec<f64> {
        let [lx, ly] = scan.padded();
        let unit = wave_number(1, half.length, half.step);
        let place = |point: usize| {
            [(point / scan.n[1]) as f64 * scan.step[0], (point % scan.n[1]) as f64 * scan.step[1]]
        };
        let points = scan.points();
        let mut wave = vec![Wide::default(); half.count * points];
        for kx in 0..lx {
            for ky in 0..ly {
                let across = [wave_number(kx, lx, scan.step[0]), wave_number(ky, ly, scan.step[1])];
                let angle = |point: usize| place(point)[0] * across[0] + place(point)[1] * across[1];
                for j in 1..half.frequencies() {
                    let kz = j as f64 * unit;
                    let k = (across[0].powi(2) + across[1].powi(2) + kz * kz).sqrt();
                    if k / unit > (half.frequencies() - 1) as f64 {
                        break;
                    }
                    let mut amplitude = Wide::default();
                    for point in 0..points {
                        for (b, count) in capture.histogram(scan.pair_of[point]).iter().enumerate() {
                            let r = half.first + b as f64 * half.step;
                            amplitude += wide_turn(-k * r - angle(point)) * (f64::from(*count).sqrt() * r);
                        }
                    }
                    for (i, value) in wave.iter_mut().enumerate() {
                        let z = half.first + (i / points) as f64 * half.step;
                        *value += amplitude * (kz / k) * wide_turn(kz * z + angle(i % points));
                    }
                }
            }
        }
        wave.iter().map(|v| v.norm_sqr()).collect()
    }

    #[test]
    fn it_is_the_sum_of_plane_waves_by_definition() {
        let capture = random_capture(None);
        let o = FkOptions::default();
        let scan = o.scan(&capture).unwrap();
        let half = HalfPaths::of(&capture);
        let off = error(&o.intensity(&capture, &scan, &half), &by_definition(&capture, &scan, &half));
        // Bins at the ends of the histogram are interpolated least well.
        assert!(off < 0.03, "{off}");
    }

    #[test]
    fn taps_interpolate_a_slow_spectrum() {
        let taps = Taps::new();
        // A bin that is a quarter of the transform away from the middle.
        let spectrum: Vec<Complex> = (0..64).map(|i| turn(-0.5 * PI * f64::from(i))).collect();
        for at in [20.0, 20.3, 31.5, 40.999] {
            let off = (taps.between(&spectrum, at) - turn(-0.5 * PI * at)).norm();
            assert!(off < 0.01, "{at}: {off}");
        }
    }
}
