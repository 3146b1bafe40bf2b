//! Bands of pairs at the depths of pixels: back-projection onto a surface.

use glam::DVec3;

use super::bands::Bands;
use super::sizes::{BANDS, SAMPLES, STEP, wide};

/// The bands of two records of a pair at a sample: a line of the cache.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Both([f32; 16]);

/// The measurement of a pair and what a surface leaves of it, in bands, and its laser and sensor point from the middle of the box's face, in walls.
pub struct BandRows {
    ends: [[f32; 3]; 2],
    samples: Vec<Both>,
}

impl BandRows {
    /// Of the measurement and of what is rendered less it, whose first bin begins at path `start`, with bins of `width`, both in walls.
    pub fn new(bands: &Bands, ends: [DVec3; 2], records: [&[f32]; 2], [start, width]: [f64; 2]) -> BandRows {
        let [a, b] = records.map(|record| bands.of(record, [start, width]));
        let both = |(a, b): (&[f32], &[f32])| {
            Both(std::array::from_fn(|k| match k / BANDS {
                0 => a[k],
                1 => -b[k - BANDS],
                _ => 0.0,
            }))
        };
        let samples = a.chunks_exact(BANDS).zip(b.chunks_exact(BANDS)).take(SAMPLES).map(both).collect();
        BandRows { ends: ends.map(|p| p.as_vec3().to_array()), samples }
    }

    /// Sums over all pairs at places, in walls: the bands of the measurements, and of what is left of them.
    pub fn at(rows: &[BandRows], places: &[[f32; 3]]) -> Vec<[f32; 2 * BANDS]> {
        let mut sums = vec![Both([0.0; 16]); places.len()];
        wide(
            #[inline(always)]
            || {
                for row in rows {
                    let [[a, b, c], [d, e, f]] = row.ends;
                    for (sum, [x, y, z]) in sums.iter_mut().zip(places) {
                        let one = ((x - a) * (x - a) + (y - b) * (y - b) + (z - c) * (z - c)).sqrt();
                        let other = ((x - d) * (x - d) + (y - e) * (y - e) + (z - f) * (z - f)).sqrt();
                        let path = (one + other) * (1.0 / STEP) as f32;
                        // Beyond the last sample there is nothing.
                        let Some([low, high]) = row.samples.get(path as usize..).and_then(<[_]>::first_chunk)
                        else {
                            continue;
                        };
                        let share = path - (path as usize) as f32;
                        for k in 0..16 {
                            sum.0[k] += low.0[k] + share * (high.0[k] - low.0[k]);
                        }
                    }
                }
            },
        );
        sums.iter().map(|Both(all)| std::array::from_fn(|k| all[k])).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn places_have_the_bands_of_their_paths_and_what_is_not_rendered_is_left() {
        let mut random = Pcg64::seed_from_u64(0);
        let of_bands = Bands::new();
        let mut place = || dvec3(random.random::<f64>() - 0.5, random.random::<f64>() - 0.5, 0.02);
        let ends: Vec<[DVec3; 2]> = (0..5).map(|_| [place(), place()]).collect();
        let records: Vec<[Vec<f32>; 2]> =
            (0..5).map(|_| [0; 2].map(|_| (0..300).map(|_| random.random::<f32>()).collect())).collect();
        let path = [0.4, 1.0 / 200.0];
        let rows: Vec<BandRows> = ends
            .iter()
            .zip(&records)
            .map(|(ends, [a, b])| BandRows::new(&of_bands, *ends, [a, b], path))
            .collect();
        // The last one is beyond all samples.
        let places = [[0.1, -0.3, 0.6], [-0.4, 0.2, 1.1], [0.0, 0.0, 9.0]];
        let found = BandRows::at(&rows, &places);
        for (place, found) in places.iter().zip(&found) {
            let at = DVec3::from_array(place.map(f64::from));
            let expected = |record: usize, band: usize| -> f64 {
                let of_pair = |(ends, records): (&[DVec3; 2], &[Vec<f32>; 2])| {
                    let bands = of_bands.of(&records[record], path);
                    let x = ends.iter().map(|end| end.distance(at)).sum::<f64>() / STEP;
                    let value = |i: usize| bands.get(i * BANDS + band).map_or(0.0, |v| f64::from(*v));
                    value(x as usize) * (1.0 - x.fract()) + value(x as usize + 1) * x.fract()
                };
                ends.iter().zip(&records).map(of_pair).sum()
            };
            for band in 0..BANDS {
                let [measured, left] = [expected(0, band), -expected(1, band)];
                assert!((f64::from(found[band]) - measured).abs() < 1e-4 * (1.0 + measured.abs()));
                assert!((f64::from(found[band + BANDS]) - left).abs() < 1e-4 * (1.0 + left.abs()));
            }
        }
        assert!(found[0].iter().all(|v| *v != 0.0) && found[2] == [0.0; 2 * BANDS]);
    }
}
