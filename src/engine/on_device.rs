//! A planned solve on the device: its buffers and kernels, what is uploaded before it and read after it.

use std::ops::{ControlFlow, Range};
use std::sync::Arc;

use super::noise::{energy, expected_noise};
use super::plan::Plan;
use crate::Result;
use crate::engine::plan::{COLUMNS_HOST, MASK_HOST, RAW_HOST, UPLOAD};
use crate::engine::rounding;
use crate::gpu::{Arena, Buffer, Command, Executor, Gpu, Schedule, Ticket};
use crate::maps::Maps;
use crate::transport::kernels::{TRACE_ROW, buffer};
use crate::transport::{Grid, Model};

/// A planned solve on the device: buffers allocated and filled, kernels made.
pub struct OnDevice {
    /// Levels, passes and buffers.
    pub plan: Arc<Plan>,
    /// The capture as kernels see it.
    pub model: Model,
    /// Runs schedules over the buffers.
    pub executor: Executor,
    /// What it does first.
    pub(super) queue: Queued,
    /// What the driver works with.
    pub(super) lists: Lists,
    /// Photon noise and energy of the counts, once computed.
    light: Option<[f64; 2]>,
}

impl OnDevice {
    /// Allocates and uploads. `memory` is a budget in bytes.
    ///
    /// # Errors
    /// As [`Arena::new`], the device fails, or it does not round to nearest.
    pub fn new(gpu: &Gpu, model: Model, plan: impl Into<Arc<Plan>>, memory: Option<u64>) -> Result<OnDevice> {
        let mut made = OnDevice::queued(gpu, model, plan, memory)?;
        made.queue_counts()?;
        made.run(|_, _| ())?;
        Ok(made)
    }

    /// As [`OnDevice::new`] without the counts; what fills the buffers is part of the first submission.
    ///
    /// # Errors
    /// As [`OnDevice::new`].
    pub(crate) fn queued(
        gpu: &Gpu,
        model: Model,
        plan: impl Into<Arc<Plan>>,
        memory: Option<u64>,
    ) -> Result<OnDevice> {
        let plan = plan.into();
        rounding::check(gpu)?;
        let arena = Arena::new(gpu, &plan.buffers, memory)?;
        let mut executor = Executor::new(gpu, arena)?;
        let kernels: Vec<_> = plan.passes.iter().map(|pass| pass.wanted(&plan)).collect();
        executor.add_kernels(&kernels)?;
        let (queue, lists) = (Queued::default(), Lists::default());
        let mut made = OnDevice { plan, model, executor, queue, lists, light: None };
        made.queue_scan()?;
        Ok(made)
    }

    /// Puts another model with its plan in the place of its own. The plan's buffers and passes must be those of its own.
    ///
    /// # Errors
    /// The device fails.
    pub fn put(&mut self, model: Model, plan: Arc<Plan>) -> Result<()> {
        (self.plan, self.model) = (plan, model);
        self.upload()
    }

    /// Queues a copy of `bytes` to the beginning of a buffer.
    ///
    /// # Errors
    /// The device fails.
    pub fn add(&mut self, to: Buffer, bytes: &[u8]) -> Result<()> {
        self.queue.add(&mut self.executor, to, bytes)
    }

    /// Queues commands whose results are not awaited.
    pub(crate) fn queue(&mut self, write: impl FnOnce(&mut Schedule, &Plan)) {
        write(&mut self.queue.schedule, &self.plan);
    }

    /// Runs what is queued and what `write` adds as one submission, and waits.
    ///
    /// # Errors
    /// The device fails.
    pub fn run(&mut self, write: impl FnOnce(&mut Schedule, &Plan)) -> Result<()> {
        let OnDevice { plan, executor, queue, .. } = self;
        let mut schedule = executor.spare_schedule();
        queue.move_into(&mut schedule);
        write(&mut schedule, plan);
        let done = executor.run(&schedule);
        executor.keep_schedule(schedule);
        done
    }

    /// Fills the buffers that hold the capture and the constants.
    ///
    /// # Errors
    /// The device fails.
    pub fn upload(&mut self) -> Result<()> {
        self.queue_scan()?;
        self.queue_counts()?;
        self.run(|_, _| ())
    }

    /// Follows a change of the model's measured values and their variance.
    ///
    /// # Errors
    /// The device fails.
    pub(crate) fn queue_counts(&mut self) -> Result<()> {
        self.light = None;
        let OnDevice { plan, model, executor, queue, .. } = self;
        queue.add_scenes(executor, plan, model)?;
        queue.add(executor, buffer::MEASURED, bytemuck::cast_slice(&model.measured))
    }

    /// Photon noise and energy of the counts, as data terms of the objective.
    pub(crate) fn light(&mut self) -> [f64; 2] {
        let OnDevice { plan, model, light, .. } = self;
        *light.get_or_insert_with(|| [expected_noise(model), energy(model, 0..plan.finest().pairs)])
    }

    /// Fills the buffers that hold what does not depend on the counts.
    fn queue_scan(&mut self) -> Result<()> {
        let OnDevice { plan, model, executor, queue, .. } = self;
        let mut add = |to, bytes: &[u8]| queue.add(executor, to, bytes);
        let wall = model.wall.first(plan.finest().pairs);
        add(buffer::WALL, bytemuck::cast_slice(&wall.words(model.centre)))?;
        for batch in plan.stretches() {
            let wall = model.wall.stretch(batch.first, batch.pairs);
            add(batch.wall, bytemuck::cast_slice(&wall.words(model.centre)))?;
        }
        if let Some(radius) = plan.domain.taps.len().checked_sub(1) {
            let words: Vec<f32> =
                std::iter::once(radius as f32).chain(plan.domain.taps.iter().map(|w| *w as f32)).collect();
            add(buffer::TAPS, bytemuck::cast_slice(&words))?;
        }
        if let Some(pulse) = &model.pulse {
            add(buffer::PULSE_TAPS, bytemuck::cast_slice(&pulse.words()))?;
        }
        if let Some(filter) = model.high_pass.filter(|_| plan.scene.high_pass) {
            let weights: Vec<f64> = (0..model.bins).map(|bin| model.bin_weight(bin)).collect();
            add(buffer::SURFACE, bytemuck::bytes_of(&filter.block(model.bins, model.bin_width)))?;
            add(buffer::ROW_FACTORS, bytemuck::cast_slice(&filter.factors(&weights, model.bin_width)))?;
        }
        if let Some(spots) = &plan.levels.spots {
            add(plan.finest().rendered.wall, bytemuck::cast_slice(&spots.rendered.wall.words(model.centre)))?;
            add(buffer::SPOT_TAPS, bytemuck::cast_slice(&spots.words()))?;
        }
        for (level, reachable) in plan.levels.volume.iter().zip(&plan.levels.reachable) {
            let bricks: Vec<u32> = reachable.iter().map(|r| u32::from(*r)).collect();
            add(level.reachable, bytemuck::cast_slice(&bricks))?;
        }
        Ok(())
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

/// What the device does before anything else that it is given: copies through the upload buffer, and commands whose results
/// are not awaited.
#[derive(Default)]
pub(crate) struct Queued {
    /// Bytes of the upload buffer that are taken.
    at: u64,
    schedule: Schedule,
}

impl Queued {
    /// Adds a copy of `bytes` to the beginning of `to`. Waits where what is under way may read the upload buffer, and where
    /// that is full.
    fn add(&mut self, executor: &mut Executor, to: Buffer, bytes: &[u8]) -> Result<()> {
        let size = executor.size(UPLOAD);
        let (mut rest, mut to_offset) = (bytes, 0);
        while !rest.is_empty() {
            if self.at == size {
                executor.run(&self.schedule)?;
                self.schedule.clear();
                self.at = 0;
            }
            if self.at == 0 {
                executor.settle()?;
            }
            let (part, more) = rest.split_at(rest.len().min((size - self.at) as usize));
            executor.write_at(UPLOAD, self.at, part);
            let (from_offset, bytes) = (self.at, part.len() as u64);
            self.schedule.commands.push(Command::Copy { from: UPLOAD, from_offset, to, to_offset, bytes });
            (self.at, to_offset, rest) = (self.at + bytes, to_offset + bytes, more);
        }
        Ok(())
    }

    /// Adds the scenes of levels and of batches.
    fn add_scenes(&mut self, executor: &mut Executor, plan: &Plan, model: &Model) -> Result<()> {
        for (buffer, bytes) in &plan.blocks {
            self.add(executor, *buffer, bytes)?;
        }
        for level in plan.levels.volume.iter().chain(plan.stretches()) {
            let scene = plan.scene_of(&plan.measured(level), model.scene_of(&level.grid, level.pairs));
            self.add(executor, level.scene, bytemuck::bytes_of(&scene))?;
            if let Some(spots) = &plan.levels.spots {
                let scene = model.scene_of_rendered(&level.grid, level.pairs, &spots.rendered);
                let scene = plan.scene_of(&level.rendered, scene);
                self.add(executor, level.rendered.scene, bytemuck::bytes_of(&scene))?;
            }
        }
        Ok(())
    }

    /// Moves what is queued into a schedule that is submitted next.
    pub fn move_into(&mut self, block: &mut Schedule) {
        block.append(&mut self.schedule);
        self.at = 0;
    }
}

/// The columns of maps that were copied to a buffer of the host.
pub(crate) fn columns_of(executor: &Executor, from: Buffer, grid: &Grid) -> Vec<[f32; 8]> {
    executor.read(from, ..grid.n[0] * grid.n[1])
}

/// The maps that [`super::extract`] left in `columns_host`; without normals where the model has none.
pub(crate) fn read_maps(executor: &Executor, grid: &Grid, has_normals: bool) -> Maps {
    maps_of(&columns_of(executor, COLUMNS_HOST, grid), grid, has_normals)
}

/// The maps of columns.
pub(crate) fn maps_of(columns: &[[f32; 8]], grid: &Grid, has_normals: bool) -> Maps {
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
        mask_fraction: Some(Maps::MASK_FRACTION),
        depth_error: None,
        probability: None,
        behind: None,
        albedo,
    }
}

/// Rows of the trace. No submission may be in flight.
pub(crate) fn trace_rows(device: &OnDevice, rows: Range<usize>) -> Vec<[u32; TRACE_ROW as usize]> {
    device.executor.read(buffer::TRACE, rows)
}

/// The active voxels with their state, after mask and state were copied to the host.
pub(crate) fn active_state(executor: &Executor, grid: &Grid) -> Vec<([usize; 3], [f32; 4])> {
    let raw: Vec<[f32; 4]> = executor.read(RAW_HOST, ..);
    let mask: Vec<u32> = executor.read(MASK_HOST, ..);
    let active = |i: &usize| mask[i / 32] >> (i % 32) & 1 == 1;
    // A full list has no state for the rest.
    (0..grid.storage()).filter(active).map(|i| grid.voxel(i)).zip(raw).collect()
}

/// The volume whose mask and active voxels' state were copied to the host. `albedo` computes the albedo of a voxel
/// from its state.
pub(crate) fn read_volume(executor: &Executor, grid: &Grid, albedo: fn([f32; 4]) -> f32) -> VolumeMap {
    let mut all = vec![0.0; grid.voxels()];
    for ([x, y, z], state) in active_state(executor, grid) {
        all[(x * grid.n[1] + y) * grid.n[2] + z] = albedo(state);
    }
    VolumeMap { grid: *grid, albedo: all }
}

/// What runs work with. It stays from one run to the next, so that later ones allocate nothing for an iteration.
#[derive(Default)]
pub(crate) struct Lists {
    /// The iterations that are submitted next.
    pub block: Schedule,
    /// What is due before the iteration after them.
    pub change: Schedule,
    /// Schedules that only show what is ahead.
    pub unused: Schedule,
    /// The rows of the trace that were read last.
    pub rows: Vec<[u32; TRACE_ROW as usize]>,
}

impl Lists {
    /// Submits the block, and empties it. `hear` is called on the way ([`Executor::submit_heard`]), if it is given.
    pub fn submit(
        &mut self,
        executor: &mut Executor,
        hear: Option<&mut dyn FnMut() -> ControlFlow<()>>,
    ) -> Result<Option<Ticket>> {
        let submitted = match hear {
            Some(hear) => executor.submit_heard(&self.block, hear),
            None => executor.submit(&self.block).map(Some),
        };
        self.block.clear();
        submitted
    }
}
