//! What a run finds out by quick solves before the one that was asked for: how much slow light counts, how surfaces reflect,
//! and what the instrument's pulse is. The trials share their pairs, their grid and, for each model, the volume that they
//! begin with.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::capture::{Capture, Pulse};
use crate::gpu::Gpu;
use crate::solve::vector::{Left, PAIRS, Start, Trial, usual_high_pass};
use crate::solve::{
    Discretisation, Doing, Progress, Ready, SolverOptions, VectorOptions, Watch, default_volume,
};
use crate::transport::{Reflectance, Volume};
use crate::{Error, Kind, Result};

mod choice;
mod high_pass;
mod model;
mod pulse;

pub use choice::{Choice, Resolved, Tuned, preset_for};
pub use high_pass::FoundHighPass;
use model::WITHOUT_NORMALS;
pub use model::{FoundModel, MODELS, Refuted};
pub use pulse::FoundPulse;
use pulse::Shape;

/// Fewer pairs that judge cannot tell a difference from chance.
const LEAST_PAIRS: usize = 16;

/// Lateral pixels and iterations of a trial.
const LATERAL: usize = 64;
const ITERATIONS: usize = 20;
const COARSE_ITERATIONS: usize = 8;
const SURFACE_ITERATIONS: usize = 40;

/// A volume that is compared with a surface: after so many iterations, it may leave so many times as much as the surface. Only
/// if it comes as close do more follow.
const VOLUMES: [(usize, f64); 3] = [(20, 2.0), (40, 1.15), (80, REFUTES)];

/// A volume that leaves less than so many times as much as the surface, beyond chance, refutes the surface's model. More
/// iterations only leave less (benches/NOTES.md).
const REFUTES: f64 = 0.9;

/// Surfaces begin with a short volume in coarse voxels. If it leaves more than so many times as much as the surface, a longer one
/// in finer voxels does not refute the model. Where one did, it left 2.1 times as much at most (benches/NOTES.md).
const FAR: f64 = 3.0;

/// A pulse as long as this share of the wall's width hides shapes: a volume that is as thick as the pulse leaves less than a
/// surface, whatever light does with the angle. So it refutes nothing.
const HIDES: f64 = 0.125;

/// A model that leaves so many times as much as the best one, each with the pulse that its surface with sharp paths asks for, is
/// not tried with a pulse.
const HOPELESS: f64 = 1.3;

/// Whether the width of the instrument's pulse is found first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FindPulse {
    /// Paths are sharp, unless the capture holds a pulse.
    Never,
    /// If the trials of the model show one: a pulse as wide as two of their bins explains the data better than sharp paths.
    IfItShows,
    /// By trials of its own.
    Always,
}

/// What trials are to find.
#[derive(Debug, Clone, Copy)]
pub struct Ask<'a> {
    /// The solver with its options, for the usual model.
    pub solver: &'a SolverOptions,
    /// Its options for each model of reflectance to choose among; empty if the model is known. The first is the usual one.
    pub models: &'a [SolverOptions],
    /// Whether to find the width of the instrument's pulse, if the capture holds no pulse.
    pub find_pulse: FindPulse,
    /// How finely the solve will be. Trials have voxels of their own.
    pub discretisation: Discretisation,
    /// Most device memory to use, in bytes.
    pub memory: Option<u64>,
}

impl Ask<'_> {
    /// Whether to find the high-pass of the objective: nobody gave it.
    pub fn finds_high_pass(&self) -> bool {
        matches!(self.solver, SolverOptions::Vector(options) if options.high_pass.is_none())
    }

    /// Whether to find the pulse of this capture: there is none yet, and only trials of the model can show one.
    pub fn find_pulse(&self, capture: &Capture) -> FindPulse {
        match (self.find_pulse, &capture.pulse) {
            (_, Some(_)) => FindPulse::Never,
            (FindPulse::IfItShows, None) if self.models.len() < 2 => FindPulse::Never,
            (asked, None) => asked,
        }
    }
}

/// What the trials of a run found.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// How surfaces reflect, if it was to be found.
    #[serde(default)]
    pub model: Option<FoundModel>,
    /// The high-pass of the objective, if it was to be found.
    #[serde(default)]
    pub high_pass: Option<FoundHighPass>,
    /// The instrument's pulse, if it was to be found.
    #[serde(default)]
    pub pulse: Option<FoundPulse>,
    /// Seconds that all trials took.
    pub seconds: f64,
}

impl Found {
    /// What was found, as sentences.
    pub fn notes(&self) -> Vec<String> {
        let high_pass = self.high_pass.iter().map(FoundHighPass::note);
        high_pass
            .chain(self.model.iter().map(FoundModel::note))
            .chain(self.pulse.iter().map(FoundPulse::note))
            .collect()
    }

    /// The solver with its options for the model that was found, and the capture with the pulse.
    ///
    /// # Errors
    /// A width that makes no pulse. This does not happen with a width that was found.
    pub fn settle<'c>(
        &self,
        solver: &SolverOptions,
        models: &[SolverOptions],
        capture: &'c Capture,
    ) -> Result<(SolverOptions, Cow<'c, Capture>)> {
        let of_model =
            |found: &FoundModel| models.iter().find(|o| o.common().reflectance == found.reflectance).cloned();
        let mut solver = self.model.as_ref().and_then(of_model).unwrap_or_else(|| solver.clone());
        if let (SolverOptions::Vector(options), Some(found)) = (&mut solver, self.high_pass) {
            (options.high_pass, options.high_pass_floor) = (Some(found.length), found.floor);
        }
        let capture = match self.pulse.as_ref().map(FoundPulse::pulse).transpose()?.flatten() {
            Some(pulse) => Cow::Owned(capture.clone().with(|c| c.pulse = Some(pulse))),
            None => Cow::Borrowed(capture),
        };
        Ok((solver, capture))
    }
}

/// Finds what is asked for, by quick solves of parts of `capture`, which has counts.
///
/// # Errors
/// The device fails or has too little memory, or `hear` cancels a trial ([`Kind::Cancelled`]). If a trial fails otherwise, the
/// usual model and sharp paths stay, and the solve itself reports what is wrong.
pub fn find(
    ask: &Ask<'_>,
    capture: &Capture,
    gpu: &Gpu,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Found> {
    let _span = gpu.span("trials");
    let start = Instant::now();
    let finds_model = ask.models.len() > 1;
    let find_pulse = ask.find_pulse(capture);
    let finds_high_pass = ask.finds_high_pass();
    if !finds_model && find_pulse == FindPulse::Never && !finds_high_pass {
        return Ok(Found::default());
    }
    let usual = ask.solver.common().reflectance;
    let mut tried = vec![];
    let mut high_pass = None;
    let searched = Trials::new(ask, capture, gpu, hear).and_then(|mut trials| {
        if finds_high_pass {
            high_pass = Some(trials.find_high_pass(capture)?);
        }
        let found = search(&mut trials, usual, finds_model);
        tried = std::mem::take(&mut trials.tried);
        found
    });
    let (answer, failed) = match searched {
        Ok(answer) => (answer, None),
        Err(e) if matches!(e.kind, Kind::Device | Kind::Cancelled) => return Err(e),
        // The device refuses what is less than the solve needs. A budget may allow the solve in parts.
        Err(e) if e.kind == Kind::Memory && ask.memory.is_none() => return Err(e),
        Err(e) => {
            let pulse = (find_pulse == FindPulse::Always).then_some(Shape::SHARP);
            (Answer { reflectance: usual, pulse, refuted: None }, Some(e.what))
        }
    };
    let Answer { reflectance, pulse, refuted } = answer;
    let seconds = start.elapsed().as_secs_f64();
    let model = finds_model.then(|| FoundModel::of(reflectance, &tried, refuted, failed.clone()));
    let pulse = pulse.map(|shape| FoundPulse::of(shape, reflectance, &tried, seconds, failed));
    Ok(Found { model, high_pass, pulse, seconds })
}

/// A trial, and what it left.
#[derive(Debug, Clone, PartialEq)]
struct Tried {
    reflectance: Reflectance,
    pulse: Shape,
    begun: Begun,
    left: Option<Left>,
    /// The pulse that its light asks for, and what it leaves with it: of a surface with sharp paths, if a pulse is looked for.
    spread: Option<(Shape, Left)>,
}

/// What a trial begins with. The first model's are one and the same.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Begun {
    /// The volume of the first model, as a solve begins: so models are compared.
    Alike,
    /// A volume of its own. A pulse shows at rims, where volumes of different models differ: with another's, a pulse is
    /// found where there is none.
    OnItsOwn,
}

/// What the trials say.
struct Answer {
    reflectance: Reflectance,
    /// `None` if it was not looked for.
    pulse: Option<Shape>,
    /// The model that would have been chosen, if its normals do not explain the light.
    refuted: Option<Refuted>,
}

/// First the models are compared with sharp paths. Then the best of them finds the pulse, and all are compared again with
/// this pulse. If another is better then, it finds the pulse anew. At last the normals of its surface are put to the
/// test.
fn search(trials: &mut Trials<'_>, usual: Reflectance, finds_model: bool) -> Result<Answer> {
    let choose = |trials: &mut Trials<'_>, pulse: Shape| match finds_model {
        true => trials.best_model(pulse),
        false => Ok(usual),
    };
    let mut reflectance = choose(trials, Shape::SHARP)?;
    let finds_pulse = match trials.find_pulse {
        FindPulse::Never => false,
        FindPulse::IfItShows => trials.shows_pulse(reflectance)?,
        FindPulse::Always => true,
    };
    let mut pulse = None;
    if finds_pulse {
        let guess = trials.asked_for(reflectance);
        let mut best = trials.best_pulse(reflectance, guess)?;
        if best != Shape::SHARP {
            let again = choose(trials, best)?;
            if again != reflectance {
                reflectance = again;
                best = trials.best_pulse(reflectance, best)?;
            }
        }
        pulse = Some(best);
    }
    let refuted =
        if finds_model { trials.refuted(reflectance, pulse.unwrap_or(Shape::SHARP))? } else { None };
    if refuted.is_some() {
        reflectance = WITHOUT_NORMALS;
        if finds_pulse {
            let guess = pulse.filter(|p| *p != Shape::SHARP).unwrap_or(trials.asked_for(reflectance));
            pulse = Some(trials.best_pulse(reflectance, guess)?);
        }
    }
    Ok(Answer { reflectance, pulse, refuted })
}

/// The trials of a capture.
struct Trials<'t> {
    models: Vec<(Reflectance, Trial)>,
    /// Metres of path, as narrow as the trials' pixels can tell.
    bin_width: f64,
    /// The narrowest pulse that the solve, whose bins may be narrower, models: in bins of the trials.
    narrowest: f64,
    /// The pulse of the capture, if it has one.
    known: Option<Pulse>,
    /// Whether a pulse is looked for.
    find_pulse: FindPulse,
    /// Width of the wall, metres.
    wall: f64,
    hear: &'t mut dyn FnMut(&Progress) -> ControlFlow<()>,
    tried: Vec<Tried>,
}

impl<'t> Trials<'t> {
    fn new(
        ask: &Ask<'_>,
        capture: &Capture,
        gpu: &'t Gpu,
        hear: &'t mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Trials<'t>> {
        let all = if ask.models.is_empty() { std::slice::from_ref(ask.solver) } else { ask.models };
        let judges = capture.pair_count() / 2;
        if judges < LEAST_PAIRS {
            return Err(Error::input(
                format!("trials need {} pairs, the capture has {}", 2 * LEAST_PAIRS, capture.pair_count()),
                "name the model and the pulse if known",
            ));
        }
        let thin = capture.subset((2 * PAIRS).min(capture.pair_count()), 0)?;
        let (confocal, [x0, x1, y0, y1]) = (capture.is_confocal(), capture.wall_extent());
        let options = quick(all[0].as_vector(confocal), confocal);
        let of_all = || default_volume(capture, options.domain.min_depth);
        let volume: Volume = ask.discretisation.volume.map_or_else(of_all, Ok)?;
        let of_trial =
            Discretisation { volume: Some(volume), bins: ask.discretisation.bins, depth_pitch: None };
        let Ready { capture: thin, grid, .. } = of_trial.ready(&options.into(), Cow::Owned(thin))?;
        let of_solve = ask.discretisation.sum(ask.solver, &capture.outline()) as f64 * capture.bin_width;
        let of_model = |options: &SolverOptions| {
            let options = quick(options.as_vector(confocal), confocal);
            (options.reflectance, Trial::new(gpu, &thin, grid, options, ask.memory))
        };
        Ok(Trials {
            models: all.iter().map(of_model).collect(),
            bin_width: thin.bin_width,
            narrowest: pulse::NARROWEST * of_solve / thin.bin_width,
            known: capture.pulse.clone(),
            find_pulse: ask.find_pulse(capture),
            wall: (x1 - x0).max(y1 - y0),
            hear,
            tried: vec![],
        })
    }

    /// Finds the high-pass by a volume of the first model. All trials have what is found, and are judged by it.
    fn find_high_pass(&mut self, capture: &Capture) -> Result<FoundHighPass> {
        let (first, length) = (self.models[0].0, usual_high_pass(capture));
        let bands =
            self.with_trial(first, Shape::SHARP, |trial, pulse, watch| trial.bands(length, pulse, watch))?;
        let found = FoundHighPass::of(length, bands);
        if found.length > 0.0 {
            self.models.iter_mut().for_each(|(_, trial)| trial.set_high_pass([found.length, found.floor]));
        }
        Ok(found)
    }

    /// What a surface with this model and this pulse leaves.
    fn left(&mut self, reflectance: Reflectance, pulse: Shape, begun: Begun) -> Result<Option<Left>> {
        let (first, _) = &self.models[0];
        let begun = if *first == reflectance { Begun::Alike } else { begun };
        let of = (reflectance, pulse, begun);
        if let Some(same) = self.tried.iter().find(|t| (t.reflectance, t.pulse, t.begun) == of) {
            return Ok(same.left.clone());
        }
        let shared = self.models[0].1.own().filter(|_| *first != reflectance && begun == Begun::Alike);
        let start = shared.map_or(Start::Own, |own| Start::Of(Box::new(own.clone())));
        let left =
            self.with_trial(reflectance, pulse, |trial, pulse, watch| trial.fit(start, pulse, watch))?;
        let asks = self.find_pulse != FindPulse::Never && pulse == Shape::SHARP;
        let spread = if asks { self.spread(reflectance)? } else { None };
        self.tried.push(Tried { reflectance, pulse, begun, left: left.clone(), spread });
        Ok(left)
    }

    /// The pulse that the last surface of a model asks for, which had sharp paths, and what it leaves with it.
    fn spread(&self, reflectance: Reflectance) -> Result<Option<(Shape, Left)>> {
        let shapes = Shape::all(self.bin_width);
        let pulses = shapes.iter().filter_map(|shape| shape.centred().transpose());
        let (_, trial) = self.models.iter().find(|m| m.0 == reflectance).expect("a trial for every model");
        let best = trial.spread(&pulses.collect::<Result<Vec<_>>>()?)?;
        Ok(best.map(|(at, left)| (shapes[at], left)))
    }

    /// What a model's surface leaves with the pulse that it asks for, if it had sharp paths, a pulse is looked for in any case, and
    /// it leaves less with one.
    fn with_spread(&self, reflectance: Reflectance, pulse: Shape) -> Option<Left> {
        let of = (reflectance, Shape::SHARP, Begun::Alike);
        let same = self.tried.iter().find(|t| (t.reflectance, t.pulse, t.begun) == of)?;
        let asked = self.find_pulse == FindPulse::Always && pulse == Shape::SHARP;
        let (spread, own) = (&same.spread.as_ref().filter(|_| asked)?.1, same.left.as_ref()?);
        (spread.share() < own.share()).then(|| spread.clone())
    }

    /// The pulse that a model's surface with sharp paths asks for. Its tail is not to be trusted: the surface stands for it.
    fn asked_for(&self, reflectance: Reflectance) -> Shape {
        let of_model = self.tried.iter().filter(|t| t.reflectance == reflectance);
        let asked = of_model.filter_map(|t| Some(t.spread.as_ref()?.0.length())).next();
        Shape::of(asked.unwrap_or(pulse::FIRST * self.bin_width), 0.0)
    }

    /// Whether the normals of this model's surface fail to explain how light depends on the angle: a volume, whose
    /// voxels have normals of their own, predicts other pairs better.
    fn refuted(&mut self, reflectance: Reflectance, pulse: Shape) -> Result<Option<Refuted>> {
        let knows_another = self.models.iter().any(|m| m.0 == WITHOUT_NORMALS);
        let known = self.known.as_ref().map_or(0.0, Pulse::fwhm);
        let hides = pulse.length().max(known) > HIDES * self.wall;
        if !reflectance.has_normals() || !knows_another || hides {
            return Ok(None);
        }
        let Some(surface) = self.left(reflectance, pulse, Begun::Alike)? else { return Ok(None) };
        let surface = surface.in_wide_bins();
        // Photon noise stays, so a volume comes near by what it leaves beyond noise.
        let comes_near = |volume: &Left, most: f64| {
            let refutes = REFUTES * surface.share() - volume.noise_share();
            volume.share() - volume.noise_share() <= most / REFUTES * refutes
        };
        if self.models[0].1.own().is_some_and(|own| !comes_near(&own.left, FAR)) {
            return Ok(None);
        }
        let (mut most, mut better) = (VOLUMES.iter().map(|of| of.1), None);
        let mut compare = |volume: Option<Left>| {
            let (Some(volume), Some(most)) = (volume, most.next()) else { return false };
            if volume.share() <= REFUTES * surface.share() && volume.is_less(&surface) {
                better = Some(volume);
                return false;
            }
            comes_near(&volume, most)
        };
        let iterations = VOLUMES.map(|(iterations, _)| iterations);
        self.with_trial(reflectance, pulse, |trial, pulse, watch| {
            trial.fit_volume(pulse, &iterations, watch, &mut compare)
        })?;
        let Some(volume) = better else { return Ok(None) };
        // It gives way to a model that finds a surface.
        let another = self.tried.iter().any(|t| t.reflectance == WITHOUT_NORMALS && t.left.is_some())
            || self.left(WITHOUT_NORMALS, pulse, Begun::Alike)?.is_some();
        Ok(another.then(|| Refuted { reflectance, surface: surface.share(), volume: volume.share() }))
    }

    /// Runs the trial of a model with this pulse.
    fn with_trial<T>(
        &mut self,
        reflectance: Reflectance,
        shape: Shape,
        run: impl FnOnce(&mut Trial, Option<&Pulse>, &mut Watch<'_>) -> Result<T>,
    ) -> Result<T> {
        let Trials { models, hear, known, .. } = self;
        let (_, trial) = models.iter_mut().find(|m| m.0 == reflectance).expect("a trial for every model");
        let mut told = |p: &Progress| hear(&Progress { doing: Doing::Trial, ..p.clone() });
        let mut watch = Watch { hear: &mut told, maps_every: None, maps_at: &[] };
        let pulse = shape.centred()?.or(known.clone());
        run(trial, pulse.as_ref(), &mut watch)
    }

    /// Whether this model shows that there may be a pulse. One without normals shows a pulse on every curved thing, so it
    /// is not asked.
    fn shows_pulse(&mut self, reflectance: Reflectance) -> Result<bool> {
        if reflectance == WITHOUT_NORMALS {
            return Ok(false);
        }
        let [sharp, wide] = [0.0, pulse::FIRST * self.bin_width].map(|fwhm| Shape { fwhm, tail: 0.0 });
        let sharp = self.left(reflectance, sharp, Begun::Alike)?;
        let wide = self.left(reflectance, wide, Begun::Alike)?;
        Ok(sharp.zip(wide).is_some_and(|(sharp, wide)| wide.is_less(&sharp)))
    }

    /// The pulse with this model: its length, from a guess on, then the share of its tail.
    fn best_pulse(&mut self, reflectance: Reflectance, guess: Shape) -> Result<Shape> {
        let sharp = self.left(reflectance, Shape::SHARP, Begun::OnItsOwn)?;
        let sharp =
            sharp.ok_or_else(|| Error::input("a trial found no surface", "give the instrument's pulse"))?;
        let of = |trials: &mut Self, pulse: Shape, least: &mut Option<Left>| {
            let left = trials.left(reflectance, pulse, Begun::OnItsOwn)?;
            *least = left.iter().chain(&*least).min_by(|a, b| a.share().total_cmp(&b.share())).cloned();
            Ok(left.map(|left| left.share()))
        };
        let (bin_width, narrowest, share) = (self.bin_width, self.narrowest, guess.share());
        let (mut first, mut second) = (None, None);
        let best = pulse::best_length(guess.length() / bin_width, narrowest, sharp.share(), &mut |bins| {
            of(self, Shape::of(bins * bin_width, share), &mut first)
        })?;
        let Some([bins, left]) = best else { return Ok(Shape::SHARP) };
        let length = bins * bin_width;
        let best =
            pulse::best_tail(share, left, &mut |share| of(self, Shape::of(length, share), &mut second))?;
        let is_worth = |better: &Option<Left>, than: &Left| {
            let enough = |better: &Left| better.share() < (1.0 - pulse::WORTH) * than.share();
            better.as_ref().is_some_and(|better| enough(better) && better.is_less(than))
        };
        // A tail that was found before, with another model, needs no reason.
        let stays = share > 0.0 || first.as_ref().is_none_or(|first| is_worth(&second, first));
        let (share, left) = if stays { (best, [first, second]) } else { (0.0, [first, None]) };
        let least = left.into_iter().flatten().min_by(|a, b| a.share().total_cmp(&b.share()));
        Ok(if is_worth(&least, &sharp) { Shape::of(length, share) } else { Shape::SHARP })
    }

    /// What each model's surface with sharp paths leaves with the pulse that it asks for, of those that found one.
    fn asking(&self) -> impl Iterator<Item = (Reflectance, f64)> {
        let alike = self.tried.iter().filter(|t| t.begun == Begun::Alike);
        alike.filter_map(|t| Some((t.reflectance, t.spread.as_ref()?.1.share())))
    }

    /// The model that is right, with this pulse.
    fn best_model(&mut self, pulse: Shape) -> Result<Reflectance> {
        let mut all: Vec<Reflectance> = self.models.iter().map(|m| m.0).collect();
        if pulse != Shape::SHARP {
            let most = HOPELESS * self.asking().map(|of| of.1).fold(f64::INFINITY, f64::min);
            all.retain(|model| !self.asking().any(|(of, left)| of == *model && left > most));
        }
        let mut left = vec![];
        for reflectance in all {
            let own = self.left(reflectance, pulse, Begun::Alike)?;
            left.push((reflectance, self.with_spread(reflectance, pulse).or(own)));
        }
        model::choose(&left)
            .ok_or_else(|| Error::input("no trial found a surface", "name the model and the pulse if known"))
    }
}

/// The options of a trial.
fn quick(options: VectorOptions, confocal: bool) -> VectorOptions {
    let fine = options.lateral >= LATERAL;
    options.with(|o| {
        o.lateral = o.lateral.min(LATERAL);
        o.iterations = ITERATIONS;
        o.all_pairs = true;
        o.domain.coarse_iterations = COARSE_ITERATIONS;
        o.surface.iterations = SURFACE_ITERATIONS;
        o.surface.pixels_per_voxel = fine.then_some(2);
        o.surface.points = None;
        if !confocal {
            // With a blur, the cosine model of one laser point explains retroreflectors as well (benches/NOTES.md).
            o.surface.blur = 0.0;
        }
        o.surface.sparsity = 0.0;
        o.domain.room = None;
    })
}
