//! The search over hypotheses on the physics of a capture: short fits of each, judged on the same held-out pairs.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use super::decide::EvidenceGate;
use super::estimates::{
    BY_CHANCE, EstimateSeconds, Estimates, FindPulse, FoundHighPass, FoundModel, FoundPulse, FoundSurface,
    Origin,
};
use super::job::Job;
use super::pulse::{self, Shape};
use super::response::{self, Response, ResponseSamples};
use super::trial::{Fitted, From, ITERATIONS, LATERAL, Trial, fit_all};
use crate::capture::{Capture, Pulse};
use crate::engine::{Doing, OnProgress, Progress, TracePoint, Watch};
use crate::gpu::Gpu;
use crate::options::SceneTraits;
use crate::surface::{Begun, HeldOut, Left, Starts};
use crate::transport::Reflectance;
use crate::{Error, Kind, Result};

/// Iterations of fits whose impulse responses are compared: tails differ less than widths do.
const OF_PULSE: usize = 30;
/// Iterations of the fits that choose an impulse response.
const OF_PULSES: usize = ITERATIONS[1] + pulse::SHARES.len() * OF_PULSE;
/// Rounds are left out where a trial's model error exceeds this multiple of that up to which the support follows the evidence:
/// light of a room or of another instrument draws surface where there is none.
const FAR: f64 = 0.75;
/// Fits begin with the union of the network and a light-cone transform, too, where this share is certainly left beyond noise, and at most
/// this: more is the light of a room, which haze explains.
const UNION_LEFT: [f64; 2] = [0.03, 0.25];
/// Share of what is left up to which the network missed surface: what the fit from the union shows counts as seen.
const UNION_SHOWN: f64 = 0.6;

/// The order in which falloffs are kept where the hold-out set cannot tell them apart. Among models of one falloff the objective is
/// the same, so the one that leaves less is the better one (benches/NOTES.md, "Models by what they leave").
const FIRST: [Reflectance; 4] =
    [Reflectance::Cosine, Reflectance::Retroreflective, Reflectance::Isotropic, Reflectance::Lambertian];

/// Estimates what the job leaves open, by short fits of parts of its capture, if that has light.
///
/// # Errors
/// The device fails or has too little memory, or `hear` cancels ([`Kind::Cancelled`]). If a fit fails otherwise, the usual model
/// and sharp paths stay, and the solve itself reports the cause.
pub fn estimate<'c>(mut job: Job<'c>, gpu: &Gpu, hear: &mut OnProgress<'_>) -> Result<Job<'c>> {
    if job.has_light() {
        let Estimates { findings, seconds, walls, .. } = std::mem::take(&mut job.estimates);
        let found = found(&job, gpu, hear)?;
        let stages = EstimateSeconds { search: seconds, ..found.stages };
        job.estimates = Estimates { findings, walls, seconds: seconds + found.seconds, stages, ..found };
    }
    Ok(job)
}

fn found(job: &Job<'_>, gpu: &Gpu, hear: &mut OnProgress<'_>) -> Result<Estimates> {
    let _span = gpu.span("trials");
    let start = Instant::now();
    let (finds_model, find_pulse) = (job.models.len() > 1, job.find_pulse());
    if !finds_model && find_pulse == FindPulse::Never && !job.finds_high_pass() && !job.finds_start() {
        return Ok(Estimates::default());
    }
    let (mut found, mut tried) = (Estimates::default(), vec![]);
    let (mut samples, mut is_by_chance) = (None, false);
    let searched = Physics::new(job, gpu, hear).and_then(|mut search| {
        let chosen = search.run();
        (found, tried, is_by_chance) = (search.found, search.tried, search.is_by_chance);
        samples = search.samples.map(|(samples, _)| samples);
        chosen
    });
    let ((reflectance, shape), failed) = match searched {
        Ok(chosen) => (chosen, None),
        // A fit needs less memory than the solve.
        Err(e) if matches!(e.kind, Kind::Device | Kind::Cancelled | Kind::Memory) => return Err(e),
        Err(e) => {
            let shape = (find_pulse == FindPulse::Always).then_some(Shape::SHARP);
            ((job.solver.common().reflectance, shape), Some(e.what))
        }
    };
    found.seconds = start.elapsed().as_secs_f64();
    let share = |t: &Tried| t.fitted.as_ref().map(|fitted| fitted.left().share());
    found.model = finds_model.then(|| FoundModel {
        reflectance,
        trials: tried.iter().map(|t| (t.reflectance, t.pulse.fwhm, share(t))).collect(),
        is_by_chance,
        failed: failed.clone(),
    });
    found.pulse = shape.map(|Shape { fwhm, tail }| {
        let of_model = tried.iter().filter(|t| t.reflectance == reflectance);
        let trials = of_model.filter_map(|t| Some([t.pulse.fwhm, t.pulse.tail, share(t)?])).collect();
        let by_samples = samples.as_ref().map(|samples| [samples.pulse().fwhm(), 0.0]);
        let [fwhm, tail] = by_samples.unwrap_or([fwhm, tail]);
        FoundPulse { fwhm, tail, samples, trials, seconds: found.stages.pulse, failed }
    });
    Ok(found)
}

/// The held-out pairs of a short fit of another version of the job's capture, with sharp paths, by the usual model. `None` if it finds no
/// surface.
///
/// # Errors
/// The device fails, or the caller cancels.
pub fn held(
    job: &Job<'_>,
    capture: &Capture,
    gpu: &Gpu,
    hear: &mut OnProgress<'_>,
) -> Result<Option<HeldOut>> {
    let job = job.with_capture(Cow::Borrowed(capture));
    let job = Job { models: vec![], find_pulse: FindPulse::Never, ..job };
    let fitted = Physics::new(&job, gpu, hear)
        .and_then(|mut search| search.fit(search.trials[0].reflectance(), Shape::SHARP, From::Start));
    match fitted {
        Err(e) if matches!(e.kind, Kind::Device | Kind::Cancelled) => Err(e),
        fitted => Ok(fitted.ok().flatten().map(|fitted| fitted.held)),
    }
}

/// The length of the high-pass, metres of path: a tenth of the wall's width, and two bins at least.
pub fn usual_high_pass(capture: &Capture) -> f64 {
    let [x0, x1, y0, y1] = capture.wall_extent();
    (0.1 * (x1 - x0).max(y1 - y0)).max(2.0 * capture.bin_width)
}

/// A hypothesis, and its fit, if that found a surface.
struct Tried {
    reflectance: Reflectance,
    pulse: Shape,
    fitted: Option<Fitted>,
}

/// Progress of all fits together: iterations that are done, and how many the fits will take as far as that is known.
struct FitProgress {
    begun: Instant,
    done: usize,
    expected: usize,
}

impl FitProgress {
    /// The progress of a fit as that of all.
    fn of(&self, progress: &Progress) -> Progress {
        let done = self.done + progress.point.iteration;
        let expected = self.expected.max(self.done + progress.iterations);
        let seconds = self.begun.elapsed().as_secs_f64();
        let remaining = (done > 0).then(|| seconds * (expected - done.min(expected)) as f64 / done as f64);
        let point = TracePoint { iteration: done, seconds, ..progress.point };
        Progress { doing: Doing::Trial, point, iterations: expected, remaining, maps: None }
    }

    /// Other fits than those that were expected are ahead.
    fn expect(&mut self, ahead: usize) {
        self.expected = self.done + ahead;
    }
}

/// The fits of a capture.
struct Physics<'t> {
    job: &'t Job<'t>,
    /// One for each model, the usual one first.
    trials: Vec<Trial<'t>>,
    starts: Arc<Starts>,
    /// In the bins of the fits, metres of path.
    bin_width: f64,
    /// The narrowest impulse response that the solve, whose bins may be narrower, models, and the longest suggestion, metres.
    narrowest: f64,
    longest: f64,
    hear: &'t mut OnProgress<'t>,
    pace: FitProgress,
    /// Those of sharp paths are first.
    tried: Vec<Tried>,
    /// Whether cosine stays because photon noise alone makes what Lambertian leaves less.
    is_by_chance: bool,
    /// The impulse response by samples, if no shape is right, and a surface with it.
    samples: Option<(ResponseSamples, Fitted)>,
    /// Whether the support may leave that of the start.
    finds_start: bool,
    /// The length of the last steps, as a share of the longest ones.
    step: f64,
    found: Estimates,
}

impl<'t> Physics<'t> {
    fn new(job: &'t Job<'t>, gpu: &Gpu, hear: &'t mut OnProgress<'t>) -> Result<Physics<'t>> {
        let all = if job.models.is_empty() { std::slice::from_ref(&job.solver) } else { &job.models };
        let pulse = match job.find_pulse() {
            FindPulse::Never => 0,
            FindPulse::IfItShows => ITERATIONS[1],
            FindPulse::Always => OF_PULSES,
        };
        let fits = usize::from(job.finds_high_pass()) + all.len();
        let expected = fits * From::Start.iterations() + pulse;
        let pace = FitProgress { begun: Instant::now(), done: 0, expected };
        let begins = &mut |p: &Progress| hear(&pace.of(&Progress { iterations: 0, ..p.clone() }));
        let trials = Trial::of_models(job, all, LATERAL, gpu, &mut Watch::of(begins))?;
        let (capture, bin_width) = (&*job.capture, trials[0].capture().bin_width);
        let of_solve = job.settings.sum(&job.solver, &capture.outline()) as f64 * capture.bin_width;
        let mut found = Estimates::default();
        found.stages.start = pace.begun.elapsed().as_secs_f64();
        Ok(Physics {
            job,
            starts: trials[0].begin.starts.clone(),
            trials,
            bin_width,
            narrowest: pulse::NARROWEST * of_solve,
            longest: pulse::longest(bin_width, SceneTraits::of(capture).wall),
            hear,
            pace,
            tried: vec![],
            is_by_chance: false,
            samples: None,
            finds_start: all[0].as_surface().grow,
            step: 1.0,
            found,
        })
    }

    /// Estimates the high-pass, the model of reflectance and the impulse response, if one is to be found, in this order.
    fn run(&mut self) -> Result<(Reflectance, Option<Shape>)> {
        self.preview_start()?;
        self.found.expected_iou = self.starts.seen.as_ref().map(|seen| seen.expected_iou());
        if self.job.finds_high_pass() {
            self.found.high_pass = Some(self.find_high_pass()?);
        }
        let begun = self.pace.begun;
        self.found.stages.high_pass = begun.elapsed().as_secs_f64() - self.found.stages.start;
        let chosen = self.choose_physics();
        let stages = &mut self.found.stages;
        stages.model = begun.elapsed().as_secs_f64() - stages.start - stages.high_pass - stages.pulse;
        self.found.finds_none = self.tried.iter().all(|t| t.fitted.is_none());
        if self.finds_start {
            self.leave_start(chosen.as_ref().ok());
        }
        chosen
    }

    /// Gives `hear` the maps that the fits begin with.
    fn preview_start(&mut self) -> Result<()> {
        let mut maps = self.starts.layers[0].clone();
        maps.mask = maps.depth.iter().map(|z| z.is_finite()).collect();
        let point = TracePoint::first(maps.nx, self.pace.begun.elapsed().as_secs_f64());
        let iterations = self.pace.expected;
        let progress =
            Progress { doing: Doing::Preview, point, iterations, remaining: None, maps: Some(maps) };
        match (self.hear)(&progress) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => {
                Err(Error::new(Kind::Cancelled, "cancelled by the caller before the fits", "run it again"))
            }
        }
    }

    /// Estimates the high-pass by a fit of the first model. All later fits have it, and are judged by it.
    fn find_high_pass(&mut self) -> Result<FoundHighPass> {
        let length = usual_high_pass(&self.job.capture);
        let fitted = self.fit(self.trials[0].reflectance(), Shape::SHARP, From::Start)?;
        let bands = fitted.map_or([f64::NAN; 2], |fitted| fitted.held.bands(length));
        let found = FoundHighPass::of(length, bands);
        self.trials.iter_mut().for_each(|trial| trial.set_high_pass([found.length, found.floor]));
        Ok(found)
    }

    /// The surface with which the solve begins: that of the best hypothesis. Without one, what the network sees may still explain light at
    /// full resolution.
    fn leave_start(&mut self, best: Option<&(Reflectance, Option<Shape>)>) {
        let Starts { layers: closed, light, seen, .. } = Starts::clone(&self.starts);
        let sharp = best.and_then(|(of, shape)| Some((*of, *shape, self.sharp(*of)?)));
        let Some((reflectance, shape, sharp)) = sharp else {
            let begun = |seen| Begun { light, is_far: true, ..Begun::of(closed, Some(seen)) };
            self.found.begun = seen.map(begun);
            return;
        };
        let (fitted, by_shape) = match &self.samples {
            Some((_, fitted)) => (fitted, None),
            None => (sharp, shape.and_then(|shape| self.fit_of(reflectance, shape))),
        };
        let held = by_shape.unwrap_or(fitted).held.clone();
        let (layers, step) = (fitted.surface.layers.clone(), fitted.surface.step);
        let is_far = seen.is_some() && !fitted.surface.is_coherent(FAR);
        self.found.begun = Some(Begun { layers, closed, is_far, seen, light, step });
        self.found.at_hand = Some((held, self.starts.clone()));
        for candidate in &mut self.found.candidates {
            let is_of_start = (candidate.start == Origin::Union) == self.found.is_union;
            candidate.kept = candidate.reflectance == reflectance && is_of_start;
        }
    }

    /// Fits hypotheses side by side. `None` where no surface is found.
    fn fits(
        &mut self,
        models: &[Reflectance],
        pulse: Option<&Pulse>,
        from: From<'_>,
    ) -> Result<Vec<Option<Fitted>>> {
        let Physics { trials, hear, pace, step, .. } = self;
        let trials: Vec<&Trial<'_>> = models.iter().map(|of| trial_of(trials, *of)).collect();
        let reported = &mut |p: &Progress| hear(&pace.of(p));
        let fitted = fit_all(&trials, pulse, from, *step, &mut Watch::of(reported))?;
        pace.done += models.len() * from.iterations();
        *step = fitted.iter().flatten().last().map_or(*step, |fitted| fitted.surface.step);
        Ok(fitted)
    }

    /// Fits a hypothesis with this impulse response. `None` if no surface is found.
    fn fit_with(&mut self, of: Reflectance, pulse: &Pulse, from: From<'_>) -> Result<Option<Fitted>> {
        Ok(self.fits(&[of], Some(pulse), from)?.pop().flatten())
    }

    /// The same with a shape, or with the impulse response of the capture in place of sharp paths.
    fn fit(&mut self, of: Reflectance, shape: Shape, from: From<'_>) -> Result<Option<Fitted>> {
        let pulse = shape.centred()?;
        let pulse = pulse.as_ref().or(self.job.capture.pulse.as_ref());
        Ok(self.fits(&[of], pulse, from)?.pop().flatten())
    }

    /// Fits models with sharp paths, side by side.
    fn fit_sharp(&mut self, models: &[Reflectance], from: From<'_>, start: Origin) -> Result<()> {
        let clock = Instant::now();
        let fitted = self.fits(models, self.job.capture.pulse.as_ref(), from)?;
        let seconds = clock.elapsed().as_secs_f64() / models.len().max(1) as f64;
        for (&reflectance, fitted) in models.iter().zip(fitted) {
            self.found.candidates.extend(fitted.as_ref().map(|fitted| {
                let left = fitted.left();
                let left_of = [left.share(), left.standard_error(), left.excess()];
                let cost = fitted.surface.cost();
                FoundSurface { reflectance, start, left: left_of, cost, seconds, kept: false }
            }));
            self.tried.push(Tried { reflectance, pulse: Shape::SHARP, fitted });
        }
        Ok(())
    }

    fn models(&self) -> Vec<Reflectance> {
        self.trials.iter().map(Trial::reflectance).collect()
    }

    /// Fits from what the network and a light-cone transform show together, where fits from the network's surface leave much, and keeps
    /// them if they leave clearly less: the network misses dark print and large faces.
    fn find_union(&mut self) -> Result<()> {
        let Some((first, left)) = least_left(&self.tried).map(|(of, fitted)| (of, fitted.left().clone()))
        else {
            return Ok(());
        };
        let [certain, most] = UNION_LEFT;
        let is_tried = left.certain() > certain && left.excess() < most;
        let Some(layers) = is_tried.then(|| self.starts.union()).flatten() else { return Ok(()) };
        // The model that leaves least speaks for all; the others follow where it leaves clearly less.
        let (one, others): (Vec<_>, Vec<_>) = self.models().into_iter().partition(|of| *of == first);
        let (before, from) = (self.tried.len(), From::Layers(&layers));
        self.pace.expect(from.iterations());
        self.fit_sharp(&one, from, Origin::Union)?;
        let best = least_left(&self.tried[before..]).map(|(_, fitted)| [fitted.left().clone(), left.clone()]);
        if !best.is_some_and(|left| EvidenceGate::UNION.passes(&left)) {
            self.tried.truncate(before);
            return Ok(());
        }
        self.pace.expect(others.len() * from.iterations());
        self.fit_sharp(&others, from, Origin::Union)?;
        let (_, best) = least_left(&self.tried[before..]).expect("one was found");
        let is_shown = best.left().excess() / left.excess() < UNION_SHOWN;
        let shown = is_shown.then(|| best.surface.layers[0].clone());
        // What was tried with sharp paths is what these fits say.
        self.tried.drain(..before);
        self.starts = Arc::new(self.starts.with_union(layers, shown.as_ref()));
        self.trials.iter_mut().for_each(|trial| trial.begin.starts = self.starts.clone());
        self.found.is_union = true;
        Ok(())
    }

    /// The fit of a hypothesis, if it found a surface.
    fn fit_of(&self, reflectance: Reflectance, pulse: Shape) -> Option<&Fitted> {
        self.tried.iter().find(|t| (t.reflectance, t.pulse) == (reflectance, pulse))?.fitted.as_ref()
    }

    fn sharp(&self, reflectance: Reflectance) -> Option<&Fitted> {
        self.fit_of(reflectance, Shape::SHARP)
    }

    /// Of these impulse responses, the one that an ideal rendering of the hold-out set suggests, and the residual with it.
    fn suggested(&self, ideal: &HeldOut, shapes: &[Shape]) -> Result<Option<(Shape, Left)>> {
        let pulses = shapes.iter().filter_map(|shape| shape.centred().transpose());
        let taps = pulses.map(|p| p.and_then(|p| p.taps(self.bin_width))).collect::<Result<Vec<_>>>()?;
        let best = pulse::best(&ideal.sides(), ideal.bins(), &taps);
        Ok(best.map(|(at, pairs)| (shapes[at], ideal.left_with(pairs))))
    }

    /// The same length without a tail, metres.
    fn suggested_length(&self, ideal: &HeldOut) -> Result<Option<f64>> {
        let plain = Shape::plain(self.bin_width, self.longest);
        Ok(self.suggested(ideal, &plain)?.map(|(shape, _)| shape.length()))
    }

    /// The residual of a hypothesis with an impulse response, whose fit continues the sharp one.
    fn left(&mut self, reflectance: Reflectance, pulse: Shape) -> Result<Option<Left>> {
        if !self.tried.iter().any(|t| (t.reflectance, t.pulse) == (reflectance, pulse)) {
            let fitted = self.spread(reflectance, pulse, OF_PULSE)?;
            self.tried.push(Tried { reflectance, pulse, fitted });
        }
        Ok(self.fit_of(reflectance, pulse).map(|fitted| fitted.left().clone()))
    }

    /// Continues the sharp fit of a model with an impulse response, for a number of iterations.
    fn spread(&mut self, of: Reflectance, pulse: Shape, iterations: usize) -> Result<Option<Fitted>> {
        let Some(sharp) = self.sharp(of) else { return Ok(None) };
        let from = sharp.surface.layers.clone();
        self.fit(of, pulse, From::Fit(&from, iterations))
    }

    /// Models are compared with the impulse responses that their sharp fits suggest. The best of them finds its own.
    fn choose_physics(&mut self) -> Result<(Reflectance, Option<Shape>)> {
        let origin = if self.starts.seen.is_some() { Origin::Learned } else { Origin::Closed };
        self.fit_sharp(&self.models(), From::Start, origin)?;
        self.find_union()?;
        let clock = Instant::now();
        let find_pulse = self.job.find_pulse();
        let shapes = Shape::all(self.bin_width, self.longest);
        // With the suggested impulse response, and as the choice needs it.
        let (mut spread, mut residuals) = (vec![], vec![]);
        for model in self.models() {
            let Some(fitted) = self.sharp(model) else {
                residuals.push((model, None));
                continue;
            };
            let suggested = match find_pulse {
                FindPulse::Never => None,
                _ => self.suggested(&fitted.held, &shapes)?,
            };
            let (left, less) = (fitted.left(), suggested.map(|(_, less)| less));
            let less = less.filter(|less| less.share() < left.share());
            let always = less.clone().filter(|_| find_pulse == FindPulse::Always);
            spread.push((model, Some(less.unwrap_or_else(|| left.clone()))));
            residuals.push((model, Some(always.unwrap_or_else(|| left.clone()))));
        }
        let no_surface =
            || Error::input("no fit found a surface", "name the model and the impulse response if known");
        let model = self.chosen(&residuals).ok_or_else(no_surface)?;
        let found = self.choose_pulse(model, &spread);
        self.found.stages.pulse = clock.elapsed().as_secs_f64();
        found
    }

    /// The impulse response with the best model, if one is to be found. Models that are not beaten, by what their sharp fits suggest,
    /// are compared again with it.
    fn choose_pulse(
        &mut self,
        mut model: Reflectance,
        spread: &[(Reflectance, Option<Left>)],
    ) -> Result<(Reflectance, Option<Shape>)> {
        let finds_pulse = match self.job.find_pulse() {
            FindPulse::Never => false,
            FindPulse::IfItShows => self.shows_pulse(model)?,
            FindPulse::Always => true,
        };
        if !finds_pulse {
            return Ok((model, None));
        }
        self.pace.expect(OF_PULSES);
        let mut pulse = self.best_pulse(model)?;
        let rivals: Vec<Reflectance> = unbeaten(spread).into_iter().filter(|rival| *rival != model).collect();
        if pulse != Shape::SHARP && !rivals.is_empty() {
            self.pace.expect(rivals.len() * OF_PULSE);
            let mut again = vec![(model, self.left(model, pulse)?)];
            for rival in rivals {
                again.push((rival, self.left(rival, pulse)?));
            }
            let other = self.chosen(&again).unwrap_or(model);
            if other != model {
                model = other;
                self.pace.expect(OF_PULSES);
                pulse = self.best_pulse(model)?;
            }
        }
        let by_samples = self.find_samples(model, pulse)?;
        Ok((by_samples.unwrap_or(model), Some(pulse)))
    }

    /// The model that these residuals choose. Cosine stays in place of Lambertian where photon noise alone makes such differences, with
    /// sharp paths and in these residuals.
    fn chosen(&mut self, residuals: &[(Reflectance, Option<Left>)]) -> Option<Reflectance> {
        let chosen = choose(residuals)?;
        let [cosine, lambertian] = [Reflectance::Cosine, Reflectance::Lambertian]
            .map(|of| Some((self.sharp(of)?, residuals.iter().find(|(model, _)| *model == of)?.1.as_ref()?)));
        let is_chance = cosine.zip(lambertian).is_some_and(|((sharp, left), (other, less))| {
            let most = BY_CHANCE * sharp.held.chance(&other.held);
            let is_within = |left: &Left, less: &Left| left.excess() - less.excess() < most;
            is_within(sharp.left(), other.left()) && is_within(left, less)
        });
        // The variance of values that are no counts is an estimate.
        let is_counted = self.trials[0].capture().integer_counts;
        self.is_by_chance = is_counted && chosen == Reflectance::Lambertian && is_chance;
        Some(if self.is_by_chance { Reflectance::Cosine } else { chosen })
    }

    /// The impulse response by samples, if surfaces of it leave clearly less than those of the best shape: the model that then leaves
    /// least.
    fn find_samples(&mut self, reflectance: Reflectance, shape: Shape) -> Result<Option<Reflectance>> {
        let Some(sharp) = self.sharp(reflectance) else { return Ok(None) };
        let shapes = Shape::all(self.bin_width, self.longest);
        if sharp.left().certain() <= response::LEFT || !response::is_worth(&sharp.held, &shapes)? {
            return Ok(None);
        }
        let Some(by_shape) = self.left(reflectance, shape)? else { return Ok(None) };
        let found = self.fit_samples(reflectance)?;
        let passes = |(response, fitted): &(Response, Fitted)| {
            response.has_echo(response::ECHO[1])
                && EvidenceGate::SAMPLES.passes(&[fitted.left().clone(), by_shape])
        };
        let Some(found) = found.filter(passes) else { return Ok(None) };
        // What other models leave with a response of their own.
        let mut all = vec![(reflectance, found)];
        let is_other = |other: &Reflectance| *other != reflectance && self.sharp(*other).is_some();
        for other in self.models().into_iter().filter(is_other).collect::<Vec<_>>() {
            all.extend(self.fit_samples(other)?.map(|found| (other, found)));
        }
        let left: Vec<_> = all.iter().map(|(model, found)| (*model, Some(found.1.left().clone()))).collect();
        let model = self.chosen(&left).unwrap_or(reflectance);
        let found = all.into_iter().find(|(of, _)| *of == model);
        self.samples = found.map(|(_, (response, fitted))| (response.at_peak(self.bin_width), fitted));
        Ok(Some(model))
    }

    /// Fits a surface and the samples of a response by turns, from the sharp fit of a model, until no less is left.
    fn fit_samples(&mut self, reflectance: Reflectance) -> Result<Option<(Response, Fitted)>> {
        let Some(sharp) = self.sharp(reflectance) else { return Ok(None) };
        let (mut layers, mut ideal) = (sharp.surface.layers.clone(), Some(sharp.held.clone()));
        let mut best: Option<(Response, Fitted)> = None;
        for _ in 0..response::ROUNDS {
            let Some(response) = ideal.as_ref().and_then(response::suggested) else { break };
            self.pace.expect(OF_PULSE);
            let pulse = response.samples(self.bin_width).pulse();
            let fitted = self.fit_with(reflectance, &pulse, From::Fit(&layers, OF_PULSE))?;
            let most = best.as_ref().map_or(f64::INFINITY, |(_, best)| response::LESS * best.left().excess());
            let Some(fitted) = fitted.filter(|fitted| fitted.left().excess() <= most) else { break };
            layers = fitted.surface.layers.clone();
            ideal = trial_of(&self.trials, reflectance).ideal(&layers)?;
            best = Some((response, fitted));
        }
        // The support of the sharp fit holds echoes: a fit from the start may do without them.
        if let Some((response, fitted)) = &mut best {
            self.pace.expect(From::Start.iterations());
            let pulse = response.samples(self.bin_width).pulse();
            let anew = self.fit_with(reflectance, &pulse, From::Start)?;
            if let Some(anew) = anew.filter(|anew| anew.left().excess() < fitted.left().excess()) {
                *fitted = anew;
            }
        }
        Ok(best)
    }

    /// Whether this model's residual shows an impulse response. Without normals every curved surface seems to have one.
    fn shows_pulse(&mut self, reflectance: Reflectance) -> Result<bool> {
        let Some(sharp) = self.sharp(reflectance).filter(|_| reflectance.has_normals()) else {
            return Ok(false);
        };
        let sharp = sharp.left().clone();
        let wide = self.left(reflectance, Shape::of(pulse::FIRST * self.bin_width, 0.0))?;
        let Some(wide) = wide.filter(|wide| wide.is_less(&sharp)) else { return Ok(false) };
        // As many more iterations with sharp paths may do the same.
        let longer = self.spread(reflectance, Shape::SHARP, OF_PULSE)?;
        Ok(wide.is_less(longer.as_ref().map_or(&sharp, Fitted::left)))
    }

    /// The impulse response with this model. Convolutions of an ideal rendering suggest its length; a surface fitted with that corrects
    /// it, as a sharp one has moved to compensate. Fits of the corrected length with several tails end the search: the best one must
    /// leave less than the sharp fit.
    fn best_pulse(&mut self, reflectance: Reflectance) -> Result<Shape> {
        let Some(fitted) = self.sharp(reflectance) else {
            return Err(Error::input("a fit found no surface", "give the instrument's impulse response"));
        };
        let sharp = fitted.left().clone();
        let Some(first) = self.suggested_length(&fitted.held)? else { return Ok(Shape::SHARP) };
        let spread = self.spread(reflectance, Shape::of(first, 0.0), ITERATIONS[1])?;
        let Some(spread) = spread.filter(|spread| spread.left().share() < sharp.share()) else {
            return Ok(Shape::SHARP);
        };
        let ideal = trial_of(&self.trials, reflectance).ideal(&spread.surface.layers)?;
        let Some(second) = ideal.map_or(Ok(None), |ideal| self.suggested_length(&ideal))? else {
            return Ok(Shape::SHARP);
        };
        let length = pulse::settled(first, second);
        // A length that the solve's bins cannot show, or a residual that falls up to the longest.
        if length < self.narrowest || !pulse::is_below(length, self.longest) {
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
        let is_better = |than: &Left| least.is_some_and(|least| is_worth(least, than));
        let share = if each[0].as_ref().is_none_or(is_better) { pulse::best_share(shares) } else { 0.0 };
        Ok(if is_better(&sharp) { Shape::of(length, share) } else { Shape::SHARP })
    }
}

/// Whether a residual is smaller than another one beyond chance, and by enough to be worth a longer model.
fn is_worth(left: &Left, than: &Left) -> bool {
    left.share() < (1.0 - pulse::WORTH) * than.share() && left.is_less(than)
}

/// The fit of these that leaves least.
fn least_left(tried: &[Tried]) -> Option<(Reflectance, &Fitted)> {
    let each = tried.iter().filter_map(|t| Some((t.reflectance, t.fitted.as_ref()?)));
    each.min_by(|a, b| a.1.left().excess().total_cmp(&b.1.left().excess()))
}

fn trial_of<'s, 't>(trials: &'s [Trial<'t>], reflectance: Reflectance) -> &'s Trial<'t> {
    trials.iter().find(|t| t.reflectance() == reflectance).expect("a trial for every model")
}

/// The models that leave as little as any other, but for chance.
fn unbeaten(left: &[(Reflectance, Option<Left>)]) -> Vec<Reflectance> {
    let found = || left.iter().filter_map(|(model, left)| Some((*model, left.as_ref()?)));
    let Some((_, least)) = found().min_by(|a, b| a.1.excess().total_cmp(&b.1.excess())) else {
        return vec![];
    };
    let is_beaten = |left: &Left| EvidenceGate::OTHER_FALLOFF.passes(&[least.clone(), left.clone()]);
    found().filter(|(_, left)| !is_beaten(left)).map(|(model, _)| model).collect()
}

/// Of the falloffs whose models leave as little as any other, but for chance, the one that comes first; of its models the one that
/// leaves least. `None` if no trial found a surface.
fn choose(left: &[(Reflectance, Option<Left>)]) -> Option<Reflectance> {
    let unbeaten = unbeaten(left);
    let first = FIRST.into_iter().find(|model| unbeaten.contains(model))?;
    let alike = left.iter().filter(|(model, _)| model.falloff_power() == first.falloff_power());
    let found = alike.filter_map(|(model, left)| Some((*model, left.as_ref()?.share())));
    found.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(model, _)| model)
}

#[cfg(test)]
mod tests {
    use super::*;
    use Reflectance::{Cosine, Lambertian, Retroreflective};

    /// Pairs that leave `mean` on average, which differ by `noise`, of squares of 100.
    fn left(mean: f64, noise: f64) -> Option<Left> {
        let of = |i: usize| [mean + noise * if i.is_multiple_of(2) { 1.0 } else { -1.0 }, 100.0];
        Some(Left { pairs: (0..64).map(of).collect(), noise: 0.0 })
    }

    #[test]
    fn the_first_falloff_is_kept_unless_another_is_better_beyond_chance() {
        let of = |retroreflective: Option<Left>| {
            choose(&[
                (Cosine, left(5.0, 0.0)),
                (Lambertian, left(6.0, 0.0)),
                (Retroreflective, retroreflective),
            ])
        };
        // The standard error is an eighth of the noise.
        assert_eq!(of(left(4.4, 0.2)), Some(Retroreflective));
        assert_eq!(of(left(4.4, 4.0)), Some(Cosine), "less than two standard errors of a half");
        assert_eq!(of(left(4.75, 0.0)), Some(Cosine), "by less than the margin");
    }

    #[test]
    fn of_models_with_one_falloff_the_one_that_leaves_least_is_chosen() {
        let of = |lambertian: Option<Left>| {
            choose(&[(Cosine, left(5.0, 0.0)), (Lambertian, lambertian), (Retroreflective, left(5.0, 2.0))])
        };
        assert_eq!(of(left(4.99, 4.0)), Some(Lambertian), "however little the difference is");
        assert_eq!(of(left(5.01, 0.0)), Some(Cosine));
        assert_eq!(of(None), Some(Cosine));
        // Retroreflective is beaten by the better one of the two.
        assert_eq!(of(left(3.0, 0.1)), Some(Lambertian));
    }

    #[test]
    fn a_model_without_a_surface_is_not_chosen() {
        assert_eq!(choose(&[(Cosine, None), (Lambertian, None)]), None);
        assert_eq!(choose(&[(Cosine, left(5.0, 0.1)), (Lambertian, None)]), Some(Cosine));
        assert_eq!(choose(&[(Cosine, None), (Lambertian, left(5.0, 0.1))]), Some(Lambertian));
    }
}
