//! The surface that a volume's maps begin: a depth and an albedo for every pixel, refined together.
//!
//! A voxel's centre stands for a square of surface whose paths differ by several bins, and a slanted surface for several
//! voxels of a column, so a volume keeps normals too level and depths to a voxel however long it is solved (study in
//! benches/NOTES.md). Here a pixel, as wide as a voxel or less, is its tilted square, four points of it or one, and its normal
//! is that of the plane through its neighbours: shading and shape are one. Minimised is what the vector solver minimises, with
//! a Gaussian prior instead of its other terms: neighbours lie in each other's planes to [`BEND`] and have albedos alike to
//! [`JUMP`], weighed as the noise of the histograms asks, by Adam on gradients that are spread over their surroundings at first
//! ([`SPREAD`]). The pixels are the bright ones of the maps ([`Pixels`]); depths stay within the grid.

use std::time::Instant;

use super::drive::{Driven, Steps, Watch, drive, stage_values};
use super::job::{Job, upload};
use super::plan::AMPLE;
use super::schedule::{compare, forward, gather, groups};
use super::vector::expected_noise;
use super::{Level, Plan, VectorOptions};
use crate::Result;
use crate::gpu::{Gpu, Schedule};
use crate::maps::Maps;
use crate::transport::kernels::*;
use crate::transport::{Grid, Model};

pub mod blur;
mod pixels;

pub use pixels::Pixels;

/// How far a pixel may be off its neighbours' planes, in pixels, and how different its albedo, in the largest one.
const BEND: f64 = 0.1;
const JUMP: f64 = 0.2;

/// Amplitude that no model explains, as a share of the data's: where there is no noise the prior still has a say.
const MISFIT: f64 = 0.05;

/// First steps: depths in bins of path and in pixels, whichever is less, albedos in the largest one.
const DEPTH_BINS: f64 = 1.0 / 3.0;
const DEPTH_PIXELS: f64 = 0.25;
const ALBEDO: f64 = 0.06;

/// Share of its largest from which on a pixel's albedo costs little more ([`VectorOptions::surface_sparsity`]).
const FAINT: f64 = 0.1;

/// What the surface leaves of the objective, over what the volume left of its own, from which on it is not taken.
const WORSE: f64 = 2.0;

/// Gaussian that the maps' albedo sees albedos under, in pixels of the first grid, which has what a scan tells apart, but of
/// one with 32 pixels a side where that is coarser; and in the map's own at least. The kernel walks (4 sigma)² of them, and
/// lavapipe stops after 65,535.
const SMOOTH: f64 = 0.5;
const LEAST_SMOOTH: f64 = 0.7;
const MOST_SMOOTH: f64 = 60.0;

/// Gaussian over which gradients are averaged at first, in pixels of the same grid, and at most in the map's own.
const SPREAD: f64 = 0.7;
const MOST_SPREAD: f64 = 6.0;

/// Iterations after which slopes find their neighbours anew.
const RENEW: usize = 10;

/// What a surface begins with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    pub pixels: usize,
    /// The largest albedo.
    pub most: f64,
    /// How much of the data its light explains, weighted and squared, in the mean over bins.
    pub explained: f64,
}

/// Refines the surface of what was `driven` for as many iterations more as `options` say, on the plan's own pixels, and tells
/// whether it is left out of the maps. These stay the volume's if there is no surface, if none of what is measured comes from
/// it, or if it explains that far worse than the volume did (which is told): it has one depth in a column, where a volume may
/// have several.
pub(super) fn refine(
    gpu: &Gpu,
    job: &mut Job<'_>,
    options: &VectorOptions,
    watch: &mut Watch<'_>,
    mut driven: Driven,
) -> Result<(Driven, bool)> {
    let (start, gpu_before) = (Instant::now(), job.executor.gpu_seconds());
    let (volume, iterations) = (driven.level, options.surface_iterations);
    let (levels, beginnings) = stages(&job.plan.surface, volume.pairs, iterations);
    let maps = driven.maps.finer(levels[0].grid.n[0] / volume.grid.n[0]);
    let pixels = Pixels::of(&maps, job.plan.pixels());
    let begin = driven.trace.last().map_or(0, |p| p.iteration);
    let first = levels[0];
    let found = if pixels.is_empty() { None } else { place(job, &first, &pixels, begin)? };
    let coarsest = job.plan.levels[0].grid;
    let weights = |level: &Level| found.map(|f| weights(&job.model, &coarsest, level, f, options));
    let told: Option<Vec<_>> = levels.iter().map(weights).collect();
    let first_blur = found.filter(|_| job.plan.blurred).and_then(|_| {
        let wide = options.surface_blur * first.grid.pitch.x * coarser(&coarsest, &first.grid);
        let noise = expected_noise(&job.model) / energy(&job.model, first.pairs);
        blur::first(wide / job.model.bin_width, noise)
    });
    let room = job.plan.tap_room();
    if let Some(told) = &told {
        if let Some(sigma) = first_blur {
            let words = blur::words(job.model.pulse.as_ref(), sigma, room);
            upload(&mut job.executor, "pulse_taps", bytemuck::cast_slice(&words))?;
        }
        upload(&mut job.executor, "surface_weights", bytemuck::cast_slice(&told[0]))?;
        upload(&mut job.executor, "columns", bytemuck::cast_slice(&columns(&maps)))?;
    }
    let loss = driven.trace.last().map_or(f64::INFINITY, |p| p.loss);
    // All of this is part of the solve; the driver's clock goes on from here.
    driven.seconds += start.elapsed().as_secs_f64();
    driven.gpu_seconds += job.executor.gpu_seconds() - gpu_before;
    let Some(told) = told else { return Ok((Driven { maps, ..driven }, false)) };
    let count = pixels.len();
    let steps = Steps {
        levels: &levels,
        start: Schedule::default(),
        iteration: &|plan, level, i| {
            let blur = first_blur.and_then(|_| blur::number(i - begin, iterations));
            let through = blur.map(|k| ((k + 1) * room) as u32);
            iteration(plan, level, count, i, i - begin, through)
        },
        due: &|_, level, done| {
            let mut s = Schedule::default();
            if let Some(next) = beginnings.iter().position(|from| *from == done - begin) {
                *level = next;
                s.extend(widen(&levels[*level], &told[*level]));
            }
            if (done - begin).is_multiple_of(RENEW) {
                s.extend(bonds(&levels[*level], count));
            }
            s
        },
        extract: &|level| extract(level, count),
        l1_weight: &|_| 1.0,
        of: begin + iterations,
        stop_below: None,
    };
    driven = drive(gpu, job, begin + iterations, steps, watch, None, Some(driven))?;
    // Without what its prior costs.
    let left = driven.trace.last().is_some_and(|p| objective_of(job, p.iteration - 1) > WORSE * loss);
    if left {
        driven.maps = maps;
    }
    driven.level = volume;
    Ok((driven, left))
}

/// Those of `levels` that are run, and the iteration from which each is: where early ones take a part of the pairs, the last
/// fifth takes as many as the volume `reached`; of few iterations all do.
fn stages(levels: &[Level], reached: usize, iterations: usize) -> (Vec<Level>, Vec<usize>) {
    let count = levels.iter().filter(|l| l.pairs <= reached).count().max(1);
    let first = if iterations < 5 { count - 1 } else { 0 };
    let left = |stage: usize| iterations / 5 * (count + 1 - stage) / 2;
    let from = |stage: usize| if stage == first { 0 } else { iterations.saturating_sub(left(stage)) };
    (levels[first..count].to_vec(), (first..count).map(from).collect())
}

/// Maps as the device holds them.
fn columns(maps: &Maps) -> Vec<[f32; 8]> {
    let of_pixel = |((a, z), n): ((&f32, &f32), &[f32; 3])| {
        let of = |v: f32| if z.is_finite() && v.is_finite() { v } else { 0.0 };
        let found = if z.is_finite() { 1.0 } else { 0.0 };
        [*a, of(*z), 0.0, found, of(n[0]), of(n[1]), of(n[2]), 0.0]
    };
    maps.albedo.iter().zip(&maps.depth).zip(&maps.normal).map(of_pixel).collect()
}

/// What goes on with more pairs.
fn widen(level: &Level, weights: &[f32; SURFACE_WEIGHTS as usize]) -> Schedule {
    let mut s = Schedule::default();
    for index in [SURFACE_BEND, SURFACE_JUMP] {
        s.set("surface_weights", index, weights[index as usize].to_bits());
    }
    s.dispatch("arguments", [1, 1, 1]).bind("scene", level.scene);
    s
}

/// Puts the pixels on the device with the albedos that explain most of the data; `None` if none do. Row `row` of the trace is
/// written on.
fn place(job: &mut Job<'_>, level: &Level, pixels: &Pixels, row: usize) -> Result<Option<Placed>> {
    let heights = |scale: f64| -> Vec<[f32; 2]> {
        pixels.depth.iter().zip(&pixels.albedo).map(|(z, a)| [*z, (scale * f64::from(*a)) as f32]).collect()
    };
    let ([x, y, _], points) = (level.grid.n, job.plan.points);
    upload(&mut job.executor, "pixels", bytemuck::cast_slice(&pixels.words()))?;
    upload(&mut job.executor, "pixel_of", bytemuck::cast_slice(&pixels.places(x * y)))?;
    upload(&mut job.executor, "heights", bytemuck::cast_slice(&heights(1.0)))?;
    let mut objective = |before: Schedule, residual| -> Result<f64> {
        let mut s = Schedule::default();
        s.stage("surface", &stage_values(level, row));
        s.extend(before);
        s.extend(render(&job.plan, level, pixels.len(), residual, None));
        s.dispatch("surface_finish", [1, 1, 1])
            .bind("scene", level.scene)
            .with(Push { iteration: row as u32, ..Default::default() });
        job.executor.run(&s)?;
        Ok(objective_of(job, row))
    };
    // |A v|² and |A v - h|², and so what factor of v leaves least.
    let rendered = objective(start(level, pixels.len(), points), "residual_bound")?;
    let left = objective(Schedule::default(), "residual")?;
    let measured = energy(&job.model, level.pairs);
    let scale = 0.5 * (rendered + measured - left) / rendered;
    if !(scale.is_finite() && scale > 0.0) {
        return Ok(None);
    }
    upload(&mut job.executor, "heights", bytemuck::cast_slice(&heights(scale)))?;
    let most = scale * f64::from(pixels.albedo.iter().fold(0.0f32, |a, b| a.max(*b)));
    Ok(Some(Placed { pixels: pixels.len(), most, explained: scale * scale * rendered }))
}

/// The data term in that row of the trace.
fn objective_of(job: &Job<'_>, row: usize) -> f64 {
    let rows: &[[u32; TRACE_ROW as usize]] = bytemuck::cast_slice(job.executor.arena.mapped("trace"));
    f64::from(f32::from_bits(rows[row][TRACE_OBJECTIVE as usize]))
}

/// The weighted mean of the squared measurement over the first `pairs`.
fn energy(model: &Model, pairs: usize) -> f64 {
    let square = |(i, m): (usize, &f32)| model.bin_weight(i % model.bins) * f64::from(*m).powi(2);
    let sum: f64 = model.measured[..pairs * model.bins].iter().enumerate().map(square).sum();
    sum / model.elements_of(pairs).max(1) as f64
}

/// What no surface need explain of the data term, where its light explains so much: photon noise and the model's own misfit.
fn unexplained(model: &Model, explained: f64) -> f64 {
    expected_noise(model).max(0.0) + MISFIT * MISFIT * explained
}

/// The buffer `surface_weights`, after levels of which the first had the grid `first`.
pub fn weights(
    model: &Model,
    first: &Grid,
    level: &Level,
    placed: Placed,
    options: &VectorOptions,
) -> [f32; SURFACE_WEIGHTS as usize] {
    // Half of chi² is the objective times this, inverted.
    let unit = 2.0 * unexplained(model, placed.explained) / model.elements_of(level.pairs).max(1) as f64;
    let most = placed.most;
    let sparse = options.surface_sparsity * placed.explained / (placed.pixels.max(1) as f64 * most);
    let pixel = (level.grid.pitch.x * level.grid.pitch.y).sqrt();
    let coarser = coarser(first, &level.grid);
    let mut all = [0.0; SURFACE_WEIGHTS as usize];
    for (index, value) in [
        (SURFACE_BEND, unit / (BEND * BEND)),
        (SURFACE_JUMP, unit / (JUMP * most).powi(2)),
        (SURFACE_DEPTH_RATE, (DEPTH_BINS * model.bin_width).min(DEPTH_PIXELS * pixel)),
        (SURFACE_ALBEDO_RATE, ALBEDO * most),
        (SURFACE_ITERATIONS, options.surface_iterations as f64),
        (SURFACE_SMOOTH, (SMOOTH * coarser).clamp(LEAST_SMOOTH, MOST_SMOOTH)),
        (SURFACE_SPREAD, (SPREAD * coarser).min(MOST_SPREAD)),
        (SURFACE_SPARSE, sparse),
        (SURFACE_FAINT, FAINT * most),
    ] {
        all[index as usize] = value as f32;
    }
    all
}

/// How many pixels of `maps` are as wide as one of the grid that a solve began with, which has what a scan tells apart; as one
/// with [`AMPLE`] a side where it is coarser.
fn coarser(first: &Grid, maps: &Grid) -> f64 {
    (first.pitch.x / maps.pitch.x).min(maps.n[0] as f64 / AMPLE as f64)
}

fn push(count: usize) -> Push {
    Push { last: count as u32, ..Default::default() }
}

/// Adam at rest, so many samples for each pixel, slopes from the depths at hand.
pub fn start(level: &Level, count: usize, points: usize) -> Schedule {
    let mut s = Schedule::default();
    s.fill("height_moments", count as u64 * 16, 0);
    s.set("counts", COUNT_ACTIVE, (points * count) as u32);
    s.dispatch("arguments", [1, 1, 1]).bind("scene", level.scene);
    s.extend(bonds(level, count));
    s
}

fn bonds(level: &Level, count: usize) -> Schedule {
    let mut s = Schedule::default();
    s.dispatch("surface_bonds", groups(count, WORKGROUP)).bind("scene", level.scene).with(push(count));
    s
}

/// Slopes and samples of the surface at hand.
pub fn points(level: &Level, count: usize) -> Schedule {
    let mut s = Schedule::default();
    s.dispatch("surface_points", groups(count, WORKGROUP)).bind("scene", level.scene).with(push(count));
    s
}

/// Renders the surface at hand and takes it in by the kernel `residual`.
fn render(
    plan: &Plan,
    level: &Level,
    count: usize,
    residual: &'static str,
    through: Option<u32>,
) -> Schedule {
    let mut s = points(level, count);
    s.extend(forward(plan, level, "forward"));
    s.extend(compare(plan, level, residual, Push::default(), through));
    s
}

/// Iteration `i` of the whole solve (from 0), `at` of the surface: points, forward, weighted residual, gather, combine,
/// pull, step, finish. Residuals go `through` the taps that begin at that word of `pulse_taps`, or the pulse's own if there is
/// one.
pub fn iteration(
    plan: &Plan,
    level: &Level,
    count: usize,
    i: usize,
    at: usize,
    through: Option<u32>,
) -> Schedule {
    let scene = level.scene;
    let mut s = render(plan, level, count, "residual", through);
    let push = Push { iteration: i as u32, step: at as u32 + 1, ..push(count) };
    let from = if through.is_some() { "spread" } else { plan.residual() };
    s.extend(gather(plan, level, "surface_gather", ARGUMENTS_BACKWARD, 0, from));
    s.dispatch("surface_combine", groups(count, WORKGROUP)).bind("scene", scene).with(push);
    s.dispatch("surface_pull", groups(count, WORKGROUP)).bind("scene", scene).with(push);
    s.dispatch("surface_step", groups(count, WORKGROUP)).bind("scene", scene).with(push);
    s.dispatch("surface_finish", [1, 1, 1]).bind("scene", scene).with(push);
    s
}

/// The maps with the surface in them, in `columns_host`.
pub fn extract(level: &Level, count: usize) -> Schedule {
    let mut s = points(level, count);
    s.dispatch("surface_extract", groups(count, WORKGROUP)).bind("scene", level.scene).with(push(count));
    let columns = level.grid.n[0] * level.grid.n[1];
    s.copy("columns", "columns_host", columns as u64 * 32);
    s
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::transport::{Grid, Volume};

    #[test]
    fn the_last_iterations_take_all_pairs() {
        let volume = Volume { min: dvec3(-0.5, -0.5, 0.3), max: dvec3(0.5, 0.5, 0.8) };
        let grid = Grid::new(volume, 32, 0.05).unwrap();
        let level = |pairs| Level { grid, pairs, wall: "wall", scene: "scene_0", reachable: "reachable_0" };
        let levels = [1024, 4096, 16_384, 65_536].map(level);
        let of = |reached, iterations| {
            let (levels, beginnings) = stages(&levels, reached, iterations);
            levels.iter().map(|l| l.pairs).zip(beginnings).collect::<Vec<_>>()
        };
        assert_eq!(of(65_536, 60), [(1024, 0), (4096, 36), (16_384, 42), (65_536, 48)]);
        // A volume that ended early: no more pairs than it had.
        assert_eq!(of(4096, 60), [(1024, 0), (4096, 48)]);
        assert_eq!(of(256, 60), [(1024, 0)]);
        assert_eq!(of(4096, 5), [(1024, 0), (4096, 4)]);
        assert_eq!(of(4096, 4), [(4096, 0)]);
    }
}
