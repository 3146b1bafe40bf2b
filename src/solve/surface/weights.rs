//! The weights of the surface's objective, and the lengths of its first steps.

use super::SurfaceOptions;
use crate::solve::Level;
use crate::solve::plan::AMPLE;
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
