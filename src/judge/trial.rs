//! Short fits of a surface, judged on pairs that they do not take: of a capture as it is, and of versions of it without a law.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::correction::{Law, LawScan};
use super::decide::{EvidenceGate, both};
use super::job::Job;
use crate::capture::{Capture, Pulse};
use crate::engine::{Doing, OnProgress, Problem, Progress, TracePoint, Watch};
use crate::gpu::{DeviceKind, Gpu, check};
use crate::maps::Maps;
use crate::methods::SolverOptions;
use crate::settings::Settings;
use crate::surface::{
    Candidate, Fit, Growth, HeldOut, Judge, Left, Quality, Rounds, Run, Starts, SurfaceOptions,
};
use crate::transport::{Grid, Reflectance};
use crate::{Error, Kind, Result};

/// Minimum hold-out size for model selection, pairs.
const LEAST_PAIRS: usize = 16;
/// Pairs that a fit takes at least.
pub const PAIRS: usize = 512;
/// Lateral pixels of a fit.
pub const LATERAL: usize = 64;
/// Rounds of the support of a fit from the start.
const ROUNDS: usize = 3;
/// Iterations of a round, and of the fit after the rounds or with another impulse response.
pub const ITERATIONS: [usize; 2] = [15, 20];
/// Iterations of a fit that continues a surface with a change of the instrument.
pub const OF_CHANGE: usize = 20;
/// A law that leaves this many times as much where it begins is not tried elsewhere: one laser in the middle of a confocal scan 3.7 to 8.6.
const HOPELESS: f64 = 2.0;
/// Fits of a search, as its progress expects them.
const USUAL: usize = 80;
/// Cells per side of the wall; all of a cell moves by the delay of one pair.
const CELLS: usize = 16;

/// Options of a short fit with this number of lateral pixels.
fn quick(options: &SolverOptions, pixels: usize) -> SurfaceOptions {
    options.as_surface().with(|o| {
        o.lateral = pixels;
        o.iterations = ITERATIONS[1];
        o.grow = false;
        o.points = None;
        o.sparsity = 0.0;
        o.pairs = PAIRS;
    })
}

/// The capture of a job in the bins of short fits, their grid of `pixels` lateral pixels, and their options.
///
/// # Errors
/// Too few pairs, or a box that the capture does not allow.
fn for_fits<'j>(
    job: &'j Job<'_>,
    solver: &SolverOptions,
    pixels: usize,
) -> Result<(Cow<'j, Capture>, Grid, SurfaceOptions)> {
    let (capture, settings) = (&*job.capture, &job.settings);
    if capture.pair_count() / 2 < LEAST_PAIRS {
        return Err(Error::input(
            format!("estimates need {} pairs, the capture has {}", 2 * LEAST_PAIRS, capture.pair_count()),
            "name the model and the impulse response if known",
        ));
    }
    let options = quick(solver, job.solver.common().lateral.min(pixels));
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
    grid: Grid,
    pub starts: Arc<Starts>,
    /// Delays of pairs that were undone, metres of path; empty: none.
    delays: Vec<f64>,
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

impl Fitted {
    /// What it leaves of the pairs that are held out.
    pub fn left(&self) -> &Left {
        self.surface.left.as_ref().expect("a fit is judged")
    }
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
    let planned =
        |trial: &&Trial<'_>| trial.planned(pulse, &trial.options, from.iterations(), Judge::HeldOut);
    let mut fits = trials.iter().map(planned).collect::<Result<Vec<_>>>()?;
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
    /// Fits of the job's capture by these models, on `pixels` lateral pixels, from what the network or a closed form sees.
    ///
    /// # Errors
    /// Too few pairs, or a box that the capture does not allow; the device fails, or the watch cancels.
    pub fn of_models(
        job: &'c Job<'_>,
        models: &[SolverOptions],
        pixels: usize,
        gpu: &Gpu,
        watch: &mut Watch<'_>,
    ) -> Result<Vec<Trial<'c>>> {
        let (whole, grid, options) = for_fits(job, &models[0], pixels)?;
        let problem = Problem { memory: job.settings.memory, ..Problem::new(&whole, grid) };
        let starts = Arc::new(Starts::of(gpu, [&job.capture, &whole], &problem, &options, watch)?);
        let capture = Arc::new(whole);
        let trial = |model: &SolverOptions| Trial {
            gpu: gpu.clone(),
            capture: capture.clone(),
            options: quick(model, options.lateral),
            begin: FitBegin { grid, starts: starts.clone(), delays: vec![] },
            memory: job.settings.memory,
        };
        Ok(models.iter().map(trial).collect())
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
    fn planned(
        &self,
        pulse: Option<&Pulse>,
        options: &SurfaceOptions,
        iterations: usize,
        judge: Judge,
    ) -> Result<Fit> {
        let outline = self.capture.outline().with(|c| c.pulse = pulse.cloned());
        let problem = Problem { memory: self.memory, ..Problem::new(&outline, self.begin.grid) };
        Fit::new(&self.gpu, &problem, options, [0, iterations], judge)
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
        let mut fit = self.planned(self.capture.pulse.as_ref(), options, 1, judge)?;
        fit.take(&self.capture)?;
        Ok(fit)
    }

    fn rendered(&self, layers: &[Maps], options: &SurfaceOptions, judge: Judge) -> Result<Option<HeldOut>> {
        let mut fit = self.judging(options, judge)?;
        fit.seen(layers, false)?.map_or(Ok(None), |_| fit.judged())
    }
}

/// A law with numbers for fits to begin with.
#[derive(Debug, Clone)]
pub struct Proposal {
    pub law: &'static Law,
    pub starts: Vec<Vec<f64>>,
    /// Whether it changes the picture by more than fits follow: the network looks at the capture without it first.
    pub is_far: bool,
}

/// A law with numbers that a fit judged.
#[derive(Clone)]
pub struct TriedLaw {
    pub law: &'static Law,
    pub numbers: Vec<f64>,
    /// Of the pairs that both hold out: what is left once it is undone, and as the capture is.
    pub left: [Left; 2],
    pub fitted: Fitted,
    /// What the fit began with.
    pub begun: FitBegin,
    /// Whether that is what the network sees once these numbers are undone.
    is_seen: bool,
}

impl TriedLaw {
    /// What is left once it is undone, over what is left as the capture is, of the same pairs.
    pub fn share_left(&self) -> f64 {
        self.left[0].excess() / self.left[1].excess().max(f64::MIN_POSITIVE)
    }

    fn is_of(&self, law: &Law, numbers: &[f64]) -> bool {
        self.law.name == law.name && self.numbers == numbers
    }

    /// By what is left.
    pub fn compared(&self, other: &TriedLaw) -> Ordering {
        self.share_left().total_cmp(&other.share_left())
    }

    pub fn passes(&self, gate: EvidenceGate) -> bool {
        let law = self.law;
        let is_far = law.least == 0.0 || self.numbers.iter().any(|n| n.abs() >= law.least);
        let is_inside = self.numbers.iter().zip(law.steps).all(|(n, [_, far])| n.abs() < 0.98 * far);
        // A number at its bound is no minimum.
        is_far
            && (is_inside || law.steps[0][0] == 0.0)
            && !(law.is_other)(&self.numbers)
            && gate.passes(&self.left)
    }
}

/// Fits that judge corrections of a capture.
pub struct Trials<'j> {
    pub job: &'j Job<'j>,
    pub trial: Trial<'j>,
    pulse: Option<Pulse>,
    pub scan: LawScan,
    /// The surface of the capture as it is.
    pub base: Fitted,
    pub gpu: &'j Gpu,
    hear: &'j mut OnProgress<'j>,
    /// What fits begin with: brief ones until laws are fitted whole.
    pub from: From<'static>,
    /// All trials so far: a minimiser comes back to the same numbers.
    pub tried: Vec<TriedLaw>,
    /// Whether a step of a law that others resemble leaves less.
    pub is_scaled: bool,
    /// Fits so far.
    done: usize,
}

impl<'j> Trials<'j> {
    /// Trials by fits that begin so. `None` if no surface is found.
    pub fn new(
        job: &'j Job<'j>,
        starts: Arc<Starts>,
        from: From<'static>,
        gpu: &'j Gpu,
        hear: &'j mut OnProgress<'j>,
    ) -> Result<Option<Trials<'j>>> {
        let (solver, pulse) = job.estimated()?;
        let pulse = pulse.or(job.capture.pulse.clone());
        let (mut whole, grid, options) = for_fits(job, &solver, LATERAL)?;
        if pulse.is_some() {
            whole.to_mut().pulse.clone_from(&pulse);
        }
        let scan = LawScan::of(&whole);
        let begin = FitBegin { grid, starts, delays: vec![] };
        let capture = Arc::new(whole);
        let trial = Trial { gpu: gpu.clone(), capture, options, begin, memory: job.settings.memory };
        let quiet = &mut |_: &Progress| ControlFlow::Continue(());
        let base = fit_all(&[&trial], pulse.as_ref(), from, 1.0, &mut Watch::of(quiet))?.pop().flatten();
        let (tried, is_scaled, done) = (vec![], false, 0);
        Ok(base.map(|base| Trials { job, trial, pulse, scan, base, gpu, hear, from, tried, is_scaled, done }))
    }

    /// Fits of other versions of the capture.
    pub fn fits(&mut self, trials: &[Trial<'_>], from: From<'_>, step: f64) -> Result<Vec<Option<Fitted>>> {
        let Trials { hear, done, .. } = self;
        let iteration = *done;
        *done += trials.len();
        let mut reported = |progress: &Progress| {
            let (point, iterations) = (TracePoint { iteration, ..progress.point }, USUAL.max(iteration));
            hear(&Progress { doing: Doing::Search, point, iterations, remaining: None, maps: None })
        };
        let trials: Vec<&Trial<'_>> = trials.iter().collect();
        fit_all(&trials, self.pulse.as_ref(), from, step, &mut Watch::of(&mut reported))
    }

    /// What a fit leaves once these numbers of a law are undone, which begins with the surface at hand, moved by its delays; `None` without a
    /// surface.
    pub fn judged(&mut self, law: &'static Law, numbers: &[f64]) -> Result<Option<TriedLaw>> {
        if let Some(same) = self.tried.iter().find(|of| of.is_of(law, numbers)) {
            return Ok(Some(same.clone()));
        }
        let mut undone = self.trial.with_capture(law.undone(self.trial.capture(), &self.scan, numbers));
        let delays = law.delays(&self.scan, numbers);
        undone.begin = self.trial.begin.moved(&delays, |pair| self.scan.place_of(pair));
        let Some(fitted) = self.fits(&[undone], self.from, 1.0)?.pop().flatten() else { return Ok(None) };
        let gains = law.gains(&self.scan, numbers);
        let left = both(&fitted.held, &self.base.held, gains.as_deref());
        let begun = self.trial.begin.clone();
        let tried = TriedLaw { law, numbers: numbers.to_vec(), left, fitted, begun, is_seen: false };
        self.tried.push(tried.clone());
        Ok(Some(tried))
    }

    /// The start of a proposal that leaves least.
    pub fn begun(&mut self, Proposal { law, starts, is_far }: &Proposal) -> Result<Option<TriedLaw>> {
        let mut best: Option<TriedLaw> = None;
        for start in starts {
            let tried = if *is_far { self.looked_at(law, start)? } else { self.judged(law, start)? };
            best = best.into_iter().chain(tried).min_by(TriedLaw::compared);
            // Looks take most of the time of a fit.
            if *is_far && best.as_ref().is_none_or(|best| best.share_left() > HOPELESS) {
                break;
            }
        }
        Ok(best)
    }

    /// The same as [`Self::judged`] by a fit that begins with what the network sees once these numbers are undone.
    pub fn looked_at(&mut self, law: &'static Law, numbers: &[f64]) -> Result<Option<TriedLaw>> {
        if let Some(same) = self.tried.iter().find(|of| of.is_seen && of.is_of(law, numbers)) {
            return Ok(Some(same.clone()));
        }
        let undone = self.job.with_capture(Cow::Owned(law.undone(&self.job.capture, &self.scan, numbers)));
        let delays = law.delays(&self.scan, numbers);
        let model = std::slice::from_ref(&undone.solver);
        let seen =
            Trial::of_models(&undone, model, LATERAL, self.gpu, &mut Watch::of(self.hear))?.swap_remove(0);
        let begin = FitBegin { delays, ..seen.begin };
        self.tried.retain(|of| !of.is_of(law, numbers));
        let seen = self.beginning_with(begin, |trials| trials.judged(law, numbers))?;
        if let Some(last) = self.tried.last_mut().filter(|_| seen.is_some()) {
            last.is_seen = true;
        }
        Ok(seen)
    }

    /// What this does with fits that begin so.
    pub fn beginning_with<T>(&mut self, begin: FitBegin, does: impl FnOnce(&mut Self) -> T) -> T {
        let own = std::mem::replace(&mut self.trial.begin, begin);
        let done = does(self);
        self.trial.begin = own;
        done
    }
}
