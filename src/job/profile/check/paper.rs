//! Compares an iteration of the paper's solver with the float64 twins.

use super::buffers::{read_raw, read_residual, read_samples, readable, write_raw, zeroed};
use super::{Held, LATERAL, error, is_clear, random};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Gpu;
use crate::solve::{Accumulation, PaperOptions, Plan, Preset, default_volume, paper, upload};
use crate::transport::Grid;
use crate::transport::kernels::buffer;
use crate::transport::twin::{self, Raw, Sample, Twin};

pub fn check(gpu: &Gpu, capture: &Capture, accumulation: Accumulation) -> Result<Vec<Held>> {
    let options = PaperOptions::preset(Preset::Synthetic).with(|o| {
        o.lateral = LATERAL;
        o.iterations = 1;
        o.domain.coarse_to_fine = false;
        o.accumulation = accumulation;
    });
    let grid = Grid::new(default_volume(capture, options.domain.min_depth)?, LATERAL, capture.bin_width)?;
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
    paper::compact(&mut s, &job.plan, job.plan.finest());
    paper::iteration(&mut s, &job.plan, job.plan.finest(), 0, 1);
    job.executor.run(&s)?;

    // Every pass is compared with its twin on the values that the pass before it left on the device.
    let mut all = vec![];
    let mut note = |pass, error| all.push(Held { pass, error });
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
    // Adam's first step is the sign of a sum, which may be near zero. So the sum's first moment is compared instead.
    let got = read_raw(&mut job, buffer::MOMENT_FIRST, touched.len())?;
    let want: Vec<Raw> = touched.iter().map(|i| first[*i as usize]).collect();
    note("update", error(&got.concat(), &want.concat()));
    Ok(all)
}

/// A random fifth of the voxels that may be active. A voxel is left out if one of its paths lies so near to the edge of
/// a bin that fp32 and float64 may choose different bins.
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
