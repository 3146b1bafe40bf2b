//! The weights of the surface's objective, and the lengths of its first steps.

use super::options::SurfaceOptions;
use crate::engine::{AMPLE, Level};
use crate::transport::kernels::*;
use crate::transport::{Grid, Model};

/// How far a pixel may be off its neighbours' planes, in pixels, and how much its albedo may differ, as a share of the
/// largest.
const BEND: f64 = 0.1;
const JUMP: f64 = 0.2;

/// First steps: of depths in bins of path and in pixels, whichever is less; of albedos as a share of the largest.
const DEPTH_BINS: f64 = 1.0 / 3.0;
const DEPTH_PIXELS: f64 = 0.25;
const ALBEDO: f64 = 0.06;

/// Above this share of the largest albedo, a pixel costs little more ([`SurfaceOptions::sparsity`]).
const FAINT: f64 = 0.1;

/// Gaussian that averages gradients at first: sigma in pixels of the same grid, and at most in the map's own.
const SPREAD: f64 = 0.7;
const MOST_SPREAD: f64 = 6.0;

/// The state that a surface begins with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// How many pixels it has.
    pub pixels: usize,
    /// The largest albedo.
    pub most: f64,
    /// The part of the data that its light explains: weighted squares, mean over bins.
    pub explained: f64,
    /// The part that it leaves.
    pub left: f64,
}

/// What the kernels are to find out before a fit, or know of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unplaced {
    /// The pixels, and their largest albedo, whose scale may be unknown.
    pub pixels: usize,
    pub brightest: f64,
    /// Data terms of the measurement: of all pairs, and of those whose light gives the scale.
    pub energies: [f64; 2],
    /// What the pixels leave, if their scale is that of the data.
    pub known: Option<f64>,
    /// What earlier fits left, which weighs the prior at first.
    pub before: Option<f64>,
    /// Iterations of the schedule that are left out.
    pub skipped: usize,
}

impl Unplaced {
    /// The buffer `surface_weights` before `surface_judge` has found the scale: for an albedo of one that explains all light.
    pub fn weights(
        &self,
        model: &Model,
        level: &Level,
        options: &SurfaceOptions,
        iterations: usize,
        factor: f64,
    ) -> [f32; SURFACE_WEIGHTS as usize] {
        let placed = Placed { pixels: self.pixels, most: 1.0, explained: 1.0, left: 0.0 };
        let mut all = weights(model, level, placed, options, iterations, factor);
        for (index, value) in [
            (SURFACE_BRIGHTEST, self.brightest),
            (SURFACE_ENERGY, self.energies[0]),
            (SURFACE_COMPARED, self.energies[1]),
            (SURFACE_PLACED, self.known.unwrap_or(0.0)),
            (SURFACE_BEFORE, self.before.unwrap_or(f64::from(f32::MAX))),
            (SURFACE_RESTED, self.skipped as f64),
        ] {
            all[index as usize] = value as f32;
        }
        all
    }
}

/// The buffer `surface_weights`, for a fit of `iterations` iterations whose steps are shorter by `factor`.
pub fn weights(
    model: &Model,
    level: &Level,
    placed: Placed,
    options: &SurfaceOptions,
    iterations: usize,
    factor: f64,
) -> [f32; SURFACE_WEIGHTS as usize] {
    // Half of chi² is the objective over this and over what is left: noise, and what the model does not explain.
    let share = 2.0 / model.elements_of(level.pairs).max(1) as f64;
    let most = placed.most;
    let [bend, jump] = [share / (BEND * BEND), share / (JUMP * most).powi(2)];
    let sparse = options.sparsity * placed.explained / (placed.pixels.max(1) as f64 * most);
    let pixel = (level.grid.pitch.x * level.grid.pitch.y).sqrt();
    let mut all = [0.0; SURFACE_WEIGHTS as usize];
    for (index, value) in [
        (SURFACE_BEND, bend * placed.left),
        (SURFACE_JUMP, jump * placed.left),
        (SURFACE_BEND_SHARE, bend),
        (SURFACE_JUMP_SHARE, jump),
        (SURFACE_DEPTH_RATE, factor * (DEPTH_BINS * model.bin_width).min(DEPTH_PIXELS * pixel)),
        (SURFACE_ALBEDO_RATE, factor * ALBEDO * most),
        (SURFACE_ITERATIONS, iterations as f64),
        (SURFACE_SPREAD, spread(&level.grid)),
        (SURFACE_SPARSE, sparse),
        (SURFACE_FAINT, FAINT * most),
        (SURFACE_FACTOR, factor),
        (SURFACE_DEPTH_LONGEST, (DEPTH_BINS * model.bin_width).min(DEPTH_PIXELS * pixel)),
        (SURFACE_ALBEDO_LONGEST, ALBEDO * most),
        (SURFACE_SCALE, 1.0),
        (SURFACE_TIMES, 1.0),
    ] {
        all[index as usize] = value as f32;
    }
    all
}

/// Pixels around each that a kernel visits at `level` at most, to average gradients.
pub fn around(level: &Level) -> u64 {
    (2 * (2.0 * spread(&level.grid)).ceil() as u64 + 1).pow(2)
}

/// First sigma of the Gaussian that averages gradients, pixels.
fn spread(maps: &Grid) -> f64 {
    (SPREAD * maps.n[0] as f64 / AMPLE as f64).min(MOST_SPREAD)
}
