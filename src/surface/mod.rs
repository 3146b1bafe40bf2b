//! The surface solver, the default: a start, then a surface with data-driven support, fitted by differentiable rendering
//! (in the manner of Tsai, Sankaranarayanan, Gkioulekas: *Beyond Volumetric Albedo*, CVPR 2019, and of Plack, Callenberg,
//! Schneider, Hullin: *Fast Differentiable Transient Rendering for Non-Line-of-Sight Reconstruction*, WACV 2023).
//!
//! minimise  ½ Σ (F √w (A(z, a) − h))² / (P T)  +  prior(z, a)
//!
//! over a depth z and an albedo a for every pixel of the support. A renders each pixel as its tilted square: one point, or four.
//! Its normal is that of the plane through its neighbours, so shading and shape are one. The weights w are the inverse falloff:
//! near and far surfaces weigh alike. F is the high-pass along time. The prior is Gaussian: neighbours lie in each other's planes
//! and have similar albedos, weighted by what the fit leaves of the data. Adam minimises it; its gradients are averaged over their
//! surroundings at first, and iterations take batches of the pairs in turns.
//!
//! A solve has three parts: the layers of a network or a closed form (`start.rs`), rounds of short fits on coarse
//! pixels between which the support follows the evidence (`support.rs`), and a fit at the resolution of the maps.

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

use crate::Result;
use crate::capture::Capture;
use crate::engine::{
    Common, Driven, Evidence, Plan, Prepared, Problem, Reconstruction, RunsOn, Solver, TimedSchedule,
    VolumeMap, Watch, finish,
};
use crate::gpu::{Abilities, Gpu};
use crate::learned::{self, LearnedStart};
use crate::maps::{Layer, Maps};
use crate::transport::Grid;

mod evidence;
pub(crate) mod fit;
mod follow;
mod held_out;
pub mod layers;
pub(crate) mod model;
mod needs;
mod options;
pub mod passes;
mod pixels;
mod plates;
mod rounds;
mod schedule;
mod settle;
mod smooth;
pub(crate) mod start;
pub(crate) mod support;
mod weights;

use evidence::{Known, conclude};
pub(crate) use fit::{Fit, Judge, Quality, Run};
pub use follow::Follow;
use follow::{FrameChange, PreviousFrame};
pub(crate) use held_out::mean_and_error;
pub use held_out::{HeldOut, Left};
pub use needs::{SMALL_PIXEL, pixels, plan, points_of};
pub use options::{Begin, LEAST_FLOOR, SurfaceOptions, SurfaceSettings};
pub use pixels::Pixels;
use rounds::grow;
pub(crate) use rounds::{Candidate, Growth, Rounds};
pub use schedule::{
    Judged, bonds, check, divide, extract, iteration, place, place_known, points, render, start as start_of,
};
pub(crate) use start::{Begun, Start, Starts};
pub use weights::{Placed, weights};

/// Rounds of the support. Evidence: benches/NOTES.md, "Support by evidence".
mod rounds_of {
    /// Lateral pixels of the coarse fit.
    pub const COARSE: usize = 64;
    /// Rounds on coarse pixels, and at the resolution of the maps.
    pub const NUMBER: [usize; 2] = [12, 2];
    /// Iterations of a round, and of the schedule that it begins: its steps stay long.
    pub const ITERATIONS: usize = 15;
    pub const SCHEDULED: usize = 45;
}

impl SurfaceOptions {
    /// Pixels of the maps side by side in a pixel of the coarse fit; 1 without a coarse fit.
    fn factor(&self) -> usize {
        let mut factor = 1;
        while self.lateral.is_multiple_of(2 * factor) && self.lateral / (2 * factor) >= rounds_of::COARSE {
            factor *= 2;
        }
        factor
    }

    /// Iterations at most: on coarse pixels, and at the resolution of the maps.
    fn most_iterations(&self) -> [usize; 2] {
        let [coarse, fine] = rounds_of::NUMBER.map(|rounds| rounds * rounds_of::ITERATIONS);
        match (self.grow, self.factor()) {
            (false, _) => [0, self.iterations],
            (true, 1) => [0, coarse + self.iterations],
            (true, _) => [coarse, fine + self.iterations],
        }
    }

    /// Checks the memory of a solve that begins with estimates: its fit also has pairs that are held out.
    ///
    /// # Errors
    /// As [`Fit::new`].
    pub(super) fn check_judged(&self, gpu: &Gpu, problem: &Problem<'_>) -> Result<()> {
        Fit::new(gpu, problem, self, self.most_iterations(), Judge::HeldOut).map(drop)
    }
}

impl Solver for SurfaceOptions {
    fn common(&self) -> Common {
        Common {
            lateral: self.lateral,
            iterations: [0, self.most_iterations().iter().sum()],
            reflectance: self.reflectance,
            accumulation: self.accumulation,
            min_depth: self.min_depth,
            pixels_per_voxel: self.factor().min(2),
            runs_on: RunsOn::Device,
        }
    }

    fn check(&self) -> Result<()> {
        SurfaceOptions::check(self)
    }

    fn takes(&self, capture: &Capture) -> Result<()> {
        start::method(self, self.lateral, capture).map(|_| ())
    }

    fn plan(&self, problem: &Problem<'_>, abilities: &Abilities) -> Result<Plan> {
        let Problem { capture, grid, .. } = *problem;
        self.takes(capture)?;
        let (outline, _) = model::outline_of(&capture.outline(), &grid, self, false);
        let iterations = self.most_iterations();
        let mut plan = plan(&outline, grid, capture.resolution(), self, iterations, 0, abilities)?;
        fit::share_with_host(&mut plan);
        Ok(plan)
    }

    fn outline(&self, plan: &Plan) -> Vec<TimedSchedule> {
        fit::outline(plan)
    }

    fn prepare(&self, gpu: &Gpu, problem: &Problem<'_>) -> Result<Box<dyn Prepared>> {
        prepare(gpu, problem, self, None, None)
    }
}

/// Prepares the solver for captures of one scan. They are frames that follow each other if `follow` says how. A surface that was `begun`
/// by earlier fits of the capture is where it begins; pairs are then held out of its fits.
///
/// # Errors
/// Options, scan or device do not allow the solve.
pub(crate) fn prepare(
    gpu: &Gpu,
    problem: &Problem<'_>,
    options: &SurfaceOptions,
    follow: Option<Follow>,
    begun: Option<&Begun>,
) -> Result<Box<dyn Prepared>> {
    let Problem { capture, grid, memory, with_volume, .. } = *problem;
    options.check()?;
    options.takes(capture)?;
    follow.map_or(Ok(()), |follow| follow.check(options))?;
    let scan = capture.outline();
    let problem = Problem { capture: &scan, ..*problem };
    let [coarse_iterations, iterations] = options.most_iterations();
    let first_grid = if coarse_iterations > 0 { grid.coarser(options.factor()) } else { grid };
    // Bins so wide that one point renders a pixel of the first fit.
    let narrow = first_grid.pitch.x / (SMALL_PIXEL * scan.bin_width);
    let sum = if coarse_iterations > 0 { ((narrow - 1e-6).ceil() as usize).clamp(1, scan.bins) } else { 1 };
    let first_scan = if sum > 1 { scan.binned(sum)?.outline() } else { scan.clone() };
    let judge = if begun.is_some() { Judge::HeldOut } else { Judge::None };
    let coarse = match coarse_iterations {
        0 => None,
        most => {
            let coarse = Problem { capture: &first_scan, grid: first_grid, ..problem };
            Some(Fit::new(gpu, &coarse, options, [0, most], judge)?)
        }
    };
    let fine = Fit::new(gpu, &problem, options, [coarse_iterations, iterations], judge)?;
    let fits = |maps: &Maps| [maps.nx, maps.ny] == [first_grid.n[0], first_grid.n[1]];
    let begun = begun.filter(|begun| begun.layers.iter().chain(&begun.closed).all(fits));
    let made = PreparedSurface {
        coarse,
        fine,
        options: options.clone(),
        grid,
        memory,
        with_volume,
        first_scan: first_scan.clone(),
        first_grid,
        sum,
        method: None,
        blends: start::is_light_cone(options, &first_scan),
        begun: begun.cloned(),
        keeps: false,
        follow,
        last: None,
    };
    made.first_method(gpu)?;
    Ok(Box::new(made))
}

/// The solver, prepared for a scan.
struct PreparedSurface {
    /// `None` where the maps are coarse, or the support is fixed.
    coarse: Option<Fit>,
    fine: Fit,
    options: SurfaceOptions,
    grid: Grid,
    memory: Option<u64>,
    with_volume: bool,
    /// The grid of the first fit.
    first_grid: Grid,
    /// How many bins are one for the closed form and the first fit, and the capture in these bins, without its counts.
    sum: usize,
    first_scan: Capture,
    /// The closed form, while everything stays allocated.
    method: Option<Start>,
    /// The light-cone transform initialises the surface.
    blends: bool,
    /// What earlier fits of the capture found.
    begun: Option<Begun>,
    /// Everything stays allocated.
    keeps: bool,
    /// If frames follow each other.
    follow: Option<Follow>,
    /// The frame before.
    last: Option<PreviousFrame>,
}

impl PreparedSurface {
    /// The closed form that initialises the surface, prepared; `None`: a plane does.
    fn first_method(&self, gpu: &Gpu) -> Result<Option<Start>> {
        let problem = Problem { memory: self.memory, ..Problem::new(&self.first_scan, self.first_grid) };
        Start::new(gpu, &problem, &self.options)
    }

    /// The layers of the closed form, and the seconds that they took.
    fn start(&mut self, capture: &Capture, watch: &mut Watch<'_>) -> Result<(Vec<Maps>, f64)> {
        let clock = Instant::now();
        let iterations = self.options.most_iterations().iter().sum();
        // Its buffers are freed before those of the fits are made, unless everything stays.
        let gpu = self.fine.planned.gpu().clone();
        let mut own = if self.keeps { None } else { self.first_method(&gpu)? };
        let layers = match self.method.as_mut().or(own.as_mut()) {
            Some(method) => method.layers(capture, iterations, watch)?.layers,
            None => vec![start::plane(capture, &self.first_grid, self.options.background)],
        };
        Ok((layers, clock.elapsed().as_secs_f64()))
    }

    /// Solves a frame of its own, given in the bins of the first fit and in those of the solve.
    fn cold(
        &mut self,
        captures: [&Capture; 2],
        until: Option<Instant>,
        watch: &mut Watch<'_>,
    ) -> Result<FitResult> {
        let (begun, seconds) = match self.begun.clone() {
            Some(begun) => (begun, 0.0),
            None => {
                let clock = Instant::now();
                // Frames have no time for the network, unless it is asked for.
                let seen = match self.options.begin {
                    Begin::Learned => {
                        let gpu = self.fine.planned.gpu();
                        start::seen(gpu, &self.options, captures[1], &self.first_grid, self.memory)?
                    }
                    _ => None,
                };
                let (closed, seconds) = match &seen {
                    Some(seen) => {
                        (vec![seen.maps(&self.first_grid, learned::SURE)], clock.elapsed().as_secs_f64())
                    }
                    None => self.start(captures[0], watch)?,
                };
                (Begun::of(closed, seen), seconds)
            }
        };
        let of = self.options.most_iterations().iter().sum();
        let (seen, light) = (begun.seen.clone(), begun.light.clone());
        let fits = Fits { options: &self.options, of, blends: self.blends, seen, light, until };
        let driven = Driven { seconds, ..Driven::begun(begun.closed[0].clone(), *self.fine.plan().finest()) };
        fits.cold(self.coarse.as_mut(), &mut self.fine, captures, begun, watch, driven)
    }

    /// Solves a frame from the surface of the frame before; `None` after a scene cut. The closed form is computed only if the
    /// residual shows a change.
    fn warm(
        &mut self,
        follow: Follow,
        last: PreviousFrame,
        [wide, capture]: [&Capture; 2],
        until: Option<Instant>,
        watch: &mut Watch<'_>,
    ) -> Result<Option<FitResult>> {
        let level = *self.fine.plan().finest();
        self.fine.step = 1.0;
        let mut driven = taken(&mut self.fine, capture, Driven::begun(last.layers[0].clone(), level))?;
        let Some((scale, seen)) = self.fine.seen(&last.layers, true)? else { return Ok(None) };
        let change = follow.change(&last, seen.left_share());
        if change == FrameChange::Cut {
            return Ok(None);
        }
        let PreviousFrame { layers, left, mut closed, is_whole } = last;
        let mut layers = follow::scaled(layers, scale);
        if change == FrameChange::Some {
            let (found, seconds) = self.start(wide, watch)?;
            driven.seconds += seconds;
            if closed.is_some() {
                follow::restrict(&mut layers, &found);
                closed = Some(found);
            } else {
                if let Some(typical) = support::typical_albedo(&layers) {
                    let flatness = support::flatness(&layers, typical);
                    support::follow(&mut layers, [typical, flatness], Some((self.fine.depth_range(), 1)));
                }
                follow::merge(&mut layers, &found);
            }
        }
        let mut wanted = follow.wanted(&self.options);
        let [rounds, each] = if change == FrameChange::Some { follow::ROUNDS } else { [0; 2] };
        if rounds > 0 {
            wanted = follow::after_rounds(wanted, self.coarse.is_some());
        }
        let of = rounds * each + wanted;
        let fits = Fits { options: &self.options, of, blends: self.blends, seen: None, light: None, until };
        let plan = [rounds, each, wanted];
        let last = PreviousFrame { layers, left, closed, is_whole };
        fits.warm(&mut self.fine, last, seen, plan, watch, driven).map(Some)
    }
}

impl Prepared for PreparedSurface {
    fn plan(&self) -> &Arc<Plan> {
        self.fine.plan()
    }

    fn allocate(&mut self) -> Result<()> {
        let gpu = self.fine.planned.gpu().clone();
        let mut first = self.first_method(&gpu)?;
        first.as_mut().map_or(Ok(()), |method| method.allocate())?;
        (self.method, self.keeps) = (first, true);
        self.coarse.iter_mut().try_for_each(Fit::allocate)?;
        self.fine.allocate()
    }

    fn solve(&mut self, capture: &Capture, watch: &mut Watch<'_>) -> Result<Reconstruction> {
        let begun = Instant::now();
        // After an error or a stop the next frame begins cold.
        let last = self.last.take();
        let wide = if self.sum > 1 { Cow::Owned(capture.binned(self.sum)?) } else { Cow::Borrowed(capture) };
        let until = self.follow.and_then(|follow| follow.fits_until(begun));
        let warm = match (self.follow, last) {
            (Some(follow), Some(last)) => self.warm(follow, last, [&wide, capture], until, watch)?,
            _ => None,
        };
        let is_warm = warm.is_some();
        let done = match warm {
            Some(done) => done,
            None => self.cold([&wide, capture], until, watch)?,
        };
        if !self.keeps {
            self.coarse.iter_mut().for_each(|fit| fit.planned.release());
        }
        let volume = self.with_volume.then(|| as_volume(&done.driven.maps, &self.grid));
        let evidence = done.evidence.map(Arc::new);
        self.last = self.follow.map(|_| done.last);
        let job = self.fine.planned.made()?;
        let solved = finish(job, done.driven, None)?;
        let [begin, fit] = done.begun;
        let stages = Some([begin, fit - begin, solved.solve_seconds - fit]);
        Ok(Reconstruction {
            volume,
            volume_iterations: 0,
            has_mask: true,
            is_warm,
            stages,
            evidence,
            ..solved
        })
    }
}

/// The fits of a solve.
struct Fits<'o> {
    options: &'o SurfaceOptions,
    /// The closed form is the light-cone transform. A back-projection has too much haze to tell where a surface ends.
    blends: bool,
    /// What the network sees, if that is the start, and the light-cone transform beside it.
    seen: Option<Arc<LearnedStart>>,
    light: Option<Maps>,
    /// Iterations in all, at most.
    of: usize,
    /// Fits end at this time.
    until: Option<Instant>,
}

/// What the fits leave.
struct FitResult {
    driven: Driven,
    /// Seconds before the rounds of the support, and before the last fit.
    begun: [f64; 2],
    /// What the next frame may begin with.
    last: PreviousFrame,
    /// What is known of every pixel, where the network has the last word.
    evidence: Option<Evidence>,
}

impl Fits<'_> {
    /// Fits from layers on coarse pixels: rounds on these, then at the resolution of the maps.
    fn cold(
        &self,
        coarse: Option<&mut Fit>,
        fine: &mut Fit,
        [wide, capture]: [&Capture; 2],
        Begun { mut layers, closed, mut step, is_far, .. }: Begun,
        watch: &mut Watch<'_>,
        mut driven: Driven,
    ) -> Result<FitResult> {
        // Without rounds the closed form has the resolution of the maps.
        let factor = if coarse.is_some() { self.options.factor() } else { 1 };
        // Whether the support follows the evidence: while the model explains the light.
        let mut is_open = self.options.grow && !is_far;
        let begin = driven.seconds;
        let finer = |layers: &[Maps]| -> Vec<Maps> {
            layers.iter().map(|maps| support::finer(maps, factor)).collect()
        };
        let closed_fine = match &self.seen {
            // On the depths that the trials found.
            Some(seen) => {
                let mut maps = seen.maps(&fine.plan().levels.maps, learned::POSSIBLE);
                support::take_over(&mut maps, &finer(&layers));
                vec![maps]
            }
            None => finer(&closed),
        };
        if let Some(coarse) = coarse {
            if is_open && !self.is_late() {
                driven = taken(coarse, wide, driven)?;
                coarse.step = step;
                (driven, is_open) = self.rounds(coarse, rounds_of::NUMBER[0], &mut layers, watch, driven)?;
                step = coarse.step;
            }
            layers = finer(&layers);
        }
        driven = taken(fine, capture, driven)?;
        fine.step = step;
        if is_open && !self.is_late() {
            let number = rounds_of::NUMBER[usize::from(factor > 1)];
            (driven, is_open) = self.rounds(fine, number, &mut layers, watch, driven)?;
        }
        let begun = [begin, driven.seconds];
        // A back-projection has too much haze to be trusted with a support.
        let is_trusted = !self.options.grow || self.seen.is_some() || self.blends;
        let mut is_closed = !is_open && is_trusted;
        if is_closed {
            (layers, fine.step) = (closed_fine.clone(), 1.0);
        }
        let (next, mut quality) =
            fine.run(&mut layers, self.run(self.options.iterations, 0), watch, driven)?;
        driven = next;
        if quality.is_none() && self.seen.is_some() && !is_closed {
            // What grew explains no light: what the network sees may.
            (layers, fine.step, is_closed) = (closed_fine.clone(), 1.0, true);
            (driven, quality) = fine.run(&mut layers, self.run(self.options.iterations, 0), watch, driven)?;
        }
        if quality.is_none() {
            // No fit explains light: what the closed form shows of it is all there is.
            let seen = fine.seen(&closed_fine, false)?;
            (layers, is_closed) = (follow::scaled(closed_fine, seen.map_or(1.0, |seen| seen.0)), true);
            quality = seen.map(|seen| seen.1);
        }
        let closed = is_closed.then_some(closed);
        driven.maps = self.shown(&layers, closed.as_deref(), quality);
        let clock = Instant::now();
        let evidence = match (&self.seen, quality) {
            (Some(seen), Some(quality)) => {
                let light = self.light.as_ref();
                let known =
                    Known { capture, layers: &layers, maps: &driven.maps, seen, light, quality, is_closed };
                let evidence = known.evidence(fine)?;
                let evidence = evidence.map(|evidence| conclude(evidence, &mut driven.maps));
                if let ([layer], Some(_)) = (&layers[..], &evidence) {
                    settle::settle(fine, layer, &mut driven.maps)?;
                }
                evidence
            }
            _ => None,
        };
        driven.seconds += clock.elapsed().as_secs_f64();
        let left = quality.map_or(1.0, |q| q.left_share());
        Ok(FitResult {
            driven,
            begun,
            last: PreviousFrame { layers, left, closed, is_whole: !self.is_late() },
            evidence,
        })
    }

    /// The maps of fitted layers. `closed`: the layers of the closed form, if their support is that of the surface.
    fn shown(&self, layers: &[Maps], closed: Option<&[Maps]>, quality: Option<Quality>) -> Maps {
        let mut shown = layers.to_vec();
        let others = match &self.seen {
            Some(_) => self.light.as_slice(),
            None => closed.unwrap_or_default(),
        };
        let blends = closed.is_some() && self.options.grow && self.blends && shown.len() == others.len();
        if blends {
            for (fitted, first) in shown.iter_mut().zip(others) {
                support::blend(fitted, &first.finer(fitted.nx / first.nx));
            }
        }
        let mut maps = concluded(shown, quality);
        if let Some(seen) = self.seen.as_ref().filter(|_| closed.is_some() && quality.is_some()) {
            maps.mask = support::weighed(&maps, &seen.probabilities(&maps), 1 + usize::from(blends));
        }
        // No fit explains light: what the network sees is all there is.
        if let Some(seen) = self.seen.as_ref().filter(|_| !maps.mask.contains(&true)) {
            maps = seen.maps_like(&maps);
        }
        maps
    }

    /// Fits from the previous frame's surface: maximum rounds, iterations per round, and final iterations.
    /// `seen`: quality of the layers of `last` in this frame.
    fn warm(
        &self,
        fine: &mut Fit,
        PreviousFrame { mut layers, left: reference, closed, .. }: PreviousFrame,
        seen: Quality,
        [rounds, each, iterations]: [usize; 3],
        watch: &mut Watch<'_>,
        mut driven: Driven,
    ) -> Result<FitResult> {
        let (mut quality, mut is_done) = (Some(seen), false);
        let mut begun = [driven.seconds; 2];
        // Steps are short where nothing changes.
        let mut run = self.run(iterations, self.options.iterations - iterations);
        if rounds > 0 && closed.is_some() {
            // The support is fixed.
            run = self.run((rounds * each + iterations).min(self.options.iterations), 0);
        } else if rounds > 0 {
            let how = Rounds { number: rounds, rings: self.options.factor().min(2) };
            let of_round = |round: usize| {
                let known = (round == 0).then_some(seen.left);
                (round == 0 || !self.is_late()).then_some(Run { known, ..self.run(each, 0) })
            };
            let (next, best) = grow(fine, how, &mut layers, &of_round, watch, driven)?;
            (driven, quality) = (next, best.map(|best| best.quality));
            begun[1] = driven.seconds;
            run = self.run(iterations, iterations);
            // Rounds that took all the time leave a whole picture.
            is_done = self.is_late() && quality.is_some();
        }
        if !is_done {
            let run = Run { known: quality.map(|q| q.left), ..run };
            (driven, quality) = fine.run(&mut layers, run, watch, driven)?;
        }
        driven.maps = self.shown(&layers, closed.as_deref(), quality);
        let left = follow::reference(quality.map_or(1.0, |q| q.left_share()), reference);
        Ok(FitResult {
            driven,
            begun,
            last: PreviousFrame { layers, left, closed, is_whole: !self.is_late() },
            evidence: None,
        })
    }

    /// A fit of `iterations` iterations, skipping the start of its schedule.
    fn run(&self, iterations: usize, skipped: usize) -> Run {
        Run { skipped, until: self.until, ..Run::of(iterations, self.of) }
    }

    /// Whether the time for fits is over. Then only the last one is left, and that is short.
    fn is_late(&self) -> bool {
        self.until.is_some_and(|until| Instant::now() >= until)
    }

    /// Rounds of short fits, until the time for fits is over, and whether the model then explains the light: else haze looks like
    /// surface.
    fn rounds(
        &self,
        fit: &mut Fit,
        number: usize,
        layers: &mut Vec<Maps>,
        watch: &mut Watch<'_>,
        driven: Driven,
    ) -> Result<(Driven, bool)> {
        // The first round was in time.
        let run = |round: usize| {
            (round == 0 || !self.is_late()).then(|| self.run(rounds_of::ITERATIONS, 0).of_round())
        };
        let (driven, grown) = grow(fit, Rounds { number, rings: 1 }, layers, &run, watch, driven)?;
        Ok((driven, grown.is_some_and(|grown| grown.is_coherent(1.0))))
    }
}

/// Gives a fit the counts of a capture; that is part of the solve.
fn taken(fit: &mut Fit, capture: &Capture, driven: Driven) -> Result<Driven> {
    let clock = Instant::now();
    fit.take(capture)?;
    Ok(Driven { seconds: driven.seconds + clock.elapsed().as_secs_f64(), ..driven })
}

/// The maps of fitted layers, with their mask. Layers without a quality explain no light: nothing stays of them.
fn concluded(mut layers: Vec<Maps>, quality: Option<Quality>) -> Maps {
    if quality.is_none() {
        layers
            .iter_mut()
            .for_each(|maps| (0..maps.depth.len()).for_each(|pixel| support::remove(maps, pixel)));
    }
    let typical = support::typical_albedo(&layers).unwrap_or(0.0);
    let threshold = support::share(support::flatness(&layers, typical)) * typical;
    let mut maps = match <[Maps; 2]>::try_from(layers) {
        Ok(both) => layers::merge(&both, layers::least_columns(both[0].nx)),
        Err(mut one) => one.swap_remove(0),
    };
    maps.mask = support::smoothed(&maps, typical).iter().map(|a| *a > threshold && typical > 0.0).collect();
    maps.mask.iter_mut().zip(&maps.depth).for_each(|(m, z)| *m &= z.is_finite());
    let white = Maps::white(&maps.albedo);
    maps.mask_fraction =
        Some(if white > 0.0 { f64::from(threshold / white).clamp(0.0, 0.99) } else { Maps::MASK_FRACTION });
    if let Some(Layer { albedo, mask, .. }) = &mut maps.behind {
        *mask = albedo.iter().map(|a| *a > threshold).collect();
    }
    maps
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
