//! Pairs that known positions of one object calibrate: wall points, delays, amounts of light, the room, the noise of every bin; and the
//! position of that object in further captures, by quadrature over the box.
//!
//! Counts of a pair at a position: room + level + light · 1 / (r_l r_s)^falloff · (cos_l cos_s)^cosine, as a Gaussian around the path
//! r_l + r_s + delay. The cosines are those between wall normal and ray. The level is free in every histogram.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use thirdbounce_base::quantile::quantile;

use crate::capture::Capture;
use crate::constants::{DEVIATION_PRIOR, DIRECT, POWER_PRIORS};
use crate::error::{Error, Result};
use crate::normal;

/// A calibrated pair.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CalibratedPair {
    /// Laser point and sensor point, metres.
    #[serde(with = "vectors")]
    pub points: [DVec3; 2],
    /// Wall normals there.
    #[serde(with = "vectors")]
    pub(crate) normals: [DVec3; 2],
    /// What a path is longer than the distances, metres.
    pub delay: f64,
    /// Logarithm of the counts of the object at a distance of 1 m in front of the point.
    pub light: f64,
    /// Counts without the object: `[bin]`.
    pub room: Vec<f64>,
    /// One over the variance, 0 in bins of direct light: `[bin]`.
    pub weights: Vec<f64>,
}

/// What positions of an object say of the pairs of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// The pairs.
    pub pairs: Vec<CalibratedPair>,
    /// Power of the distances and of the cosines.
    pub powers: [f64; 2],
    /// Standard deviation of the paths of light, metres.
    pub deviation: f64,
    /// Path at the start of the first bin, width of a bin, metres.
    pub(crate) bins: [f64; 2],
    /// Lowest and highest corner of the positions, metres.
    #[serde(with = "vectors")]
    pub volume: [DVec3; 2],
}

/// Two vectors as numbers.
mod vectors {
    use glam::DVec3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(vectors: &[DVec3; 2], to: S) -> Result<S::Ok, S::Error> {
        vectors.map(|vector| vector.to_array()).serialize(to)
    }

    pub fn deserialize<'d, D: Deserializer<'d>>(from: D) -> Result<[DVec3; 2], D::Error> {
        Ok(<[[f64; 3]; 2]>::deserialize(from)?.map(DVec3::from_array))
    }
}

/// A share of the residuals of a bin that is within this many standard deviations: what few positions light counts, single bad counts do
/// not.
const SHARE: f64 = 0.9;
const SHARE_DEVIATION: f64 = 1.6449;
/// Half the width of the light, standard deviations.
const REACH: f64 = 5.0;

/// Counts of all positions: `[position][pair * bins + bin]`.
pub(crate) struct KnownPositions<'a> {
    pub counts: Vec<&'a [f32]>,
    pub at: &'a [DVec3],
    pub bins: usize,
}

impl CalibratedPair {
    /// Amount of light and path of an object; logarithm.
    fn ray(&self, at: DVec3, [falloff, cosine]: [f64; 2]) -> [f64; 2] {
        let (mut light, mut path) = (self.light, self.delay);
        for (point, normal) in self.points.iter().zip(self.normals) {
            let way = at - *point;
            let distance = way.length().max(1e-6);
            path += distance;
            light += cosine * (normal.dot(way) / distance).max(1e-3).ln() - falloff * distance.ln();
        }
        [light, path]
    }

    /// Subtracts the level of a histogram.
    pub(crate) fn leveled(&self, values: &mut [f64]) {
        let [sum, all] = values.iter().zip(&self.weights).fold([0.0; 2], |[s, a], (v, w)| [s + v * w, a + w]);
        let level = if all > 0.0 { sum / all } else { 0.0 };
        values.iter_mut().for_each(|v| *v -= level);
    }
}

impl Calibration {
    /// Whether all pairs have the same number of bins and all numbers are finite.
    pub fn is_sound(&self) -> bool {
        let bins = self.pairs.first().map_or(0, |pair| pair.room.len());
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        let is_sound = |pair: &CalibratedPair| {
            pair.room.len() == bins
                && pair.weights.len() == bins
                && pair.points.iter().chain(&pair.normals).all(|v| v.is_finite())
                && finite(&[pair.delay, pair.light])
                && finite(&pair.room)
                && finite(&pair.weights)
        };
        bins > 0
            && self.pairs.iter().all(is_sound)
            && finite(&self.powers)
            && self.deviation > 0.0
            && self.bins[1] > 0.0
    }

    /// Points as given, bins behind the direct light, no object.
    pub(crate) fn start(
        capture: &Capture,
        measured: &KnownPositions,
        has_direct: bool,
    ) -> Result<Calibration> {
        let bins = measured.bins;
        let unit = [capture.t_start, capture.bin_width];
        let normals =
            |given: &Option<Vec<DVec3>>, pair: usize| given.as_ref().map_or(DVec3::Z, |all| all[pair]);
        let pair = |pair: usize| {
            let median_of = |bin: usize| {
                median(measured.counts.iter().map(|c| f64::from(c[pair * bins + bin])).collect())
            };
            let room: Vec<f64> = (0..bins).map(median_of).collect();
            let (from, delay) = if has_direct { behind_direct(&room, unit) } else { (0, 0.0) };
            if from + 4 > bins {
                return Err(Error::input(
                    format!("pair {pair} has no bins behind its direct light"),
                    "give --gate, the paths of the object's light",
                ));
            }
            Ok(CalibratedPair {
                points: [capture.laser[pair], capture.sensor[pair]],
                normals: [normals(&capture.laser_normal, pair), normals(&capture.sensor_normal, pair)],
                delay,
                light: f64::NEG_INFINITY,
                weights: (0..bins).map(|bin| if bin < from { 0.0 } else { 1.0 }).collect(),
                room,
            })
        };
        let (low, high) = measured
            .at
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
        Ok(Calibration {
            pairs: (0..capture.pair_count()).map(pair).collect::<Result<_>>()?,
            powers: POWER_PRIORS.map(|prior| prior[0]),
            deviation: (DEVIATION_PRIOR[0] * capture.bin_width).hypot(DEVIATION_PRIOR[1]),
            bins: unit,
            volume: [low, high],
        })
    }

    /// Counts of the object in a pair, added to `into`.
    pub(crate) fn render(&self, pair: &CalibratedPair, at: DVec3, into: &mut [f64]) {
        let [light, path] = pair.ray(at, self.powers);
        let [start, width] = self.bins;
        let place = |path: f64| (path - start) / width;
        let low = place(path - REACH * self.deviation).floor().max(0.0);
        let high = place(path + REACH * self.deviation).ceil().min(into.len() as f64);
        if low >= high || light == f64::NEG_INFINITY {
            return;
        }
        let edge = |bin: usize| {
            let z = (start + bin as f64 * width - path) / self.deviation;
            normal::share_below(z)
        };
        let light = light.min(80.0).exp();
        let mut last = edge(low as usize);
        for (at, value) in into[low as usize..high as usize].iter_mut().enumerate() {
            let next = edge(low as usize + at + 1);
            *value += light * (next - last);
            last = next;
        }
    }

    /// Counts of the object at every position, without level: `[position * bins + bin]`.
    pub(crate) fn templates(&self, pair: &CalibratedPair, measured: &KnownPositions) -> Vec<f64> {
        let mut all = vec![0.0; measured.at.len() * measured.bins];
        for (at, into) in measured.at.iter().zip(all.chunks_exact_mut(measured.bins)) {
            self.render(pair, *at, into);
            pair.leveled(into);
        }
        all
    }

    /// Residuals of a pair beside the room, without level: `[position * bins + bin]`.
    pub(crate) fn residuals(&self, which: usize, measured: &KnownPositions) -> Vec<f64> {
        let (pair, bins) = (&self.pairs[which], measured.bins);
        let mut left = self.templates(pair, measured);
        for (counts, row) in measured.counts.iter().zip(left.chunks_exact_mut(bins)) {
            let mut own: Vec<f64> =
                counts[which * bins..(which + 1) * bins].iter().map(|c| f64::from(*c)).collect();
            pair.leveled(&mut own);
            row.iter_mut().zip(&own).for_each(|(left, own)| *left = own - *left);
        }
        for bin in 0..bins {
            let middle = median(left.iter().skip(bin).step_by(bins).copied().collect());
            left.iter_mut().skip(bin).step_by(bins).for_each(|v| *v -= middle);
        }
        left
    }

    /// Sets rooms and weights by what the object leaves.
    pub(crate) fn weigh(&mut self, measured: &KnownPositions) {
        let bins = measured.bins;
        for which in 0..self.pairs.len() {
            // Weights depend on levels, and levels on weights.
            for _ in 0..3 {
                let left = self.residuals(which, measured);
                let spread = |bin: usize| {
                    let sizes = left.iter().skip(bin).step_by(bins).map(|v| v.abs());
                    quantile(&mut sizes.collect::<Vec<_>>(), SHARE) / SHARE_DEVIATION
                };
                let mut variances: Vec<f64> = (0..bins).map(|bin| spread(bin).powi(2)).collect();
                let used: Vec<f64> = (variances.iter().zip(&self.pairs[which].weights))
                    .filter(|(_, weight)| **weight > 0.0)
                    .map(|(variance, _)| *variance)
                    .collect();
                let most = used.iter().fold(0.0, |most: f64, v| most.max(*v));
                // A bin without any light, such as one that is always 0, is no exact bin.
                let least = if most > 0.0 { (0.1 * median(used)).max(0.01 * most) } else { 1.0 };
                variances.iter_mut().for_each(|v| *v = v.max(least));
                let weights = self.pairs[which].weights.iter().zip(&variances);
                let next = weights.map(|(w, v)| if *w > 0.0 { v.recip() } else { 0.0 });
                self.pairs[which].weights = next.collect();
            }
            let pair = &self.pairs[which];
            let mut rest: Vec<Vec<f64>> = vec![Vec::with_capacity(measured.at.len()); bins];
            for (counts, at) in measured.counts.iter().zip(measured.at) {
                let mut lit = vec![0.0; bins];
                self.render(pair, *at, &mut lit);
                (0..bins).for_each(|bin| rest[bin].push(f64::from(counts[which * bins + bin]) - lit[bin]));
            }
            self.pairs[which].room = rest.into_iter().map(median).collect();
        }
    }
}

/// The median of values, 0 of none.
fn median(mut values: Vec<f64>) -> f64 {
    quantile(&mut values, 0.5)
}

/// The first bin behind direct light, and its mean path.
fn behind_direct(room: &[f64], [start, width]: [f64; 2]) -> (usize, f64) {
    let floor = median(room.to_vec());
    let lit: Vec<f64> = room.iter().map(|v| (v - floor).max(0.0)).collect();
    let most = lit.iter().fold(0.0, |most: f64, v| most.max(*v));
    let Some(last) = lit.iter().rposition(|v| *v > DIRECT * most && most > 0.0) else { return (0, 0.0) };
    // Only the last run of lit bins: light of the optics comes before that of the wall.
    let first = lit[..=last].iter().rposition(|v| *v <= DIRECT * most).map_or(0, |dark| dark + 1);
    let sums = (first..=last).fold([0.0; 2], |[s, p], bin| [s + lit[bin], p + lit[bin] * (bin as f64 + 0.5)]);
    (last + 2, start + width * sums[1] / sums[0])
}

pub(crate) fn check_scan(capture: &Capture, pairs: usize, bins: usize, unit: [f64; 2]) -> Result<()> {
    let is_same = capture.pair_count() == pairs
        && capture.bins == bins
        && capture.t_start == unit[0]
        && capture.bin_width == unit[1];
    is_same.then_some(()).ok_or_else(|| {
        Error::input(
            format!(
                "{}: {} pairs of {} bins of {} m from {} m on; the calibration has {pairs} of {bins} of {} m from {} m on",
                capture.name,
                capture.pair_count(),
                capture.bins,
                capture.bin_width,
                capture.t_start,
                unit[1],
                unit[0]
            ),
            "give captures of one scan, and the same options as for the calibration",
        )
    })
}
