use glam::{DVec3, dvec3};

use super::{Raw, Twin, Way, instrument, random3};
use crate::transport::kernels::PADDING;
use crate::transport::{Binning, Gradient, Reflectance, Sampling};

/// The surface element of a voxel's sample, as every pair sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Position, metres.
    pub point: DVec3,
    /// Albedo.
    pub albedo: f64,
    /// Unit normal.
    pub normal: DVec3,
    /// Length of the normal before normalization.
    pub length: f64,
}

const BASE_NORMAL: DVec3 = dvec3(0.0, 0.0, -1.0);

/// Position of the sample of voxel `index`, in voxels.
pub fn sample_point(twin: &Twin, index: u32, iteration: u32) -> DVec3 {
    let c = twin.grid.voxel(index as usize).map(|c| c as f64);
    let centre = DVec3::from_array(c);
    if twin.model.sampling == Sampling::Fixed {
        return centre;
    }
    let shift = DVec3::from_array(random3(index, iteration, 1, twin.model.seed)) - 0.5;
    let last = DVec3::from_array(twin.grid.n.map(|n| n as f64 - 1.0));
    (centre + shift).clamp(DVec3::ZERO, last)
}

/// Samples of the active voxels.
pub fn sample(twin: &Twin, iteration: u32, active: &[u32], raw: &[Raw]) -> Vec<Sample> {
    active
        .iter()
        .map(|index| {
            let g = sample_point(twin, *index, iteration);
            let mut v = [0.0; 4];
            for (corner, weight) in corners(twin, g) {
                for k in 0..4 {
                    v[k] += weight * raw[corner][k];
                }
            }
            let u = toward_wall(v);
            let length = u.length().max(1e-12);
            Sample { point: twin.grid.position(g), albedo: elu(v[0]), normal: u / length, length }
        })
        .collect()
}

/// The voxels (up to eight) that are interpolated at `g`, with their weights.
fn corners(twin: &Twin, g: DVec3) -> Vec<(usize, f64)> {
    let mut all = vec![];
    let base = g.floor();
    for corner in 0..8 {
        let step = DVec3::from_array([0, 1, 2].map(|a| f64::from(corner >> a & 1)));
        let at = base + step;
        let near = (1.0 - (g - at).abs()).max(DVec3::ZERO);
        let weight = near.x * near.y * near.z;
        let c = at.to_array().map(|v| v as usize);
        if weight > 0.0 && twin.grid.contains(c) {
            all.push((twin.grid.index(c), weight));
        }
    }
    all
}

pub(super) fn elu(a: f64) -> f64 {
    if a > 0.0 { a } else { a.exp() - 1.0 }
}

pub(super) fn toward_wall(v: Raw) -> DVec3 {
    dvec3(v[1], v[2], v[3]).clamp(DVec3::splat(-10.0), DVec3::splat(10.0)).map(f64::tanh) + BASE_NORMAL
}

/// The arm from a sample to a wall point of a pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arm {
    pub toward: DVec3,
    pub distance: f64,
    /// (reference / distance)², or its root for retroreflective surfaces; 0 for a degenerate pair.
    pub falloff: f64,
    /// Cosine at the wall.
    pub wall: f64,
    pub wall_normal: DVec3,
}

/// A pair as a sample sees it: the arms to the scanned point and to the other point.
pub(super) struct Kernel {
    pub arms: [Arm; 2],
    pub falloff: f64,
    /// Path in bins from the leading edge of bin 0.
    pub bin: f64,
}

/// The arms of a pair: value = albedo · cosines · falloff, at path r_l + r_s.
fn kernel(twin: &Twin, pair: usize, s: &Sample) -> Kernel {
    let m = twin.model;
    let wall = m.rendered_wall();
    let arms = wall.points_of(pair).map(|number| {
        let [point, normal] = wall.point(number);
        let d = point - s.point;
        let r = d.length();
        if r < m.nearest(twin.grid) || r == 0.0 {
            return Arm { toward: DVec3::ZERO, distance: 0.0, falloff: 0.0, wall: 0.0, wall_normal: normal };
        }
        let toward = d / r;
        let falloff = (m.reference / r).powi(m.falloff_power() / 2);
        Arm { toward, distance: r, falloff, wall: (-normal.dot(toward)).max(0.0), wall_normal: normal }
    });
    let falloff = arms[0].falloff * arms[1].falloff;
    Kernel { falloff, bin: (arms[0].distance + arms[1].distance - m.t_start) / m.bin_width, arms }
}

/// Light that a surface vector (unit, or of any length) sends to a pair, without the falloff, and its derivative by the
/// vector. Without normals it is 1.
pub(super) fn shine(reflectance: Reflectance, arms: &[Arm; 2], v: DVec3) -> (f64, DVec3) {
    let [a, b] = arms;
    match reflectance {
        Reflectance::Cosine => {
            let value = v.dot(a.toward);
            if value > 0.0 { (value, a.toward) } else { (0.0, DVec3::ZERO) }
        }
        Reflectance::Lambertian => {
            let n = v.normalize_or_zero();
            let (cos_a, cos_b) = (n.dot(a.toward), n.dot(b.toward));
            if cos_a <= 0.0 || cos_b <= 0.0 {
                return (0.0, DVec3::ZERO);
            }
            let slope = cos_b * a.toward + cos_a * b.toward - cos_a * cos_b * n;
            (a.wall * b.wall * v.length() * cos_a * cos_b, a.wall * b.wall * slope)
        }
        Reflectance::Retroreflective | Reflectance::Isotropic => (1.0, DVec3::ZERO),
    }
}

/// The bins that a path at `position` (in bins from the leading edge of bin 0) adds to, with their shares.
fn shares(twin: &Twin, position: f64) -> impl Iterator<Item = (usize, f64)> {
    let both = match twin.model.binning {
        Binning::Nearest => [(position.floor(), 1.0), (-1.0, 0.0)],
        Binning::Linear => {
            let centre = position - 0.5;
            let low = centre.floor();
            [(low, 1.0 - (centre - low)), (low + 1.0, centre - low)]
        }
    };
    let bins = twin.model.bins as f64;
    both.into_iter().filter(move |(b, w)| *b >= 0.0 && *b < bins && *w > 0.0).map(|(b, w)| (b as usize, w))
}

/// The cells of paths in a pair's row, as `place.glsl` counts them: bin 0 is cell [`PADDING`], and the ends of a row belong
/// to no bin. What is not a number is in the first cell.
pub fn places(twin: &Twin, paths: &[f64]) -> Vec<u32> {
    let m = twin.model;
    let first = f64::from(PADDING) - if m.binning == Binning::Linear { 0.5 } else { 0.0 };
    let last = m.stride() as f64 + 1.0;
    let cell = |path: &f64| ((path - m.t_start) / m.bin_width + first).floor();
    // `max` ignores NaN.
    paths.iter().map(|path| cell(path).max(0.0).min(last) as u32).collect()
}

/// Accumulated histograms of the samples, `[pair * bins + bin]`, before the render scale.
pub fn forward(twin: &Twin, samples: &[Sample]) -> Vec<f64> {
    (0..twin.model.rendered_wall().pairs()).flat_map(|pair| forward_pair(twin, pair, samples)).collect()
}

/// The histogram of one pair, like [`forward`].
pub fn forward_pair(twin: &Twin, pair: usize, samples: &[Sample]) -> Vec<f64> {
    let mut sums = vec![0.0; twin.model.bins];
    for s in samples {
        let k = kernel(twin, pair, s);
        let value = s.albedo * shine(twin.model.reflectance, &k.arms, s.normal).0 * k.falloff;
        for (bin, share) in shares(twin, k.bin) {
            sums[bin] += value * share;
        }
    }
    sums
}

/// dLoss / d(accumulated value) of every bin, and the data loss (mean squared error). `weights` are those of the noise
/// term, one per bin or one per histogram; empty without a noise term. Both directions go through the model's
/// instrument.
pub fn residual(twin: &Twin, accumulated: &[f64], weights: &[f64]) -> (Vec<f64>, f64) {
    let m = twin.model;
    let (render, elements) = (f64::from(m.scene(twin.grid).render_scale), m.elements as f64);
    let mut loss = 0.0;
    let gradient: Vec<f64> = instrument(twin, accumulated, Way::Spread)
        .iter()
        .enumerate()
        .map(|(i, sum)| {
            let mut rendered = sum * render;
            let mut open = 1.0;
            if !weights.is_empty() {
                let w = weights[if weights.len() == m.measured.len() { i } else { i / m.bins }];
                rendered += m.peak * (m.noise[0] + m.noise[1] / (1.0 + (-w).exp()));
                open = if rendered > 0.0 { 1.0 } else { 0.0 };
                rendered = rendered.max(0.0);
            }
            let difference = rendered - f64::from(m.measured[i]);
            loss += difference * difference / elements;
            2.0 / elements * render * open * difference
        })
        .collect();
    (instrument(twin, &gradient, Way::Back), loss)
}

/// d(weighted mean squared error) / d(accumulated value) of every bin, then the weighted error and the plain one: bins
/// weighted by the inverse falloff, through the high-pass if the model has one. Both directions go through the model's
/// instrument.
pub fn residual_weighted(twin: &Twin, accumulated: &[f64]) -> (Vec<f64>, [f64; 2]) {
    let m = twin.model;
    let (render, elements) = (f64::from(m.scene(twin.grid).render_scale), m.elements as f64);
    let seen = instrument(twin, accumulated, Way::Spread);
    let plain: Vec<f64> = seen.iter().zip(&m.measured).map(|(sum, h)| sum * render - f64::from(*h)).collect();
    let filter = |rows: &mut [f64]| {
        m.high_pass.iter().for_each(|f| rows.chunks_mut(m.bins).for_each(|row| f.apply(row, m.bin_width)));
    };
    let weigh = |i: usize| m.bin_weight(i % m.bins).sqrt();
    let mut rows: Vec<f64> = plain.iter().enumerate().map(|(i, d)| weigh(i) * d).collect();
    filter(&mut rows);
    let squares = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>() / elements;
    let loss = [squares(&rows), squares(&plain)];
    filter(&mut rows);
    let gradient: Vec<f64> =
        rows.iter().enumerate().map(|(i, v)| 2.0 / elements * render * weigh(i) * v).collect();
    (instrument(twin, &gradient, Way::Back), loss)
}

/// Calls `hear` with every pair's kernel of a sample, and the residual at its path.
pub(super) fn gather(twin: &Twin, s: &Sample, residual: &[f64], mut hear: impl FnMut(&Kernel, f64)) {
    let bins = twin.model.bins;
    for pair in 0..twin.model.rendered_wall().pairs() {
        let k = kernel(twin, pair, s);
        let r: f64 = shares(twin, k.bin).map(|(b, w)| w * residual[pair * bins + b]).sum();
        // A path that is not finite reads no bin, and tells.
        hear(&k, if k.bin.is_finite() { r } else { f64::NAN });
    }
}

/// Calls `hear` like [`gather`], with linear binning, and adds the residual's rise from the first to the second of the
/// two bins around the path.
pub(super) fn gather_rising(
    twin: &Twin,
    s: &Sample,
    residual: &[f64],
    mut hear: impl FnMut(&Kernel, [f64; 2]),
) {
    let bins = twin.model.bins as f64;
    for pair in 0..twin.model.rendered_wall().pairs() {
        let k = kernel(twin, pair, s);
        let at = |bin: f64| {
            let known = bin >= 0.0 && bin < bins;
            if known { residual[pair * twin.model.bins + bin as usize] } else { 0.0 }
        };
        let centre = k.bin - 0.5;
        let rise = at(centre.floor() + 1.0) - at(centre.floor());
        hear(&k, [at(centre.floor()) + (centre - centre.floor()) * rise, rise]);
    }
}

/// dLoss / d(raw variables at the sample), one per sample.
pub fn backward(twin: &Twin, samples: &[Sample], residual: &[f64]) -> Vec<Raw> {
    let m = twin.model;
    samples
        .iter()
        .map(|s| {
            let mut albedo =
                m.l1 / twin.grid.voxels() as f64 * if s.albedo == 0.0 { 0.0 } else { s.albedo.signum() };
            let mut normal = DVec3::ZERO;
            gather(twin, s, residual, |k, mut r| {
                if m.gradient == Gradient::Exact {
                    r *= k.falloff;
                }
                let (value, slope) = shine(m.reflectance, &k.arms, s.normal);
                albedo += r * value;
                normal += r * s.albedo * slope;
            });
            let slope = if s.albedo > 0.0 { 1.0 } else { s.albedo + 1.0 };
            let tanh = s.normal * s.length - BASE_NORMAL;
            let across =
                (normal - s.normal * s.normal.dot(normal)) / s.length * (1.0 - tanh * tanh).max(DVec3::ZERO);
            [albedo * slope, across.x, across.y, across.z]
        })
        .collect()
}

/// Sum of |albedo| over the samples: the trace's L1 column.
pub fn finish(samples: &[Sample]) -> f64 {
    samples.iter().map(|s| s.albedo.abs()).sum()
}

/// The loss of the paper's solver: mean squared error plus α Σ|albedo| / voxels.
pub fn objective(twin: &Twin, iteration: u32, active: &[u32], raw: &[Raw], weights: &[f64]) -> f64 {
    let samples = sample(twin, iteration, active, raw);
    let (_, loss) = residual(twin, &forward(twin, &samples), weights);
    loss + twin.model.l1 / twin.grid.voxels() as f64 * finish(&samples)
}

/// [`objective`] with every bin's squared difference weighted by (t / (2 reference))⁴, t the bin's centre. Its exact
/// gradient is the published one, without the falloff.
pub fn weighted_objective(twin: &Twin, iteration: u32, active: &[u32], raw: &[Raw]) -> f64 {
    let m = twin.model;
    let samples = sample(twin, iteration, active, raw);
    let accumulated = instrument(twin, &forward(twin, &samples), Way::Spread);
    let render = f64::from(m.scene(twin.grid).render_scale);
    let data: f64 = accumulated
        .iter()
        .enumerate()
        .map(|(i, sum)| {
            let difference = sum * render - f64::from(m.measured[i]);
            m.bin_weight(i % m.bins) * difference * difference
        })
        .sum();
    data / m.elements as f64 + m.l1 / twin.grid.voxels() as f64 * finish(&samples)
}
