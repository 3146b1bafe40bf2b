//! Rounds of short fits between which the support follows the evidence. Each is judged on pairs that no fit takes; the best one
//! is the result.

use super::fit::{Fit, Quality, Run};
use super::held_out::Left;
use crate::Result;
use crate::engine::{Driven, Watch};
use crate::maps::Maps;
use crate::surface::support;

/// Evidence: benches/NOTES.md, "Support by evidence".
mod constants {
    /// A larger model error means that haze looks like surface: of surfaces that bend away, and of plates.
    pub const MOST_ERROR: [f64; 2] = [super::super::fit::MOST_ERROR, 0.01];
    /// Rounds without a better one end the search.
    pub const PATIENCE: usize = 2;
    /// Pixels more by a factor f must lower what is left by the factor f^-GROWTH.
    pub const GROWTH: f64 = 0.5;
    /// The support is stable where a round changes at most this share of the pixels.
    pub const STABLE: f64 = 0.02;
}
use constants::*;

/// Rounds of fits between which the support changes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rounds {
    /// Most rounds.
    pub number: usize,
    /// Rings of pixels that the support grows by after each.
    pub rings: usize,
}

/// A fitted surface, and its judgement.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub layers: Vec<Maps>,
    /// The length of the last steps, as a share of the longest ones.
    pub step: f64,
    pub quality: Quality,
    /// What it leaves of the pairs that are held out; `None` where none are.
    pub left: Option<Left>,
}

impl Candidate {
    /// The present surface of a fit, which has these layers and this quality, with its judgement.
    ///
    /// # Errors
    /// The device fails.
    pub fn of(fit: &mut Fit, layers: Vec<Maps>, quality: Quality) -> Result<Candidate> {
        Ok(Candidate { layers, step: fit.step, quality, left: fit.judged()?.map(|held| held.left()) })
    }

    /// Pixels of all layers.
    pub fn pixels(&self) -> usize {
        self.layers.iter().flat_map(|l| &l.depth).filter(|z| z.is_finite()).count()
    }

    /// What decides between surfaces of one capture: the logarithm of what is left beyond noise of the pairs that are held out,
    /// and a price of every pixel.
    pub fn cost(&self) -> f64 {
        self.excess().max(f64::MIN_POSITIVE).ln() + GROWTH * (self.pixels().max(1) as f64).ln()
    }

    /// What is left beyond noise, as a share of the energy.
    pub fn excess(&self) -> f64 {
        match &self.left {
            Some(left) => left.excess() + left.standard_error(),
            None => self.quality.model_error(),
        }
    }

    /// Whether the model error is small enough to separate dim surface from haze, up to a factor.
    pub fn is_coherent(&self, factor: f64) -> bool {
        let flatness = support::typical_albedo(&self.layers)
            .map_or(0.0, |typical| support::flatness(&self.layers, typical));
        let [most, most_of_plates] = MOST_ERROR;
        self.quality.model_error() <= factor * (most + (most_of_plates - most) * f64::from(flatness))
    }
}

/// Rounds under way.
pub(crate) struct Growth {
    how: Rounds,
    /// Depths that surfaces may have, metres.
    range: [f32; 2],
    /// The support of the next round, with what the last one found.
    pub layers: Vec<Maps>,
    round: usize,
    /// What the last round left.
    left: Option<f64>,
    best: Option<Candidate>,
    /// Rounds since the best one.
    worse: usize,
    is_over: bool,
}

/// Pixels with a surface.
fn lit(layers: &[Maps]) -> Vec<bool> {
    layers.iter().flat_map(|l| &l.depth).map(|z| z.is_finite()).collect()
}

impl Growth {
    /// Rounds of `fit` that begin with `layers`.
    pub fn new(fit: &Fit, how: Rounds, layers: Vec<Maps>) -> Growth {
        let range = fit.depth_range();
        Growth { how, range, layers, round: 0, left: None, best: None, worse: 0, is_over: false }
    }

    /// The next round, if there is one: `run` gives its fit by its number from 0, or nothing if the time is over.
    pub fn next(&self, run: &dyn Fn(usize) -> Option<Run>) -> Option<Run> {
        let how = (!self.is_over && self.round < self.how.number).then(|| run(self.round)).flatten()?;
        // New pixels disturb the surface: what it left before weighs its prior.
        Some(Run { level: self.left, ..how })
    }

    /// Judges a round that ended with this quality, and lets the support follow the evidence.
    ///
    /// # Errors
    /// The device fails.
    pub fn judge(&mut self, fit: &mut Fit, quality: Option<Quality>) -> Result<()> {
        self.round += 1;
        self.left = quality.map(|q| q.left);
        let Some(quality) = quality else {
            self.is_over = true;
            return Ok(());
        };
        let this = Candidate::of(fit, self.layers.clone(), quality)?;
        match &self.best {
            Some(best) if this.cost() >= best.cost() => self.worse += 1,
            _ => (self.best, self.worse) = (Some(this), 0),
        }
        let layers = &mut self.layers;
        let Some(typical) = support::typical_albedo(layers).filter(|_| self.worse < PATIENCE) else {
            self.is_over = true;
            return Ok(());
        };
        let old = lit(layers);
        let flatness = support::flatness(layers, typical);
        support::follow(layers, [typical, flatness], Some((self.range, self.how.rings)));
        let new = lit(layers);
        let changed = old.iter().zip(&new).filter(|(a, b)| a != b).count() as f64;
        let all = new.iter().filter(|l| **l).count() as f64;
        self.is_over = changed <= STABLE * all || all == 0.0;
        Ok(())
    }

    /// Leaves the support of the best round, and gives that; without a round that explains light, the layers stay as they are.
    pub fn settle(&mut self) -> Option<Candidate> {
        let best = self.best.take()?;
        let mut layers = best.layers.clone();
        if let Some(typical) = support::typical_albedo(&layers) {
            let flatness = support::flatness(&layers, typical);
            support::follow(&mut layers, [typical, flatness], None);
        }
        if !lit(&layers).contains(&true) {
            layers = best.layers.clone();
        }
        self.layers = layers;
        Some(best)
    }
}

/// Fits `layers` in rounds, and replaces them by the support of the best one; returns that. `None` if they explain no light.
///
/// # Errors
/// The device fails, or the watch cancels.
pub(crate) fn grow(
    fit: &mut Fit,
    how: Rounds,
    layers: &mut Vec<Maps>,
    run: &dyn Fn(usize) -> Option<Run>,
    watch: &mut Watch<'_>,
    mut driven: Driven,
) -> Result<(Driven, Option<Candidate>)> {
    let mut growth = Growth::new(fit, how, std::mem::take(layers));
    while let Some(how) = growth.next(run) {
        let (next, quality) = fit.run(&mut growth.layers, how, watch, driven)?;
        driven = next;
        growth.judge(fit, quality)?;
    }
    let best = growth.settle();
    *layers = growth.layers;
    Ok((driven, best))
}
