//! Compares an iteration of the surface with the float64 twins.

use super::buffers::{read_raw, read_residual, read_samples, readable, zeroed};
use super::{Held, LATERAL, error, is_clear, random};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::Gpu;
use crate::solve::surface::{self, OfFit, Pixels, Placed};
use crate::solve::{Accumulation, Plan, SurfaceOptions, default_volume, upload};
use crate::transport::Grid;
use crate::transport::kernels::buffer;
use crate::transport::twin::{self, Height, Sample, Twin};

pub fn check(gpu: &Gpu, capture: &Capture, accumulation: Accumulation) -> Result<Vec<Held>> {
    let options = SurfaceOptions::default().with(|o| {
        o.lateral = LATERAL;
        o.points = Some(4);
        o.accumulation = accumulation;
    });
    let grid = Grid::new(default_volume(capture, options.min_depth)?, LATERAL, capture.bin_width)?;
    let model = surface::model::model(capture, &grid, &options);
    let needs = OfFit { options: &options, iterations: [0, 1] };
    let plan = Plan::new(&model, grid, capture.scan, &needs, &gpu.abilities(), false)?;
    let mut job = readable(gpu, model, plan)?;
    let (model, level, points) = (job.model.clone(), *job.plan.finest(), surface::points_of(&job.plan));
    let twin = Twin { model: &model, grid: &grid };
    // Three by four pixels of a slanted surface, at a depth where no path lies near a bin's centre.
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
        let placed = Placed { pixels: pixels.len(), most: 2.0, explained: 1.0, left: 0.01 };
        surface::weights(&model, &level, placed, &options, 1)
    };
    upload(&mut job.executor, buffer::SURFACE_WEIGHTS, bytemuck::cast_slice(&weights))?;
    let mut s = zeroed(&job, &[buffer::COUNTS, buffer::HISTOGRAMS]);
    surface::start_of(&mut s, &level, pixels.len(), points);
    surface::iteration(&mut s, &job.plan, &level, pixels.len(), [0, 0, 1]);
    job.executor.run(&s)?;

    let mut all = vec![];
    let mut note = |pass, error| all.push(Held { pass, error });
    let got = read_samples(&mut job, points * pixels.len())?;
    let bonds = twin::surface_bonds(&twin, &pixels.columns, &heights);
    let (_, want) = twin::surface_points(&twin, &pixels.columns, &bonds, &heights, points);
    let flat = |samples: &[Sample]| -> Vec<f64> {
        samples.iter().flat_map(|s| [s.point.to_array(), s.normal.to_array()].concat()).collect()
    };
    note("points", error(&flat(&got), &flat(&want)));
    let residual = read_residual(&mut job)?;
    let (want, _) = twin::residual_weighted(&twin, &twin::forward(&twin, &got));
    note("forward", error(&residual, &want));
    let pulls = twin::surface_gather(&twin, &got, &residual);
    let gradient = read_raw(&mut job, buffer::GRADIENT, got.len())?;
    let want: Vec<f64> = pulls.iter().flat_map(|p| [p.vector.x, p.vector.y, p.vector.z]).collect();
    let vectors: Vec<f64> = gradient.iter().flat_map(|g| g[..3].to_vec()).collect();
    note("backward", error(&vectors, &want));
    let depths: Vec<f64> = gradient.iter().map(|g| g[3]).collect();
    note("depth", error(&depths, &pulls.iter().map(|p| p.depth).collect::<Vec<_>>()));
    Ok(all)
}
