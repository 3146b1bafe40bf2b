//! A job on the device: its buffers, its kernels, what is uploaded before solving and read after it.

use super::Plan;
use crate::Result;
use crate::gpu::{Arena, Command, Executor, Gpu, Schedule};
use crate::maps::Maps;
use crate::transport::kernels::SceneData;
use crate::transport::{Grid, Model};

/// A job on the device: buffers filled, kernels made, first domain listed.
pub struct Job<'g> {
    pub plan: Plan,
    pub model: Model,
    pub executor: Executor<'g>,
}

impl<'g> Job<'g> {
    /// Allocates and uploads. `memory` is a budget in bytes.
    ///
    /// Errors: those of [`Arena::new`] and of the device.
    pub fn new(gpu: &'g Gpu, model: Model, plan: Plan, memory: Option<u64>) -> Result<Job<'g>> {
        let arena = Arena::new(gpu, &plan.buffers, memory)?;
        let mut executor = Executor::new(gpu, arena)?;
        plan.add_kernels(&mut executor)?;
        let mut job = Job { plan, model, executor };
        job.upload()?;
        Ok(job)
    }

    /// Fills the buffers that hold the capture and the constants.
    pub fn upload(&mut self) -> Result<()> {
        let Job { plan, model, executor } = self;
        upload(executor, "wall", bytemuck::cast_slice(&model.wall.words()))?;
        upload(executor, "measured", bytemuck::cast_slice(&model.measured))?;
        let mut taps = vec![(plan.taps.len() - 1) as f32];
        taps.extend(plan.taps.iter().map(|w| *w as f32));
        upload(executor, "taps", bytemuck::cast_slice(&taps))?;
        if let Some(pulse) = &model.pulse {
            upload(executor, "pulse_taps", bytemuck::cast_slice(&pulse.words()))?;
        }
        for level in plan.levels.iter().chain(plan.surface_only()) {
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
        Ok(())
    }
}

/// Copies `bytes` to a device buffer through the upload buffer, in as many parts as it takes.
pub fn upload(executor: &mut Executor<'_>, buffer: &'static str, bytes: &[u8]) -> Result<()> {
    let size = executor.arena.mapped("upload").len();
    for (i, part) in bytes.chunks(size).enumerate() {
        executor.arena.mapped_mut("upload")[..part.len()].copy_from_slice(part);
        let mut s = Schedule::default();
        s.commands.push(Command::Copy {
            from: "upload",
            from_offset: 0,
            to: buffer,
            to_offset: (i * size) as u64,
            bytes: part.len() as u64,
        });
        executor.run(&s)?;
    }
    Ok(())
}

/// The maps that [`super::extract`] left in `columns_host`; without normals where surfaces have no direction.
pub(super) fn read_maps(arena: &Arena<'_>, grid: &Grid, has_normals: bool) -> Maps {
    let columns: &[[f32; 8]] = bytemuck::cast_slice(arena.mapped("columns_host"));
    let columns = &columns[..grid.n[0] * grid.n[1]];
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

/// The volume whose mask and active voxels' raw variables or vectors were copied to the host.
pub(super) fn read_volume(arena: &Arena<'_>, grid: &Grid, vectors: bool) -> super::VolumeMap {
    let raw: &[[f32; 4]] = bytemuck::cast_slice(arena.mapped("raw_host"));
    let mask: &[u32] = bytemuck::cast_slice(arena.mapped("mask_host"));
    let active = |i: &usize| mask[i / 32] >> (i % 32) & 1 == 1;
    let mut albedo = vec![0.0; grid.voxels()];
    for (slot, i) in (0..grid.storage()).filter(active).enumerate() {
        let [x, y, z] = grid.voxel(i);
        // A list that is full leaves the rest out.
        let Some([a, b, c, _]) = raw.get(slot) else { break };
        albedo[(x * grid.n[1] + y) * grid.n[2] + z] = match (vectors, *a > 0.0) {
            (true, _) => (a * a + b * b + c * c).sqrt(),
            (false, true) => *a,
            (false, false) => a.exp_m1(),
        };
    }
    super::VolumeMap { grid: *grid, albedo }
}
