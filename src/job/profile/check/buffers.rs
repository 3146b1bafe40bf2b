//! Reads and writes the device's buffers for a check.

use glam::dvec3;

use crate::Result;
use crate::gpu::{Buffer, BufferPlan, Command, Gpu, Place, Schedule};
use crate::solve::{OnDevice, Plan, upload};
use crate::transport::Model;
use crate::transport::kernels::buffer;
use crate::transport::twin::{Raw, Sample};

/// The buffer through which the others are read.
const BACK: Buffer = Buffer::named("back");

/// The job, with one more buffer through which the others are read.
pub fn readable(gpu: &Gpu, model: Model, mut plan: Plan) -> Result<OnDevice> {
    let largest = plan.buffers.iter().map(|b| b.bytes).max().unwrap_or(0);
    plan.buffers.push(BufferPlan::new(BACK, largest, Place::Readback));
    OnDevice::new(gpu, model, plan, None)
}

/// Fills these buffers with zeros.
pub fn zeroed(job: &OnDevice, buffers: &[Buffer]) -> Schedule {
    let mut s = Schedule::default();
    buffers.iter().for_each(|buffer| s.fill(*buffer, job.plan.bytes_of(*buffer), 0));
    s
}

pub fn read<T: bytemuck::Pod>(job: &mut OnDevice, from: Buffer, count: usize) -> Result<Vec<T>> {
    let bytes = count * size_of::<T>();
    if bytes == 0 {
        return Ok(vec![]);
    }
    let mut s = Schedule::default();
    let (to, bytes) = (BACK, bytes as u64);
    s.commands.push(Command::Copy { from, from_offset: 0, to, to_offset: 0, bytes });
    job.executor.run(&s)?;
    Ok(job.executor.read(BACK, ..count))
}

pub fn read_floats(job: &mut OnDevice, from: Buffer, count: usize) -> Result<Vec<f64>> {
    Ok(read::<f32>(job, from, count)?.into_iter().map(f64::from).collect())
}

/// The residual that gradients gather from, `[pair * bins + bin]`.
pub fn read_residual(job: &mut OnDevice) -> Result<Vec<f64>> {
    let (from, level) = (job.plan.residual(), job.plan.finest());
    let cells = crate::transport::cells(level.rendered.count, job.plan.scene.bins);
    let all = read_floats(job, from, cells)?;
    Ok(job.model.bins_of(&all))
}

pub fn read_raw(job: &mut OnDevice, from: Buffer, count: usize) -> Result<Vec<Raw>> {
    Ok(read::<[f32; 4]>(job, from, count)?.into_iter().map(|r| r.map(f64::from)).collect())
}

pub fn read_samples(job: &mut OnDevice, count: usize) -> Result<Vec<Sample>> {
    let points = read_raw(job, buffer::SAMPLE_POINTS, count)?;
    let normals = read_raw(job, buffer::SAMPLE_NORMALS, count)?;
    let one = |(p, n): (&Raw, &Raw)| Sample {
        point: dvec3(p[0], p[1], p[2]),
        albedo: p[3],
        normal: dvec3(n[0], n[1], n[2]),
        length: n[3],
    };
    Ok(points.iter().zip(&normals).map(one).collect())
}

pub fn write_raw(job: &mut OnDevice, to: Buffer, raw: &[Raw]) -> Result<()> {
    let words: Vec<[f32; 4]> = raw.iter().map(|r| r.map(|v| v as f32)).collect();
    upload(&mut job.executor, to, bytemuck::cast_slice(&words))
}
