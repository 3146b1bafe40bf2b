//! Gradients against finite differences of their objective, in float64. `paper.rs` compares the kernels with the same
//! functions.

use fixtures::device::*;
use glam::dvec3;
use thirdbounce::capture::PulseTaps;
use thirdbounce::transport::twin::{self, Raw, Twin, Way};
use thirdbounce::transport::{Binning, Gradient, Grid, Model, Sampling, Volume, Wall};

/// Adjoint of the sampling, as in `update`: from gradients at samples to gradients of voxels.
fn to_voxels(twin: &Twin, iteration: u32, active: &[u32], gradient: &[Raw]) -> Vec<Raw> {
    // One step of Adam without moments and with a huge epsilon is the gradient times lr / epsilon.
    let mut model = twin.model.clone();
    (model.betas, model.epsilon, model.learning_rate) = ([0.0, 0.0], 1e12, 1e12);
    let plain = Twin { model: &model, grid: twin.grid };
    let count = twin.grid.storage();
    let all: Vec<u32> = (0..count as u32).collect();
    let mut raw = vec![[0.0; 4]; count];
    let (mut first, mut second) = (raw.clone(), raw.clone());
    twin::update(&plain, iteration, 1, active, &all, gradient, &mut raw, &mut first, &mut second);
    raw.iter().map(|r| r.map(|v| -v)).collect()
}

fn scene() -> (Model, Grid, Vec<Raw>, Vec<u32>) {
    let mut m = model(4, 48, 21);
    m.gradient = Gradient::Exact;
    let volume = Volume { min: dvec3(-0.5, -0.5, 0.25), max: dvec3(0.5, 0.5, 0.9) };
    let grid = Grid::new(volume, 8, 0.1).unwrap();
    let (raw, domain) = state(&m, &grid, 0.4, 22);
    let active = twin::compact(&domain);
    (m, grid, raw, active)
}

#[test]
fn exact_gradient_is_the_slope_of_the_objective() {
    for sampling in [Sampling::Continuous, Sampling::Fixed] {
        for binning in [Binning::Linear, Binning::Nearest] {
            let (mut m, grid, raw, active) = scene();
            (m.sampling, m.binning) = (sampling, binning);
            let twin = Twin { model: &m, grid: &grid };
            let samples = twin::sample(&twin, 3, &active, &raw);
            let (residual, _) = twin::residual(&twin, &twin::forward(&twin, &samples), &[]);
            let gradient = to_voxels(&twin, 3, &active, &twin::backward(&twin, &samples, &residual));
            assert_gradient(&raw, &gradient, |r| twin::objective(&twin, 3, &active, r, &[]));
        }
    }
}

#[test]
fn exact_gradient_holds_with_the_noise_term_and_its_clamp() {
    for pulse in [None, Some(tail())] {
        check_noise(pulse);
    }
}

fn check_noise(pulse: Option<PulseTaps>) {
    let (mut m, grid, raw, active) = scene();
    m.noise = [0.001, 0.002];
    let sharp = m.clone();
    m.pulse = pulse;
    let weights: Vec<f64> = (0..m.pairs() * m.bins).map(|i| ((i * 37 % 11) as f64 - 5.0) / 3.0).collect();
    let twin = Twin { model: &m, grid: &grid };
    let samples = twin::sample(&twin, 0, &active, &raw);
    let accumulated = twin::forward(&twin, &samples);
    let (residual, _) = twin::residual(&twin, &accumulated, &weights);
    // The noise term is added after the pulse, so it learns from the residual before the adjoint of the pulse.
    let shown = twin::pulse(&twin, &accumulated, Way::Spread);
    let (of_bins, _) = twin::residual(&Twin { model: &sharp, grid: &grid }, &shown, &weights);
    assert!(of_bins.contains(&0.0), "some bins are clamped");
    let gradient = to_voxels(&twin, 0, &active, &twin::backward(&twin, &samples, &residual));
    assert_gradient(&raw, &gradient, |r| twin::objective(&twin, 0, &active, r, &weights));

    // The gradient by the weights, from one step of Adam at rest: its first moment is (1 - beta1) g.
    let mut state: Vec<[f64; 3]> = weights.iter().map(|w| [*w, 0.0, 0.0]).collect();
    twin::noise(&twin, 1, &of_bins, &mut state);
    for i in (0..weights.len()).step_by(53) {
        let at = |h: f64| {
            let mut moved = weights.clone();
            moved[i] += h;
            twin::objective(&twin, 0, &active, &raw, &moved)
        };
        let slope = (at(1e-4) - at(-1e-4)) / 2e-4;
        let gradient = state[i][1] / (1.0 - m.betas[0]);
        assert!((slope - gradient).abs() < 1e-8, "weight {i}: gradient {gradient} but slope {slope}");
    }
}

/// Every reflectance over every kind of pairs and walls, with sharp paths and with a pulse.
#[test]
fn exact_gradient_of_every_model_pair_and_wall() {
    for (geometry, reflectance, curved) in variants() {
        for pulse in [None, Some(tail())] {
            let (base, grid, raw, active) = scene();
            let m = Model { pulse, ..variant(&base, geometry, reflectance, curved, 25) };
            let twin = Twin { model: &m, grid: &grid };
            let samples = twin::sample(&twin, 3, &active, &raw);
            let (residual, _) = twin::residual(&twin, &twin::forward(&twin, &samples), &[]);
            let gradient = to_voxels(&twin, 3, &active, &twin::backward(&twin, &samples, &residual));
            let turns = gradient.iter().any(|g| g[1] != 0.0);
            assert_eq!(turns, reflectance.has_normals(), "{reflectance:?}");
            assert_gradient(&raw, &gradient, |r| twin::objective(&twin, 3, &active, r, &[]));
        }
    }
}

/// On the axis of one pair, with every voxel's path on a bin's centre, weight and falloff cancel exactly.
#[test]
fn published_gradient_is_the_slope_of_the_falloff_weighted_objective() {
    let mut m = model(1, 60, 23);
    m.gradient = Gradient::Published;
    m.sampling = Sampling::Fixed;
    m.t_start = 0.5;
    m.bin_width = 0.04;
    m.measured = (0..60).map(|i| (i % 7) as f32).collect();
    // Voxel k at depth 0.26 + 0.02 k: path 0.5 + 0.04 (k + 1/2), the centre of bin k.
    let grid = Grid { n: [1, 1, 40], origin: dvec3(0.0, 0.0, 0.26), pitch: dvec3(0.05, 0.05, 0.02) };
    m.wall = Wall::confocal(vec![dvec3(0.0, 0.0, 0.0)]);
    let twin = Twin { model: &m, grid: &grid };
    let (raw, domain) = state(&m, &grid, 0.9, 24);
    let active = twin::compact(&domain);
    let samples = twin::sample(&twin, 0, &active, &raw);
    for s in &samples {
        let position = (2.0 * s.point.z - m.t_start) / m.bin_width - 0.5;
        assert!((position - position.round()).abs() < 1e-9, "paths lie on bin centres");
    }
    let (residual, _) = twin::residual(&twin, &twin::forward(&twin, &samples), &[]);
    let gradient = to_voxels(&twin, 0, &active, &twin::backward(&twin, &samples, &residual));
    assert_gradient(&raw, &gradient, |r| twin::weighted_objective(&twin, 0, &active, r));
}

/// Off the axis a path misses the bin's centre by up to a bin, so weight × falloff is 1 ± 4 bin / path.
#[test]
fn published_gradient_agrees_with_the_weighted_objective_to_the_width_of_a_bin() {
    let (mut m, grid, raw, active) = scene();
    m.l1 = 0.0;
    m.gradient = Gradient::Published;
    let twin = Twin { model: &m, grid: &grid };
    let samples = twin::sample(&twin, 1, &active, &raw);
    let (residual, _) = twin::residual(&twin, &twin::forward(&twin, &samples), &[]);
    let published = twin::backward(&twin, &samples, &residual).concat();
    // The weighted objective's gradient: exact gradient of the residual times (t / 2 reference)^4.
    let weighted: Vec<f64> = residual
        .iter()
        .enumerate()
        .map(|(i, r)| {
            r * ((m.t_start + ((i % m.bins) as f64 + 0.5) * m.bin_width) / (2.0 * m.reference)).powi(4)
        })
        .collect();
    let mut exact = m.clone();
    exact.gradient = Gradient::Exact;
    let exact = twin::backward(&Twin { model: &exact, grid: &grid }, &samples, &weighted).concat();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let cosine = dot(&published, &exact) / (dot(&published, &published) * dot(&exact, &exact)).sqrt();
    let nearest_path = 2.0 * 0.25;
    let bound = 4.0 * m.bin_width / nearest_path;
    assert!(1.0 - cosine < bound * bound, "cosine {cosine}, bound {bound}");
    assert!(cosine < 1.0, "they are not the same vector");
}
