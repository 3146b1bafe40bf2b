//! The solver of "Domain Reduction Strategy for Non-Line-of-Sight Imaging" (ECCV 2024).

use std::sync::Arc;

use crate::Result;
use crate::capture::{Background, Capture};
use crate::engine::{
    Common, Iterate, Level, OnDevice, Pass, Plan, Planned, Prepared, Problem, Reconstruction, RunsOn, Solver,
    TimedSchedule, Watch, drive, finish, outline,
};
use crate::gpu::{Abilities, Gpu, Schedule, check};
use crate::transport::{Grid, Model, Rows};

mod domain;
mod needs;
mod options;
pub mod passes;
mod schedule;

pub use domain::{compact, extract};
pub use needs::plan;
pub use options::{
    Decay, Domain, DomainSettings, Noise, NoiseSettings, NoiseTerm, PaperOptions, PaperSettings,
};
pub use schedule::{double, due, initialise, iteration, reduce, restart};

/// The model that `options` make of a capture for `grid`.
pub fn model(capture: &Capture, grid: &Grid, options: &PaperOptions) -> Model {
    let (mut model, rows) = outline_of(capture, grid, options);
    if !capture.histograms.is_empty() {
        model.take(&rows, capture, &Background::NONE);
    }
    model
}

/// The same without measured values, and the rows that they are taken by.
fn outline_of(capture: &Capture, grid: &Grid, options: &PaperOptions) -> (Model, Rows) {
    let (model, mut rows) = Model::outline(capture, options.reflectance, options.peak, options.general);
    let mut model = Model { min_depth: options.domain.min_depth, binning: options.binning, ..model };
    if !options.general {
        rows.crop(model.trim(grid));
    }
    (model, rows)
}

impl Solver for PaperOptions {
    fn common(&self) -> Common {
        Common {
            lateral: self.lateral,
            iterations: self.demand().iterations,
            reflectance: self.reflectance,
            accumulation: self.accumulation,
            min_depth: self.domain.min_depth,
            pixels_per_voxel: self.demand().pixels_per_voxel,
            runs_on: RunsOn::Device,
        }
    }

    fn check(&self) -> Result<()> {
        PaperOptions::check(self)
    }

    fn plan(&self, problem: &Problem<'_>, abilities: &Abilities) -> Result<Plan> {
        // The counts are as large as all the rest, and a plan is the same without them.
        let Problem { capture, grid, with_volume, .. } = *problem;
        let (outline, _) = outline_of(&capture.outline(), &grid, self);
        plan(&outline, grid, capture.resolution(), self, abilities, with_volume)
    }

    fn outline(&self, plan: &Plan) -> Vec<TimedSchedule> {
        outline::of("volume", plan, &PaperIterations::of(plan, self), 0..self.iterations)
    }

    fn prepare(&self, gpu: &Gpu, problem: &Problem<'_>) -> Result<Box<dyn Prepared>> {
        PaperOptions::check(self)?;
        let Problem { capture, grid, memory, with_volume, .. } = *problem;
        let (outline, rows) = outline_of(capture, &grid, self);
        let plan = plan(&outline, grid, capture.resolution(), self, &gpu.abilities(), with_volume)?;
        check(&plan.buffers, &gpu.memory(), memory)?;
        let planned = Planned::new(gpu, outline, plan, memory);
        Ok(Box::new(PreparedPaper { planned, rows, options: self.clone(), with_volume }))
    }
}

struct PreparedPaper {
    planned: Planned,
    rows: Rows,
    options: PaperOptions,
    with_volume: bool,
}

impl Prepared for PreparedPaper {
    fn plan(&self) -> &Arc<Plan> {
        self.planned.plan()
    }

    fn allocate(&mut self) -> Result<()> {
        let PreparedPaper { planned, options, .. } = self;
        let OnDevice { plan, executor, .. } = planned.made()?;
        let mut reserve = |schedule: &Schedule| executor.reserve(schedule);
        outline::each(plan, &PaperIterations::of(plan, options), 0..options.iterations, &mut reserve)
    }

    fn solve(&mut self, capture: &Capture, watch: &mut Watch<'_>) -> Result<Reconstruction> {
        let PreparedPaper { planned, rows, options, with_volume } = self;
        let gpu = planned.gpu().clone();
        let job = planned.made()?;
        job.model.take(rows, capture, &Background::NONE);
        job.queue_counts()?;
        let plan = job.plan.clone();
        let driven = drive(&gpu, job, options.iterations, &PaperIterations::of(&plan, options), watch, None)?;
        finish(job, driven, with_volume.then_some(albedo_of))
    }
}

/// The volume as the driver sees it.
struct PaperIterations<'o> {
    levels: Vec<Level>,
    options: &'o PaperOptions,
}

impl PaperIterations<'_> {
    fn of<'o>(plan: &Plan, options: &'o PaperOptions) -> PaperIterations<'o> {
        PaperIterations { levels: plan.levels.volume.clone(), options }
    }
}

impl Iterate for PaperIterations<'_> {
    fn levels(&self) -> &[Level] {
        &self.levels
    }

    fn start(&self, s: &mut Schedule, plan: &Plan) {
        initialise(s, plan, &plan.levels.volume[0]);
    }

    fn iteration(&self, s: &mut Schedule, plan: &Plan, level: &Level, i: usize) {
        iteration(s, plan, level, i as u32, (i % self.options.restart_every) as u32 + 1);
    }

    fn due(&self, s: &mut Schedule, plan: &Plan, level: &mut usize, done: usize) {
        due(s, plan, self.options, level, done);
    }

    fn extract(&self, s: &mut Schedule, level: &Level) {
        domain::extract(s, level);
    }

    fn has_maps(&self) -> bool {
        true
    }

    fn passes(&self) -> &'static [&'static Pass] {
        passes::ALL
    }

    fn l1_weight(&self, level: &Level) -> f64 {
        self.options.l1 / level.grid.voxels() as f64
    }

    fn of(&self) -> usize {
        self.options.iterations
    }

    fn shrinks(&self) -> bool {
        true
    }
}

/// Albedo of a voxel from its raw variables: ELU.
fn albedo_of([a, ..]: [f32; 4]) -> f32 {
    if a > 0.0 { a } else { a.exp_m1() }
}
