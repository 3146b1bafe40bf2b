//! Short fits of a surface, judged on pairs that they do not take.

use std::borrow::Cow;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::constants::{ITERATIONS, LATERAL, LEAST_PAIRS, PAIRS, ROUNDS};
use crate::capture::{Capture, Pulse};
use crate::engine::{Doing, Problem, Progress, TracePoint, Watch};
use crate::gpu::{DeviceKind, Gpu, check};
use crate::maps::Maps;
use crate::methods::SolverOptions;
use crate::settings::Settings;
use crate::surface::{Candidate, Fit, Growth, HeldOut, Judge, Quality, Rounds, Run, Starts, SurfaceOptions};
use crate::transport::{Grid, Reflectance};
use crate::{Error, Kind, Result};

/// Cells per side of the wall; all of a cell moves by the delay of one pair.
const CELLS: usize = 16;

/// Options of a short fit with this number of lateral pixels.
pub(super) fn quick(options: &SolverOptions, pixels: usize) -> SurfaceOptions {
    options.as_surface().with(|o| {
        o.lateral = pixels;
        o.iterations = ITERATIONS[1];
        o.grow = false;
        o.points = None;
        o.sparsity = 0.0;
        o.pairs = PAIRS;
    })
}

/// The capture in the bins of short fits, their grid, and their options.
///
/// # Errors
/// Too few pairs, or a box that the capture does not allow.
pub fn for_fits<'c>(
    settings: &Settings,
    lateral: usize,
    capture: &'c Capture,
    solver: &SolverOptions,
) -> Result<(Cow<'c, Capture>, Grid, SurfaceOptions)> {
    if capture.pair_count() / 2 < LEAST_PAIRS {
        return Err(Error::input(
            format!("estimates need {} pairs, the capture has {}", 2 * LEAST_PAIRS, capture.pair_count()),
            "name the model and the impulse response if known",
        ));
    }
    let options = quick(solver, lateral.min(LATERAL));
    let solver: SolverOptions = options.clone().into();
    let volume = settings.volume.map_or_else(|| solver.default_volume(capture), Ok)?;
    let of_trial = Settings { volume: Some(volume), bins: settings.bins, ..Settings::default() };
    let (whole, _) = of_trial.summed(&solver, Cow::Borrowed(capture))?;
    let grid = of_trial.grid(&solver, &whole)?;
    Ok((whole, grid, options))
}

/// Fits with one model of reflectance.
#[derive(Clone)]
pub(crate) struct Trial<'c> {
    gpu: Gpu,
    /// In the bins of the fits.
    capture: Arc<Cow<'c, Capture>>,
    options: SurfaceOptions,
    /// What fits begin with.
    pub begin: FitBegin,
    memory: Option<u64>,
}

/// The grid of a fit, and what the network or the closed form sees in it.
#[derive(Clone)]
pub(crate) struct FitBegin {
    pub grid: Grid,
    pub starts: Arc<Starts>,
    /// Delays of pairs that were undone, metres of path; empty: none.
    pub delays: Vec<f64>,
}

impl FitBegin {
    /// What it is of a capture in which these delays of pairs are undone. `of`: where a pair is.
    pub fn moved(&self, delays: &[f64], of: impl Fn(usize) -> DVec3) -> FitBegin {
        let count = delays.len().max(self.delays.len());
        let at = |delays: &[f64], pair: usize| delays.get(pair).copied().unwrap_or(0.0);
        let by: Vec<f64> = (0..count).map(|pair| at(delays, pair) - at(&self.delays, pair)).collect();
        if by.iter().all(|by| *by == 0.0) {
            return self.clone();
        }
        let mut starts = Starts::clone(&self.starts);
        for maps in &mut starts.layers {
            let [x0, x1, y0, y1] = maps.extent;
            let nearest = |cell: usize| {
                let [u, v] = [cell / CELLS, cell % CELLS].map(|i| (i as f64 + 0.5) / CELLS as f64);
                let place = DVec2::new(x0 + u * (x1 - x0), y0 + v * (y1 - y0));
                let far = |pair: &usize| of(*pair).truncate().distance_squared(place);
                (0..count).min_by(|a, b| far(a).total_cmp(&far(b))).map_or(0.0, |pair| by[pair])
            };
            move_by_delays(maps, &(0..CELLS * CELLS).map(nearest).collect::<Vec<f64>>());
        }
        FitBegin { starts: Arc::new(starts), delays: delays.to_vec(), ..self.clone() }
    }
}

/// Moves a surface as if the delays of the cells of the wall, `[x][y]`, were undone: a depth changes by half of the delay; where the delay has a
/// slope, light came from aside, by half of the slope times the depth.
fn move_by_delays(maps: &mut Maps, cells: &[f64]) {
    let (given, last) = (maps.clone(), CELLS - 1);
    let [x0, x1, y0, y1] = maps.extent;
    let finite = || given.depth.iter().filter(|z| z.is_finite()).map(|z| f64::from(*z));
    let middle = finite().sum::<f64>() / finite().count().max(1) as f64;
    let cell = |ix: usize, iy: usize| [ix * CELLS / given.nx, iy * CELLS / given.ny];
    let delay = |[i, k]: [usize; 2]| cells[i * CELLS + k];
    let pitch = [(x1 - x0) / given.nx as f64, (y1 - y0) / given.ny as f64];
    // Half of the slope of the delays along one axis, from the cells on both sides.
    let half_slope = |at: [usize; 2], axis: usize, length: f64| {
        let beside = |i: usize| std::array::from_fn(|k| if k == axis { i } else { at[k] });
        let [before, behind] = [at[axis].saturating_sub(1), (at[axis] + 1).min(last)];
        let apart = (behind - before) as f64 / CELLS as f64;
        0.5 * (delay(beside(behind)) - delay(beside(before))) / (apart * length)
    };
    let from = |i: usize, slope: f64, pitch: f64, n: usize| {
        (i as f64 - (middle * slope / pitch).round()).clamp(0.0, n as f64 - 1.0) as usize
    };
    for to in 0..given.depth.len() {
        let [ix, iy] = [to / given.ny, to % given.ny];
        let at = cell(ix, iy);
        let fx = from(ix, half_slope(at, 0, x1 - x0), pitch[0], given.nx);
        let fy = from(iy, half_slope(at, 1, y1 - y0), pitch[1], given.ny);
        let seen = fx * given.ny + fy;
        maps.albedo[to] = given.albedo[seen];
        maps.depth[to] = given.depth[seen] - 0.5 * delay(cell(fx, fy)) as f32;
        if !given.mask.is_empty() {
            maps.mask[to] = given.mask[seen];
        }
    }
}

/// What a fit begins with.
#[derive(Debug, Clone, Copy)]
pub(crate) enum From<'l> {
    /// The network or the closed form.
    Start,
    /// The same with one round of the support.
    Brief,
    /// Layers in place of these, in the same way.
    Layers(&'l [Maps]),
    /// Another fit, whose support stays, for a number of iterations.
    Fit(&'l [Maps], usize),
}

impl From<'_> {
    /// Rounds of the support, and iterations of the fit after these.
    fn parts(&self) -> [usize; 2] {
        match self {
            From::Fit(_, iterations) => [0, *iterations],
            From::Brief => [1, ITERATIONS[1]],
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

/// A fit under way.
struct UnderWay {
    fit: Fit,
    growth: Growth,
    /// Iterations of the fit after the rounds, until it is begun.
    last: Option<usize>,
    /// Iterations of all, and those that are done.
    all: usize,
    done: usize,
    /// The run that the device has.
    run: Option<Run>,
    /// Of the fit after the rounds.
    quality: Option<Quality>,
}

impl UnderWay {
    /// Gives the device the next round, or the fit after the rounds. Whether there was one.
    fn begin(&mut self) -> Result<bool> {
        let round = |_: usize| Some(Run::of(ITERATIONS[0], self.all).of_round());
        self.run = self.growth.next(&round);
        if self.run.is_none()
            && let Some(last) = self.last.take()
        {
            self.growth.settle();
            self.run = Some(Run::of(last, self.all));
        }
        self.run.map_or(Ok(()), |run| self.fit.begin(&self.growth.layers, run, self.done))?;
        Ok(self.run.is_some())
    }

    /// Takes the result of the run that the device has.
    fn end(&mut self) -> Result<Option<TracePoint>> {
        let Some(run) = self.run.take() else { return Ok(None) };
        let (point, quality) = self.fit.end(&mut self.growth.layers)?.unzip();
        self.done += run.iterations;
        match self.last {
            Some(_) => self.growth.judge(&mut self.fit, quality)?,
            None => self.quality = quality,
        }
        Ok(point)
    }

    /// The surface. `None` if none is found, or nothing judges it.
    fn fitted(mut self) -> Result<Option<Fitted>> {
        let Some((quality, held)) = self.quality.zip(self.fit.judged()?) else { return Ok(None) };
        let (layers, step) = (self.growth.layers, self.fit.step);
        let surface = Candidate { layers, step, quality, left: Some(held.left()) };
        Ok(Some(Fitted { surface, held }))
    }
}

/// Fits a surface with this impulse response by each trial; steps begin with this length. `None` where no surface is found, or nothing
/// judges it. Fits go on side by side where a device has the memory: the host then waits for all of them at once.
///
/// # Errors
/// The device fails, the watch cancels, or the impulse response has no taps.
pub(crate) fn fit_all(
    trials: &[&Trial<'_>],
    pulse: Option<&Pulse>,
    from: From<'_>,
    step: f64,
    watch: &mut Watch<'_>,
) -> Result<Vec<Option<Fitted>>> {
    let Some(Trial { gpu, memory, .. }) = trials.first() else { return Ok(vec![]) };
    let mut fits = trials.iter().map(|trial| trial.planned(pulse, from)).collect::<Result<Vec<_>>>()?;
    let buffers: Vec<_> = fits.iter().flat_map(|fit| fit.plan().buffers.clone()).collect();
    let is_together = gpu.info.kind != DeviceKind::Host && check(&buffers, &gpu.memory(), *memory).is_ok();
    let (mut fitted, mut before, all) = (vec![], 0, trials.len() * from.iterations());
    let number = if is_together { trials.len() } else { 1 };
    for trials in trials.chunks(number) {
        let begun = trials.iter().zip(fits.drain(..trials.len()));
        let mut some = begun.map(|(trial, fit)| trial.begun(fit, from, step)).collect::<Result<Vec<_>>>()?;
        loop {
            let begun = some.iter_mut().map(UnderWay::begin).collect::<Result<Vec<bool>>>()?;
            if !begun.contains(&true) {
                break;
            }
            // What began last is done last.
            for at in (0..some.len()).rev() {
                let Some(point) = some[at].end()? else { continue };
                let iteration = before + some.iter().map(|fit| fit.done).sum::<usize>();
                let point = TracePoint { iteration, ..point };
                let progress =
                    Progress { doing: Doing::Trial, point, iterations: all, remaining: None, maps: None };
                if (watch.hear)(&progress).is_break() {
                    let what = format!("cancelled by the caller after {iteration} iterations");
                    return Err(Error::new(Kind::Cancelled, what, "run it again"));
                }
            }
        }
        before += trials.len() * from.iterations();
        for fit in some {
            fitted.push(fit.fitted()?);
        }
    }
    Ok(fitted)
}

impl<'c> Trial<'c> {
    /// Prepares fits.
    pub fn new(
        gpu: &Gpu,
        capture: Arc<Cow<'c, Capture>>,
        options: SurfaceOptions,
        begin: FitBegin,
        memory: Option<u64>,
    ) -> Trial<'c> {
        Trial { gpu: gpu.clone(), capture, options, begin, memory }
    }

    /// The model of reflectance.
    pub fn reflectance(&self) -> Reflectance {
        self.options.reflectance
    }

    /// Gives the fits, and what judges them, a high-pass of this length (metres of path) and floor.
    pub fn set_high_pass(&mut self, [length, floor]: [f64; 2]) {
        (self.options.high_pass, self.options.high_pass_floor) = (Some(length), floor);
    }

    /// A fit with this impulse response, planned.
    fn planned(&self, pulse: Option<&Pulse>, from: From<'_>) -> Result<Fit> {
        let outline = self.capture.outline().with(|c| c.pulse = pulse.cloned());
        let problem = Problem { memory: self.memory, ..Problem::new(&outline, self.begin.grid) };
        Fit::new(&self.gpu, &problem, &self.options, [0, from.iterations()], Judge::HeldOut)
    }

    /// A planned fit with the counts, whose steps begin with this length.
    fn begun(&self, mut fit: Fit, from: From<'_>, step: f64) -> Result<UnderWay> {
        let ([rounds, last], all) = (from.parts(), from.iterations());
        fit.take(&self.capture)?;
        fit.step = step;
        let layers = match from {
            From::Start | From::Brief => self.begin.starts.layers.clone(),
            From::Layers(layers) | From::Fit(layers, _) => layers.to_vec(),
        };
        let growth = Growth::new(&fit, Rounds { number: rounds, rings: 1 }, layers);
        Ok(UnderWay { fit, growth, last: Some(last), all, done: 0, run: None, quality: None })
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

    /// The capture, in the bins of the fits.
    pub fn capture(&self) -> &Capture {
        &self.capture
    }

    /// The same fits of another version of the capture.
    pub fn with_capture(&self, capture: Capture) -> Trial<'c> {
        Trial { capture: Arc::new(Cow::Owned(capture)), ..self.clone() }
    }

    /// The pairs that are held out, with the rendering of each version of a surface by sharp paths. Albedos have the scale of the fits.
    ///
    /// # Errors
    /// The device fails.
    pub fn renderings(&self, versions: &[Vec<Maps>]) -> Result<Vec<Option<HeldOut>>> {
        let mut fit = self.judging(&self.options, Judge::HeldOut)?;
        versions.iter().map(|layers| fit.rendered(layers)).collect()
    }

    /// A fit with the counts that only judges.
    fn judging(&self, options: &SurfaceOptions, judge: Judge) -> Result<Fit> {
        let outline = self.capture.outline();
        let problem = Problem { memory: self.memory, ..Problem::new(&outline, self.begin.grid) };
        let mut fit = Fit::new(&self.gpu, &problem, options, [0, 1], judge)?;
        fit.take(&self.capture)?;
        Ok(fit)
    }

    fn rendered(&self, layers: &[Maps], options: &SurfaceOptions, judge: Judge) -> Result<Option<HeldOut>> {
        let mut fit = self.judging(options, judge)?;
        fit.seen(layers, false)?.map_or(Ok(None), |_| fit.judged())
    }
}
