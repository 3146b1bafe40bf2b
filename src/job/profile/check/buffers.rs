//! What a check reads from the device and writes to it.

use glam::dvec3;

use crate::Result;
use crate::gpu::{BufferPlan, Command, Gpu, Place, Schedule};
use crate::solve::{Job, Plan, upload};
use crate::transport::Model;
use crate::transport::twin::{Raw, Sample};

/// The job with a buffer through which every other can be read.
pub fn readable<'g>(gpu: &'g Gpu, model: Model, mut plan: Plan) -> Result<Job<'g>> {
    let largest = plan.buffers.iter().map(|b| b.bytes).max().unwrap_or(0);
    plan.buffers.push(BufferPlan::new("back", largest, Place::Readback));
    Job::new(gpu, model, plan, None)
}

/// Fills these buffers with zeros.
pub fn zeroed(job: &Job<'_>, buffers: &[&'static str]) -> Schedule {
    let bytes = job.plan.bytes();
    let mut s = Schedule::default();
    buffers.iter().for_each(|buffer| s.fill(buffer, bytes[*buffer], 0));
    s
}

pub fn read<T: bytemuck::Pod>(job: &mut Job<'_>, from: &'static str, count: usize) -> Result<Vec<T>> {
    let bytes = count * size_of::<T>();
    if bytes == 0 {
        return Ok(vec![]);
    }
    let mut s = Schedule::default();
    let (to, bytes) = ("back", bytes as u64);
    s.commands.push(Command::Copy { from, from_offset: 0, to, to_offset: 0, bytes });
    job.executor.run(&s)?;
    Ok(bytemuck::pod_collect_to_vec(&job.executor.arena.mapped("back")[..bytes as usize]))
}

pub fn read_floats(job: &mut Job<'_>, from: &'static str, count: usize) -> Result<Vec<f64>> {
    Ok(read::<f32>(job, from, count)?.into_iter().map(f64::from).collect())
}

/// What gradients gather from, `[pair * bins + bin]`.
pub fn read_residual(job: &mut Job<'_>) -> Result<Vec<f64>> {
    let (from, cells) = (job.plan.residual(), job.model.cells());
    let all = read_floats(job, from, cells)?;
    Ok(job.model.bins_of(&all))
}

pub fn read_raw(job: &mut Job<'_>, from: &'static str, count: usize) -> Result<Vec<Raw>> {
    Ok(read::<[f32; 4]>(job, from, count)?.into_iter().map(|r| r.map(f64::from)).collect())
}

pub fn read_samples(job: &mut Job<'_>, count: usize) -> Result<Vec<Sample>> {
    let points = read_raw(job, "sample_points", count)?;
    let normals = read_raw(job, "sample_normals", count)?;
    let one = |(p, n): (&Raw, &Raw)| Sample {
        point: dvec3(p[0], p[1], p[2]),
        albedo: p[3],
        normal: dvec3(n[0], n[1], n[2]),
        length: n[3],
    };
    Ok(points.iter().zip(&normals).map(one).collect())
}

pub fn write_raw(job: &mut Job<'_>, to: &'static str, raw: &[Raw]) -> Result<()> {
    let words: Vec<[f32; 4]> = raw.iter().map(|r| r.map(|v| v as f32)).collect();
    upload(&mut job.executor, to, bytemuck::cast_slice(&words))
}
