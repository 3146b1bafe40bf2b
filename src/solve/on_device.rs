//! A planned solve on the device: its buffers and kernels, what is uploaded before it and read after it.

use std::ops::Range;

use super::Plan;
use super::over_pairs::sum_bins;
use super::plan::{COLUMNS_HOST, MASK_HOST, RAW_HOST, UPLOAD};
use crate::Result;
use crate::gpu::{Arena, Buffer, Command, Executor, Gpu, Schedule};
use crate::maps::Maps;
use crate::transport::kernels::{SceneData, TRACE_ROW, buffer};
use crate::transport::{Grid, Model};

/// A planned solve on the device: buffers allocated and filled, kernels made.
pub struct OnDevice<'g> {
    /// Levels, passes and buffers.
    pub plan: Plan,
    /// The capture as kernels see it.
    pub model: Model,
    /// The same in the volume's own bins, if these are wider.
    pub summed: Option<Model>,
    /// Runs schedules over the buffers.
    pub executor: Executor<'g>,
}

impl<'g> OnDevice<'g> {
    /// Allocates and uploads. `memory` is a budget in bytes.
    ///
    /// # Errors
    /// As [`Arena::new`], or the device fails.
    pub fn new(gpu: &'g Gpu, model: Model, plan: Plan, memory: Option<u64>) -> Result<OnDevice<'g>> {
        let arena = Arena::new(gpu, &plan.buffers, memory)?;
        let mut executor = Executor::new(gpu, arena)?;
        for pass in &plan.passes {
            executor.add_kernel(*pass, (pass.code)(&plan), &pass.values(&plan))?;
        }
        let summed = (plan.sum > 1).then(|| model.summed(plan.sum));
        let mut made = OnDevice { plan, model, summed, executor };
        made.upload()?;
        Ok(made)
    }

    /// Fills the buffers that hold the capture and the constants.
    ///
    /// # Errors
    /// The device fails.
    pub fn upload(&mut self) -> Result<()> {
        let OnDevice { plan, model, summed, executor } = self;
        upload(executor, buffer::WALL, bytemuck::cast_slice(&model.wall.words()))?;
        upload(executor, buffer::MEASURED, bytemuck::cast_slice(&model.measured))?;
        let mut taps = vec![(plan.taps.len() - 1) as f32];
        taps.extend(plan.taps.iter().map(|w| *w as f32));
        upload(executor, buffer::TAPS, bytemuck::cast_slice(&taps))?;
        if let Some(pulse) = &model.pulse {
            upload(executor, buffer::PULSE_TAPS, bytemuck::cast_slice(&pulse.words()))?;
        }
        if let Some(pulse) = summed.as_ref().and_then(|m| m.pulse.as_ref()) {
            upload(executor, plan.finest().taps, bytemuck::cast_slice(&pulse.words()))?;
        }
        for level in plan.levels.iter().chain(plan.pixels_only()) {
            let model = summed.as_ref().filter(|m| m.bins == level.bins).unwrap_or(model);
            let scene = model.scene_of(&level.grid, level.pairs);
            let [capacity, touched_capacity] = [plan.capacity, plan.touched_capacity].map(|v| v as u32);
            let scene = SceneData { capacity, touched_capacity, ..scene };
            upload(executor, level.scene, bytemuck::bytes_of(&scene))?;
        }
        for (level, reachable) in plan.levels.iter().zip(&plan.reachable) {
            let bricks: Vec<u32> = reachable.iter().map(|r| u32::from(*r)).collect();
            upload(executor, level.reachable, bytemuck::cast_slice(&bricks))?;
            if level.pairs < plan.pairs {
                upload(executor, level.wall, bytemuck::cast_slice(&model.wall.first(level.pairs).words()))?;
            }
        }
        executor.run(&sum_bins(plan))
    }

    /// The model in the bins of the volume's levels.
    pub fn of_volume(&self) -> &Model {
        self.summed.as_ref().unwrap_or(&self.model)
    }
}

/// Volume of a finished solve.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeMap {
    /// The grid of the last level.
    pub grid: Grid,
    /// Albedo, `[(ix * ny + iy) * nz + iz]`, 0 where inactive.
    pub albedo: Vec<f32>,
}

/// Copies `bytes` to a device buffer through the upload buffer, in as many parts as it takes.
///
/// # Errors
/// The device fails.
pub fn upload(executor: &mut Executor<'_>, buffer: Buffer, bytes: &[u8]) -> Result<()> {
    let size = executor.arena().size(UPLOAD) as usize;
    for (i, part) in bytes.chunks(size).enumerate() {
        executor.write(UPLOAD, part);
        let mut s = Schedule::default();
        s.commands.push(Command::Copy {
            from: UPLOAD,
            from_offset: 0,
            to: buffer,
            to_offset: (i * size) as u64,
            bytes: part.len() as u64,
        });
        executor.run(&s)?;
    }
    Ok(())
}

/// The maps that [`super::extract`] left in `columns_host`; without normals where the model has none.
pub(super) fn read_maps(executor: &Executor<'_>, grid: &Grid, has_normals: bool) -> Maps {
    let columns: Vec<[f32; 8]> = executor.read(COLUMNS_HOST, ..grid.n[0] * grid.n[1]);
    let pick = |found: bool, v: f32| if found { v } else { f32::NAN };
    let albedo: Vec<f32> = columns.iter().map(|c| c[0]).collect();
    Maps {
        nx: grid.n[0],
        ny: grid.n[1],
        extent: grid.extent(),
        depth: columns.iter().map(|c| pick(c[3] > 0.0, c[1])).collect(),
        normal: columns
            .iter()
            .map(|c| [c[4], c[5], c[6]].map(|v| pick(c[3] > 0.0 && has_normals, v)))
            .collect(),
        mask: Maps::mask_of(&albedo, Maps::MASK_FRACTION),
        mask_fraction: Maps::MASK_FRACTION,
        albedo,
    }
}

/// Rows of the trace. No submission may be in flight.
pub(super) fn trace_rows(device: &OnDevice<'_>, rows: Range<usize>) -> Vec<[u32; TRACE_ROW as usize]> {
    device.executor.read(buffer::TRACE, rows)
}

/// The volume whose mask and active voxels' state were copied to the host. `albedo` computes the albedo of a voxel
/// from its state.
pub(super) fn read_volume(executor: &Executor<'_>, grid: &Grid, albedo: fn([f32; 4]) -> f32) -> VolumeMap {
    let raw: Vec<[f32; 4]> = executor.read(RAW_HOST, ..);
    let mask: Vec<u32> = executor.read(MASK_HOST, ..);
    let active = |i: &usize| mask[i / 32] >> (i % 32) & 1 == 1;
    let mut all = vec![0.0; grid.voxels()];
    for (slot, i) in (0..grid.storage()).filter(active).enumerate() {
        let [x, y, z] = grid.voxel(i);
        // A full list has no state for the rest.
        let Some(state) = raw.get(slot) else { break };
        all[(x * grid.n[1] + y) * grid.n[2] + z] = albedo(*state);
    }
    VolumeMap { grid: *grid, albedo: all }
}
