//! The surface alone: a height field with an albedo for every pixel, optimised by differentiable rendering without a volume
//! before it (in the manner of Plack, Callenberg, Schneider, Hullin: *Fast Differentiable Transient Rendering for
//! Non-Line-of-Sight Reconstruction*, WACV 2023, and of Tsai, Sankaranarayanan, Gkioulekas: *Beyond Volumetric Albedo*,
//! CVPR 2019).
//!
//! It shows what [`super::surface`] adds to a solve. Model, objective and optimiser are those of the vector solver's
//! surface. The difference is what it begins with: the depths and albedos of a closed-form method, or a plane
//! ([`begin`]). There is one layer, and pixels that the beginning does not have stay dark.

use std::sync::Arc;
use std::time::Instant;

use super::drive::Driven;
use super::plan::pass::Pass;
use super::plan::{Demand, LeftOut, Level, Needs};
use super::prepared::Planned;
use super::result::finish;
use super::surface::{self, Beginning};
use super::{
    Beside, Common, Plan, Prepared, Problem, Reconstruction, RunsOn, Solver, TimedSchedule, VolumeMap, Watch,
    vector,
};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::{Abilities, Buffer, Constant, Gpu, Schedule};
use crate::maps::Maps;
use crate::transport::kernels::buffer;
use crate::transport::{Grid, Rows};

mod begin;
mod options;

pub use options::{Begin, SurfaceAloneOptions};

impl Needs for SurfaceAloneOptions {
    fn demand(&self) -> Demand {
        let of_vector = self.as_vector().demand();
        Demand { iterations: [0, self.surface.iterations], refined: None, cosine_volume: false, ..of_vector }
    }

    /// Points of all pixels of the maps.
    fn capacities(&self, levels: &[Level]) -> [usize; 2] {
        let pixels = levels.last().map_or(0, |l| l.grid.n[0] * l.grid.n[1])
            * self.as_vector().pixels_per_voxel().pow(2);
        [pixels * self.surface.points.unwrap_or(4); 2]
    }

    fn constants(&self, plan: &Plan) -> Vec<(Constant, u32)> {
        self.as_vector().constants(plan)
    }

    fn passes(&self) -> Vec<&'static Pass> {
        surface::passes::ALL.to_vec()
    }

    fn buffers(&self, plan: &Plan) -> Vec<(Buffer, u64)> {
        surface::buffers(plan)
    }

    /// No domain changes.
    fn volumes(&self, _levels: &[Level], _capacities: [usize; 2]) -> [Buffer; 2] {
        [buffer::GRADIENT, buffer::SAMPLE_POINTS]
    }

    fn left_out(&self, plan: &Plan, out: &mut LeftOut) {
        surface::left_out(plan, out);
        out.add("the volume before the surface", "all of its iterations");
    }
}

impl Solver for SurfaceAloneOptions {
    fn common(&self) -> Common {
        let demand = self.demand();
        Common {
            lateral: self.lateral,
            iterations: demand.iterations,
            reflectance: self.reflectance,
            accumulation: self.accumulation,
            sizes: self.sizes,
            min_depth: self.min_depth,
            pixels_per_voxel: demand.pixels_per_voxel,
            runs_on: RunsOn::Device,
        }
    }

    fn check(&self) -> Result<()> {
        SurfaceAloneOptions::check(self)
    }

    fn takes(&self, capture: &Capture) -> Result<()> {
        self.first_method(capture).map(|_| ())
    }

    fn needs(&self) -> Option<&dyn Needs> {
        Some(self)
    }

    fn plan(&self, problem: &Problem<'_>, abilities: &Abilities) -> Result<Plan> {
        let Problem { capture, grid, .. } = *problem;
        self.takes(capture)?;
        let model = vector::model(&capture.outline(), &grid, &self.as_vector());
        Plan::new(&model, grid, capture.resolution(), self, abilities, false)
    }

    fn outline(&self, plan: &Plan) -> Vec<TimedSchedule> {
        surface::outline(plan, &self.surface)
    }

    fn prepare(&self, gpu: &Gpu, problem: &Problem<'_>) -> Result<Box<dyn Prepared>> {
        let Problem { capture, grid, memory, with_volume } = *problem;
        self.check()?;
        self.takes(capture)?;
        let (outline, rows) = vector::outline_of(capture, &grid, &self.as_vector());
        let plan = Plan::new(&outline, grid, capture.resolution(), self, &gpu.abilities(), false)?;
        let plan = plan.within(self, &gpu.memory(), memory)?;
        let planned = Planned::new(gpu, outline, plan, memory);
        // Its errors come before any work.
        let scan = capture.outline();
        let made =
            Alone { planned, rows, options: self.clone(), grid, memory, with_volume, scan, kept: None };
        made.first_method()?;
        Ok(Box::new(made))
    }
}

/// A surface that is prepared for a scan.
struct Alone {
    planned: Planned,
    rows: Rows,
    options: SurfaceAloneOptions,
    /// The maps' grid, as the method that it begins with takes it.
    grid: Grid,
    memory: Option<u64>,
    with_volume: bool,
    /// The capture without its counts.
    scan: Capture,
    /// What it begins with, if everything was allocated before.
    kept: Option<Box<dyn Prepared>>,
}

impl Alone {
    /// The method that the surface begins with, prepared; `None`: a plane.
    fn first_method(&self) -> Result<Option<Box<dyn Prepared>>> {
        let method = self.options.first_method(&self.scan)?;
        let problem = Problem { memory: self.memory, ..Problem::new(&self.scan, self.grid) };
        method.map(|m| m.prepare(self.planned.gpu(), &problem)).transpose()
    }

    /// The maps that the surface begins with.
    fn beginning(&mut self, capture: &Capture, watch: &mut Watch<'_>) -> Result<Maps> {
        // Its buffers go before those of the surface come, unless everything is to be kept.
        let mut own = if self.kept.is_none() { self.first_method()? } else { None };
        match self.kept.as_mut().or(own.as_mut()) {
            Some(method) => begin::of_method(&mut **method, capture, self.options.surface.iterations, watch),
            None => Ok(begin::plane(capture, &self.planned.plan().levels.maps, self.options.background)),
        }
    }
}

impl Prepared for Alone {
    fn plan(&self) -> &Arc<Plan> {
        self.planned.plan()
    }

    fn allocate(&mut self) -> Result<()> {
        let mut first = self.first_method()?;
        first.as_mut().map_or(Ok(()), |method| method.allocate())?;
        self.kept = first;
        let job = self.planned.made(|_| Ok(()))?;
        let (plan, executor) = (job.plan.clone(), &mut job.executor);
        executor.reserve(&Schedule::of(|s| surface::cleared(s, &plan)))?;
        surface::each(&plan, &self.options.surface, &mut |schedule| executor.reserve(schedule))
    }

    fn solve(&mut self, capture: &Capture, beside: Beside<'_, '_>) -> Result<Reconstruction> {
        let begun = Instant::now();
        let first = self.beginning(capture, beside.watch)?;
        let Alone { planned, rows, options, grid, with_volume, .. } = self;
        let gpu = planned.gpu().clone();
        let job = planned.made(|_| Ok(()))?;
        vector::take(capture, &options.as_vector(), rows, &mut job.model, None);
        job.upload_counts()?;
        job.executor.run_once(|s| surface::cleared(s, &job.plan))?;
        let seconds = begun.elapsed().as_secs_f64();
        let driven = Driven { seconds, ..Driven::begun(first, *job.plan.finest()) };
        let driven =
            surface::refine(&gpu, job, &options.surface, beside.watch, driven, Beginning::Maps)?.driven;
        let volume = with_volume.then(|| as_volume(&driven.maps, grid));
        Ok(Reconstruction { volume, volume_iterations: 0, ..finish(job, driven, None)? })
    }
}

/// The surface as a volume: the albedo of every pixel in the voxel of its depth.
fn as_volume(maps: &Maps, grid: &Grid) -> VolumeMap {
    let [nx, ny, nz] = grid.n;
    let mut albedo = vec![0.0; nx * ny * nz];
    for (pixel, (value, z)) in
        maps.albedo.iter().zip(&maps.depth).enumerate().filter(|(_, (_, z))| z.is_finite())
    {
        let at = ((f64::from(*z) - grid.origin.z) / grid.pitch.z).round().max(0.0) as usize;
        albedo[pixel * nz + at.min(nz - 1)] = *value;
    }
    VolumeMap { grid: *grid, albedo }
}
