//! A planned solve whose buffers can be read and written by name.

use std::sync::Arc;

use thirdbounce::Result;
use thirdbounce::closed_form::plan_of_projection;
use thirdbounce::engine::{Level, OnDevice, Plan, Tuning, UPLOAD};
use thirdbounce::gpu::{
    Abilities, Buffer, BufferPlan, Command, Constant, Gpu, Kernel, KernelCode, Place, Schedule,
};
use thirdbounce::learned::schedule::LEARNED_KERNELS;
use thirdbounce::methods::{PaperOptions, paper};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::{Grid, Model};
use thirdbounce_kernels::Cells;

use crate::scenes::FitNeeds;

/// The buffer through which the host reads others.
const BACK: Buffer = Buffer::named("back");

/// What a job runs.
#[derive(Clone, Copy)]
pub enum Needs<'n> {
    /// The paper's solver.
    Paper(&'n PaperOptions),
    /// A fit of a surface.
    Fit(&'n FitNeeds),
    /// A back-projection on a grid whose cells are the maps' pixels.
    Projection,
}

impl<'n> From<&'n PaperOptions> for Needs<'n> {
    fn from(options: &'n PaperOptions) -> Needs<'n> {
        Needs::Paper(options)
    }
}

impl<'n> From<&'n FitNeeds> for Needs<'n> {
    fn from(fit: &'n FitNeeds) -> Needs<'n> {
        Needs::Fit(fit)
    }
}

impl Needs<'_> {
    fn plan(self, model: &Model, grid: Grid, device: &Abilities) -> Result<Plan> {
        // Levels follow the resolution of the grid instead of that of the scan.
        let all = [1, model.pairs()];
        match self {
            Needs::Paper(options) => {
                let scan = if options.domain.coarse_to_fine { [1, grid.n[0] / 2] } else { all };
                paper::plan(model, grid, scan, options, device, false)
            }
            Needs::Fit(fit) => fit.plan(model, grid, all, device),
            Needs::Projection => plan_of_projection(model, grid, all, 1, device),
        }
    }
}

/// A job whose device buffers are filled with NaN bits, except for the content that [`OnDevice::upload`] writes. Kernels
/// are made when a schedule runs them.
///
/// # Errors
/// As [`Plan::open`] and [`OnDevice::new`].
pub fn job<'n>(
    gpu: &Gpu,
    model: &Model,
    grid: &Grid,
    needs: impl Into<Needs<'n>>,
    tune: impl FnOnce(&mut Tuning),
) -> Result<OnDevice> {
    job_with(gpu, model, grid, needs.into(), &[], tune)
}

/// As [`job`], with more buffers.
///
/// # Errors
/// As [`job`].
pub(crate) fn job_with(
    gpu: &Gpu,
    model: &Model,
    grid: &Grid,
    needs: Needs<'_>,
    more: &[BufferPlan],
    tune: impl FnOnce(&mut Tuning),
) -> Result<OnDevice> {
    // Passes over pairs are divided as the kernels need it, not by what the device gets at once: sums keep their order.
    let mut device = gpu.abilities();
    device.limits.work = u64::MAX;
    let mut plan = needs.plan(model, *grid, &device)?;
    plan.tune(tune);
    // Room for partial sums of smaller groups than the plan's own.
    for b in plan.buffers.iter_mut().filter(|b| b.buffer.to_string().ends_with("_partials") && b.bytes > 0) {
        b.bytes = b.bytes.max(grid.storage() as u64 * 4);
    }
    plan.buffers.extend(more.iter().map(|b| BufferPlan { place: Place::Device, ..b.clone() }));
    let largest = plan.buffers.iter().map(|b| b.bytes).max().unwrap_or(0);
    plan.buffers.push(BufferPlan::new(BACK, largest, Place::Readback));
    plan.buffers.iter_mut().filter(|b| b.buffer == UPLOAD).for_each(|b| b.bytes = largest);
    let all = std::mem::take(&mut plan.passes);
    let mut job = OnDevice::new(gpu, model.clone(), plan, None)?;
    Arc::make_mut(&mut job.plan).passes = all;
    let mut poison = Schedule::default();
    for b in job.plan.buffers.iter().filter(|b| b.place == Place::Device) {
        poison.fill(b.buffer, b.bytes, u32::MAX);
    }
    job.executor.run(&poison)?;
    job.upload()?;
    Ok(job)
}

/// The module of a kernel of a plan with its constants; of a kernel that no solver has, the module of its name.
pub fn code_of(job: &OnDevice, kernel: Kernel) -> (&'static KernelCode, Vec<(Constant, u32)>) {
    if let Some((_, code, constants)) = LEARNED_KERNELS.iter().find(|k| k.0 == kernel) {
        return (code, constants.to_vec());
    }
    match job.plan.passes.iter().find(|pass| pass.kernel == kernel) {
        Some(pass) => ((pass.code)(&job.plan), pass.values(&job.plan)),
        None => {
            let code = KERNELS.iter().find(|code| code.name == kernel.name());
            (code.unwrap_or_else(|| unreachable!("{kernel} is no kernel")), vec![])
        }
    }
}

/// Makes the kernels that the schedule runs, unless they are made, and runs it.
///
/// # Errors
/// The device fails.
pub fn perform(job: &mut OnDevice, schedule: &Schedule) -> Result<()> {
    for command in &schedule.commands {
        let Command::Dispatch { kernel, .. } = command else { continue };
        if !job.executor.has_kernel(*kernel) {
            let (code, constants) = code_of(job, *kernel);
            job.executor.add_kernel(*kernel, code, &constants)?;
        }
    }
    job.executor.run(schedule)
}

/// The words of a buffer.
///
/// # Errors
/// The device fails.
pub fn read_words(job: &mut OnDevice, from: Buffer) -> Result<Vec<u32>> {
    let bytes = job.plan.bytes_of(from) / 4 * 4;
    let is_read = job.plan.buffers.iter().any(|b| b.buffer == from && b.place == Place::Readback);
    if is_read || bytes == 0 {
        return Ok(if bytes == 0 { vec![] } else { job.executor.read(from, ..bytes as usize / 4) });
    }
    let mut s = Schedule::default();
    s.copy(from, BACK, bytes);
    job.executor.run(&s)?;
    Ok(job.executor.read(BACK, ..bytes as usize / 4))
}

/// Writes the first words of a buffer.
///
/// # Errors
/// The device fails.
pub fn write<T: bytemuck::NoUninit>(job: &mut OnDevice, to: Buffer, values: &[T]) -> Result<()> {
    job.add(to, bytemuck::cast_slice(values))?;
    job.run(|_, _| ())
}

/// Buffers of integers, or of floats by their bits beside integers.
const WORDS: &[Buffer] = &[
    buffer::ACTIVE_VOXELS,
    buffer::ARGUMENTS,
    buffer::BRICK_OFFSETS,
    buffer::COUNTS,
    buffer::LEARNED_WEIGHTS,
    buffer::LEVELS,
    buffer::MASK,
    buffer::MASK_BEFORE,
    buffer::PIXELS,
    buffer::PIXEL_OF,
    buffer::RANKS,
    buffer::RANKS_BEFORE,
    buffer::RIM_BEFORE,
    buffer::RIM_MASK,
    buffer::RIM_RANKS,
    buffer::RIM_RANKS_BEFORE,
    buffer::SPOT_TAPS,
    buffer::TRACE,
];

/// The content of a buffer in float64.
///
/// # Errors
/// The device fails.
pub fn decode(job: &mut OnDevice, buffer: Buffer, words: Vec<u32>) -> Result<Cells<f64>> {
    let of_level = |l: &Level| [l.reachable, l.scene, l.rendered.scene].contains(&buffer);
    let is_block = [buffer::PAPER, buffer::SURFACE].contains(&buffer)
        || job.plan.blocks.iter().any(|(block, _)| *block == buffer);
    if is_block || WORDS.contains(&buffer) || job.plan.levels.volume.iter().any(of_level) {
        return Ok(Cells::Words(words));
    }
    if buffer != buffer::HISTOGRAMS || !job.plan.fixed_point() {
        return Ok(Cells::Floats(words.into_iter().map(|w| f32::from_bits(w).into()).collect()));
    }
    // As in `glsl/include/fixed.glsl`.
    let counts = read_words(job, buffer::COUNTS)?;
    let exponent = |v: f32| if v == 0.0 { 0 } else { v.log2().floor() as i32 + 1 };
    let (active, level) = (counts[COUNT_ACTIVE as usize], job.plan.finest());
    let bound = job.model.scene_of(&level.grid, level.pairs).kernel_bound;
    let bits = u32::BITS as i32 - active.leading_zeros() as i32;
    let peak = f32::from_bits(counts[COUNT_PEAK_ALBEDO as usize]);
    let scale = 2f64.powi(-(61 - exponent(peak) - exponent(bound) - bits).clamp(-120, 120));
    let value = |[low, high]: &[u32; 2]| ((u64::from(*high) << 32 | u64::from(*low)) as i64) as f64 * scale;
    Ok(Cells::Floats(words.as_chunks().0.iter().map(value).collect()))
}

/// Sets the bins of all histograms to zero, and all bits of their padding.
///
/// # Errors
/// The device fails.
pub fn zero_histograms(job: &mut OnDevice) -> Result<()> {
    let words = if job.plan.fixed_point() { 2 } else { 1 };
    let (pairs, stride) = (job.plan.finest().rendered.count, job.model.stride());
    let cells = thirdbounce::transport::cells(pairs, job.model.bins);
    let padding = |cell: usize| if cell % stride < PADDING as usize { u32::MAX } else { 0 };
    let all: Vec<u32> = (0..cells * words).map(|word| padding(word / words)).collect();
    write(job, buffer::HISTOGRAMS, &all)
}
