//! The surface solver, the default: a closed form, then a surface with data-driven support, fitted by differentiable rendering
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
//! A solve has three parts: the closed form's layers (`start.rs`), rounds of short fits on coarse
//! pixels between which the support follows the evidence (`support.rs`), and a fit at the resolution of the maps.

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

use super::drive::{Driven, Watch};
use super::result::finish;
use super::{Common, Plan, Prepared, Problem, Reconstruction, RunsOn, Solver, TimedSchedule, VolumeMap};
use crate::Result;
use crate::capture::Capture;
use crate::gpu::{Abilities, Gpu};
use crate::maps::{Layer, Maps};
use crate::transport::Grid;

pub(crate) mod fit;
mod follow;
pub mod layers;
pub(crate) mod model;
mod needs;
mod options;
pub mod passes;
mod pixels;
mod schedule;
pub(crate) mod start;
pub(crate) mod support;
mod weights;

pub(crate) use fit::{Fit, Quality, Run};
pub use follow::Follow;
use follow::{Change, Last};
pub use needs::{OfFit, SMALL_PIXEL, pixels, points_of};
pub use options::{Begin, LEAST_FLOOR, SurfaceOptions, SurfaceSettings};
pub use pixels::Pixels;
pub use schedule::{bonds, divide, extract, iteration, points, render, start as start_of};
pub(crate) use start::Start;
pub use weights::{Placed, weights};

/// Rounds of the support. Evidence: benches/NOTES.md, "Support by evidence".
mod rounds {
    /// Lateral pixels of the coarse fit.
    pub const COARSE: usize = 64;
    /// Rounds on coarse pixels, and at the resolution of the maps.
    pub const NUMBER: [usize; 2] = [12, 2];
    /// Iterations of a round.
    pub const ITERATIONS: usize = 10;
    /// The model error is judged after this many rounds, or up to twice as many while a round lowers it to less than a share.
    pub const JUDGED: usize = 4;
    pub const FALLS: f64 = 0.9;
    /// With a larger model error the support stays that of the closed form: haze would look like a surface. Of surfaces that bend
    /// away, and of plates, whose support needs no growth.
    pub const MOST_ERROR: [f64; 2] = [0.06, 0.015];
    /// The support is stable where a round changes at most this share of the pixels, and lowers the model error by less than this.
    pub const STABLE: [f64; 2] = [0.08, 0.03];
    /// What noise alone adds to the share of the typical evidence above which a pixel is surface.
    pub const MASK: f32 = 0.2;
}

impl SurfaceOptions {
    /// Pixels of the maps side by side in a pixel of the coarse fit; 1 without a coarse fit.
    fn factor(&self) -> usize {
        let mut factor = 1;
        while self.lateral.is_multiple_of(2 * factor) && self.lateral / (2 * factor) >= rounds::COARSE {
            factor *= 2;
        }
        factor
    }

    /// Iterations at most: on coarse pixels, and at the resolution of the maps.
    fn most_iterations(&self) -> [usize; 2] {
        let [coarse, fine] = rounds::NUMBER;
        let of = |rounds: usize| if self.grow { rounds * rounds::ITERATIONS } else { 0 };
        match (self.grow, self.factor()) {
            (false, _) => [0, self.iterations],
            (true, 1) => [0, of(coarse) + self.iterations],
            (true, _) => [of(coarse), of(fine) + self.iterations],
        }
    }
}

impl Solver for SurfaceOptions {
    fn common(&self) -> Common {
        Common {
            lateral: self.lateral,
            iterations: [0, self.most_iterations().iter().sum()],
            reflectance: self.reflectance,
            accumulation: self.accumulation,
            sizes: self.sizes,
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
        let (outline, _) = model::outline_of(&capture.outline(), &grid, self);
        let needs = OfFit { options: self, iterations: self.most_iterations() };
        Plan::new(&outline, grid, capture.resolution(), &needs, abilities, false)
    }

    fn within(&self, plan: Plan, gpu: &Gpu, memory: Option<u64>) -> Result<Plan> {
        plan.within(&OfFit { options: self, iterations: self.most_iterations() }, &gpu.memory(), memory)
    }

    fn outline(&self, plan: &Plan) -> Vec<TimedSchedule> {
        fit::outline(plan)
    }

    fn prepare(&self, gpu: &Gpu, problem: &Problem<'_>) -> Result<Box<dyn Prepared>> {
        prepare_for_frames(gpu, problem, self, None)
    }
}

/// Prepares the solver for frames of one scan, which follow each other if `follow` says how.
///
/// # Errors
/// Options, scan or device do not allow the solve.
pub fn prepare_for_frames(
    gpu: &Gpu,
    problem: &Problem<'_>,
    options: &SurfaceOptions,
    follow: Option<Follow>,
) -> Result<Box<dyn Prepared>> {
    let Problem { capture, grid, memory, with_volume } = *problem;
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
    let coarse = match coarse_iterations {
        0 => None,
        most => {
            let coarse = Problem { capture: &first_scan, grid: first_grid, ..problem };
            Some(Fit::new(gpu, &coarse, options, [0, most])?)
        }
    };
    let fine = Fit::new(gpu, &problem, options, [coarse_iterations, iterations])?;
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
    /// Everything stays allocated.
    keeps: bool,
    /// If frames follow each other.
    follow: Option<Follow>,
    /// The frame before.
    last: Option<Last>,
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
            Some(method) => method.layers(capture, iterations, watch)?,
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
    ) -> Result<Done> {
        let (closed, seconds) = self.start(captures[0], watch)?;
        let of = self.options.most_iterations().iter().sum();
        let fits = Fits { options: &self.options, of, blends: self.blends, until };
        let driven = Driven { seconds, ..Driven::begun(closed[0].clone(), *self.fine.plan().finest()) };
        fits.cold(self.coarse.as_mut(), &mut self.fine, captures, closed, watch, driven)
    }

    /// Solves a frame from the surface of the frame before; `None` after a scene cut. The closed form is computed only if the
    /// residual shows a change.
    fn warm(
        &mut self,
        follow: Follow,
        last: Last,
        [wide, capture]: [&Capture; 2],
        until: Option<Instant>,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Done>> {
        let level = *self.fine.plan().finest();
        let mut driven = taken(&mut self.fine, capture, Driven::begun(last.layers[0].clone(), level))?;
        let Some((scale, seen)) = self.fine.seen(&last.layers)? else { return Ok(None) };
        let change = follow.change(&last, seen.left_share());
        if change == Change::Cut {
            return Ok(None);
        }
        let Last { layers, left, mut closed, .. } = last;
        let mut layers = follow::scaled(layers, scale);
        if change == Change::Some {
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
        let [rounds, each] = if change == Change::Some { follow::ROUNDS } else { [0; 2] };
        if rounds > 0 {
            wanted = follow::after_rounds(wanted, self.coarse.is_some());
        }
        let fits = Fits { options: &self.options, of: rounds * each + wanted, blends: self.blends, until };
        let plan = [rounds, each, wanted];
        fits.warm(&mut self.fine, layers, closed, (seen, left), plan, watch, driven).map(Some)
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
        self.last = self.follow.map(|_| done.last);
        let job = self.fine.planned.made(|_| Ok(()))?;
        let solved = finish(job, done.driven, None)?;
        Ok(Reconstruction { volume, volume_iterations: 0, has_mask: true, is_warm, ..solved })
    }
}

/// The fits of a solve.
struct Fits<'o> {
    options: &'o SurfaceOptions,
    /// The closed form is the light-cone transform. A back-projection has too much haze to tell where a surface ends.
    blends: bool,
    /// Iterations in all, at most.
    of: usize,
    /// Fits end at this time.
    until: Option<Instant>,
}

/// What the fits leave.
struct Done {
    driven: Driven,
    /// What the next frame may begin with.
    last: Last,
}

impl Fits<'_> {
    /// Fits from the closed form: rounds on coarse pixels, then at the resolution of the maps.
    fn cold(
        &self,
        coarse: Option<&mut Fit>,
        fine: &mut Fit,
        [wide, capture]: [&Capture; 2],
        closed: Vec<Maps>,
        watch: &mut Watch<'_>,
        mut driven: Driven,
    ) -> Result<Done> {
        let factor = self.options.factor();
        let mut grows = self.options.grow;
        let mut layers = closed.clone();
        if let Some(coarse) = coarse {
            if !self.is_late() {
                driven = taken(coarse, wide, driven)?;
                let rounds = Rounds::of(rounds::NUMBER[0]);
                (driven, grows) = self.rounds(coarse, rounds, &mut None, &mut layers, watch, driven)?;
            }
            if !grows {
                layers = closed.clone();
            }
            layers = layers.iter().map(|maps| support::finer(maps, factor)).collect();
        }
        driven = taken(fine, capture, driven)?;
        if grows && !self.is_late() {
            let number = rounds::NUMBER[usize::from(factor > 1)];
            (driven, grows) = self.rounds(fine, Rounds::of(number), &mut None, &mut layers, watch, driven)?;
            if !grows {
                layers = closed.clone();
            }
        }
        let run = self.run(self.options.iterations, 0);
        let (mut driven, quality) = fine.run(&mut layers, run, watch, driven)?;
        let closed = (!grows).then_some(closed);
        driven.maps = self.shown(&layers, closed.as_deref(), quality);
        let left = quality.map_or(1.0, |q| q.left_share());
        Ok(Done { driven, last: Last { layers, left, closed, is_whole: !self.is_late() } })
    }

    /// The maps of fitted layers. `closed`: the layers of the closed form, if their support is that of the surface.
    fn shown(&self, layers: &[Maps], closed: Option<&[Maps]>, quality: Option<Quality>) -> Maps {
        let mut shown = layers.to_vec();
        if let Some(closed) = closed.filter(|_| self.options.grow && self.blends) {
            for (fitted, first) in shown.iter_mut().zip(closed) {
                support::blend(fitted, &first.finer(fitted.nx / first.nx));
            }
        }
        concluded(shown, quality)
    }

    /// Fits from the previous frame's surface: maximum rounds, iterations per round, and final iterations.
    /// `closed`: as for [`Fits::shown`]. Also takes the quality of the layers, and the reference of the frame before.
    #[allow(clippy::too_many_arguments)] // all of it is one frame
    fn warm(
        &self,
        fine: &mut Fit,
        mut layers: Vec<Maps>,
        closed: Option<Vec<Maps>>,
        (seen, reference): (Quality, f64),
        [rounds, each, iterations]: [usize; 3],
        watch: &mut Watch<'_>,
        mut driven: Driven,
    ) -> Result<Done> {
        let (mut quality, mut is_done) = (Some(seen), false);
        // Steps are short where nothing changes.
        let mut run = self.run(iterations, self.options.iterations - iterations);
        if rounds > 0 && closed.is_some() {
            // The support is fixed.
            run = self.run((rounds * each + iterations).min(self.options.iterations), 0);
        } else if rounds > 0 {
            let rounds = Rounds { number: rounds, iterations: each, rings: self.options.factor().min(2) };
            (driven, _) = self.rounds(fine, rounds, &mut quality, &mut layers, watch, driven)?;
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
        Ok(Done { driven, last: Last { layers, left, closed, is_whole: !self.is_late() } })
    }

    /// A fit of `iterations` iterations, skipping the start of its schedule.
    fn run(&self, iterations: usize, skipped: usize) -> Run {
        Run { iterations, skipped, of: self.of, known: None, until: self.until }
    }

    /// Whether the time for fits is over. Then only the last one is left, and that is short.
    fn is_late(&self) -> bool {
        self.until.is_some_and(|until| Instant::now() >= until)
    }

    /// Rounds of short fits, until the time for fits is over. `quality` is that of `layers`, if the scale of their albedos is that of
    /// the data, and is replaced by that of the last fit. Returns whether the support may grow.
    fn rounds(
        &self,
        fit: &mut Fit,
        rounds: Rounds,
        quality: &mut Option<Quality>,
        layers: &mut Vec<Maps>,
        watch: &mut Watch<'_>,
        driven: Driven,
    ) -> Result<(Driven, bool)> {
        let (mut driven, mut is_first, range) = (Some(driven), true, fit.depth_range());
        let grows = in_rounds(rounds, range, layers, &mut |layers| {
            // The first round was in time.
            if !std::mem::take(&mut is_first) && self.is_late() {
                return Ok(None);
            }
            let before = driven.take().expect("given back");
            let run = Run { known: quality.map(|q| q.left), ..self.run(rounds.iterations, 0) };
            let (next, found) = fit.run(layers, run, watch, before)?;
            (driven, *quality) = (Some(next), found);
            Ok(found)
        })?;
        Ok((driven.expect("given back"), grows))
    }
}

/// Gives a fit the counts of a capture; that is part of the solve.
fn taken(fit: &mut Fit, capture: &Capture, driven: Driven) -> Result<Driven> {
    let clock = Instant::now();
    fit.take(capture)?;
    Ok(Driven { seconds: driven.seconds + clock.elapsed().as_secs_f64(), ..driven })
}

/// Rounds of fits between which the support changes.
#[derive(Clone, Copy)]
pub(crate) struct Rounds {
    /// Most rounds.
    number: usize,
    /// Iterations of each.
    iterations: usize,
    /// Rings of pixels that the support grows by after each.
    rings: usize,
}

impl Rounds {
    /// Rounds of a solve, by their number.
    pub fn of(number: usize) -> Rounds {
        Rounds { number, iterations: rounds::ITERATIONS, rings: 1 }
    }
}

/// Rounds of short fits by `fit`, between which the support follows the evidence, until it is stable or all are done. Returns
/// whether the support may grow.
pub(crate) fn in_rounds(
    Rounds { number, rings, .. }: Rounds,
    range: [f32; 2],
    layers: &mut Vec<Maps>,
    fit: &mut dyn FnMut(&mut Vec<Maps>) -> Result<Option<Quality>>,
) -> Result<bool> {
    let mut before = f64::INFINITY;
    let mut judges = number > rounds::JUDGED;
    let lit = |layers: &[Maps]| -> Vec<bool> {
        layers.iter().flat_map(|l| &l.depth).map(|z| z.is_finite()).collect()
    };
    for round in 1..=number {
        let quality = fit(layers)?;
        let (Some(quality), Some(typical)) = (quality, support::typical_albedo(layers)) else { break };
        let error = quality.model_error();
        let old = lit(layers);
        let fitted = layers.clone();
        let flatness = support::flatness(layers, typical);
        support::follow(layers, [typical, flatness], (round < number).then_some((range, rings)));
        let new = lit(layers);
        if !new.contains(&true) {
            // No pixel has the evidence of a surface: the support stays that of the closed form.
            *layers = fitted;
            return Ok(false);
        }
        let changed = old.iter().zip(&new).filter(|(a, b)| a != b).count() as f64;
        let all = new.iter().filter(|l| **l).count() as f64;
        let stable = changed <= rounds::STABLE[0] * all && error > (1.0 - rounds::STABLE[1]) * before;
        let falls = error < rounds::FALLS * before && round < 2 * rounds::JUDGED;
        if judges && (stable || round >= rounds::JUDGED && !falls) {
            judges = false;
            let [most, most_of_plates] = rounds::MOST_ERROR;
            if error > most + (most_of_plates - most) * f64::from(flatness) {
                return Ok(false);
            }
        }
        if stable {
            break;
        }
        before = error;
    }
    Ok(true)
}

/// The maps of fitted layers, with their mask. Layers without a quality explain no light: nothing stays of them.
fn concluded(mut layers: Vec<Maps>, quality: Option<Quality>) -> Maps {
    if quality.is_none() {
        layers
            .iter_mut()
            .for_each(|maps| (0..maps.depth.len()).for_each(|pixel| support::remove(maps, pixel)));
    }
    let noise = quality.map_or(0.0, |q| q.noise_share()) as f32;
    let typical = support::typical_albedo(&layers).unwrap_or(0.0);
    let threshold = (support::share(support::flatness(&layers, typical)) + rounds::MASK * noise) * typical;
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
