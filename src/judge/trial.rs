//! A short fit of a surface, judged on pairs that it does not take.

use std::borrow::Cow;
use std::sync::Arc;

use super::constants::{ITERATIONS, ROUNDS};
use crate::capture::{Capture, Pulse};
use crate::engine::{Driven, Problem, Watch};
use crate::gpu::Gpu;
use crate::maps::Maps;
use crate::surface::{Candidate, Fit, HeldOut, Judge, Rounds, Run, Starts, SurfaceOptions};
use crate::transport::{Grid, Reflectance};
use crate::{Kind, Result, surface};

/// Fits with one model of reflectance.
pub(crate) struct Trial<'c> {
    gpu: Gpu,
    /// In the bins of the fits.
    capture: Arc<Cow<'c, Capture>>,
    grid: Grid,
    options: SurfaceOptions,
    starts: Arc<Starts>,
    memory: Option<u64>,
}

/// What a fit begins with.
#[derive(Debug, Clone, Copy)]
pub(crate) enum From<'l> {
    /// The network or the closed form.
    Start,
    /// Another fit, whose support stays, for a number of iterations.
    Fit(&'l [Maps], usize),
}

impl From<'_> {
    /// Rounds of the support, and iterations of the fit after these.
    fn parts(&self) -> [usize; 2] {
        match self {
            From::Fit(_, iterations) => [0, *iterations],
            _ => [ROUNDS, ITERATIONS[1]],
        }
    }

    /// Iterations of the fit at most.
    pub fn iterations(&self) -> usize {
        let [rounds, last] = self.parts();
        rounds * ITERATIONS[0] + last
    }
}

/// A fit, judged on the pairs that are held out.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    /// The surface, with its judgement.
    pub surface: Candidate,
    /// The pairs that are held out, with their rendering.
    pub held: HeldOut,
}

impl<'c> Trial<'c> {
    /// Prepares fits.
    pub fn new(
        gpu: &Gpu,
        capture: Arc<Cow<'c, Capture>>,
        grid: Grid,
        options: SurfaceOptions,
        starts: Arc<Starts>,
        memory: Option<u64>,
    ) -> Trial<'c> {
        Trial { gpu: gpu.clone(), capture, grid, options, starts, memory }
    }

    /// The model of reflectance.
    pub fn reflectance(&self) -> Reflectance {
        self.options.reflectance
    }

    /// Gives the fits, and what judges them, a high-pass of this length (metres of path) and floor.
    pub fn set_high_pass(&mut self, [length, floor]: [f64; 2]) {
        (self.options.high_pass, self.options.high_pass_floor) = (Some(length), floor);
    }

    /// Fits a surface with this impulse response; steps begin with this length. `None` if no surface is found, or nothing judges it.
    ///
    /// # Errors
    /// The device fails, the watch cancels, or the impulse response has no taps.
    pub fn fit(
        &self,
        pulse: Option<&Pulse>,
        from: From<'_>,
        step: f64,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Fitted>> {
        let ([rounds, last], all) = (from.parts(), from.iterations());
        let outline = self.capture.outline().with(|c| c.pulse = pulse.cloned());
        let problem = Problem { memory: self.memory, ..Problem::new(&outline, self.grid) };
        let mut fit = Fit::new(&self.gpu, &problem, &self.options, [0, all], Judge::HeldOut)?;
        fit.take(&self.capture)?;
        fit.step = step;
        let mut layers = match from {
            From::Start => self.starts.layers.clone(),
            From::Fit(layers, _) => layers.to_vec(),
        };
        let mut driven = Driven::begun(layers[0].clone(), *fit.plan().finest());
        if rounds > 0 {
            let how = Rounds { number: rounds, rings: 1 };
            let run = |_: usize| Some(Run::of(ITERATIONS[0], all).of_round());
            (driven, _) = surface::grow(&mut fit, how, &mut layers, &run, watch, driven)?;
        }
        let (_, quality) = fit.run(&mut layers, Run::of(last, all), watch, driven)?;
        let Some((quality, held)) = quality.zip(fit.judged()?) else { return Ok(None) };
        let surface = Candidate { layers, step: fit.step, quality, left: Some(held.left()) };
        Ok(Some(Fitted { surface, held }))
    }

    /// All pairs, with the rendering of these layers; `None` if they explain no light, or all pairs do not fit.
    ///
    /// # Errors
    /// The device fails.
    pub fn all(&self, layers: &[Maps]) -> Result<Option<HeldOut>> {
        let options = self.options.clone().with(|o| o.pairs = self.capture.pair_count());
        match self.rendered(layers, &options, Judge::All) {
            Err(e) if e.kind == Kind::Memory => Ok(None),
            rendered => rendered,
        }
    }

    /// The pairs that are held out, with the rendering of these layers by sharp paths; `None` if they explain no light.
    ///
    /// # Errors
    /// The device fails.
    pub fn ideal(&self, layers: &[Maps]) -> Result<Option<HeldOut>> {
        self.rendered(layers, &self.options, Judge::HeldOut)
    }

    fn rendered(&self, layers: &[Maps], options: &SurfaceOptions, judge: Judge) -> Result<Option<HeldOut>> {
        let outline = self.capture.outline();
        let problem = Problem { memory: self.memory, ..Problem::new(&outline, self.grid) };
        let mut fit = Fit::new(&self.gpu, &problem, options, [0, 1], judge)?;
        fit.take(&self.capture)?;
        fit.seen(layers, false)?.map_or(Ok(None), |_| fit.judged())
    }
}
