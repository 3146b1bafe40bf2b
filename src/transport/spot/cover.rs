//! Points of the wall that cover the spots of one side's points: a lattice, or a few for every point.

use glam::{DVec2, DVec3, dvec2};

use super::SpotTaps;
use super::each::around_each;
use super::side::{Relay, WallSide};
use crate::capture::lattice::Lattice;

/// A spot is cut off at this many standard deviations along x and y.
const REACH: f64 = 3.0;

/// A spot below this many steps of the lattice takes three points side by side.
const NARROW: f64 = 0.6;

/// A standard deviation is at most this many steps of the lattice.
const FINEST: f64 = 8.0;

/// A lattice may have this many times as many points as the scan. Otherwise points have a few of their own.
const MOST: usize = 10;

/// A lattice's points may be off their places by this share of its step.
const REGULAR: f64 = 0.02;

/// Points that cover the spots of a side's points, and the stages that sum them.
pub(super) struct Covered {
    pub points: Vec<DVec3>,
    pub normals: Option<Vec<DVec3>>,
    pub stages: Vec<SpotTaps>,
}

impl WallSide {
    /// Points that cover a spot of `sigma` metres around every point.
    pub fn covered(self, sigma: f64, coarsest: f64) -> Covered {
        if sigma == 0.0 {
            return Covered { points: self.points, normals: self.normals, stages: vec![] };
        }
        let lattice = Lattice::of(&self.points);
        let (at, stages) = self
            .on_lattice(&lattice, sigma, coarsest)
            .or_else(|| self.on_any_lattice(&lattice, sigma, coarsest))
            .unwrap_or_else(|| around_each(&self.points, sigma));
        let relay = Relay::of(&self);
        let (points, normals): (Vec<DVec3>, Vec<DVec3>) = at.into_iter().map(|p| relay.at(p)).unzip();
        Covered { points, normals: self.normals.as_ref().map(|_| normals), stages }
    }

    /// A lattice through the scan's own points, summed along x, then along y.
    fn on_lattice(&self, own: &Lattice, sigma: f64, coarsest: f64) -> Option<(Vec<DVec2>, Vec<SpotTaps>)> {
        let places = own.full()?;
        let axes =
            [0, 1].map(|a| LatticeAxis::of(own.range[a], own.spacing[a], own.counts[a], sigma, coarsest));
        let regular = |(p, at): (&DVec3, &[usize; 2])| {
            (0..2).all(|a| {
                let off = (p[a] - axes[a].measured[at[a]]).abs();
                own.spacing[a].is_none_or(|step| off <= REGULAR * step)
            })
        };
        let [x, y] = &axes;
        let deep = y.rendered.len();
        if x.rendered.len() * deep > MOST * self.points.len() || !self.points.iter().zip(places).all(regular)
        {
            return None;
        }
        let at = x.rendered.iter().flat_map(|x| y.rendered.iter().map(|y| dvec2(*x, *y))).collect();
        let along_x = SpotTaps { inner: deep, ..SpotTaps::of(x.rendered.len(), x.taps(sigma)) };
        let of_y = y.taps(sigma);
        let sum = |[ix, iy]: &[usize; 2]| -> Vec<(u32, f32)> {
            of_y[*iy].iter().map(|(j, weight)| ((ix * deep) as u32 + j, *weight)).collect()
        };
        let along_y = SpotTaps::of(x.measured.len() * deep, places.iter().map(sum).collect());
        Some((at, vec![along_x, along_y]))
    }

    /// A lattice of its own for points that form none.
    fn on_any_lattice(
        &self,
        own: &Lattice,
        sigma: f64,
        coarsest: f64,
    ) -> Option<(Vec<DVec2>, Vec<SpotTaps>)> {
        let apart = own.spacing.into_iter().flatten().fold(coarsest, f64::max);
        let step = sigma.min(apart.max(sigma / FINEST));
        let axes = own.range.map(|range| LatticeAxis::covering(range, step, sigma));
        let [wide, deep] = [0, 1].map(|a: usize| axes[a].len());
        if wide.saturating_mul(deep) > 4 * MOST * self.points.len() {
            return None;
        }
        let sum = |p: &DVec3| -> Vec<(u32, f32)> {
            let [x, y] = [0, 1].map(|a| gaussian(p[a], &axes[a], sigma));
            x.iter()
                .flat_map(|(i, v)| y.iter().map(move |(j, w)| (i * deep as u32 + j, (v * w) as f32)))
                .collect()
        };
        let mut rows: Vec<Vec<(u32, f32)>> = self.points.iter().map(sum).collect();
        // Only those that some spot needs.
        let mut number = vec![u32::MAX; wide * deep];
        rows.iter().flatten().for_each(|(c, _)| number[*c as usize] = 0);
        let used: Vec<usize> = (0..number.len()).filter(|c| number[*c] == 0).collect();
        if used.len() > MOST * self.points.len() {
            return None;
        }
        (0..).zip(&used).for_each(|(n, c)| number[*c] = n);
        rows.iter_mut().flatten().for_each(|(c, _)| *c = number[*c as usize]);
        let at = |c: &usize| dvec2(axes[0][c / deep], axes[1][c % deep]);
        Some((used.iter().map(at).collect(), vec![SpotTaps::of(used.len(), rows)]))
    }
}

/// One axis of a lattice: coordinates in metres.
struct LatticeAxis {
    measured: Vec<f64>,
    rendered: Vec<f64>,
}

impl LatticeAxis {
    /// `count` measured places a `spacing` apart, and rendered ones at every or every Nth of them and beyond both ends.
    fn of(
        [low, high]: [f64; 2],
        spacing: Option<f64>,
        count: usize,
        sigma: f64,
        coarsest: f64,
    ) -> LatticeAxis {
        let Some(spacing) = spacing else {
            let rendered = LatticeAxis::covering([low, high], sigma, sigma);
            return LatticeAxis { measured: vec![low], rendered };
        };
        let every = (sigma.min(coarsest.max(sigma / FINEST)) / spacing + 1e-6).floor().max(1.0);
        let step = every * spacing;
        let beyond = (REACH * sigma / step).floor().max(1.0);
        let first = low - beyond * step;
        let places = ((high + (REACH * sigma).max(step) - first) / step + 1e-6).floor() as usize + 1;
        LatticeAxis {
            measured: (0..count).map(|i| low + i as f64 * spacing).collect(),
            rendered: (0..places).map(|i| first + i as f64 * step).collect(),
        }
    }

    /// Coordinates a `step` apart from below to above a range with its spot.
    fn covering([low, high]: [f64; 2], step: f64, sigma: f64) -> Vec<f64> {
        let beyond = REACH * sigma;
        let places = ((high - low + 2.0 * beyond) / step + 1e-6).floor();
        let first = 0.5 * (low + high) - 0.5 * places * step;
        (0..=places as usize).map(|i| first + i as f64 * step).collect()
    }

    /// The rendered places of every measured one, with their weights.
    fn taps(&self, sigma: f64) -> Vec<Vec<(u32, f32)>> {
        let rounded = |all: Vec<(u32, f64)>| all.into_iter().map(|(i, w)| (i, w as f32)).collect();
        self.measured.iter().map(|at| rounded(gaussian(*at, &self.rendered, sigma))).collect()
    }
}

/// Weights of a Gaussian around `at` over equally spaced places, which sum to one: mean and variance are the Gaussian's.
fn gaussian(at: f64, places: &[f64], sigma: f64) -> Vec<(u32, f64)> {
    let step = if places.len() > 1 { places[1] - places[0] } else { sigma };
    let here = ((at - places[0]) / step).round() as usize;
    if sigma < NARROW * step {
        let aside = 0.5 * (sigma / step).powi(2);
        return [(here - 1, aside), (here, 1.0 - 2.0 * aside), (here + 1, aside)]
            .map(|(i, w)| (i as u32, w))
            .to_vec();
    }
    let near = |(_, place): &(u32, &f64)| (*place - at).abs() <= REACH * sigma + 1e-6 * step;
    let near: Vec<(u32, &f64)> = (0..).zip(places).filter(near).collect();
    let mut weights = vec![];
    let (mut centre, mut variance) = (at, sigma * sigma);
    // Few places at its edges change the moments of a Gaussian. A slightly different one has the wanted moments.
    for _ in 0..8 {
        weights = near.iter().map(|(i, p)| (*i, (-0.5 * (*p - centre).powi(2) / variance).exp())).collect();
        let sum: f64 = weights.iter().map(|(_, w)| w).sum();
        weights.iter_mut().for_each(|(_, w)| *w /= sum);
        let moment =
            |n| -> f64 { near.iter().zip(&weights).map(|((_, p), (_, w))| w * (*p - at).powi(n)).sum() };
        centre -= moment(1);
        variance *= (sigma * sigma / moment(2)).clamp(0.5, 2.0);
    }
    weights
}
