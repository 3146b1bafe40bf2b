//! A short fit of a surface to some pairs, judged by as many other pairs.

use std::sync::Arc;

use super::constants::{ITERATIONS, ROUNDS};
use super::hold_out::{Left, Unseen};
use crate::Result;
use crate::capture::{Capture, Pulse};
use crate::gpu::{BufferPlan, Gpu, Place, Schedule};
use crate::maps::Maps;
use crate::solve::drive::{Driven, Watch};
use crate::solve::surface::{self, OfFit, SurfaceOptions};
use crate::solve::{OnDevice, Plan, Problem, RESIDUAL_HOST, passes};
use crate::transport::kernels::buffer;
use crate::transport::{Grid, Model, Reflectance};

/// The layers of the closed form that all fits begin with.
///
/// # Errors
/// The device fails, or the watch cancels.
pub fn start(
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    options: &SurfaceOptions,
    memory: Option<u64>,
    watch: &mut Watch<'_>,
) -> Result<Vec<Maps>> {
    let problem = Problem { memory, ..Problem::new(capture, grid) };
    match surface::Start::new(gpu, &problem, options)? {
        Some(mut start) => start.layers(capture, options.iterations, watch),
        None => Ok(vec![surface::start::plane(capture, &grid, options.background)]),
    }
}

/// Fits with one model of reflectance.
pub struct Trial {
    gpu: Gpu,
    /// The pairs that are fitted, and those that judge.
    seen: Model,
    held: Model,
    /// Points to a side of a scan as dense as half of the pairs.
    scan: [usize; 2],
    grid: Grid,
    options: SurfaceOptions,
    layers: Vec<Maps>,
    memory: Option<u64>,
}

/// A fit, judged on the hold-out set.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The surface.
    pub layers: Vec<Maps>,
    /// The hold-out set with its rendering.
    pub unseen: Unseen,
    /// Its residual.
    pub left: Left,
}

impl Trial {
    /// Prepares fits that begin with `layers`. Half of the capture's pairs are fitted, and half of them judge.
    pub fn new(
        gpu: &Gpu,
        capture: &Capture,
        grid: Grid,
        options: SurfaceOptions,
        layers: Vec<Maps>,
        memory: Option<u64>,
    ) -> Trial {
        let whole = surface::model::model(capture, &grid, &options);
        let [seen, held] = [0, 1].map(|side| whole.half(side));
        let scan = capture.resolution().map(|n| ((n as f64 / 2f64.sqrt()) as usize).max(1));
        Trial { gpu: gpu.clone(), seen, held, scan, grid, options, layers, memory }
    }

    /// The model of reflectance.
    pub fn reflectance(&self) -> Reflectance {
        self.options.reflectance
    }

    /// Gives the fits, and what judges them, a high-pass of this length (metres of path) and floor.
    pub fn set_high_pass(&mut self, [length, floor]: [f64; 2]) {
        (self.options.high_pass, self.options.high_pass_floor) = (Some(length), floor);
        let filter = self.options.filter();
        [&mut self.seen, &mut self.held].into_iter().for_each(|side| side.high_pass = filter);
    }

    /// Fits a surface with this impulse response, beginning with another fit, for `iterations` iterations, or with the closed
    /// form; `None` if none is found.
    ///
    /// # Errors
    /// The device fails, the watch cancels, or the impulse response has no taps.
    pub fn fit(
        &mut self,
        pulse: Option<&Pulse>,
        from: Option<(&[Maps], usize)>,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Fitted>> {
        for side in [&mut self.seen, &mut self.held] {
            side.pulse = pulse.map(|p| p.taps(side.bin_width)).transpose()?;
        }
        let last = from.map_or(ITERATIONS[1], |from| from.1);
        let iterations = last + if from.is_none() { ROUNDS * ITERATIONS[0] } else { 0 };
        let [plan, plan_of_held] = self.plans(iterations)?;
        let mut layers = from.map_or_else(|| self.layers.clone(), |(layers, _)| layers.to_vec());
        let mut job = OnDevice::new(&self.gpu, self.seen.clone(), plan, self.memory)?;
        job.executor.run_once(|s| {
            surface::fit::cleared(s, &job.plan);
            surface::divide(s, &job.plan);
        })?;
        let mut driven = Some(Driven::begun(layers[0].clone(), *job.plan.finest()));
        let (mut scales, mut found) = (true, true);
        let mut fit = |layers: &mut Vec<Maps>, iterations: usize| {
            let before = driven.take().expect("given back");
            let (next, quality) = surface::fit::run(
                &self.gpu,
                &mut job,
                &self.options,
                layers,
                surface::Run {
                    iterations,
                    skipped: 0,
                    of: iterations,
                    scales: std::mem::take(&mut scales),
                    until: None,
                },
                watch,
                before,
            )?;
            driven = Some(next);
            found &= quality.is_some();
            Ok(quality)
        };
        if from.is_none() {
            let range = self.grid.depth_range().map(|z| z as f32);
            surface::in_rounds(ROUNDS, range, &mut layers, &mut |layers| fit(layers, ITERATIONS[0]))?;
        }
        fit(&mut layers, last)?;
        if !found {
            return Ok(None);
        }
        let count = layers.iter().flat_map(|l| &l.depth).filter(|z| z.is_finite()).count();
        let unseen = self.judge(&mut job, plan_of_held, count)?;
        let left = unseen.left();
        Ok(Some(Fitted { layers, unseen, left }))
    }

    /// The plan of a fit, with room for the hold-out set, and that of the hold-out set.
    fn plans(&self, iterations: usize) -> Result<[Arc<Plan>; 2]> {
        let needs = OfFit { options: &self.options, iterations: [0, iterations] };
        let mut plan = Plan::new(&self.seen, self.grid, self.scan, &needs, &self.gpu.abilities(), false)?;
        let plan_of_held = plan.of_other_pairs(&self.held, &needs);
        plan.make_room(&plan_of_held);
        let residual = plan.bytes_of(buffer::RESIDUAL);
        plan.buffers.push(BufferPlan::new(RESIDUAL_HOST, residual, Place::Readback));
        Ok([plan, plan_of_held].map(Arc::new))
    }

    /// Renders the fitted pixels for the hold-out set, and compares.
    fn judge(&self, job: &mut OnDevice, plan_of_held: Arc<Plan>, count: usize) -> Result<Unseen> {
        let level = plan_of_held.levels.pixels.expect("a fit has pixels");
        job.put(self.held.clone(), plan_of_held)?;
        let cells = job.plan.cells_at(&level);
        let schedule = Schedule::of(|s| {
            surface::render(s, &job.plan, &level, count, &passes::RESIDUAL);
            s.copy(buffer::RESIDUAL, RESIDUAL_HOST, cells as u64 * 4);
        });
        job.executor.run(&schedule)?;
        let residual: Vec<f32> = job.executor.read(RESIDUAL_HOST, ..cells);
        Ok(Unseen::of(&job.model, &residual, &level.grid))
    }
}
