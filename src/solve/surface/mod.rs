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
//! A solve has three parts ([`PreparedSurface::solve`]): the closed form's layers ([`start`]), rounds of short fits on coarse
//! pixels between which the support follows the evidence ([`support`]), and a fit at the resolution of the maps.

use std::sync::Arc;
use std::time::Instant;

use super::drive::{Driven, Watch};
use super::on_device::OnDevice;
use super::plan::Needs;
use super::prepared::Planned;
use super::result::finish;
use super::{
    Beside, Common, Plan, Prepared, Problem, Reconstruction, RunsOn, Solver, TimedSchedule, VolumeMap,
};
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

pub(crate) use fit::{Fit, Quality};
pub use needs::{OfFit, SMALL_PIXEL, pixels, points_of};
pub use follow::Follow;
pub use options::{Begin, LEAST_FLOOR, SurfaceOptions};
pub use pixels::Pixels;
pub use schedule::{bonds, divide, extract, iteration, points, render, start as start_of};
pub use weights::{Placed, weights};

/// Rounds of the support. Evidence: benches/studies/surface.md, "Support by evidence".
mod rounds {
    /// Lateral pixels of the coarse fit.
    pub const COARSE: usize = 64;
    /// Rounds on coarse pixels, and at the resolution of the maps.
    pub const NUMBER: [usize; 2] = [12, 2];
    /// Iterations of a round.
    pub const ITERATIONS: usize = 10;
    /// The model error is judged after this many rounds.
    pub const JUDGED: usize = 4;
    /// With a larger model error the support does not grow: haze would look like a surface.
    pub const MOST_ERROR: f64 = 0.06;
    /// With a larger share of photon noise, fewer iterations at the resolution of the maps are enough.
    pub const NOISY: f64 = 0.05;
    /// The share of iterations that are enough then.
    pub const OF_NOISY: f64 = 25.0 / 60.0;
    /// A pixel is surface where the smoothed albedo is above this share of the typical one, without noise, and what noise adds.
    pub const MASK: [f32; 2] = [0.3, 0.2];
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
        let Problem { capture, grid, memory, with_volume } = *problem;
        self.check()?;
        self.takes(capture)?;
        let [coarse, fine] = self.most_iterations();
        let scan = capture.outline();
        let scan_problem = Problem { capture: &scan, ..*problem };
        let coarse = (coarse > 0)
            .then(|| {
                let grid = grid.coarser(self.factor());
                Fit::new(gpu, &Problem { grid, ..scan_problem }, self, [0, coarse])
            })
            .transpose()?;
        let fine = Fit::new(gpu, &scan_problem, self, [coarse.as_ref().map_or(0, |_| self.most_iterations()[0]), fine])?;
        let mut made = PreparedSurface {
            coarse,
            fine,
            options: self.clone(),
            grid,
            memory,
            with_volume,
            scan: scan.clone(),
            method: None,
            keeps: false,
        };
        made.first_method(gpu)?;
        Ok(Box::new(made))
    }
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
    /// The capture without its counts.
    scan: Capture,
    /// The closed form, while everything stays allocated.
    method: Option<Box<dyn Prepared>>,
    /// Everything stays allocated.
    keeps: bool,
}

impl PreparedSurface {
    /// The grid of the first fit.
    fn first_grid(&self) -> Grid {
        if self.coarse.is_some() { self.grid.coarser(self.options.factor()) } else { self.grid }
    }

    /// The closed form that initialises the surface, prepared; `None`: a plane does.
    fn first_method(&mut self, gpu: &Gpu) -> Result<Option<Box<dyn Prepared>>> {
        let grid = self.first_grid();
        let method = start::method(&self.options, grid.n[0], &self.scan)?;
        let problem = Problem { memory: self.memory, ..Problem::new(&self.scan, grid) }.and_volume();
        method.map(|m| m.prepare(gpu, &problem)).transpose()
    }

    /// The layers that the fits begin with.
    fn start(&mut self, gpu: &Gpu, capture: &Capture, watch: &mut Watch<'_>) -> Result<Vec<Maps>> {
        let grid = self.first_grid();
        let iterations = self.options.most_iterations().iter().sum();
        // Its buffers are freed before those of the fits are made, unless everything stays.
        let mut own = if self.keeps { None } else { self.first_method(gpu)? };
        match self.method.as_mut().or(own.as_mut()) {
            Some(method) => start::of_method(&mut **method, capture, iterations, watch),
            None => Ok(vec![start::plane(capture, &grid, self.options.background)]),
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

    fn solve(&mut self, capture: &Capture, beside: Beside<'_, '_>) -> Result<Reconstruction> {
        let begun = Instant::now();
        let gpu = self.fine.planned.gpu().clone();
        let watch = beside.watch;
        let layers = self.start(&gpu, capture, watch)?;
        let fits = Fits { options: &self.options, of: self.options.most_iterations().iter().sum() };
        let level = *self.fine.plan().finest();
        let driven = Driven { seconds: begun.elapsed().as_secs_f64(), ..Driven::begun(layers[0].clone(), level) };
        let done = fits.run(self.coarse.as_mut(), &mut self.fine, capture, layers, watch, driven)?;
        if !self.keeps {
            self.coarse.iter_mut().for_each(|fit| fit.planned.release());
        }
        let volume = self.with_volume.then(|| as_volume(&done.driven.maps, &self.grid));
        let job = self.fine.planned.made(|_| Ok(()))?;
        Ok(Reconstruction { volume, volume_iterations: 0, has_mask: true, ..finish(job, done.driven, None)? })
    }
}

/// The fits of a solve.
struct Fits<'o> {
    options: &'o SurfaceOptions,
    /// Iterations in all, at most.
    of: usize,
}

/// What the fits leave.
struct Done {
    driven: Driven,
}

impl Fits<'_> {
    fn run(
        &self,
        coarse: Option<&mut Fit>,
        fine: &mut Fit,
        capture: &Capture,
        mut layers: Vec<Maps>,
        watch: &mut Watch<'_>,
        mut driven: Driven,
    ) -> Result<Done> {
        let mut grows = self.options.grow;
        let begun = layers.clone();
        let mut scales = true;
        if let Some(coarse) = coarse {
            let clock = Instant::now();
            coarse.take(capture)?;
            driven.seconds += clock.elapsed().as_secs_f64();
            (driven, grows) = self.rounds(coarse, rounds::NUMBER[0], &mut layers, &mut scales, watch, driven)?;
            if !grows {
                layers = begun;
                scales = true;
            }
            layers = layers.iter().map(|maps| support::finer(maps, self.options.factor())).collect();
        }
        let clock = Instant::now();
        fine.take(capture)?;
        driven.seconds += clock.elapsed().as_secs_f64();
        // The scale is found again for other pixels.
        scales = true;
        if grows {
            let number = rounds::NUMBER[usize::from(self.options.factor() > 1)];
            (driven, _) = self.rounds(fine, number, &mut layers, &mut scales, watch, driven)?;
        }
        let (next, quality) = fine.run(&mut layers, [crate::dbg_of("FINE", self.options.iterations as f64) as usize, self.of], scales, watch, driven)?;
        driven = next;
        if std::env::var("DBG").is_ok() && let Some(q) = quality { eprintln!("DBG fine phi {:.4} nu {:.4} grows {grows}", q.model_error(), q.noise_share()); }
        driven.maps = concluded(layers, quality);
        Ok(Done { driven })
    }

    /// Rounds of short fits. Returns whether the support may grow.
    fn rounds(
        &self,
        fit: &mut Fit,
        number: usize,
        layers: &mut Vec<Maps>,
        scales: &mut bool,
        watch: &mut Watch<'_>,
        driven: Driven,
    ) -> Result<(Driven, bool)> {
        let range = fit.plan().levels.maps.depth_range().map(|z| z as f32);
        let mut driven = Some(driven);
        let grows = in_rounds(number, range, layers, &mut |layers| {
            let before = driven.take().expect("given back");
            let (next, quality) = fit.run(layers, [rounds::ITERATIONS, self.of], *scales, watch, before)?;
            driven = Some(next);
            *scales = false;
            Ok(quality)
        })?;
        Ok((driven.expect("given back"), grows))
    }
}

/// Rounds of short fits by `fit`, between which the support follows the evidence, until it is stable or `number` are done.
/// Returns whether the support may grow.
pub(crate) fn in_rounds(
    number: usize,
    range: [f32; 2],
    layers: &mut Vec<Maps>,
    fit: &mut dyn FnMut(&mut Vec<Maps>) -> Result<Option<Quality>>,
) -> Result<bool> {
    let mut before: Option<f64> = None;
    for round in 1..=number {
        let quality = fit(layers)?;
        let (Some(quality), Some(typical)) = (quality, support::typical_albedo(layers)) else { break };
        let error = quality.model_error();
        let lit = |layers: &[Maps]| -> Vec<bool> { layers.iter().flat_map(|l| &l.depth).map(|z| z.is_finite()).collect() };
        if std::env::var("DBG").is_ok() { eprintln!("round {round} phi {:.4} nu {:.4} pixels {} t {typical:.3}", error, quality.noise_share(), lit(layers).iter().filter(|l| **l).count()); }
        if round == rounds::JUDGED && number > rounds::JUDGED && error > crate::dbg_of("GATE", rounds::MOST_ERROR) {
            return Ok(false);
        }
        let old = lit(layers);
        for maps in layers.iter_mut() {
            if round < number {
                support::grow(maps, typical, range);
            }
            support::settle(maps, typical);
            support::drop_islands(maps);
        }
        let new = lit(layers);
        let [changed, all] = [old.iter().zip(&new).filter(|(a, b)| a != b).count(), new.iter().filter(|l| **l).count()];
        let stable = changed as f64 <= crate::dbg_of("STABLE", 0.08) * all as f64 && before.is_some_and(|b| error > 0.97 * b);
        if std::env::var("DBG").is_ok() { eprintln!("   changed {changed} of {all}"); }
        before = Some(error);
        if stable { break; }
    }
    Ok(true)
}

/// The maps of fitted layers, with their mask.
fn concluded(layers: Vec<Maps>, quality: Option<Quality>) -> Maps {
    let noise = quality.map_or(0.0, |q| q.noise_share()) as f32;
    let typical = support::typical_albedo(&layers).unwrap_or(0.0);
    let threshold = (crate::dbg_of("MASK0", rounds::MASK[0].into()) as f32 + rounds::MASK[1] * noise) * typical;
    let mut maps = match <[Maps; 2]>::try_from(layers) {
        Ok(both) => {
            let least = layers::LEAST_CELLS * (both[0].nx as f64 / super::plan::AMPLE as f64).powi(2);
            layers::merge(&both, least)
        }
        Err(mut one) => one.swap_remove(0),
    };
    maps.mask = support::smoothed(&maps, typical).iter().map(|a| *a > threshold && typical > 0.0).collect();
    maps.mask.iter_mut().zip(&maps.depth).for_each(|(m, z)| *m &= z.is_finite());
    let white = Maps::white(&maps.albedo);
    maps.mask_fraction = Some(if white > 0.0 { f64::from(threshold / white).clamp(0.0, 0.99) } else { Maps::MASK_FRACTION });
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
