//! Light of samples by the model, in float64: what kernels and their reference should render, written without them.

use glam::{DVec3, dvec3};

pub use thirdbounce::capture::pulse::Way;
use thirdbounce::transport::{Binning, Grid, Model, Reflectance};

/// Four numbers of a voxel: raw variables, a gradient, a point with its albedo.
pub type Raw = [f64; 4];

/// The surface element of a sample, as every pair sees it.
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

impl Sample {
    /// The sample in a slot of `sample_points` and `sample_normals`.
    pub fn at(model: &Model, points: &[Raw], normals: &[Raw], slot: usize) -> Sample {
        let [x, y, z, albedo] = points[slot];
        let directed = model.reflectance.has_normals();
        let [a, b, c, length] = if directed { normals[slot] } else { [0.0, 0.0, -1.0, 1.0] };
        Sample { point: dvec3(x, y, z), albedo, normal: dvec3(a, b, c), length }
    }
}

/// The arm from a sample to a wall point of a pair.
#[derive(Debug, Clone, Copy)]
struct Arm {
    toward: DVec3,
    distance: f64,
    /// (reference / distance)², or its root for retroreflective surfaces; 0 for a degenerate pair.
    falloff: f64,
    /// Cosine at the wall.
    wall: f64,
}

/// The arms of a pair: value = albedo · cosines · falloffs, at path r_l + r_s.
fn arms(model: &Model, grid: &Grid, pair: usize, s: &Sample) -> [Arm; 2] {
    let wall = model.rendered_wall();
    wall.points_of(pair).map(|number| {
        let [point, normal] = wall.point(number);
        let d = point - s.point;
        let r = d.length();
        if r < model.nearest(grid) || r == 0.0 {
            return Arm { toward: DVec3::ZERO, distance: 0.0, falloff: 0.0, wall: 0.0 };
        }
        let toward = d / r;
        let falloff = (model.reference / r).powi(model.falloff_power() / 2);
        Arm { toward, distance: r, falloff, wall: (-normal.dot(toward)).max(0.0) }
    })
}

/// The cosines of a pair for a unit normal.
fn cosines(reflectance: Reflectance, [a, b]: &[Arm; 2], normal: DVec3) -> f64 {
    let cosine = |arm: &Arm| normal.dot(arm.toward).max(0.0);
    match reflectance {
        Reflectance::Cosine => cosine(a),
        Reflectance::Lambertian => a.wall * b.wall * cosine(a) * cosine(b),
        Reflectance::Retroreflective | Reflectance::Isotropic => 1.0,
    }
}

/// The bins that a path at `position` (in bins from the leading edge of bin 0) adds to, with their shares.
fn shares(model: &Model, position: f64) -> impl Iterator<Item = (usize, f64)> + use<> {
    let both = match model.binning {
        Binning::Nearest => [(position.floor(), 1.0), (-1.0, 0.0)],
        Binning::Linear => {
            let centre = position - 0.5;
            let low = centre.floor();
            [(low, 1.0 - (centre - low)), (low + 1.0, centre - low)]
        }
    };
    let bins = model.bins as f64;
    both.into_iter().filter(move |(b, w)| *b >= 0.0 && *b < bins && *w > 0.0).map(|(b, w)| (b as usize, w))
}

/// Accumulated histograms of the samples, `[pair * bins + bin]`, before the render scale.
pub fn rendered(model: &Model, grid: &Grid, samples: &[Sample]) -> Vec<f64> {
    let of_pair = |pair: usize| {
        let mut sums = vec![0.0; model.bins];
        for s in samples {
            let arms = arms(model, grid, pair, s);
            let value =
                s.albedo * cosines(model.reflectance, &arms, s.normal) * arms[0].falloff * arms[1].falloff;
            let bin = (arms[0].distance + arms[1].distance - model.t_start) / model.bin_width;
            shares(model, bin).for_each(|(bin, share)| sums[bin] += value * share);
        }
        sums
    };
    (0..model.rendered_wall().pairs()).flat_map(of_pair).collect()
}

/// Histograms of rendered pairs as the instrument shows them: summed over the measured pairs' spots, spread by the pulse.
/// Or back, through both in reverse.
pub fn instrument(model: &Model, values: &[f64], way: Way) -> Vec<f64> {
    let pulse = |values: Vec<f64>| match &model.pulse {
        Some(taps) => values.chunks(model.bins).flat_map(|h| taps.through(h, way)).collect(),
        None => values,
    };
    let spots = |values: Vec<f64>| {
        let stages = model.rendered.as_ref().map_or(vec![], |r| match way {
            Way::Spread => r.stages.clone(),
            Way::Back => r.back(),
        });
        stages.iter().fold(values, |v, stage| stage.through(&v, model.bins))
    };
    match way {
        Way::Spread => pulse(spots(values.to_vec())),
        Way::Back => spots(pulse(values.to_vec())),
    }
}
