//! The surface: a depth and an albedo for every pixel, refined together from the volume's maps.
//!
//! A voxel's centre stands for a square of surface whose paths differ by several bins, and a slanted surface lies in
//! several voxels of a column. So a volume keeps normals too level and depths to a voxel, however long it is solved
//! (study in benches/NOTES.md). Here a pixel, as wide as a voxel or less, is its tilted square, rendered as four
//! points or one. Its normal is that of the plane through its neighbours: shading and shape are one.
//!
//! The objective is the vector solver's, with a Gaussian prior instead of its other terms: neighbours lie in each
//! other's planes and have similar albedos, weighted by the noise of the histograms ([`weights()`]). Adam minimises it;
//! its gradients are averaged over their surroundings at first. Its iterations take a quarter of the pairs in turns: Adam
//! averages their gradients, and the result is that of all pairs in each (study in benches/studies/pairs.md). The pixels
//! are the bright ones of the maps ([`Pixels`]); depths stay within the grid. Where the volume shows two surfaces behind
//! each other, both are refined, each in a layer of its own ([`layers`]).

use std::time::Instant;

use super::drive::{Driven, Steps, Watch, drive, stage_values};
use super::estimate::{energy, expected_noise};
use super::on_device::{OnDevice, read_maps, trace_rows, upload};
use super::outline::{self, TimedSchedule};
use super::over_pairs::{scene_of_sums, turns_of_finish};
use super::passes::objective;
use super::{Level, Plan};
use crate::Result;
use crate::gpu::{Gpu, Schedule};
use crate::maps::Maps;
use crate::transport::Grid;
use crate::transport::kernels::*;

mod beginning;
pub mod blur;
pub mod layers;
mod needs;
mod options;
pub mod passes;
mod pixels;
mod schedule;
mod stairs;
mod weights;

pub(super) use beginning::{Beginning, Continuation};
pub use needs::{SMALL_PIXEL, buffers, is_blurred, left_out, more_taps, pixels, points_of, points_per_pixel};
pub use options::SurfaceOptions;
use pixels::support;
pub use pixels::{Pixels, SUPPORT};
pub use schedule::{bonds, divide, extract, extract_behind, iteration, points, render, start};
use weights::coarser;
pub use weights::{Placed, weights};

/// The surface is rejected if its objective exceeds the volume's by this ratio.
const WORSE: f64 = 2.0;

/// The bonds and the weights of the prior are found again after every Nth iteration.
const RENEW: usize = 10;

/// A volume's maps after the surface.
pub(super) struct Refined {
    /// The solve.
    pub driven: Driven,
    /// The surface was rejected because it explains the data far worse than the volume did: it has one depth in a
    /// column, or two, where a volume may have several. The maps are the volume's then.
    pub left: bool,
    /// Pixels of the surface; 0 if there is none, or if it explains none of the data.
    pub pixels: usize,
}

/// Sets to zero what sums begin with, where no volume was solved before: its start does so.
pub(super) fn cleared(s: &mut Schedule, plan: &Plan) {
    for cleared in [buffer::COUNTS, buffer::HISTOGRAMS] {
        s.fill(cleared, plan.bytes_of(cleared), 0);
    }
}

/// Refines the surface of `driven` for as many iterations as `options` say, on the plan's own pixels. After a frame, it goes
/// on from that one's surface, as the second half of twice as many iterations, and all of them take all pairs.
pub(super) fn refine(
    gpu: &Gpu,
    job: &mut OnDevice,
    options: &SurfaceOptions,
    watch: &mut Watch<'_>,
    mut driven: Driven,
    beginning: Beginning<'_>,
) -> Result<Refined> {
    let (start, gpu_before) = (Instant::now(), job.executor.gpu_seconds());
    let (volume, iterations) = (driven.level, options.iterations);
    let level = job.plan.levels.pixels.expect("a surface is part of the plan");
    let (on, second) = match beginning {
        Beginning::Volume => (None, Some(behind(job, &volume)?)),
        Beginning::Frame(on) => (Some(on), Some(behind(job, &volume)?)),
        Beginning::Kept(behind) => (None, Some(behind.clone())),
        Beginning::Maps => (None, None),
    };
    let skipped = if on.is_some() { iterations } else { 0 };
    let options = &SurfaceOptions { iterations: iterations + skipped, ..options.clone() };
    let mut layers = match second {
        Some(second) => begun(job, &driven, second, level.grid.n[0] / volume.grid.n[0]),
        None => vec![driven.maps.clone()],
    };
    if let (Some(on), [only]) = (&on, &mut layers[..]) {
        on.begin(only, volume.grid.pitch.z);
    }
    let pixels = Pixels::of(&layers, support(&job.plan), pixels(&job.plan));
    let begin = driven.trace.last().map_or(0, |p| p.iteration);
    let found = if pixels.is_empty() { None } else { place(job, &level, &pixels, begin)? };
    let coarsest = job.plan.levels.volume[0].grid;
    let mut weights = found.map(|f| weights(&job.model, &coarsest, &level, f, options));
    on.iter().for_each(|on| weights.iter_mut().for_each(|weights| on.pace(&driven.maps, weights)));
    let first_blur = found.filter(|_| is_blurred(&job.plan) && on.is_none()).and_then(|_| {
        let wide = options.blur * level.grid.pitch.x * coarser(&coarsest, &level.grid);
        let noise = expected_noise(&job.model) / energy(&job.model, level.pairs);
        blur::first(wide / job.model.bin_width, noise)
    });
    let room = job.plan.tap_room();
    if let Some(weights) = &weights {
        if let Some(sigma) = first_blur {
            let words = blur::words(job.model.pulse.as_ref(), sigma, room);
            upload(&mut job.executor, buffer::PULSE_TAPS, bytemuck::cast_slice(&words))?;
        }
        upload(&mut job.executor, buffer::SURFACE_WEIGHTS, bytemuck::cast_slice(weights))?;
        upload(&mut job.executor, buffer::COLUMNS, bytemuck::cast_slice(&columns(&layers[0])))?;
        job.executor.run_once(|s| divide(s, &job.plan))?;
    }
    let loss = driven.trace.last().map_or(f64::INFINITY, |p| p.loss);
    // All of this is part of the solve; the driver's clock continues from here.
    driven.seconds += start.elapsed().as_secs_f64();
    driven.gpu_seconds += job.executor.gpu_seconds() - gpu_before;
    let brightest = |driven: &Driven| driven.maps.finer(layers[0].nx / driven.maps.nx);
    if weights.is_none() {
        let driven = Driven { maps: brightest(&driven), ..driven };
        return Ok(Refined { driven, left: false, pixels: 0 });
    }
    let volumes = brightest(&driven);
    let of_layers = pixels.of_layers(volumes.albedo.len());
    let steps = Steps {
        until: on.and_then(|on| on.until),
        ..steps(&job.plan, level, of_layers, begin, [skipped, iterations], first_blur.map(|_| room))
    };
    driven = drive(gpu, job, begin + iterations, steps, watch, Some(driven))?;
    // Without the cost of the prior.
    let most = match volume.sum {
        1 => WORSE * loss,
        // The volume's loss is that of wider bins: its share of the data counts, and narrow bins have more noise.
        _ => {
            let share = loss / energy(job.model_of(&volume), volume.pairs);
            WORSE * share * energy(&job.model, volume.pairs) + expected_noise(&job.model).max(0.0)
        }
    };
    let left = driven.trace.last().is_some_and(|p| objective_of(job, p.iteration - 1) > most);
    if left {
        driven.maps = volumes;
    } else if let [_, behind] = &layers[..] {
        driven.maps = with_both(job, &driven, behind, of_layers)?;
    }
    driven.level = volume;
    Ok(Refined { driven, left, pixels: pixels.len() })
}

/// The maps of the second surfaces in the columns of the volume that is on the device.
pub(super) fn behind(job: &mut OnDevice, level: &Level) -> Result<Maps> {
    job.executor.run_once(|s| extract_behind(s, level))?;
    Ok(read_maps(&job.executor, &level.grid, job.plan.scene.reflectance.has_normals()))
}

/// The maps that the surface begins with, one for each layer, with each pixel of the volume's divided into `factor` ×
/// `factor`. A second layer is there only if the volume shows it.
fn begun(job: &OnDevice, driven: &Driven, second: Maps, factor: usize) -> Vec<Maps> {
    let level = driven.level;
    let least = least(&job.plan, &level.grid);
    let layers = layers::split(&driven.maps, &second, least);
    let layers = layers.map_or_else(|| vec![driven.maps.clone()], Vec::from);
    let mut layers: Vec<Maps> = match factor {
        1 => layers,
        _ => layers.iter().map(|maps| maps.finer(factor)).collect(),
    };
    let pixel = level.grid.pitch.x / factor as f64;
    layers.iter_mut().for_each(|maps| stairs::level(maps, level.grid.pitch.z, pixel));
    layers
}

/// Pixels of the smallest region with two surfaces that counts.
fn least(plan: &Plan, grid: &Grid) -> f64 {
    layers::LEAST_CELLS * coarser(&plan.levels.volume[0].grid, grid).powi(2)
}

/// The maps of both refined layers. Those of the first are in `driven`; the second layer began with `behind`.
fn with_both(job: &mut OnDevice, driven: &Driven, behind: &Maps, of_layers: [usize; 2]) -> Result<Maps> {
    let level = driven.level;
    upload(&mut job.executor, buffer::COLUMNS, bytemuck::cast_slice(&columns(behind)))?;
    job.executor.run_once(|s| extract(s, &level, of_layers, 1))?;
    let behind = read_maps(&job.executor, &level.grid, job.plan.scene.reflectance.has_normals());
    Ok(layers::merge(&[driven.maps.clone(), behind], least(&job.plan, &level.grid)))
}

/// The steps that the driver runs: `iterations` of a surface with so many pixels in each layer, after `begin` of the
/// volume, as if so many as `skipped` had been done. Maps on the way show the first layer. `taps` are the words of a set of taps; with them, residuals go through
/// a Gaussian at first.
fn steps(
    plan: &Plan,
    level: Level,
    of_layers: [usize; 2],
    begin: usize,
    [skipped, iterations]: [usize; 2],
    taps: Option<usize>,
) -> Steps<'static> {
    let count = of_layers.iter().sum();
    Steps {
        levels: vec![plan.batch(0).copied().unwrap_or(level)],
        start: Box::new(|_, _| ()),
        iteration: Box::new(move |s, plan, level, i| {
            let blur = taps.and_then(|room| blur::number(i - begin, iterations).map(|k| (k + 1) * room));
            iteration(
                s,
                plan,
                level,
                count,
                [i, i - begin, skipped, skipped + iterations],
                blur.map(|word| word as u32),
            );
        }),
        due: Box::new(move |s, _, _, done| {
            if (done - begin).is_multiple_of(RENEW) {
                bonds(s, &level, count, done);
            }
        }),
        extract: Box::new(move |s, level| extract(s, level, of_layers, 0)),
        passes: [super::passes::ALL, passes::ALL],
        l1_weight: Box::new(|_| 1.0),
        of: begin + iterations,
        after: vec![],
        stop_below: None,
        shrinks: false,
        until: None,
    }
}

/// The schedules of a surface on all pixels that there is room for, after a volume with all pairs; empty without a
/// surface.
pub fn outline(plan: &Plan, options: &SurfaceOptions) -> Vec<TimedSchedule> {
    let begin = plan.demand.iterations[0];
    let parts = |steps| outline::of("surface", plan, &steps, begin..begin + options.iterations);
    whole(plan, options).map_or_else(Vec::new, parts)
}

/// Every schedule that [`refine`] may run.
///
/// # Errors
/// Those of `take`.
pub(super) fn each(
    plan: &Plan,
    options: &SurfaceOptions,
    take: &mut dyn FnMut(&Schedule) -> Result<()>,
) -> Result<()> {
    let Some(steps) = whole(plan, options) else { return Ok(()) };
    let begin = plan.demand.iterations[0];
    outline::each(plan, &steps, begin..begin + options.iterations, take)?;
    plan.levels.volume.iter().try_for_each(|level| take(&Schedule::of(|s| extract_behind(s, level))))?;
    take(&Schedule::of(|s| divide(s, plan)))?;
    take(&Schedule::of(|s| compared(s, plan, &steps.levels[0], 1, begin)))
}

/// The steps of [`outline`].
fn whole(plan: &Plan, options: &SurfaceOptions) -> Option<Steps<'static>> {
    let (level, iterations) = (plan.levels.pixels?, options.iterations);
    let (count, begin) = (pixels(plan), plan.demand.iterations[0]);
    let taps = is_blurred(plan).then_some(plan.tap_room());
    Some(Steps {
        start: Box::new(move |s, plan| start(s, &level, count, points_of(plan))),
        ..steps(plan, level, [count, 0], begin, [0, iterations], taps)
    })
}

/// What a volume's run tells of the surface after it: [`Steps::after`].
pub(super) fn ahead(plan: &Plan, iterations: usize) -> Vec<[f64; 2]> {
    let points = (points_of(plan) as f64).sqrt();
    let of = |level: &Level| vec![[level.grid.n[0] as f64 * points, level.pairs as f64]; iterations];
    plan.batch(0).or(plan.levels.pixels.as_ref()).map_or_else(Vec::new, of)
}

/// The maps in the layout of the device.
fn columns(maps: &Maps) -> Vec<[f32; 8]> {
    let of_pixel = |((a, z), n): ((&f32, &f32), &[f32; 3])| {
        let of = |v: f32| if z.is_finite() && v.is_finite() { v } else { 0.0 };
        let found = if z.is_finite() { 1.0 } else { 0.0 };
        [*a, of(*z), 0.0, found, of(n[0]), of(n[1]), of(n[2]), 0.0]
    };
    maps.albedo.iter().zip(&maps.depth).zip(&maps.normal).map(of_pixel).collect()
}

/// Uploads the pixels with the albedos that explain most of the data; `None` if none do. Overwrites row `row` of the
/// trace.
fn place(job: &mut OnDevice, level: &Level, pixels: &Pixels, row: usize) -> Result<Option<Placed>> {
    let heights = |scale: f64| -> Vec<[f32; 2]> {
        pixels.depth.iter().zip(&pixels.albedo).map(|(z, a)| [*z, (scale * f64::from(*a)) as f32]).collect()
    };
    let ([x, y, _], points) = (level.grid.n, points_of(&job.plan));
    upload(&mut job.executor, buffer::PIXELS, bytemuck::cast_slice(&pixels.words()))?;
    upload(&mut job.executor, buffer::PIXEL_OF, bytemuck::cast_slice(&pixels.places(x * y)))?;
    // |h|², |A v - h|² and |2 A v - h|² give the factor of v that leaves least.
    let mut left = [0.0; 3];
    for (times, left) in left.iter_mut().enumerate() {
        upload(&mut job.executor, buffer::HEIGHTS, bytemuck::cast_slice(&heights(times as f64)))?;
        job.executor.run_once(|s| {
            s.stage("surface", &stage_values(level, row));
            if times == 0 {
                start(s, level, pixels.len(), points);
            }
            compared(s, &job.plan, level, pixels.len(), row);
        })?;
        *left = objective_of(job, row);
    }
    let [measured, once, twice] = left;
    let rendered = 0.5 * (measured - 2.0 * once + twice);
    let scale = 0.5 * (rendered + measured - once) / rendered;
    if !(scale.is_finite() && scale > 0.0) {
        return Ok(None);
    }
    upload(&mut job.executor, buffer::HEIGHTS, bytemuck::cast_slice(&heights(scale)))?;
    let most = scale * f64::from(pixels.albedo.iter().fold(0.0f32, |a, b| a.max(*b)));
    let explained = scale * scale * rendered;
    Ok(Some(Placed { pixels: pixels.len(), most, explained, left: measured - explained }))
}

/// Renders so many pixels, and leaves the objective in row `row` of the trace.
fn compared(s: &mut Schedule, plan: &Plan, level: &Level, pixels: usize, row: usize) {
    render(s, plan, level, pixels, objective(plan), None);
    s.dispatch(&passes::SURFACE_FINISH, [1, 1, 1], turns_of_finish(plan))
        .bind(buffer::SCENE, scene_of_sums(plan, level))
        .with(Push { iteration: row as u32, ..Default::default() });
}

/// The data term in row `row` of the trace.
fn objective_of(job: &OnDevice, row: usize) -> f64 {
    f64::from(f32::from_bits(trace_rows(job, row..row + 1)[0][TRACE_OBJECTIVE as usize]))
}
