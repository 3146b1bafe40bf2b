//! Phasor fields (Liu, Guillén, La Manna, Nam, Reza, Le, Jarabo, Gutierrez, Velten: *Non-line-of-sight imaging using
//! phasor-field virtual wave optics*, Nature 2019; Liu, Bauer, Velten: *Phasor field diffraction based reconstruction for
//! fast non-line-of-sight imaging systems*, Nature Communications 2020).
//!
//! Transients are filtered by a virtual pulse, a Gaussian packet of a few wavelengths. The wave that the wall then has
//! is carried back into the hidden volume, frequency by frequency, and the image is its strength at the time at which the
//! pulse is at each voxel. Here it is carried by its plane waves (the angular spectrum), which are exact and take one
//! product per depth. Plane waves that would have come from beyond the padded scan are left out at that depth: a
//! transform is periodic, and they would come back on the other side (Matsushima and Shimobaba 2009).
//!
//! In a confocal scan both arms are one: the wave number is twice that of the path. With one laser or sensor point, each
//! voxel's phase turns by the arm to that point.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::fourier::{Complex, Line, Planes, Spare, SpareSpectra, fast_length, transpose, turn, wave_number};
use super::image::{AlbedoVolume, on_grid};
use super::light_cone::plane_waves;
use super::method::{By, ClosedForm, HostMethod};
use super::options::{ImageOptions, ImageSettings};
use super::scan::RegularScan;
use super::sharpness::Ladder;
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Buffer;
use crate::options::options;
use crate::transport::Grid;

options! {
    /// Options of phasor fields.
    pub struct PhasorOptions: PhasorSettings(scene) {
        nested {
            /// What all closed-form methods have.
            image: ImageOptions / ImageSettings,
        }
        "Solver" {
            /// Lateral pixels of the maps
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

/// The filtered histograms' spectra, frequency by frequency.
const BAND: Buffer = Buffer::named("band");
/// The same of the padded scan.
const WAVE: Buffer = Buffer::named("wave");
/// The wave at all depths.
const BY_DEPTH: Buffer = Buffer::named("wave_by_depth");
/// The volume at the scan's points.
const AT_POINTS: Buffer = Buffer::named("volume_at_points");

/// Wavelengths to choose from, in distances of scan points.
pub(super) const WAVELENGTHS: Ladder = Ladder { setting: "wavelength", values: &[3.0, 4.0, 6.0] };

/// Standard deviation of the virtual pulse, as a share of its length: the published code's window.
const OF_LENGTH: f64 = 0.15;

/// Cutoff, standard deviations from the centre frequency of the pulse.
const BAND_WIDTH: f64 = 3.0;

/// The frequencies of the virtual pulse.
struct Band {
    /// Length of the transform over bins.
    length: usize,
    /// First frequency, as a place of the transform.
    first: usize,
    /// Radians per metre of path, and weight of each.
    all: Vec<[f64; 2]>,
}

impl Band {
    fn of(options: &PhasorOptions, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Band {
        let wavelength =
            options.wavelength.unwrap_or(WAVELENGTHS.values[0]) * scan.measured[0].max(scan.measured[1]);
        let deviation = OF_LENGTH * options.cycles * wavelength;
        // Frequencies repeat the histogram with the transform's length: longer than any path that is read.
        let far = grid.depth_range()[1] - scan.z;
        let [x, y] = scan.size();
        let longest = 2.0 * (far * far + x * x + y * y).sqrt() - capture.t_start + 4.0 * deviation;
        let bins = (longest / capture.bin_width).ceil().max(0.0) as usize;
        let length = 2 * fast_length(bins.max(capture.bins).div_ceil(2));
        let unit = TAU / (length as f64 * capture.bin_width);
        let middle = TAU / wavelength;
        let [low, high] = [-1.0, 1.0].map(|side| (middle + side * BAND_WIDTH / deviation) / unit);
        let first = low.ceil().max(1.0) as usize;
        let last = (high.floor() as usize).min(length / 2).max(first);
        let of = |i: usize| {
            let omega = i as f64 * unit;
            [omega, (-0.5 * ((omega - middle) * deviation).powi(2)).exp()]
        };
        Band { length, first, all: (first..=last).map(of).collect() }
    }
}

/// The virtual pulse as two filters along time, the even and the odd one: words of `filter.comp`. `wavelength` is in
/// bins.
pub(super) fn pulse(wavelength: f64, cycles: f64, bins: usize) -> [Vec<f32>; 2] {
    let deviation = OF_LENGTH * cycles * wavelength;
    let reach = ((BAND_WIDTH * deviation).ceil() as usize).clamp(1, bins.max(2) - 1);
    let of = |wave: fn(f64) -> f64| -> Vec<f64> {
        let value =
            |i: usize| wave(TAU * i as f64 / wavelength) * (-0.5 * (i as f64 / deviation).powi(2)).exp();
        (0..=reach).map(value).collect()
    };
    // Cut off, the even one would let through a constant.
    let mut even = of(f64::cos);
    let envelope = of(|_| 1.0);
    let sum = |all: &[f64]| all[0] + 2.0 * all[1..].iter().sum::<f64>();
    let share = sum(&even) / sum(&envelope);
    even.iter_mut().zip(&envelope).for_each(|(v, e)| *v -= share * e);
    [(1.0, even), (-1.0, of(f64::sin))]
        .map(|(side, taps)| std::iter::once(side * reach as f64).chain(taps).map(|v| v as f32).collect())
}

impl ClosedForm for PhasorOptions {
    const NAME: &'static str = "phasor";
    const MASK_SHARE: f64 = 0.50;

    const BY: By<Self> =
        By::Host(HostMethod { scan: Self::scan, arrays: Self::arrays, volume: Self::volume });

    fn shared(&self) -> (usize, &ImageOptions) {
        (self.lateral, &self.image)
    }

    fn sharpness(&mut self) -> Option<(Ladder, &mut Option<f64>)> {
        Some((WAVELENGTHS, &mut self.wavelength))
    }
}

impl PhasorOptions {
    fn scan(&self, capture: &Capture) -> Result<RegularScan> {
        RegularScan::with_one_spot(capture, "the phasor field")
    }

    fn arrays(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Vec<(Buffer, u64)> {
        let band = Band::of(self, capture, scan, grid).all.len();
        let wide: usize = scan.padded().iter().product();
        let [points, deep] = [scan.points(), grid.n[2]];
        let bytes = |complex: usize| 8 * complex as u64;
        vec![
            (BAND, bytes(2 * points * band)),
            (WAVE, bytes(wide * band)),
            (BY_DEPTH, if scan.spot.is_none() { bytes(2 * wide * deep) } else { 0 }),
            (AT_POINTS, 4 * (points * deep) as u64),
        ]
    }

    fn volume(
        &self,
        capture: &Capture,
        scan: &RegularScan,
        grid: &Grid,
        _: &mut SpareSpectra,
    ) -> AlbedoVolume {
        AlbedoVolume { albedo: on_grid(scan, &self.at_points(capture, scan, grid), grid), normal: None }
    }
}

impl PhasorOptions {
    /// The wave's strength at the scan's points and the grid's depths, `[point * depths + depth]`.
    fn at_points(&self, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Vec<f32> {
        let band = Band::of(self, capture, scan, grid);
        let wave = wave_at_wall(capture, scan, &band);
        match scan.spot {
            None => confocal(scan, &band, grid, wave),
            Some(_) => one_spot(scan, &band, grid, &wave),
        }
    }
}

/// The filtered wave's plane waves, `[(frequency * padded[1] + ky) * padded[0] + kx]`.
fn wave_at_wall(capture: &Capture, scan: &RegularScan, band: &Band) -> Vec<Complex> {
    let (points, count) = (scan.points(), band.all.len());
    let mut of_points = vec![Complex::default(); points * count];
    let line = Line::forward(band.length);
    let centre = capture.t_start + 0.5 * capture.bin_width;
    of_points.par_chunks_mut(count).zip(&scan.pair_of).for_each_init(Default::default, |s, (to, pair)| {
        let (values, spare): &mut (Vec<Complex>, Vec<Complex>) = s;
        values.clear();
        values.extend(capture.histogram(*pair).iter().map(|v| Complex::from(*v)));
        values.resize(band.length, Complex::default());
        line.run(values, spare);
        for ((to, value), [omega, weight]) in to.iter_mut().zip(&values[band.first..]).zip(&band.all) {
            *to = value * turn(-omega * centre) * *weight as f32;
        }
    });
    plane_waves(scan, of_points)
}

/// A plane wave: its wave number along z, and the depth from which on it has come from beyond the padded scan. `None` if
/// it does not travel.
fn plane_wave(scan: &RegularScan, i: usize, k: f64) -> Option<[f64; 2]> {
    let padded = scan.padded();
    let across = [0, 1].map(|a| wave_number([i % padded[0], i / padded[0]][a], padded[a], scan.step[a]));
    let squared = k * k - across[0] * across[0] - across[1] * across[1];
    if squared <= 0.0 {
        return None;
    }
    let kz = squared.sqrt();
    // At depth z it has moved by z · across / kz. The empty half of the padding is as wide as the scan.
    let until = [0, 1].map(|a| scan.size()[a] * kz / across[a].abs().max(1e-12));
    Some([kz, until[0].min(until[1])])
}

/// Depths of the grid's voxels over the wall: the first one, and their distance.
fn depths(scan: &RegularScan, grid: &Grid) -> [f64; 2] {
    [grid.origin.z - scan.z, grid.pitch.z]
}

/// Number of depths up to `until`.
fn within(until: f64, [first, step]: [f64; 2], count: usize) -> usize {
    (((until - first) / step).floor() + 1.0).clamp(0.0, count as f64) as usize
}

/// The strength of the wave at the scan's points and the grid's depths, `[point * depths + depth]`. Frequencies are
/// summed before they are transformed: all voxels are lit at the same time.
fn confocal(scan: &RegularScan, band: &Band, grid: &Grid, wave: Vec<Complex>) -> Vec<f32> {
    let padded = scan.padded();
    let (wide, deep) = (padded[0] * padded[1], grid.n[2]);
    let at = depths(scan, grid);
    let mut columns = vec![Complex::default(); wide * deep];
    columns.par_chunks_mut(deep).enumerate().for_each(|(i, column)| {
        for (f, [omega, _]) in band.all.iter().enumerate() {
            let Some([kz, until]) = plane_wave(scan, i, 2.0 * omega) else { continue };
            let step = turn(kz * at[1]);
            let mut value = wave[f * wide + i] * turn(kz * at[0]);
            for to in &mut column[..within(until, at, deep)] {
                *to += value;
                value *= step;
            }
        }
    });
    drop(wave);
    let mut planes = vec![Complex::default(); wide * deep];
    transpose(&columns, &mut planes, [wide, deep]);
    drop(columns);
    let backward = Planes::backward(padded);
    let points = scan.points();
    let mut strength = vec![0.0f32; points * deep];
    planes.par_chunks_mut(wide).zip(strength.par_chunks_mut(points)).for_each_init(
        Spare::default,
        |spare, (plane, to)| {
            backward.plane(plane, scan.n[0], spare);
            for (to, from) in to.chunks_mut(scan.n[1]).zip(plane.chunks(padded[1])) {
                to.iter_mut().zip(from).for_each(|(t, f)| *t = f.norm());
            }
        },
    );
    let mut values = vec![0.0f32; points * deep];
    transpose(&strength, &mut values, [deep, points]);
    values
}

/// The same where one side of the pairs is one point: the arm to it turns the phase of every voxel, frequency by
/// frequency.
fn one_spot(scan: &RegularScan, band: &Band, grid: &Grid, wave: &[Complex]) -> Vec<f32> {
    let padded = scan.padded();
    let (wide, deep, points) = (padded[0] * padded[1], grid.n[2], scan.points());
    let at = depths(scan, grid);
    let spot = scan.spot.unwrap_or_default();
    let backward = Planes::backward(padded);
    let mut strength = vec![0.0f32; points * deep];
    strength.par_chunks_mut(points).enumerate().for_each_init(
        || (vec![Complex::default(); wide], vec![Complex::default(); points], Spare::default()),
        |(plane, sum, spare), (depth, to)| {
            let z = at[0] + depth as f64 * at[1];
            let arm = |point: usize| {
                let [x, y] = [point / scan.n[1], point % scan.n[1]];
                let across = [
                    scan.first[0] + x as f64 * scan.step[0] - spot.x,
                    scan.first[1] + y as f64 * scan.step[1] - spot.y,
                ];
                (across[0].powi(2) + across[1].powi(2) + (z + scan.z - spot.z).powi(2)).sqrt()
            };
            let arms: Vec<f64> = (0..points).map(arm).collect();
            sum.fill(Complex::default());
            for (f, [omega, _]) in band.all.iter().enumerate() {
                for (i, (to, from)) in plane.iter_mut().zip(&wave[f * wide..(f + 1) * wide]).enumerate() {
                    *to = match plane_wave(scan, i, *omega) {
                        Some([kz, until]) if z <= until => from * turn(kz * z),
                        _ => Complex::default(),
                    };
                }
                backward.plane(plane, scan.n[0], spare);
                for x in 0..scan.n[0] {
                    for y in 0..scan.n[1] {
                        let point = x * scan.n[1] + y;
                        sum[point] += plane[x * padded[1] + y] * turn(omega * arms[point]);
                    }
                }
            }
            to.iter_mut().zip(&*sum).for_each(|(t, s)| *t = s.norm());
        },
    );
    let mut values = vec![0.0f32; points * deep];
    transpose(&strength, &mut values, [deep, points]);
    values
}

#[cfg(test)]
mod tests {
    use super::super::reference::{Wide, error, random_capture, random_grid, wide_turn};
    use super::*;

    /// The same by definition, in float64: every plane wave of every frequency, whose amplitude is the sum over all bins
    /// and points.
    fn by_definition(o: &PhasorOptions, capture: &Capture, scan: &RegularScan, grid: &Grid) -> Vec<f64> {
        let band = Band::of(o, capture, scan, grid);
        let (padded, points, deep) = (scan.padded(), scan.points(), grid.n[2]);
        let place = |point: usize| {
            [(point / scan.n[1]) as f64 * scan.step[0], (point % scan.n[1]) as f64 * scan.step[1]]
        };
        let depth = |k: usize| grid.origin.z + k as f64 * grid.pitch.z;
        let mut wave = vec![Wide::default(); points * deep];
        for [omega, weight] in &band.all {
            for i in 0..padded[0] * padded[1] {
                let across = [
                    wave_number(i % padded[0], padded[0], scan.step[0]),
                    wave_number(i / padded[0], padded[1], scan.step[1]),
                ];
                let k = if scan.spot.is_some() { *omega } else { 2.0 * omega };
                let squared = k * k - across[0].powi(2) - across[1].powi(2);
                if squared <= 0.0 {
                    continue;
                }
                let kz = squared.sqrt();
                let angle = |point: usize| place(point)[0] * across[0] + place(point)[1] * across[1];
                let mut amplitude = Wide::default();
                for point in 0..points {
                    for (b, count) in capture.histogram(scan.pair_of[point]).iter().enumerate() {
                        let path = capture.t_start + (b as f64 + 0.5) * capture.bin_width;
                        amplitude += wide_turn(-omega * path - angle(point)) * f64::from(*count) * *weight;
                    }
                }
                for (at, value) in wave.iter_mut().enumerate() {
                    let (point, z) = (at / deep, depth(at % deep));
                    let off = |a: usize| (z - scan.z) * across[a].abs() / kz > scan.size()[a];
                    if off(0) || off(1) {
                        continue;
                    }
                    let arm = scan.spot.map_or(0.0, |spot| {
                        let [x, y] = [0, 1].map(|a| scan.first[a] + place(point)[a]);
                        spot.distance(glam::dvec3(x, y, z))
                    });
                    *value += amplitude * wide_turn(kz * (z - scan.z) + angle(point) + omega * arm);
                }
            }
        }
        wave.iter().map(|v| v.norm()).collect()
    }

    #[test]
    fn it_is_the_sum_of_plane_waves_by_definition() {
        for spot in [None, Some(glam::dvec3(0.3, -0.1, 0.05))] {
            let capture = random_capture(spot);
            let o = PhasorOptions::default();
            let scan = o.scan(&capture).unwrap();
            let grid = random_grid(&scan);
            let wanted = by_definition(&o, &capture, &scan, &grid);
            let off = error(&o.at_points(&capture, &scan, &grid), &wanted);
            assert!(off < 1e-4, "{spot:?}: {off}");
        }
    }

    #[test]
    fn the_pulse_is_even_and_odd_and_lets_no_constant_through() {
        let [even, odd] = pulse(12.0, 5.0, 1000);
        assert_eq!((even[0], odd[0]), (27.0, -27.0));
        assert_eq!((even.len(), odd.len()), (29, 29));
        let sum = even[1] + 2.0 * even[2..].iter().sum::<f32>();
        assert!(sum.abs() < 1e-4 && odd[1] == 0.0 && odd[4] > 0.5 && even[7] < -0.5);
        // As many bins as there are.
        assert_eq!(pulse(12.0, 5.0, 9)[0].len(), 10);
    }
}
