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
use follow::Last;
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
    let mut made = PreparedSurface {
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
    fn first_method(&mut self, gpu: &Gpu) -> Result<Option<Start>> {
        let problem = Problem { memory: self.memory, ..Problem::new(&self.first_scan, self.first_grid) };
        Start::new(gpu, &problem, &self.options)
    }

    /// The layers that the fits begin with.
    fn start(&mut self, gpu: &Gpu, capture: &Capture, watch: &mut Watch<'_>) -> Result<Vec<Maps>> {
        let iterations = self.options.most_iterations().iter().sum();
        // Its buffers are freed before those of the fits are made, unless everything stays.
        let mut own = if self.keeps { None } else { self.first_method(gpu)? };
        match self.method.as_mut().or(own.as_mut()) {
            Some(method) => method.layers(capture, iterations, watch),
            None => Ok(vec![start::plane(capture, &self.first_grid, self.options.background)]),
        }
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
        let gpu = self.fine.planned.gpu().clone();
        // After an error or a stop the next frame begins cold.
        let last = self.last.take();
        let wide = if self.sum > 1 { Cow::Owned(capture.binned(self.sum)?) } else { Cow::Borrowed(capture) };
        let closed = self.start(&gpu, &wide, watch)?;
        let until = self.follow.and_then(|follow| follow.fits_until(begun));
        let seconds = begun.elapsed().as_secs_f64();
        let level = *self.fine.plan().finest();
        let start = |closed: &[Maps]| Driven { seconds, ..Driven::begun(closed[0].clone(), level) };
        let blends = self.blends;
        let mut fits =
            Fits { options: &self.options, of: self.options.most_iterations().iter().sum(), blends, until };
        let warm = match (self.follow, last) {
            (Some(follow), Some(last)) => {
                fits.of = follow.wanted(&self.options);
                let driven = taken(&mut self.fine, capture, start(&closed))?;
                let explained = self.fine.explains(&last.layers)?;
                if explained > (1.0 - follow.cut_above) * last.explained {
                    Some(fits.warm(&mut self.fine, &closed, &last, watch, driven)?)
                } else {
                    None
                }
            }
            _ => None,
        };
        let is_warm = warm.is_some();
        let done = match warm {
            Some(done) => done,
            None => {
                fits.of = self.options.most_iterations().iter().sum();
                let driven = start(&closed);
                fits.cold(self.coarse.as_mut(), &mut self.fine, [&wide, capture], closed, watch, driven)?
            }
        };
        if !self.keeps {
            self.coarse.iter_mut().for_each(|fit| fit.planned.release());
        }
        let volume = self.with_volume.then(|| as_volume(&done.driven.maps, &self.grid));
        self.last = self.follow.map(|_| Last { layers: done.layers, explained: done.explained });
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
    /// The fitted layers.
    layers: Vec<Maps>,
    /// Share of the light that they explain.
    explained: f64,
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
                (driven, grows) = self.rounds(coarse, rounds::NUMBER[0], &mut layers, watch, driven)?;
            }
            if !grows {
                layers = closed.clone();
            }
            layers = layers.iter().map(|maps| support::finer(maps, factor)).collect();
        }
        driven = taken(fine, capture, driven)?;
        if grows && !self.is_late() {
            let number = rounds::NUMBER[usize::from(factor > 1)];
            (driven, grows) = self.rounds(fine, number, &mut layers, watch, driven)?;
            if !grows {
                layers = closed.clone();
            }
        }
        let run = self.run(self.options.iterations, 0);
        let (mut driven, quality) = fine.run(&mut layers, run, watch, driven)?;
        let mut shown = layers.clone();
        if !grows && self.options.grow && self.blends {
            for (fitted, first) in shown.iter_mut().zip(&closed) {
                support::blend(fitted, &first.finer(fitted.nx / first.nx));
            }
        }
        driven.maps = concluded(shown, quality);
        Ok(Done { driven, layers, explained: quality.map_or(0.0, |q| q.explained()) })
    }

    /// Fits from the surface of the frame before, with what is new in the closed form.
    fn warm(
        &self,
        fine: &mut Fit,
        closed: &[Maps],
        last: &Last,
        watch: &mut Watch<'_>,
        driven: Driven,
    ) -> Result<Done> {
        let mut layers = follow::merged(&last.layers, closed);
        let run = self.run(self.of, self.options.iterations - self.of);
        let (mut driven, quality) = fine.run(&mut layers, run, watch, driven)?;
        driven.maps = concluded(layers.clone(), quality);
        // The support that the next frame begins with follows as in a round, where the fit was long enough to tell.
        if let Some(typical) = support::typical_albedo(&layers).filter(|_| !self.is_late()) {
            let range = fine.plan().levels.maps.depth_range().map(|z| z as f32);
            let share = support::share(support::flatness(&layers, typical));
            for maps in &mut layers {
                support::grow(maps, typical, range);
                support::settle(maps, typical, share);
                support::drop_islands(maps);
            }
        }
        Ok(Done { driven, layers, explained: quality.map_or(0.0, |q| q.explained()) })
    }

    /// A fit of `iterations` iterations, skipping the start of its schedule.
    fn run(&self, iterations: usize, skipped: usize) -> Run {
        Run { iterations, skipped, of: self.of, scales: true, until: self.until }
    }

    /// Whether the time for fits is over. Then only the last one is left, and that is short.
    fn is_late(&self) -> bool {
        self.until.is_some_and(|until| Instant::now() >= until)
    }

    /// Rounds of short fits, until the time for fits is over. Returns whether the support may grow.
    fn rounds(
        &self,
        fit: &mut Fit,
        number: usize,
        layers: &mut Vec<Maps>,
        watch: &mut Watch<'_>,
        driven: Driven,
    ) -> Result<(Driven, bool)> {
        let range = fit.plan().levels.maps.depth_range().map(|z| z as f32);
        let (mut driven, mut scales) = (Some(driven), true);
        let grows = in_rounds(number, range, layers, &mut |layers| {
            // The first round was in time.
            if self.is_late() && !scales {
                return Ok(None);
            }
            let before = driven.take().expect("given back");
            let scales = std::mem::take(&mut scales);
            let run = Run { scales, ..self.run(rounds::ITERATIONS, 0) };
            let (next, quality) = fit.run(layers, run, watch, before)?;
            driven = Some(next);
            Ok(quality)
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

/// Rounds of short fits by `fit`, between which the support follows the evidence, until it is stable or `number` are done.
/// Returns whether the support may grow.
pub(crate) fn in_rounds(
    number: usize,
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
        let flatness = support::flatness(layers, typical);
        let old = lit(layers);
        for maps in layers.iter_mut() {
            if round < number {
                support::grow(maps, typical, range);
            }
            support::settle(maps, typical, support::share(flatness));
            support::drop_islands(maps);
        }
        let new = lit(layers);
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
