//! The search over hypotheses: short fits of each, judged on the same held-out pairs.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use super::estimates::{FindPulse, FoundSurface, Origin};
use super::high_pass::{FoundHighPass, usual_high_pass};
use super::job::Job;
use super::pulse::{Shape, Tried};
use super::response::Response;
use super::samples::ResponseSamples;
use super::spread::ComparedRows;
use super::trial::{FitBegin, Fitted, From, Trial, fit_all, for_fits, quick};
use crate::capture::{Capture, Pulse};
use crate::engine::{Doing, Problem, Progress, TracePoint, Watch};
use crate::gpu::Gpu;
use crate::judge::constants::*;
use crate::judge::{model, pulse, response};
use crate::maps::Maps;
use crate::methods::SolverOptions;
use crate::options::SceneTraits;
use crate::surface::{Candidate, HeldOut, Left, Starts};
use crate::transport::Reflectance;
use crate::{Error, Kind, Result};

/// The sharp fit of a model, and the impulse response that its residual suggests, with the residual then.
pub(crate) struct Sharp {
    pub reflectance: Reflectance,
    pub fitted: Fitted,
    /// Its number among the candidates.
    pub candidate: usize,
    suggested: Option<(Shape, Left)>,
}

/// Progress of all fits together: iterations that are done, and how many the fits will take as far as that is known.
pub(crate) struct FitProgress {
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
pub(crate) struct Physics<'t> {
    /// One for each model, the usual one first.
    pub trials: Vec<Trial<'t>>,
    pub starts: Arc<Starts>,
    /// The sharp fit of each model, and the impulse response that its residual suggests.
    pub sharp: Vec<Sharp>,
    /// Metres of path.
    bin_width: f64,
    /// Whether its values are counts of photons.
    is_counted: bool,
    /// The narrowest impulse response that the solve, whose bins may be narrower, models: in bins of the fits.
    narrowest: f64,
    /// The length of the longest suggestion, metres.
    longest: f64,
    /// The impulse response of the capture, if it has one.
    known: Option<Pulse>,
    find_pulse: FindPulse,
    hear: &'t mut dyn FnMut(&Progress) -> ControlFlow<()>,
    pace: FitProgress,
    pub tried: Vec<Tried>,
    /// The held-out pairs of fits with an impulse response.
    spread: Vec<((Reflectance, Shape), HeldOut)>,
    pub candidates: Vec<FoundSurface>,
    /// Whether cosine stays because photon noise alone makes what Lambertian leaves less.
    pub is_by_chance: bool,
    /// The impulse response by samples, if no shape is right.
    pub samples: Option<ResponseSamples>,
    /// Seconds spent on the impulse response.
    pub pulse_seconds: f64,
    /// Whether the support may leave that of the start.
    pub finds_start: bool,
    /// Whether fits begin with what the network and a light-cone transform show together.
    pub is_union: bool,
    /// The length of the last steps, as a share of the longest ones.
    step: f64,
}

impl<'t> Physics<'t> {
    pub fn new(
        job: &'t Job<'_>,
        gpu: &'t Gpu,
        hear: &'t mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Physics<'t>> {
        let capture = &*job.capture;
        let all = if job.models.is_empty() { std::slice::from_ref(&job.solver) } else { &job.models };
        let (whole, grid, options) = for_fits(&job.settings, job.solver.common().lateral, capture, &all[0])?;
        let finds_start = all[0].as_surface().grow;
        let [high_pass, models] = [usize::from(job.finds_high_pass()), all.len()];
        let pulse = match job.find_pulse() {
            FindPulse::Never => 0,
            FindPulse::IfItShows => ITERATIONS[1],
            FindPulse::Always => FitProgress::OF_PULSE,
        };
        let expected = (high_pass + models) * From::Start.iterations() + pulse;
        let pace = FitProgress { begun: Instant::now(), done: 0, expected };
        let mut watch_hear = |p: &Progress| hear(&pace.of(&Progress { iterations: 0, ..p.clone() }));
        let mut watch = Watch { hear: &mut watch_hear, maps_every: None, maps_at: &[] };
        let problem = Problem { memory: job.settings.memory, ..Problem::new(&whole, grid) };
        let starts = Arc::new(Starts::of(gpu, [capture, &whole], &problem, &options, &mut watch)?);
        let whole = Arc::new(whole);
        let of_solve = job.settings.sum(&job.solver, &capture.outline()) as f64 * capture.bin_width;
        let trial = |model: &SolverOptions| {
            Trial::new(
                gpu,
                whole.clone(),
                quick(model, options.lateral),
                FitBegin { grid, starts: starts.clone(), delays: vec![] },
                job.settings.memory,
            )
        };
        Ok(Physics {
            trials: all.iter().map(trial).collect(),
            starts,
            sharp: vec![],
            bin_width: whole.bin_width,
            is_counted: whole.integer_counts,
            narrowest: pulse::NARROWEST * of_solve / whole.bin_width,
            longest: pulse::longest(whole.bin_width, SceneTraits::of(capture).wall),
            known: capture.pulse.clone(),
            find_pulse: job.find_pulse(),
            hear,
            pace,
            tried: vec![],
            spread: vec![],
            candidates: vec![],
            is_by_chance: false,
            samples: None,
            pulse_seconds: 0.0,
            finds_start,
            is_union: false,
            step: 1.0,
        })
    }

    /// Gives `hear` the maps that the fits begin with.
    ///
    /// # Errors
    /// `hear` cancels.
    pub fn tell_start(&mut self) -> Result<()> {
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
    pub fn find_high_pass(&mut self, capture: &Capture) -> Result<FoundHighPass> {
        let length = usual_high_pass(capture);
        let first = self.trials[0].reflectance();
        let fitted = self.fit(first, Shape::SHARP, From::Start)?;
        let bands = fitted.map_or([f64::NAN; 2], |fitted| fitted.held.bands(length));
        let found = FoundHighPass::of(length, bands);
        self.trials.iter_mut().for_each(|trial| trial.set_high_pass([found.length, found.floor]));
        Ok(found)
    }

    /// Fits a hypothesis. `None` if no surface is found.
    pub fn fit(&mut self, reflectance: Reflectance, shape: Shape, from: From<'_>) -> Result<Option<Fitted>> {
        let pulse = shape.centred()?.or(self.known.clone());
        self.fit_with(reflectance, pulse, from)
    }

    /// Fits a hypothesis with this impulse response. `None` if no surface is found.
    fn fit_with(
        &mut self,
        reflectance: Reflectance,
        pulse: Option<Pulse>,
        from: From<'_>,
    ) -> Result<Option<Fitted>> {
        let Physics { trials, hear, pace, step, .. } = self;
        let trial = trial_of(trials, reflectance);
        let mut reported = |p: &Progress| hear(&pace.of(p));
        let mut watch = Watch { hear: &mut reported, maps_every: None, maps_at: &[] };
        let fitted = fit_all(&[trial], pulse.as_ref(), from, *step, &mut watch)?.pop().flatten();
        pace.pass(from.iterations());
        *step = fitted.as_ref().map_or(*step, |fitted| fitted.surface.step);
        Ok(fitted)
    }

    /// Fits every model with sharp paths.
    fn fit_sharp(&mut self) -> Result<()> {
        let models: Vec<Reflectance> = self.trials.iter().map(Trial::reflectance).collect();
        let origin = if self.starts.seen.is_some() { Origin::Learned } else { Origin::Closed };
        self.sharp = self.fit_models(&models, From::Start, origin)?;
        self.find_union()
    }

    /// Fits these models with sharp paths, side by side.
    fn fit_models(&mut self, models: &[Reflectance], from: From<'_>, origin: Origin) -> Result<Vec<Sharp>> {
        let clock = Instant::now();
        let Physics { trials, hear, known, pace, step, .. } = self;
        let mut reported = |p: &Progress| hear(&pace.of(p));
        let mut watch = Watch { hear: &mut reported, maps_every: None, maps_at: &[] };
        let all: Vec<&Trial<'_>> = models.iter().map(|of| trial_of(trials, *of)).collect();
        let fitted = fit_all(&all, known.as_ref(), from, *step, &mut watch)?;
        self.pace.pass(models.len() * from.iterations());
        let seconds = clock.elapsed().as_secs_f64() / models.len().max(1) as f64;
        let mut sharp = vec![];
        for (reflectance, fitted) in models.iter().copied().zip(fitted) {
            let left = fitted.as_ref().and_then(|fitted| fitted.surface.left.clone());
            self.tried.push(Tried { reflectance, pulse: Shape::SHARP, left });
            let Some(fitted) = fitted else { continue };
            self.step = fitted.surface.step;
            self.candidates.push(FoundSurface::of(reflectance, origin, &fitted, seconds));
            let candidate = self.candidates.len() - 1;
            let clock = Instant::now();
            let suggested = match self.find_pulse {
                FindPulse::Never => None,
                _ => self.suggested(&fitted.held, &Shape::all(self.bin_width, self.longest))?,
            };
            self.pulse_seconds += clock.elapsed().as_secs_f64();
            sharp.push(Sharp { reflectance, fitted, candidate, suggested });
        }
        Ok(sharp)
    }

    /// Fits from what the network and a light-cone transform show together, where fits from the network's surface leave much, and keeps
    /// them if they leave clearly less: the network misses dark print and large faces.
    fn find_union(&mut self) -> Result<()> {
        let Some((sharp, left)) = least_left(&self.sharp) else { return Ok(()) };
        let first = sharp.reflectance;
        let [certain, most] = UNION_LEFT;
        let is_tried = left.certain() > certain && left.excess() < most;
        if !is_tried {
            return Ok(());
        }
        let Some(layers) = self.starts.union() else { return Ok(()) };
        // The model that leaves least speaks for all; the others follow where it leaves clearly less.
        let mut models: Vec<Reflectance> = self.trials.iter().map(Trial::reflectance).collect();
        let at = models.iter().position(|model| *model == first).expect("it was fitted");
        models.swap(0, at);
        let (one, others) = models.split_at(1);
        let from = From::Layers(&layers);
        self.pace.expect(from.iterations());
        let before = self.tried.len();
        let mut found = self.fit_models(one, from, Origin::Union)?;
        let share = |found: &[Sharp]| {
            let less = least_left(found)
                .map(|(_, less)| less)
                .filter(|less| less.errors_below(&left) > UNION_ERRORS);
            less.map_or(1.0, |less| less.excess() / left.excess())
        };
        if share(&found) > UNION_LESS {
            self.tried.truncate(before);
            return Ok(());
        }
        self.pace.expect(others.len() * from.iterations());
        found.extend(self.fit_models(others, from, Origin::Union)?);
        let share = share(&found);
        // What was tried with sharp paths is what these fits say.
        self.tried.drain(..before);
        let shown = least_left(&found).filter(|_| share < UNION_SHOWN);
        let shown = shown.map(|(best, _)| best.fitted.surface.layers[0].clone());
        self.begin_with(layers, shown.as_ref());
        self.sharp = found;
        self.is_union = true;
        Ok(())
    }

    fn begin_with(&mut self, layers: Vec<Maps>, shown: Option<&Maps>) {
        self.starts = Arc::new(self.starts.with_union(layers, shown));
        self.trials.iter_mut().for_each(|trial| trial.begin.starts = self.starts.clone());
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
        let fitted = self.spread(reflectance, pulse, OF_PULSE)?;
        let left = fitted.as_ref().and_then(|fitted| fitted.surface.left.clone());
        self.spread.extend(fitted.map(|fitted| (of, fitted.held)));
        self.tried.push(Tried { reflectance, pulse, left: left.clone() });
        Ok(left)
    }

    /// Continues the sharp fit of a model with an impulse response, for a number of iterations.
    fn spread(
        &mut self,
        reflectance: Reflectance,
        pulse: Shape,
        iterations: usize,
    ) -> Result<Option<Fitted>> {
        let Some(sharp) = self.sharp(reflectance) else { return Ok(None) };
        let from = sharp.fitted.surface.layers.clone();
        self.fit(reflectance, pulse, From::Fit(&from, iterations))
    }

    /// The held-out pairs of the fit of a hypothesis with an impulse response, if there is one.
    pub fn spread_by(&self, reflectance: Reflectance, pulse: Shape) -> Option<HeldOut> {
        self.spread.iter().find(|(of, _)| *of == (reflectance, pulse)).map(|(_, held)| held.clone())
    }

    /// Models are compared with the impulse responses that their sharp fits suggest. The best of them finds its own.
    pub fn run(&mut self, usual: Reflectance, finds_model: bool) -> Result<(Reflectance, Option<Shape>)> {
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
        let model = self.chosen(&residuals).ok_or_else(no_surface)?;
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
            let other = self.chosen(&again).unwrap_or(model);
            if other != model {
                model = other;
                self.pace.expect(FitProgress::OF_PULSE);
                pulse = self.best_pulse(model)?;
            }
        }
        if let Some(by_samples) = self.find_samples(model, pulse)? {
            model = by_samples;
        }
        Ok((model, Some(pulse)))
    }

    /// The model that these residuals choose. Cosine stays in place of Lambertian where photon noise alone makes such differences, with
    /// sharp paths and in these residuals.
    fn chosen(&mut self, residuals: &[(Reflectance, Option<Left>)]) -> Option<Reflectance> {
        let chosen = model::choose(residuals)?;
        let [cosine, lambertian] = [Reflectance::Cosine, Reflectance::Lambertian]
            .map(|of| Some((self.sharp(of)?, residuals.iter().find(|(model, _)| *model == of)?.1.as_ref()?)));
        let is_chance = cosine.zip(lambertian).is_some_and(|((sharp, left), (other, less))| {
            let [sharp, other] = [sharp, other].map(|of| &of.fitted.held);
            let most = model::BY_CHANCE * sharp.chance(other);
            sharp.left().excess() - other.left().excess() < most && left.excess() - less.excess() < most
        });
        // The variance of other values is an estimate.
        self.is_by_chance = self.is_counted && chosen == Reflectance::Lambertian && is_chance;
        Some(if self.is_by_chance { Reflectance::Cosine } else { chosen })
    }

    /// The impulse response by samples, if surfaces of it leave clearly less than those of the best shape: the model that then leaves
    /// least, whose surface is that of the search from here on.
    fn find_samples(&mut self, reflectance: Reflectance, shape: Shape) -> Result<Option<Reflectance>> {
        let Some(sharp) = self.sharp(reflectance) else { return Ok(None) };
        let held = &sharp.fitted.held;
        let is_left = held.left().certain() > response::LEFT;
        if !is_left || !response::is_worth(held, &Shape::all(self.bin_width, self.longest))? {
            return Ok(None);
        }
        let Some(by_shape) = self.left(reflectance, shape)? else { return Ok(None) };
        let Some(found) = self.fit_samples(reflectance)? else { return Ok(None) };
        if !found.0.has_echo(response::ECHO[1]) || !response::is_taken(&found.1.held.left(), &by_shape) {
            return Ok(None);
        }
        // What other models leave with a response of their own.
        let mut all = vec![(reflectance, found)];
        let others = self.sharp.iter().map(|sharp| sharp.reflectance).filter(|other| *other != reflectance);
        for other in others.collect::<Vec<_>>() {
            all.extend(self.fit_samples(other)?.map(|found| (other, found)));
        }
        let left: Vec<_> = all.iter().map(|(model, found)| (*model, Some(found.1.held.left()))).collect();
        let model = self.chosen(&left).unwrap_or(reflectance);
        let (_, (response, fitted)) = all.into_iter().find(|(of, _)| *of == model).expect("one of them");
        self.samples = Some(response.at_peak(self.bin_width));
        self.known = Some(response.samples(self.bin_width).pulse());
        let sharp = self.sharp.iter_mut().find(|sharp| sharp.reflectance == model).expect("a sharp fit");
        sharp.fitted = fitted;
        Ok(Some(model))
    }

    /// Fits a surface and the samples of a response by turns, from the sharp fit of a model, until no less is left.
    fn fit_samples(&mut self, reflectance: Reflectance) -> Result<Option<(Response, Fitted)>> {
        let Some(sharp) = self.sharp(reflectance) else { return Ok(None) };
        let mut layers = sharp.fitted.surface.layers.clone();
        let mut ideal = Some(sharp.fitted.held.clone());
        let mut best: Option<(Response, Fitted)> = None;
        for _ in 0..response::ROUNDS {
            let Some(response) = ideal.as_ref().and_then(response::suggested) else { break };
            self.pace.expect(OF_PULSE);
            let pulse = response.samples(self.bin_width).pulse();
            let Some(fitted) = self.fit_with(reflectance, Some(pulse), From::Fit(&layers, OF_PULSE))? else {
                break;
            };
            let excess = |fitted: &Fitted| fitted.held.left().excess();
            if best.as_ref().is_some_and(|(_, best)| excess(&fitted) > response::LESS * excess(best)) {
                break;
            }
            layers = fitted.surface.layers.clone();
            ideal = trial_of(&self.trials, reflectance).ideal(&layers)?;
            best = Some((response, fitted));
        }
        // The support of the sharp fit holds echoes: a fit from the start may do without them.
        if let Some((response, fitted)) = &mut best {
            self.pace.expect(From::Start.iterations());
            let pulse = response.samples(self.bin_width).pulse();
            let anew = self.fit_with(reflectance, Some(pulse), From::Start)?;
            if let Some(anew) = anew.filter(|anew| anew.held.left().excess() < fitted.held.left().excess()) {
                *fitted = anew;
            }
        }
        Ok(best)
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
        let longer = self.spread(reflectance, Shape::SHARP, OF_PULSE)?.and_then(|fitted| fitted.surface.left);
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
        let surface =
            self.spread(reflectance, Shape::of(first, 0.0), ITERATIONS[1])?.map(|fitted| fitted.surface);
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

/// The fit of these that leaves least, and what it leaves.
fn least_left(sharp: &[Sharp]) -> Option<(&Sharp, Left)> {
    let each = sharp.iter().map(|sharp| (sharp, sharp.fitted.held.left()));
    each.min_by(|a, b| a.1.excess().total_cmp(&b.1.excess()))
}

pub(crate) fn trial_of<'s, 't>(trials: &'s [Trial<'t>], reflectance: Reflectance) -> &'s Trial<'t> {
    trials.iter().find(|t| t.reflectance() == reflectance).expect("a trial for every model")
}
