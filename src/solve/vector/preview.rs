//! A first picture before the solve: the filtered back-projection.

use super::passes::{BACKPROJECT, FILTER, GAUSSIAN_X_VOLUME};
use super::schedule::project;
use super::{VectorOptions, model, upload_hat};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::{BufferPlan, Gpu, Place};
use crate::maps::Maps;
use crate::solve::passes::{GAUSSIAN_Y, GAUSSIAN_Z, SUM_BINS};
use crate::solve::plan::RAW_HOST;
use crate::solve::{OnDevice, Pass, Plan};
use crate::transport::Grid;

/// The passes of a back-projection; others are not even compiled.
const PASSES: [&Pass; 6] = [&SUM_BINS, &FILTER, &BACKPROJECT, &GAUSSIAN_X_VOLUME, &GAUSSIAN_Y, &GAUSSIAN_Z];

/// The brightest voxel of every column of the filtered back-projection, with as many pairs as the solver would begin
/// with on such a grid. The volume's voxels are the maps' pixels, so the grid should be coarse. Albedo has no scale
/// here, and there are no normals.
///
/// # Errors
/// As [`super::reconstruct`].
pub fn preview(
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    options: &VectorOptions,
    memory: Option<u64>,
) -> Result<Maps> {
    let options = options.clone().with(|o| {
        o.iterations = 1;
        o.surface.iterations = 0;
        o.surface.pixels_per_voxel = Some(1);
    });
    options.check()?;
    let model = model(capture, &grid, &options);
    let mut plan = Plan::new(&model, grid, capture.resolution(), &options, &gpu.abilities(), false)?;
    plan = plan.within(&options, &gpu.memory(), memory)?;
    plan.passes.retain(|pass| PASSES.contains(pass));
    let storage = grid.storage();
    plan.buffers.push(BufferPlan::new(RAW_HOST, storage as u64 * 4, Place::Readback));
    let mut job = OnDevice::new(gpu, model, plan, memory)?;
    let level = *job.plan.levels.iter().find(|l| l.grid == grid).unwrap_or(job.plan.finest());
    upload_hat(&mut job, &level)?;
    job.executor.run_once(|s| {
        project(s, &job.plan, &level);
        s.copy(job.plan.volumes[0], RAW_HOST, storage as u64 * 4);
    })?;
    Ok(brightest(&grid, &job.executor.read(RAW_HOST, ..storage)))
}

/// The brightest voxel of every column of `volume`, which lies in storage order.
fn brightest(grid: &Grid, volume: &[f32]) -> Maps {
    let [nx, ny, nz] = grid.n;
    let (mut albedo, mut depth) = (vec![0.0f32; nx * ny], vec![f32::NAN; nx * ny]);
    for (i, value) in volume.iter().enumerate() {
        let [x, y, z] = grid.voxel(i);
        if x < nx && y < ny && z < nz && *value > albedo[x * ny + y] {
            albedo[x * ny + y] = *value;
            depth[x * ny + y] = (grid.origin.z + z as f64 * grid.pitch.z) as f32;
        }
    }
    Maps {
        nx,
        ny,
        extent: grid.extent(),
        normal: vec![[f32::NAN; 3]; nx * ny],
        mask: Maps::mask_of(&albedo, Maps::MASK_FRACTION),
        mask_fraction: Some(Maps::MASK_FRACTION),
        confidence: None,
        behind: None,
        albedo,
        depth,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::Volume;

    #[test]
    fn a_column_shows_its_brightest_voxel() {
        let volume = Volume { min: glam::dvec3(0.0, 0.0, 1.0), max: glam::dvec3(0.2, 0.2, 1.4) };
        let grid = Grid::new(volume, 2, 0.1).unwrap();
        let mut values = vec![0.0; grid.storage()];
        for (voxel, value) in [([0, 1, 0], 0.3), ([0, 1, 2], 0.5), ([0, 1, 3], 0.4), ([1, 0, 1], 0.1)] {
            values[grid.index(voxel)] = value;
        }
        let maps = brightest(&grid, &values);
        assert_eq!(maps.albedo, [0.0, 0.5, 0.1, 0.0]);
        assert_eq!(maps.mask, [false, true, false, false]);
        let at = |z: f64| (grid.origin.z + z * grid.pitch.z) as f32;
        assert_eq!([maps.depth[1], maps.depth[2]], [at(2.0), at(1.0)]);
        assert!(maps.depth[0].is_nan() && maps.depth[3].is_nan());
        maps.check().unwrap();
    }
}
