//! A capture as a fit sees it: pairs, counts, and the light that a blob sends to a pair.

use glam::DVec3;

use crate::blob::Blob;
use crate::capture::{Capture, PulseTaps, Reflectance};
use crate::constants::{BEHIND, HEIGHTS, LEAST_COUNT, SPREAD};
use crate::edge::Edge;
use crate::error::Result;
use crate::normal;

/// Standard deviation of a Gaussian of full width at half maximum 1.
const DEVIATION: f64 = 0.424_660_900_144_009_5;
/// Half the width of a rendered path, standard deviations.
const REACH: f64 = 5.0;

/// Counts of pairs, and what blobs send to them.
#[derive(Debug, Clone)]
pub struct Sight {
    pub(crate) laser: Vec<DVec3>,
    pub(crate) sensor: Vec<DVec3>,
    laser_normal: Vec<DVec3>,
    sensor_normal: Vec<DVec3>,
    pub(crate) bins: usize,
    pub(crate) width: f64,
    pub(crate) start: f64,
    /// `[pair * bins + bin]`.
    pub(crate) counts: Vec<f64>,
    taps: PulseTaps,
    /// Variances of both spots, squared metres.
    spots: [f64; 2],
    law: Reflectance,
    /// Variance per count, and of a bin without light.
    pub(crate) noise: [f64; 2],
    /// Whether counts are those of photons and none is subtracted.
    pub(crate) is_counted: bool,
    /// Unit of length, metres.
    pub(crate) unit: f64,
    /// The part of the wall that the scan covers: x from, to, y from, to, metres.
    pub(crate) wall: [f64; 4],
    /// Counts of a bin without light.
    pub(crate) background: f64,
    /// Rays of a blob in a pair: 1, or the heights of an upright object.
    pub(crate) parts: usize,
    edge: Option<Edge>,
}

/// The light of a blob in a pair, and derivatives by its position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    /// Path, metres, of the middle of the light.
    pub path: f64,
    /// Variance of paths, squared metres.
    pub variance: f64,
    /// Counts in all bins.
    pub light: f64,
    pub by_path: DVec3,
    pub by_variance: DVec3,
    /// Of the logarithm of the light; and by that of the extent.
    pub by_light: DVec3,
    pub by_extent: f64,
}

impl Sight {
    /// Of a prepared capture. `noise`: variance of a bin per count, and that of a bin without light. `Cosine` has no cosine here: the
    /// normal of a blob is not known.
    ///
    /// # Errors
    /// Those of [`Capture::check`], and of an impulse response that is too long.
    pub fn of(capture: &Capture, law: Reflectance, noise: [f64; 2]) -> Result<Sight> {
        capture.check()?;
        let sharp = || PulseTaps { before: 0, weights: vec![1.0] };
        let taps = capture.pulse.as_ref().map(|pulse| pulse.taps_of_bins(capture.bin_width)).transpose()?;
        let normals = |given: &Option<Vec<DVec3>>| {
            given.clone().unwrap_or_else(|| vec![DVec3::Z; capture.pair_count()])
        };
        let spot = |width: Option<f64>| (width.unwrap_or(0.0) * DEVIATION).powi(2);
        let least = f64::MIN_POSITIVE.sqrt();
        Ok(Sight {
            laser: capture.laser.clone(),
            sensor: capture.sensor.clone(),
            laser_normal: normals(&capture.laser_normal),
            sensor_normal: normals(&capture.sensor_normal),
            bins: capture.bins,
            width: capture.bin_width,
            start: capture.t_start,
            counts: capture.histograms.iter().map(|v| f64::from(*v)).collect(),
            taps: taps.unwrap_or_else(sharp),
            spots: [spot(capture.laser_spot), spot(capture.sensor_spot)],
            law,
            noise: [noise[0].max(least), noise[1].max(0.0)],
            is_counted: capture.integer_counts,
            unit: capture.unit(),
            wall: capture.wall_extent(),
            background: capture.background().level,
            parts: 1,
            edge: None,
        })
    }

    /// The same scan past an edge.
    #[must_use]
    pub fn past(self, edge: Option<Edge>) -> Sight {
        Sight { edge, ..self }
    }

    /// The same scan of upright objects.
    pub(crate) fn upright(&self) -> Sight {
        Sight { parts: HEIGHTS, ..self.clone() }
    }

    /// Share of the light between both points of a pair and a place that passes the edge.
    pub(crate) fn passed(&self, pair: usize, at: DVec3, radius: f64) -> f64 {
        let Some(edge) = self.edge else { return 1.0 };
        let sides = [(self.laser[pair], self.spots[0]), (self.sensor[pair], self.spots[1])];
        sides.iter().map(|(point, spot)| edge.passed(*point, *spot, at, radius).light).sum::<f64>().exp()
    }

    /// The height of a part, from 0 to twice the centre's, as a share of that.
    pub(crate) fn lift(&self, part: usize) -> f64 {
        if self.parts > 1 { (2 * part + 1) as f64 / self.parts as f64 } else { 1.0 }
    }

    /// The rays of a blob in a pair.
    pub(crate) fn rays<'a>(&'a self, pair: usize, blob: &'a Blob) -> impl Iterator<Item = Ray> + 'a {
        (0..self.parts).map(move |part| self.ray(pair, blob, part))
    }

    /// Number of pairs.
    pub fn pairs(&self) -> usize {
        self.laser.len()
    }

    /// Standard deviation and mean delay of the impulse response, bins.
    pub(crate) fn response(&self) -> [f64; 2] {
        let weights = || self.taps.weights.iter().enumerate();
        let delay: f64 = weights().map(|(i, w)| w * i as f64).sum::<f64>() - self.taps.before as f64;
        [self.taps.deviation(), delay]
    }

    /// The middle of all wall points.
    pub fn middle(&self) -> DVec3 {
        let all = self.laser.iter().chain(&self.sensor);
        all.sum::<DVec3>() / (2 * self.pairs()).max(1) as f64
    }

    /// The path at the end of the last bin, metres.
    pub(crate) fn end(&self) -> f64 {
        self.start + self.bins as f64 * self.width
    }

    /// Variance of a bin of this mean, with a least one, and the share of it that noise has.
    pub(crate) fn variance(&self, mean: f64) -> [f64; 2] {
        let [per_count, floor] = self.noise;
        let dark = if self.is_counted { 0.0 } else { floor };
        let noise = per_count * mean.max(0.0) + dark;
        let variance = noise + LEAST_COUNT * per_count * per_count;
        [variance, noise / variance]
    }

    /// The light of a part of a blob in a pair.
    fn ray(&self, pair: usize, blob: &Blob, part: usize) -> Ray {
        let is_upright = self.parts > 1;
        let lift = self.lift(part);
        let at = blob.at * DVec3::new(1.0, 1.0, lift);
        let sides = [
            (self.laser[pair], self.laser_normal[pair], self.spots[0]),
            (self.sensor[pair], self.sensor_normal[pair], self.spots[1]),
        ];
        let radius = blob.extent.exp();
        let mut ray = Ray {
            path: -2.0 * BEHIND * blob.roundness * radius,
            variance: (2.0 * SPREAD * radius).powi(2) + (0.05 * self.width).powi(2),
            light: blob.light - (self.parts as f64).ln(),
            by_path: DVec3::ZERO,
            by_variance: DVec3::ZERO,
            by_light: DVec3::ZERO,
            by_extent: 0.0,
        };
        let power = f64::from(self.law.falloff_power()) / 2.0;
        for (point, normal, spot) in sides {
            let way = at - point;
            let distance = way.length().max(1e-6 * self.unit);
            let (toward, cosine) = (way / distance, normal.dot(way) / distance);
            ray.path += distance;
            ray.by_path += toward;
            ray.light -= power * (distance / self.unit).ln();
            ray.by_light -= power * toward / distance;
            let turned = (normal - cosine * toward) / distance;
            // A spot lies in the wall: along the ray it is as wide as its sine.
            ray.variance += spot * (1.0 - cosine * cosine);
            ray.by_variance -= 2.0 * spot * cosine * turned;
            if self.law == Reflectance::Lambertian {
                let lit = cosine.max(1e-3);
                ray.light += lit.ln();
                ray.by_light += turned / lit;
            }
            if is_upright && self.law.has_normals() {
                // The cosine of a face that turns toward the point.
                let level = (1.0 - cosine * cosine).max(1e-6);
                ray.light += 0.5 * level.ln();
                ray.by_light -= cosine / level * turned;
            }
            if let Some(edge) = self.edge {
                let passed = edge.passed(point, spot, at, radius);
                ray.light += passed.light;
                ray.by_light += passed.by_at;
                ray.by_extent += passed.by_extent;
            }
        }
        for derivative in [&mut ray.by_path, &mut ray.by_variance, &mut ray.by_light] {
            derivative.z *= lift;
        }
        ray.light = ray.light.min(80.0).exp();
        ray
    }

    /// Counts of a ray in every bin, and their derivatives by path and variance, added to `into`: `[bin]`. Returns the bins that changed.
    pub(crate) fn render(&self, ray: &Ray, spare: &mut Vec<[f64; 3]>, into: &mut [[f64; 3]]) -> [usize; 2] {
        let deviation = ray.variance.sqrt();
        let place = |path: f64| (path - self.start) / self.width;
        let (before, after) =
            (self.taps.before as f64, (self.taps.weights.len() - 1 - self.taps.before) as f64);
        let [low, high] = [-REACH, REACH].map(|reach| place(ray.path + reach * deviation).floor());
        // Bins whose light taps bring into the histogram.
        let (low, high) = (low.max(-after), high.min(self.bins as f64 - 1.0 + before));
        if low > high || !(low.is_finite() && high.is_finite()) {
            return [0, 0];
        }
        spare.clear();
        let edge = |bin: f64| {
            let z = (self.start + bin * self.width - ray.path) / deviation;
            let density = normal::density(z);
            [normal::share_below(z), density, z * density]
        };
        let mut last = edge(low);
        let [by_path, by_variance] = [-ray.light / deviation, -0.5 * ray.light / ray.variance];
        for bin in 0..=(high - low) as usize {
            let next = edge(low + bin as f64 + 1.0);
            spare.push([
                ray.light * (next[0] - last[0]),
                by_path * (next[1] - last[1]),
                by_variance * (next[2] - last[2]),
            ]);
            last = next;
        }
        let first = (low - before).max(0.0) as usize;
        let end = ((high + after).min(self.bins as f64 - 1.0).max(-1.0) + 1.0) as usize;
        for (tap, weight) in self.taps.weights.iter().enumerate() {
            let shift = low as i64 + tap as i64 - self.taps.before as i64;
            for (at, values) in spare.iter().enumerate() {
                let bin = at as i64 + shift;
                if (0..self.bins as i64).contains(&bin) {
                    let sum = &mut into[bin as usize];
                    (0..3).for_each(|k| sum[k] += weight * values[k]);
                }
            }
        }
        [first.min(end), end]
    }
}
