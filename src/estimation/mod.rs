//! Estimates of what the user leaves open: the high-pass of the objective, how surfaces reflect, and the instrument's impulse
//! response. Short surface fits of 64 lateral pixels compare the hypotheses on pairs that they have not seen, in the domain that
//! the solve minimises. Indistinguishable hypotheses are ranked by a fixed order.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::capture::{Capture, Pulse};
use crate::gpu::Gpu;
use crate::solve::option::SceneTraits;
use crate::solve::surface::{Candidate, Starts};
use crate::solve::{
    Begun, Discretisation, Doing, Problem, Progress, Ready, SolverOptions, SurfaceOptions, TracePoint, Watch,
    default_volume,
};
use crate::transport::{Reflectance, Volume};
use crate::{Error, Kind, Result};

mod device;
mod high_pass;
mod model;
mod pulse;
mod request;
mod spread;
mod trial;

pub use crate::solve::surface::{HeldOut, Left};
pub use device::{FoundDevice, device};
pub use high_pass::{FoundHighPass, usual_high_pass};
pub use model::{FoundModel, MODELS};
pub use pulse::FoundPulse;
use pulse::Shape;
pub use request::{EstimateRequest, preset_for};
use spread::ComparedRows;
pub(crate) use spread::add_products;
use trial::{Fitted, From, Trial};

/// Constants of the estimates. Evidence: benches/NOTES.md.
mod constants {
    /// Minimum hold-out size for model selection, pairs.
    pub const LEAST_PAIRS: usize = 16;
    /// Minimum hold-out size for an impulse response of exact values: with fewer pairs, it only hides errors of the depths.
    pub const LEAST_FOR_PULSE: usize = 64;
    /// Pairs that a fit takes at least.
    pub const PAIRS: usize = 512;
    /// Lateral pixels of a fit.
    pub const LATERAL: usize = 64;
    /// Rounds of the support of a fit from the start.
    pub const ROUNDS: usize = 3;
    /// Iterations of a round, and of the fit after the rounds or with another impulse response.
    pub const ITERATIONS: [usize; 2] = [15, 20];
    /// Iterations of fits whose impulse responses are compared: tails differ less than widths do.
    pub const OF_PULSE: usize = 30;
    /// Rounds are left out where a trial's model error exceeds this multiple of that up to which the support follows the evidence:
    /// light of a room or of another instrument draws surface where there is none.
    pub const FAR: f64 = 0.75;
}
use constants::*;

/// Whether the instrument's impulse response is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FindPulse {
    /// Paths are sharp, unless the capture holds an impulse response.
    Never,
    /// If a fit with an impulse response of two bins has a smaller residual than one with sharp paths.
    IfItShows,
    /// In any case.
    Always,
}

/// The estimates of a run.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Estimates {
    /// The gain law of devices near the wall, if their positions are known.
    #[serde(default)]
    pub device: Option<FoundDevice>,
    /// How surfaces reflect, if it was estimated.
    #[serde(default)]
    pub model: Option<FoundModel>,
    /// The high-pass of the objective, if it was estimated.
    #[serde(default)]
    pub high_pass: Option<FoundHighPass>,
    /// The instrument's impulse response, if it was estimated.
    #[serde(default)]
    pub pulse: Option<FoundPulse>,
    /// The share of the union of the network's mask and the true one that both have, as the network expects, if the surface begins
    /// with what it sees.
    #[serde(default)]
    pub expected_iou: Option<f64>,
    /// A surface of sharp paths for each model, with what judges it.
    #[serde(default)]
    pub candidates: Vec<FoundSurface>,
    /// Seconds of all fits.
    pub seconds: f64,
    /// The same by what was estimated.
    #[serde(skip)]
    pub stages: EstimateSeconds,
    /// What the surface of the chosen model shows of the pairs.
    #[serde(skip)]
    pub shown: Option<Shown>,
    /// Whether fits were tried and none found a surface.
    #[serde(skip)]
    pub finds_none: bool,
    /// Layers of the surface that the fits found, and of its start, on coarse pixels.
    #[serde(skip)]
    pub(crate) begun: Option<Begun>,
}

/// Seconds of estimates.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct EstimateSeconds {
    /// The network or the closed form that fits begin with.
    pub start: f64,
    /// The high-pass.
    pub high_pass: f64,
    /// The reflectance, and the start of the surface.
    pub model: f64,
    /// The impulse response.
    pub pulse: f64,
}

impl Estimates {
    /// The estimates as sentences.
    pub fn notes(&self) -> Vec<String> {
        let start = self.expected_iou.map(|iou| {
            format!(
                "the surface begins with what the network sees; it expects an IoU of {iou:.2} (begin with lct or fbp for a \
                 closed form)"
            )
        });
        let high_pass = self.high_pass.iter().map(FoundHighPass::note);
        let device = self.device.iter().map(FoundDevice::note);
        device
            .chain(start)
            .chain(high_pass)
            .chain(self.model.iter().map(FoundModel::note))
            .chain(self.pulse.iter().map(FoundPulse::note))
            .collect()
    }

    /// The solver with its options for the estimated model and high-pass, and the capture with the impulse response.
    ///
    /// # Errors
    /// A width that makes no impulse response. This does not happen with an estimated width.
    pub fn settle<'c>(
        &self,
        solver: &SolverOptions,
        models: &[SolverOptions],
        capture: &'c Capture,
    ) -> Result<(SolverOptions, Cow<'c, Capture>)> {
        let of_model =
            |found: &FoundModel| models.iter().find(|o| o.common().reflectance == found.reflectance).cloned();
        let mut solver = self.model.as_ref().and_then(of_model).unwrap_or_else(|| solver.clone());
        if let (SolverOptions::Surface(options), Some(found)) = (&mut solver, self.high_pass) {
            (options.high_pass, options.high_pass_floor) = (Some(found.length), found.floor);
        }
        let capture = match self.pulse.as_ref().map(FoundPulse::pulse).transpose()?.flatten() {
            Some(pulse) => Cow::Owned(capture.clone().with(|c| c.pulse = Some(pulse))),
            None => Cow::Borrowed(capture),
        };
        Ok((solver, capture))
    }
}

/// Estimates what is requested, by short fits of parts of `capture`, which has counts.
///
/// # Errors
/// The device fails or has too little memory, or `hear` cancels ([`Kind::Cancelled`]). If a fit fails otherwise, the usual model
/// and sharp paths stay, and the solve itself reports the cause.
pub fn estimate(
    request: &EstimateRequest,
    capture: &Capture,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Estimates> {
    let _span = gpu.span("trials");
    let start = Instant::now();
    let finds_model = request.models.len() > 1;
    let find_pulse = request.find_pulse(capture);
    let finds_high_pass = request.finds_high_pass();
    // The solve begins with the surface of the fits where its support may leave that of the start.
    let finds_start = matches!(&request.solver, SolverOptions::Surface(options) if options.grow);
    if !finds_model && find_pulse == FindPulse::Never && !finds_high_pass && !finds_start {
        return Ok(Estimates::default());
    }
    let usual = request.solver.common().reflectance;
    let mut tried = vec![];
    let (mut high_pass, mut begun, mut candidates, mut expected_iou) = (None, None, vec![], None);
    let (mut shown, mut finds_none) = (None, false);
    let mut stages = EstimateSeconds::default();
    let searched = Search::new(request, capture, gpu, hear).and_then(|mut search| {
        stages.start = start.elapsed().as_secs_f64();
        expected_iou = search.starts.seen.as_ref().map(|seen| seen.expected_iou());
        if finds_high_pass {
            high_pass = Some(search.find_high_pass(capture)?);
        }
        stages.high_pass = start.elapsed().as_secs_f64() - stages.start;
        let found = search.run(usual, finds_model);
        stages.pulse = search.pulse_seconds;
        stages.model = start.elapsed().as_secs_f64() - stages.start - stages.high_pass - stages.pulse;
        tried = std::mem::take(&mut search.tried);
        candidates = std::mem::take(&mut search.candidates);
        finds_none = search.sharp.is_empty();
        if let Some((reflectance, _)) = found.as_ref().ok().filter(|_| search.finds_start)
            && let Some(best) = search.sharp.into_iter().find(|s| s.reflectance == *reflectance)
        {
            candidates[best.candidate].kept = true;
            let is_far = !best.fitted.surface.is_coherent(FAR);
            shown = Some(Shown::of(trial_of(&search.trials, *reflectance), best.fitted.clone())?);
            let Candidate { layers, step, .. } = best.fitted.surface;
            let Starts { layers: closed, light, seen } = Starts::clone(&search.starts);
            begun = Some(Begun { layers, closed, is_far: is_far && seen.is_some(), seen, light, step });
        } else if search.finds_start && search.starts.seen.is_some() {
            // No trial found a surface: what the network sees may still explain light at full resolution.
            let Starts { layers, light, seen } = Starts::clone(&search.starts);
            begun = Some(Begun { light, is_far: true, ..Begun::of(layers, seen) });
        }
        found
    });
    let ((reflectance, pulse), failed) = match searched {
        Ok(answer) => (answer, None),
        Err(e) if matches!(e.kind, Kind::Device | Kind::Cancelled) => return Err(e),
        // A fit needs less than the solve.
        Err(e) if e.kind == Kind::Memory => return Err(e),
        Err(e) => ((usual, (find_pulse == FindPulse::Always).then_some(Shape::SHARP)), Some(e.what)),
    };
    let seconds = start.elapsed().as_secs_f64();
    let model = finds_model.then(|| FoundModel::of(reflectance, &tried, failed.clone()));
    let pulse = pulse.map(|shape| FoundPulse::of(shape, reflectance, &tried, stages.pulse, failed));
    Ok(Estimates {
        model,
        high_pass,
        pulse,
        expected_iou,
        candidates,
        seconds,
        stages,
        shown,
        finds_none,
        begun,
        device: None,
    })
}

/// What a short fit of a capture shows of its pairs.
#[derive(Debug, Clone)]
pub struct Shown {
    /// The pairs that it does not take.
    pub held: HeldOut,
    /// All pairs, if much of those that are held out is left.
    pub all: Option<HeldOut>,
}

/// Share that is certainly left beyond noise, from which the residual of all pairs may show a cause.
const DOUBTFUL: f64 = 0.08;

impl Shown {
    fn of(trial: &Trial<'_>, fitted: Fitted) -> Result<Shown> {
        let is_doubtful = fitted.held.left().certain() > DOUBTFUL;
        let all = if is_doubtful { trial.all(&fitted.surface.layers)? } else { None };
        Ok(Shown { held: fitted.held, all })
    }
}

/// What a short fit of another version of the capture shows, with sharp paths, by the model and the high-pass that were `found`.
/// `None` if it finds no surface.
///
/// # Errors
/// The device fails, or `hear` cancels.
pub fn shown(
    request: &EstimateRequest,
    found: &Estimates,
    capture: &Capture,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Option<Shown>> {
    let (solver, _) = found.settle(&request.solver, &request.models, capture)?;
    let request = EstimateRequest { solver, models: vec![], find_pulse: FindPulse::Never, ..request.clone() };
    let searched = Search::new(&request, capture, gpu, hear).and_then(|mut search| {
        let model = search.trials[0].reflectance();
        let fitted = search.fit(model, Shape::SHARP, From::Start)?;
        fitted.map(|fitted| Shown::of(&search.trials[0], fitted)).transpose()
    });
    match searched {
        Err(e) if matches!(e.kind, Kind::Device | Kind::Cancelled) => Err(e),
        searched => Ok(searched.unwrap_or(None)),
    }
}

/// A surface that short fits found, judged on the pairs that are held out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoundSurface {
    /// How it reflects.
    pub reflectance: Reflectance,
    /// What it began with.
    pub start: Origin,
    /// Share of the squares of held-out pairs that it leaves, its standard error, and the share beyond photon noise.
    pub left: [f64; 3],
    /// Logarithm of what is left beyond noise, with the price of its pixels.
    pub cost: f64,
    /// Seconds of its fits.
    pub seconds: f64,
    /// The solve begins with it.
    pub kept: bool,
}

/// A start of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// The network.
    Learned,
    /// The closed form.
    Closed,
}

impl FoundSurface {
    fn of(reflectance: Reflectance, start: Origin, fitted: &Fitted, seconds: f64) -> FoundSurface {
        let left = fitted.surface.left.as_ref();
        FoundSurface {
            reflectance,
            start,
            left: left.map_or([f64::NAN; 3], |l| [l.share(), l.standard_error(), l.excess()]),
            cost: fitted.surface.cost(),
            seconds,
            kept: false,
        }
    }
}

/// A hypothesis, and the residual of its fit on the hold-out set.
#[derive(Debug, Clone, PartialEq)]
struct Tried {
    reflectance: Reflectance,
    pulse: Shape,
    left: Option<Left>,
}

/// The sharp fit of a model, and the impulse response that its residual suggests, with the residual then.
struct Sharp {
    reflectance: Reflectance,
    fitted: Fitted,
    /// Its number among the candidates.
    candidate: usize,
    suggested: Option<(Shape, Left)>,
}

/// Progress of all fits together: iterations that are done, and how many the fits will take as far as that is known.
struct FitProgress {
    begun: Instant,
    done: usize,
    expected: usize,
}

impl FitProgress {
    /// The fits that choose an impulse response.
    const OF_PULSE: usize = ITERATIONS[1] + pulse::SHARES.len() * OF_PULSE;

    /// The progress of a fit as that of all.
    fn of(&self, progress: &Progress) -> Progress {
        let done = self.done + progress.point.iteration;
        let expected = self.expected.max(self.done + progress.iterations);
        let seconds = self.begun.elapsed().as_secs_f64();
        let remaining = (done > 0).then(|| seconds * (expected - done.min(expected)) as f64 / done as f64);
        let point = TracePoint { iteration: done, seconds, ..progress.point };
        Progress { doing: Doing::Trial, point, iterations: expected, remaining, maps: None }
    }

    /// A fit of these iterations is done, or is not needed.
    fn pass(&mut self, iterations: usize) {
        self.done += iterations;
    }

    /// Other fits than those that were expected are ahead.
    fn expect(&mut self, ahead: usize) {
        self.expected = self.done + ahead;
    }
}

/// The fits of a capture.
struct Search<'t> {
    /// One for each model, the usual one first.
    trials: Vec<Trial<'t>>,
    starts: Arc<Starts>,
    /// The sharp fit of each model, and the impulse response that its residual suggests.
    sharp: Vec<Sharp>,
    /// Metres of path.
    bin_width: f64,
    /// The narrowest impulse response that the solve, whose bins may be narrower, models: in bins of the fits.
    narrowest: f64,
    /// The length of the longest suggestion, metres.
    longest: f64,
    /// The impulse response of the capture, if it has one.
    known: Option<Pulse>,
    find_pulse: FindPulse,
    hear: &'t mut dyn FnMut(&Progress) -> ControlFlow<()>,
    pace: FitProgress,
    tried: Vec<Tried>,
    candidates: Vec<FoundSurface>,
    /// Seconds spent on the impulse response.
    pulse_seconds: f64,
    /// Whether the support may leave that of the start.
    finds_start: bool,
    /// The length of the last steps, as a share of the longest ones.
    step: f64,
}

impl<'t> Search<'t> {
    fn new(
        request: &EstimateRequest,
        capture: &'t Capture,
        gpu: &'t Gpu,
        hear: &'t mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Search<'t>> {
        let all =
            if request.models.is_empty() { std::slice::from_ref(&request.solver) } else { &request.models };
        if capture.pair_count() / 2 < LEAST_PAIRS {
            return Err(Error::input(
                format!("estimates need {} pairs, the capture has {}", 2 * LEAST_PAIRS, capture.pair_count()),
                "name the model and the impulse response if known",
            ));
        }
        let options = quick(&all[0]);
        let of_all = || default_volume(capture, options.min_depth);
        let volume: Volume = request.discretisation.volume.map_or_else(of_all, Ok)?;
        let of_trial =
            Discretisation { volume: Some(volume), bins: request.discretisation.bins, depth_pitch: None };
        let Ready { capture: whole, grid, .. } =
            of_trial.ready(&options.clone().into(), Cow::Borrowed(capture))?;
        let finds_start = all[0].as_surface().grow;
        let [high_pass, models] = [usize::from(request.finds_high_pass()), all.len()];
        let pulse = match request.find_pulse(capture) {
            FindPulse::Never => 0,
            FindPulse::IfItShows => ITERATIONS[1],
            FindPulse::Always => FitProgress::OF_PULSE,
        };
        let expected = (high_pass + models) * From::Start.iterations() + pulse;
        let pace = FitProgress { begun: Instant::now(), done: 0, expected };
        let mut watch_hear = |p: &Progress| hear(&pace.of(&Progress { iterations: 0, ..p.clone() }));
        let mut watch = Watch { hear: &mut watch_hear, maps_every: None, maps_at: &[] };
        let problem = Problem { memory: request.memory, ..Problem::new(&whole, grid) };
        let starts = Arc::new(Starts::of(gpu, [capture, &whole], &problem, &options, &mut watch)?);
        let whole = Arc::new(whole);
        let of_solve =
            request.discretisation.sum(&request.solver, &capture.outline()) as f64 * capture.bin_width;
        let trial = |options: &SolverOptions| {
            Trial::new(gpu, whole.clone(), grid, quick(options), starts.clone(), request.memory)
        };
        Ok(Search {
            trials: all.iter().map(trial).collect(),
            starts,
            sharp: vec![],
            bin_width: whole.bin_width,
            narrowest: pulse::NARROWEST * of_solve / whole.bin_width,
            longest: pulse::longest(whole.bin_width, SceneTraits::of(capture).wall),
            known: capture.pulse.clone(),
            find_pulse: request.find_pulse(capture),
            hear,
            pace,
            tried: vec![],
            candidates: vec![],
            pulse_seconds: 0.0,
            finds_start,
            step: 1.0,
        })
    }

    /// Estimates the high-pass by a fit of the first model. All later fits have it, and are judged by it.
    fn find_high_pass(&mut self, capture: &Capture) -> Result<FoundHighPass> {
        let length = usual_high_pass(capture);
        let first = self.trials[0].reflectance();
        let fitted = self.fit(first, Shape::SHARP, From::Start)?;
        let bands = fitted.map_or([f64::NAN; 2], |fitted| fitted.held.bands(length));
        let found = FoundHighPass::of(length, bands);
        self.trials.iter_mut().for_each(|trial| trial.set_high_pass([found.length, found.floor]));
        Ok(found)
    }

    /// Fits a hypothesis. `None` if no surface is found.
    fn fit(&mut self, reflectance: Reflectance, shape: Shape, from: From<'_>) -> Result<Option<Fitted>> {
        let Search { trials, hear, known, pace, step, .. } = self;
        let trial = trial_of(trials, reflectance);
        let mut reported = |p: &Progress| hear(&pace.of(p));
        let mut watch = Watch { hear: &mut reported, maps_every: None, maps_at: &[] };
        let pulse = shape.centred()?.or(known.clone());
        let fitted = trial.fit(pulse.as_ref(), from, *step, &mut watch)?;
        pace.pass(from.iterations());
        *step = fitted.as_ref().map_or(*step, |fitted| fitted.surface.step);
        Ok(fitted)
    }

    /// Fits every model with sharp paths.
    fn fit_sharp(&mut self) -> Result<()> {
        let models: Vec<Reflectance> = self.trials.iter().map(Trial::reflectance).collect();
        for reflectance in models {
            let best = self.candidate(reflectance)?;
            let left = best.as_ref().and_then(|(fitted, _)| fitted.surface.left.clone());
            self.tried.push(Tried { reflectance, pulse: Shape::SHARP, left });
            let Some((fitted, candidate)) = best else { continue };
            let clock = Instant::now();
            let suggested = match self.find_pulse {
                FindPulse::Never => None,
                _ => self.suggested(&fitted.held, &Shape::all(self.bin_width, self.longest))?,
            };
            self.pulse_seconds += clock.elapsed().as_secs_f64();
            self.sharp.push(Sharp { reflectance, fitted, candidate, suggested });
        }
        Ok(())
    }

    /// A sharp fit of a model, and its number among the candidates.
    fn candidate(&mut self, model: Reflectance) -> Result<Option<(Fitted, usize)>> {
        let clock = Instant::now();
        let Some(fitted) = self.fit(model, Shape::SHARP, From::Start)? else { return Ok(None) };
        let start = if self.starts.seen.is_some() { Origin::Learned } else { Origin::Closed };
        self.candidates.push(FoundSurface::of(model, start, &fitted, clock.elapsed().as_secs_f64()));
        Ok(Some((fitted, self.candidates.len() - 1)))
    }

    /// The sharp fit of a model, if it found a surface.
    fn sharp(&self, reflectance: Reflectance) -> Option<&Sharp> {
        self.sharp.iter().find(|s| s.reflectance == reflectance)
    }

    /// Of these impulse responses, the one that an ideal rendering of the hold-out set suggests, and the residual with it.
    fn suggested(&self, ideal: &HeldOut, shapes: &[Shape]) -> Result<Option<(Shape, Left)>> {
        let pulses = shapes.iter().filter_map(|shape| shape.centred().transpose());
        let taps = pulses.map(|p| p.and_then(|p| p.taps(self.bin_width))).collect::<Result<Vec<_>>>()?;
        let [rendered, measured] = ideal.sides();
        let rows = ComparedRows { rendered: &rendered, measured: &measured, bins: ideal.bins() };
        Ok(rows.best(&taps).map(|(at, pairs)| (shapes[at], ideal.left_with(pairs))))
    }

    /// The same length without a tail, metres.
    fn suggested_length(&self, ideal: &HeldOut) -> Result<Option<f64>> {
        let plain = Shape::plain(self.bin_width, self.longest);
        Ok(self.suggested(ideal, &plain)?.map(|(shape, _)| shape.length()))
    }

    /// The residual of a hypothesis with an impulse response, whose fit continues the sharp one.
    fn left(&mut self, reflectance: Reflectance, pulse: Shape) -> Result<Option<Left>> {
        let of = (reflectance, pulse);
        if let Some(same) = self.tried.iter().find(|t| (t.reflectance, t.pulse) == of) {
            return Ok(same.left.clone());
        }
        let left = self.spread(reflectance, pulse, OF_PULSE)?.and_then(|surface| surface.left);
        self.tried.push(Tried { reflectance, pulse, left: left.clone() });
        Ok(left)
    }

    /// Continues the sharp fit of a model with an impulse response, for a number of iterations.
    fn spread(
        &mut self,
        reflectance: Reflectance,
        pulse: Shape,
        iterations: usize,
    ) -> Result<Option<Candidate>> {
        let Some(sharp) = self.sharp(reflectance) else { return Ok(None) };
        let from = sharp.fitted.surface.layers.clone();
        Ok(self.fit(reflectance, pulse, From::Fit(&from, iterations))?.map(|fitted| fitted.surface))
    }

    /// Models are compared with the impulse responses that their sharp fits suggest. The best of them finds its own.
    fn run(&mut self, usual: Reflectance, finds_model: bool) -> Result<(Reflectance, Option<Shape>)> {
        self.fit_sharp()?;
        let models: Vec<Reflectance> =
            if finds_model { self.trials.iter().map(Trial::reflectance).collect() } else { vec![usual] };
        // With the suggested impulse response, and as the choice needs it.
        let (mut spread, mut residuals) = (vec![], vec![]);
        for model in &models {
            let Some(Sharp { fitted, suggested, .. }) = self.sharp(*model) else {
                residuals.push((*model, None));
                continue;
            };
            let left = fitted.surface.left.as_ref().expect("trials are judged");
            let less = suggested.as_ref().map(|s| &s.1).filter(|less| less.share() < left.share());
            spread.push((*model, Some(less.unwrap_or(left).clone())));
            let always = self.find_pulse == FindPulse::Always;
            residuals.push((*model, Some(less.filter(|_| always).unwrap_or(left).clone())));
        }
        let no_surface =
            || Error::input("no fit found a surface", "name the model and the impulse response if known");
        let model = model::choose(&residuals).ok_or_else(no_surface)?;
        let clock = Instant::now();
        let found = self.find_pulse(model, &spread);
        self.pulse_seconds += clock.elapsed().as_secs_f64();
        found
    }

    /// The impulse response with the best model, if one is to be found. Models that are not beaten, by what their sharp fits suggest,
    /// are compared again with it.
    fn find_pulse(
        &mut self,
        mut model: Reflectance,
        spread: &[(Reflectance, Option<Left>)],
    ) -> Result<(Reflectance, Option<Shape>)> {
        let finds_pulse = match self.find_pulse {
            FindPulse::Never => false,
            FindPulse::IfItShows => self.shows_pulse(model)?,
            FindPulse::Always => true,
        };
        if !finds_pulse {
            return Ok((model, None));
        }
        self.pace.expect(FitProgress::OF_PULSE);
        let mut pulse = self.best_pulse(model)?;
        let rivals: Vec<Reflectance> =
            model::unbeaten(spread).into_iter().filter(|rival| *rival != model).collect();
        if pulse != Shape::SHARP && !rivals.is_empty() {
            self.pace.expect(rivals.len() * OF_PULSE);
            let mut again = vec![(model, self.left(model, pulse)?)];
            for rival in rivals {
                again.push((rival, self.left(rival, pulse)?));
            }
            let other = model::choose(&again).unwrap_or(model);
            if other != model {
                model = other;
                self.pace.expect(FitProgress::OF_PULSE);
                pulse = self.best_pulse(model)?;
            }
        }
        Ok((model, Some(pulse)))
    }

    /// Whether this model's residual shows an impulse response. Without normals every curved surface seems to have one.
    fn shows_pulse(&mut self, reflectance: Reflectance) -> Result<bool> {
        if !reflectance.has_normals() {
            return Ok(false);
        }
        let wide = Shape::of(pulse::FIRST * self.bin_width, 0.0);
        let sharp = self.sharp(reflectance).and_then(|sharp| sharp.fitted.surface.left.clone());
        let wide = self.left(reflectance, wide)?;
        let Some((sharp, wide)) = sharp.zip(wide).filter(|(sharp, wide)| wide.is_less(sharp)) else {
            return Ok(false);
        };
        // As many more iterations with sharp paths may do the same.
        let longer = self.spread(reflectance, Shape::SHARP, OF_PULSE)?.and_then(|surface| surface.left);
        Ok(wide.is_less(&longer.unwrap_or(sharp)))
    }

    /// The impulse response with this model. Convolutions of an ideal rendering suggest its length; a surface fitted with that corrects
    /// it, as a sharp one has moved to compensate. Fits of the corrected length with several tails end the search: the best one must
    /// leave less than the sharp fit.
    fn best_pulse(&mut self, reflectance: Reflectance) -> Result<Shape> {
        let Some(Sharp { fitted, .. }) = self.sharp(reflectance) else {
            return Err(Error::input("a fit found no surface", "give the instrument's impulse response"));
        };
        let sharp = fitted.surface.left.clone().expect("trials are judged");
        let Some(first) = self.suggested_length(&fitted.held)? else { return Ok(Shape::SHARP) };
        let surface = self.spread(reflectance, Shape::of(first, 0.0), ITERATIONS[1])?;
        let is_less = |surface: &Candidate| surface.left.as_ref().is_some_and(|l| l.share() < sharp.share());
        let Some(surface) = surface.filter(is_less) else { return Ok(Shape::SHARP) };
        let ideal = trial_of(&self.trials, reflectance).ideal(&surface.layers)?;
        let Some(second) = ideal.map(|ideal| self.suggested_length(&ideal)).transpose()?.flatten() else {
            return Ok(Shape::SHARP);
        };
        let length = pulse::settled(first, second);
        // A length that the solve's bins cannot show, or a residual that falls up to the longest.
        if length < self.narrowest * self.bin_width || !pulse::is_below(length, self.longest) {
            return Ok(Shape::SHARP);
        }
        let mut each: Vec<Option<Left>> = vec![];
        for share in pulse::SHARES {
            each.push(self.left(reflectance, Shape::of(length, share))?);
            // Longer tails are worse than one that is worse than none.
            if let [Some(plain), Some(tailed)] = &each[..]
                && tailed.share() >= plain.share()
            {
                break;
            }
        }
        // A shape without a surface is no better one.
        let shares =
            std::array::from_fn(|i| each.get(i).and_then(Option::as_ref).map_or(f64::INFINITY, Left::share));
        let least = each.iter().flatten().min_by(|a, b| a.share().total_cmp(&b.share()));
        let is_tailed =
            each[0].as_ref().is_none_or(|plain| least.is_some_and(|least| is_worth(least, plain)));
        let share = if is_tailed { pulse::best_share(shares) } else { 0.0 };
        let is_pulse = least.is_some_and(|least| is_worth(least, &sharp));
        Ok(if is_pulse { Shape::of(length, share) } else { Shape::SHARP })
    }
}

/// Whether a residual is smaller than another one beyond chance, and by enough to be worth a longer model.
fn is_worth(left: &Left, than: &Left) -> bool {
    left.share() < (1.0 - pulse::WORTH) * than.share() && left.is_less(than)
}

fn trial_of<'s, 't>(trials: &'s [Trial<'t>], reflectance: Reflectance) -> &'s Trial<'t> {
    trials.iter().find(|t| t.reflectance() == reflectance).expect("a trial for every model")
}

/// The options of a fit.
fn quick(options: &SolverOptions) -> SurfaceOptions {
    options.as_surface().with(|o| {
        o.lateral = o.lateral.min(LATERAL);
        o.iterations = ITERATIONS[1];
        o.grow = false;
        o.points = None;
        o.sparsity = 0.0;
        o.pairs = PAIRS;
    })
}
