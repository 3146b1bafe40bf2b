//! Compares an iteration of the vector solver with the float64 twins.

use glam::{DVec3, dvec3};

use super::buffers::{read, read_floats, read_raw, read_residual, read_samples, readable};
use super::{Held, LATERAL, error};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::{Gpu, Schedule};
use crate::solve::{Accumulation, OnDevice, Plan, VectorOptions, default_volume, upload, vector};
use crate::transport::Grid;
use crate::transport::kernels::{MOMENTUM_BETA, MOMENTUM_SHARE, buffer};
use crate::transport::twin::{self, Raw, Sample, Twin};

/// The vector solver's job for a capture, on one grid.
pub fn job(gpu: &Gpu, capture: &Capture, options: &VectorOptions) -> Result<OnDevice> {
    let grid = Grid::new(default_volume(capture, options.domain.min_depth)?, LATERAL, capture.bin_width)?;
    let model = vector::model(capture, &grid, options);
    let plan = Plan::new(&model, grid, capture.scan, options, &gpu.abilities(), false)?;
    readable(gpu, model, plan)
}

pub fn check(gpu: &Gpu, capture: &Capture, accumulation: Accumulation) -> Result<Vec<Held>> {
    let options = VectorOptions::default().with(|o| {
        o.lateral = LATERAL;
        o.iterations = 2;
        o.domain.coarse_to_fine = false;
        o.accumulation = accumulation;
    });
    let mut job = job(gpu, capture, &options)?;
    let grid = job.plan.finest().grid;
    let model = job.model.clone();
    let twin = Twin { model: &model, grid: &grid };
    let hat = vector::hat(vector::HAT_SIGMA * grid.pitch.x / capture.bin_width, model.bins);
    upload(&mut job.executor, buffer::HAT_TAPS, bytemuck::cast_slice(&hat))?;
    let level = *job.plan.finest();
    let mut s = Schedule::of(|s| vector::start(s, &job.plan, &level, &options));
    // After the first iteration there is something to render. It leaves no momentum, so momentum is set here.
    vector::iteration(&mut s, &job.plan, &level, 0);
    s.set(buffer::MOMENTUM, MOMENTUM_BETA, 0.5f32.to_bits());
    job.executor.run(&s)?;

    let storage = grid.storage();
    let vectors = |raw: Vec<Raw>| -> Vec<DVec3> { raw.iter().map(|r| dvec3(r[0], r[1], r[2])).collect() };
    let count = read::<u32>(&mut job, buffer::COUNTS, 1)?[0] as usize;
    let active = read::<u32>(&mut job, buffer::ACTIVE_VOXELS, count)?;
    // Moves values from slots to storage indices, which the twins use.
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
    job.executor.run(&Schedule::of(|s| vector::iteration(s, &job.plan, &level, 1)))?;

    let mut all = vec![];
    let mut note = |pass, error| all.push(Held { pass, error });
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
    Ok(all)
}
