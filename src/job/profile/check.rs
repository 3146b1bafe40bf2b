//! Whether a device computes what the float64 twins do: an iteration of each solver and of the surface on a small
//! simulated scene, on every accumulation path that the device offers.

use std::collections::BTreeMap;

use glam::{DVec3, dvec3};
use serde::{Deserialize, Serialize};

use super::super::account::plain;
use crate::Result;
use crate::capture::{Capture, Pulse};
use crate::gpu::Gpu;
use crate::simulate::{RenderOptions, Scene, simulate};
use crate::solve::surface::{Pixels, Placed};
use crate::solve::{
    Accumulation, OnDevice, PaperOptions, Plan, Preset, VectorOptions, compact, default_volume, paper,
    surface, upload, vector,
};
use crate::transport::kernels::{MOMENTUM_BETA, MOMENTUM_SHARE, buffer};
use crate::transport::twin::{self, Height, Raw, Sample, Twin};
use crate::transport::{Grid, Model};

mod buffers;

use buffers::{read, read_floats, read_raw, read_residual, read_samples, readable, write_raw, zeroed};

/// A pass that was held against its twin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checked {
    pub solver: String,
    pub accumulation: String,
    /// "sample", "forward" (with the residual), "backward", "update", ...
    pub pass: String,
    /// Largest difference over the largest true value.
    pub error: f64,
    pub allowed: f64,
}

impl Checked {
    /// Not so if the device gave NaN.
    pub fn passed(&self) -> bool {
        self.error <= self.allowed
    }
}

/// fp32 over some thousand additions, whose sums may cancel.
const ALLOWED: f64 = 1e-4;

/// Runs and compares them all.
///
/// # Errors
/// The device's. A pass that differs is no error here: see [`Checked::passed`].
pub fn check(gpu: &Gpu) -> Result<Vec<Checked>> {
    let scene = Scene { scan: 6, bin_width: 0.02, ..Scene::named("letter-Z")? };
    let capture = simulate(&scene, &RenderOptions { noise: 0.2, ..RenderOptions::default() })?.capture;
    // An uneven one, three bins and a half from end to end.
    let pulse = Pulse { samples: vec![1.0, 4.0, 3.0, 2.0, 1.0], width: 0.014, start: -0.02 };
    let pulsed = Capture { pulse: Some(pulse), ..capture.clone() };
    let mut all = vec![];
    use Accumulation::{Cas, Fixed, Fixed32, Float, Owned};
    for accumulation in [Float, Fixed, Fixed32, Cas, Owned] {
        if accumulation == Float && !gpu.accumulations.float {
            continue;
        }
        check_paper(gpu, &capture, accumulation, &mut all)?;
        check_vector(gpu, &capture, accumulation, &mut all)?;
        check_surface(gpu, &capture, accumulation, &mut all)?;
        check_vector(gpu, &pulsed, accumulation, &mut all)?;
        check_surface(gpu, &pulsed, accumulation, &mut all)?;
    }
    Ok(all)
}

const LATERAL: usize = 12;

fn check_paper(
    gpu: &Gpu,
    capture: &Capture,
    accumulation: Accumulation,
    all: &mut Vec<Checked>,
) -> Result<()> {
    let options = PaperOptions {
        lateral: LATERAL,
        iterations: 1,
        coarse_to_fine: false,
        accumulation,
        ..PaperOptions::preset(Preset::Synthetic)
    };
    let grid = Grid::new(default_volume(capture, options.min_depth)?, LATERAL, capture.bin_width)?;
    let model = paper::model(capture, &grid, &options);
    let plan = Plan::new(&model, grid, capture.scan, &options, &gpu.abilities(), false)?;
    let mut job = readable(gpu, model, plan)?;
    let model = job.model.clone();
    let twin = Twin { model: &model, grid: &grid };

    let raw: Vec<Raw> = (0..grid.storage()).map(|i| random(i).map(|u| f64::from(3.0 * u - 1.5))).collect();
    let domain = domain(&twin, &raw);
    let (active, touched) = (twin::compact(&domain), twin::touched(&grid, &domain));
    let mut mask = vec![0u32; grid.storage() / 32];
    active.iter().for_each(|i| mask[*i as usize / 32] |= 1 << (i % 32));
    // State lies in the order of the touched voxels.
    let by_slot: Vec<Raw> = touched.iter().map(|i| raw[*i as usize]).collect();
    write_raw(&mut job, buffer::RAW, &by_slot)?;
    upload(&mut job.executor, buffer::MASK, bytemuck::cast_slice(&mask))?;
    let mut s =
        zeroed(&job, &[buffer::COUNTS, buffer::HISTOGRAMS, buffer::MOMENT_FIRST, buffer::MOMENT_SECOND]);
    s.extend(compact(&job.plan, job.plan.finest()));
    s.extend(paper::iteration(&job.plan, job.plan.finest(), 0, 1));
    job.executor.run(&s)?;

    // Every pass is held against its twin on what the pass before it left on the device.
    let mut note = |pass, error| all.push(checked("paper", accumulation, pass, error));
    let got = read_samples(&mut job, active.len())?;
    let want = twin::sample(&twin, 0, &active, &raw);
    let flat = |samples: &[Sample]| -> Vec<f64> {
        let one = |s: &Sample| [s.point.to_array(), s.normal.to_array(), [s.albedo, s.length, 0.0]].concat();
        samples.iter().flat_map(one).collect()
    };
    note("sample", error(&flat(&got), &flat(&want)));
    let residual = read_residual(&mut job)?;
    let (want, _) = twin::residual(&twin, &twin::forward(&twin, &got), &[]);
    note("forward", error(&residual, &want));
    let gradient = read_raw(&mut job, buffer::GRADIENT, active.len())?;
    note("backward", error(&gradient.concat(), &twin::backward(&twin, &got, &residual).concat()));
    let (mut want, rest) = (raw, vec![[0.0; 4]; grid.storage()]);
    let (mut first, mut second) = (rest.clone(), rest);
    twin::update(&twin, 0, 1, &active, &touched, &gradient, &mut want, &mut first, &mut second);
    // Adam's first step is the sign of a sum that may vanish: its moments tell whether the sum is right.
    let got = read_raw(&mut job, buffer::MOMENT_FIRST, touched.len())?;
    let want: Vec<Raw> = touched.iter().map(|i| first[*i as usize]).collect();
    note("update", error(&got.concat(), &want.concat()));
    Ok(())
}

/// The vector solver's job of that capture, on one grid.
fn vector_job<'g>(gpu: &'g Gpu, capture: &Capture, options: &VectorOptions) -> Result<OnDevice<'g>> {
    let grid = Grid::new(default_volume(capture, options.min_depth)?, LATERAL, capture.bin_width)?;
    let model = vector::model(capture, &grid, options);
    let plan = Plan::new(&model, grid, capture.scan, options, &gpu.abilities(), false)?;
    readable(gpu, model, plan)
}

fn check_vector(
    gpu: &Gpu,
    capture: &Capture,
    accumulation: Accumulation,
    all: &mut Vec<Checked>,
) -> Result<()> {
    let options = VectorOptions {
        lateral: LATERAL,
        iterations: 2,
        coarse_to_fine: false,
        accumulation,
        ..VectorOptions::default()
    };
    let mut job = vector_job(gpu, capture, &options)?;
    let grid = job.plan.finest().grid;
    let model = job.model.clone();
    let twin = Twin { model: &model, grid: &grid };
    let hat = vector::hat(vector::HAT_SIGMA * grid.pitch.x / capture.bin_width, model.bins);
    upload(&mut job.executor, buffer::HAT_TAPS, bytemuck::cast_slice(&hat))?;
    let level = *job.plan.finest();
    let mut s = vector::start(&job.plan, &level, &options);
    // After the first iteration there is something to render; momentum it must be given.
    s.extend(vector::iteration(&job.plan, &level, 0));
    s.set(buffer::MOMENTUM, MOMENTUM_BETA, 0.5f32.to_bits());
    job.executor.run(&s)?;

    let storage = grid.storage();
    let vectors = |raw: Vec<Raw>| -> Vec<DVec3> { raw.iter().map(|r| dvec3(r[0], r[1], r[2])).collect() };
    let count = read::<u32>(&mut job, buffer::COUNTS, 1)?[0] as usize;
    let active = read::<u32>(&mut job, buffer::ACTIVE_VOXELS, count)?;
    // What lies by slot, by storage index for the twins.
    let spread = |slots: Vec<Raw>| -> Vec<DVec3> {
        let mut all = vec![DVec3::ZERO; storage];
        active.iter().zip(vectors(slots)).for_each(|(i, v)| all[*i as usize] = v);
        all
    };
    let mut v = spread(read_raw(&mut job, buffer::RAW, count)?);
    let mut before = spread(read_raw(&mut job, buffer::BEFORE, count)?);
    let momentum = read_floats(&mut job, buffer::MOMENTUM, MOMENTUM_BETA.max(MOMENTUM_SHARE) as usize + 1)?;
    let by_slot = read_floats(&mut job, buffer::BOUNDS, 2 * count)?;
    let mut bounds = vec![[0.0; 2]; storage];
    active.iter().zip(by_slot.chunks(2)).for_each(|(i, b)| bounds[*i as usize] = [b[0], b[1]]);
    job.executor.run(&vector::iteration(&job.plan, &level, 1))?;

    let mut note = |pass, error| all.push(checked(named("vector", &model), accumulation, pass, error));
    let flat = |v: &[DVec3]| -> Vec<f64> { v.iter().flat_map(|v| v.to_array()).collect() };
    let directions = |s: &[Sample]| -> Vec<f64> { s.iter().flat_map(|s| s.normal.to_array()).collect() };
    let got = read_samples(&mut job, count)?;
    let want = twin::extrapolate(&twin, &active, &v, &before, momentum[MOMENTUM_BETA as usize]);
    note("extrapolate", error(&directions(&got), &directions(&want)));
    let residual = read_residual(&mut job)?;
    let accumulated = twin::forward(&twin, &got);
    let (want, _) = twin::residual_weighted(&twin, &accumulated, true);
    note("forward", error(&residual, &want));
    let gradient = twin::gradient_vectors(&twin, &got, &residual);
    let share = momentum[MOMENTUM_SHARE as usize];
    twin::step(&twin, &active, &got, &gradient, &bounds, share, &mut v, &mut before);
    note("backward", error(&flat(&spread(read_raw(&mut job, buffer::RAW, count)?)), &flat(&v)));
    Ok(())
}

fn check_surface(
    gpu: &Gpu,
    capture: &Capture,
    accumulation: Accumulation,
    all: &mut Vec<Checked>,
) -> Result<()> {
    let options = VectorOptions {
        lateral: LATERAL,
        surface_iterations: 1,
        surface_points: Some(4),
        coarse_to_fine: false,
        accumulation,
        ..VectorOptions::default()
    };
    let mut job = vector_job(gpu, capture, &options)?;
    let grid = job.plan.finest().grid;
    let (model, level, points) = (job.model.clone(), *job.plan.finest(), surface::points_of(&job.plan));
    let twin = Twin { model: &model, grid: &grid };
    // Three by four pixels of a slanted surface, as deep as it takes for no path to lie where a bin ends.
    let columns: Vec<u32> = (0..12u32).map(|i| (4 + i / 4) * LATERAL as u32 + 4 + i % 4).collect();
    let heights = |try_: u32| -> Vec<Height> {
        let height = |i: u32| Height {
            depth: f64::from(0.6 + 4e-4 * try_ as f32 + 0.01 * (i % 4) as f32 + 0.02 * (i / 4) as f32),
            albedo: f64::from(1.0 + random(i as usize)[0]),
        };
        (0..12).map(height).collect()
    };
    let clear = |h: &Vec<Height>| {
        let bonds = twin::surface_bonds(&twin, &columns, h);
        let (_, samples) = twin::surface_points(&twin, &columns, &bonds, h, points);
        samples.iter().all(|s| is_clear(&model, s.point, 0.5))
    };
    let heights = (0..100).map(heights).find(clear).unwrap_or_default();
    let of = |value: fn(&Height) -> f64| heights.iter().map(|h| value(h) as f32).collect::<Vec<_>>();
    let pixels = Pixels { depth: of(|h| h.depth), albedo: of(|h| h.albedo), columns };
    let words: Vec<[f32; 2]> = pixels.depth.iter().zip(&pixels.albedo).map(|(z, a)| [*z, *a]).collect();
    upload(&mut job.executor, buffer::PIXELS, bytemuck::cast_slice(&pixels.words()))?;
    upload(&mut job.executor, buffer::PIXEL_OF, bytemuck::cast_slice(&pixels.places(LATERAL * LATERAL)))?;
    upload(&mut job.executor, buffer::HEIGHTS, bytemuck::cast_slice(&words))?;
    let weights = {
        let placed = Placed { pixels: pixels.len(), most: 2.0, explained: 1.0 };
        surface::weights(&model, &grid, &level, placed, &options)
    };
    upload(&mut job.executor, buffer::SURFACE_WEIGHTS, bytemuck::cast_slice(&weights))?;
    let mut s = zeroed(&job, &[buffer::COUNTS, buffer::HISTOGRAMS]);
    s.extend(surface::start(&level, pixels.len(), points));
    s.extend(surface::iteration(&job.plan, &level, pixels.len(), 0, 0, None));
    job.executor.run(&s)?;

    let mut note = |pass, error| all.push(checked(named("surface", &model), accumulation, pass, error));
    let got = read_samples(&mut job, points * pixels.len())?;
    let bonds = twin::surface_bonds(&twin, &pixels.columns, &heights);
    let (_, want) = twin::surface_points(&twin, &pixels.columns, &bonds, &heights, points);
    let flat = |samples: &[Sample]| -> Vec<f64> {
        samples.iter().flat_map(|s| [s.point.to_array(), s.normal.to_array()].concat()).collect()
    };
    note("points", error(&flat(&got), &flat(&want)));
    let residual = read_residual(&mut job)?;
    let (want, _) = twin::residual_weighted(&twin, &twin::forward(&twin, &got), true);
    note("forward", error(&residual, &want));
    let pulls = twin::surface_gather(&twin, &got, &residual);
    let gradient = read_raw(&mut job, buffer::GRADIENT, got.len())?;
    let want: Vec<f64> = pulls.iter().flat_map(|p| [p.vector.x, p.vector.y, p.vector.z]).collect();
    let vectors: Vec<f64> = gradient.iter().flat_map(|g| g[..3].to_vec()).collect();
    note("backward", error(&vectors, &want));
    let depths: Vec<f64> = gradient.iter().map(|g| g[3]).collect();
    note("depth", error(&depths, &pulls.iter().map(|p| p.depth).collect::<Vec<_>>()));
    Ok(())
}

/// The pass of that name, and whether it goes through a pulse.
fn named(what: &str, model: &Model) -> String {
    format!("{what}{}", if model.pulse.is_some() { ", pulse" } else { "" })
}

fn checked(solver: impl Into<String>, accumulation: Accumulation, pass: &str, error: f64) -> Checked {
    let (solver, pass) = (solver.into(), pass.into());
    Checked { solver, accumulation: plain(&accumulation), pass, error, allowed: ALLOWED }
}

/// Four repeatable numbers in [0, 1).
fn random(i: usize) -> [f32; 4] {
    std::array::from_fn(|k| twin::random3(i as u32, k as u32, 0, 1)[0] as f32)
}

/// Whether no path by that point runs so near to where a bin begins (`part` 0) or to its centre (0.5) that fp32 and float64
/// may choose different ones.
fn is_clear(model: &Model, point: DVec3, part: f64) -> bool {
    (0..model.pairs()).all(|pair| {
        let position = (model.wall.path(pair, point) - model.t_start) / model.bin_width - part;
        (position - position.round()).abs() > 1e-4
    })
}

/// A fifth of the voxels that may be active, less those of which some path runs so near to the edge of a bin that
/// fp32 and float64 may choose different ones.
fn domain(twin: &Twin, raw: &[Raw]) -> Vec<bool> {
    let (model, grid) = (twin.model, twin.grid);
    let near = model.near_z(grid);
    let clear = |i: u32| {
        let s = twin::sample(twin, 0, &[i], raw)[0];
        is_clear(model, s.point, 0.0)
    };
    let on = |i: usize| {
        let c = grid.voxel(i);
        grid.contains(c) && c[2] >= near && random(i + 7919)[0] < 0.2 && clear(i as u32)
    };
    (0..grid.storage()).map(on).collect()
}

/// NaN if the device gave one.
fn error(got: &[f64], want: &[f64]) -> f64 {
    let largest = want.iter().fold(1e-300f64, |a, b| a.max(b.abs()));
    let worst = got.iter().zip(want).map(|(g, w)| (g - w).abs()).max_by(f64::total_cmp);
    worst.unwrap_or(f64::NAN) / largest
}

/// The largest error of every pass, for a table: ((solver, pass), error).
pub fn worst(all: &[Checked]) -> BTreeMap<(String, String), f64> {
    let mut worst = BTreeMap::new();
    for c in all {
        let error: &mut f64 = worst.entry((c.solver.clone(), c.pass.clone())).or_insert(0.0);
        // A NaN stays.
        *error = if c.error > *error || c.error.is_nan() { c.error } else { *error };
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::GpuOptions;

    #[test]
    fn this_device_computes_as_the_twins_on_every_path() {
        let gpu = Gpu::open(&GpuOptions::default()).expect("a Vulkan device: `make setup` installs lavapipe");
        let all = check(&gpu).unwrap();
        assert_eq!(all.len(), 18 * if gpu.accumulations.float { 5 } else { 4 });
        for c in &all {
            println!("{c:?}");
            assert!(c.passed() && c.error > 0.0, "{c:?}");
        }
        assert_eq!(worst(&all).len(), 18);
    }

    #[test]
    fn what_differs_does_not_pass() {
        let c = |error| checked("paper", Accumulation::Owned, "forward", error);
        assert!(c(1e-6).passed() && !c(1e-3).passed() && !c(f64::NAN).passed());
        assert!(worst(&[c(1e-6), c(f64::NAN), c(1e-5)]).values().all(|e| e.is_nan()));
        assert!(error(&[1.0, f64::NAN], &[1.0, 2.0]).is_nan());
        assert_eq!(error(&[1.0, 3.0], &[1.0, 2.0]), 0.5);
    }
}
