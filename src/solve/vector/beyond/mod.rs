//! Light from beyond the box that is reconstructed: a body wider than the scan, a floor, a ceiling. Without a place for
//! it, a solver puts it at the borders of the box, where there is nothing.
//!
//! A coarse volume of a wider box is fitted to a few pairs, and so is one of the box alone. If the wider one predicts
//! other pairs better, what its voxels beyond the box send is rendered for all pairs and taken off the measurement. The
//! solve itself then has nothing to explain but what is inside.
//!
//! A floor sends light without edges in time. Voxels of the box explain a part of it as well as those beyond, and they
//! get it first, because they are nearer. So the light of the voxels beyond is too dim. How many times it is taken off,
//! held-back pairs tell, too: those of which the box alone, fitted to what remains, leaves the least.

use std::sync::Arc;

use rayon::prelude::*;

use super::trial::{Left, PAIRS, Sides, render_volume};
use super::{VectorOptions, make_ready, solve_volume};
use crate::Result;
use crate::capture::{Capture, PulseTaps, Way};
use crate::gpu::{Gpu, Schedule};
use crate::solve::drive::{Doing, Progress, Watch};
use crate::solve::on_device::active_state;
use crate::solve::plan::{MASK_HOST, RAW_HOST};
use crate::solve::result::TakenOff;
use crate::solve::{OnDevice, Plan};
use crate::transport::kernels::buffer;
use crate::transport::twin::{self, Sample, Twin};
use crate::transport::{Grid, Model, Volume};

mod aside;
pub use aside::{Aside, aside};

/// Coarse voxels over the width of the box, and at most on either side of it.
const INSIDE: usize = 16;
const BESIDE: usize = 16;

/// Iterations of a coarse volume, and of all grids before its last together: these are cheap.
const ITERATIONS: usize = 80;
const COARSE_ITERATIONS: usize = 30;

/// Power of the expected brightness in the bounds: shells that meet a wide grid meet so many dim voxels that all bounds
/// are large without it, and steps short.
const BOUND_POWER: f64 = 0.5;

/// Least brightness of an active voxel over that of the brightest one. Floors are spread over many dim voxels.
const KEEP_ABOVE: f64 = 0.02;

/// How many times the light found beyond the box is taken off, in trials: equally spaced.
const STRENGTHS: [f64; 3] = [1.0, 1.25, 1.5];

/// A bin is at most this share of a coarse voxel's width: over the voxel, paths differ by more.
const OF_VOXEL: f64 = 0.4;

/// Paths over a voxel beyond the box differ by a Gaussian with this share of its width as sigma: such voxels are seen at
/// an angle, of 45 degrees or so.
const SPREAD: f64 = 0.4;

/// How far that Gaussian reaches to each side, in sigmas.
const REACH: f64 = 4.0;

/// Light beyond the box, as samples of a coarse model.
pub struct Beyond {
    samples: Vec<Sample>,
    /// The model and the grid that the samples belong to.
    model: Model,
    grid: Grid,
    /// What is told of it.
    pub told: TakenOff,
}

/// The search for light beyond a box, for captures of one scan.
pub struct Search {
    gpu: Gpu,
    options: VectorOptions,
    memory: Option<u64>,
    /// The box, and its lateral extent as coarse voxels.
    inner: Grid,
    alone: Grid,
    wide: Grid,
    /// The scan.
    outline: Capture,
    /// The coarse volumes of the box alone and of the wider one, once they are on the device.
    fits: [Option<Fit>; 2],
}

/// A coarse volume on the device.
struct Fit {
    options: VectorOptions,
    grid: Grid,
    /// The plan of the pairs that are fitted, and that of those that judge.
    plans: [Arc<Plan>; 2],
    job: OnDevice,
}

/// Which coarse volume.
#[derive(Clone, Copy)]
enum Which {
    Alone,
    Wide,
}

impl Search {
    /// The search beyond `inner`; `None` if the scan has too few pairs for it, or paths too short.
    ///
    /// # Errors
    /// No coarse grid fits into the box.
    pub fn of(
        gpu: &Gpu,
        capture: &Capture,
        inner: &Grid,
        options: &VectorOptions,
        memory: Option<u64>,
    ) -> Result<Option<Search>> {
        let Some(wide) = wider(capture, inner).filter(|_| pairs_of(capture) >= 8) else { return Ok(None) };
        Ok(Some(Search {
            gpu: gpu.clone(),
            options: coarse(options),
            memory,
            inner: *inner,
            alone: Grid::new(box_of(inner, [0.0; 2]), INSIDE, wide.pitch.z)?,
            wide,
            outline: capture.outline(),
            fits: [None, None],
        }))
    }

    /// Puts both coarse volumes on the device.
    ///
    /// # Errors
    /// The device fails, or has no memory for them.
    pub fn allocate(&mut self) -> Result<()> {
        let sides = self.sides(&self.outline)?;
        self.made(Which::Alone, &sides)?;
        self.made(Which::Wide, &sides).map(|_| ())
    }

    /// Takes them off the device.
    pub fn release(&mut self) {
        self.fits = [None, None];
    }

    /// Finds the light beyond the box; `None` if nothing is there, or if it explains nothing beyond chance.
    ///
    /// # Errors
    /// The device fails, or the watch cancels.
    pub fn find(&mut self, capture: &Capture, watch: &mut Watch<'_>) -> Result<Option<Beyond>> {
        let Watch { hear, .. } = watch;
        let mut told = |p: &Progress| hear(&Progress { doing: Doing::Trial, ..p.clone() });
        let watch = &mut Watch { hear: &mut told, maps_every: None, maps_at: &[] };
        let sides = self.sides(capture)?;
        let Some(own) = self.fit(Which::Alone, &sides, watch)? else { return Ok(None) };
        let Some(more) = self.fit(Which::Wide, &sides, watch)? else { return Ok(None) };
        if !more.left.is_less(&own.left) {
            return Ok(None);
        }
        let [x0, x1, y0, y1] = self.inner.extent();
        let is_beyond = |s: &Sample| s.point.x < x0 || s.point.x > x1 || s.point.y < y0 || s.point.y > y1;
        let samples: Vec<Sample> = more.samples.into_iter().filter(is_beyond).collect();
        if samples.is_empty() {
            return Ok(None);
        }
        let told = TakenOff { left: more.left.share(), left_without: own.left.share(), strength: 1.0 };
        let mut beyond = Beyond { samples, model: sides.seen.clone(), grid: self.wide, told };
        beyond.told.strength = self.strength(&beyond, &sides, watch)?;
        Ok(Some(beyond))
    }

    /// A few pairs of a capture in wide bins, those to fit and those that judge: in the bins that the wider box reaches, as
    /// every fit is judged by the same bins.
    fn sides(&self, capture: &Capture) -> Result<Sides> {
        let thin = Capture { laser_spot: None, sensor_spot: None, ..capture.subset(pairs_of(capture), 1)? };
        let sum = (OF_VOXEL * self.wide.pitch.x / thin.bin_width).max(1.0) as usize;
        let thin = thin.binned(sum.min(thin.bins))?;
        Ok(Sides::of(&thin, &self.wide, &self.options))
    }

    /// A coarse volume on the device, for the pairs of `sides`.
    fn made(&mut self, which: Which, sides: &Sides) -> Result<&mut Fit> {
        let Search { gpu, options, memory, fits, .. } = self;
        let grid = match which {
            Which::Alone => self.alone,
            Which::Wide => self.wide,
        };
        let place = &mut fits[which as usize];
        if let Some(fit) = place {
            fit.job.put(sides.seen.clone(), fit.plans[0].clone())?;
        } else {
            let options = options.clone().with(|o| o.lateral = grid.n[0]);
            let plans = sides.plans(gpu, grid, &options, true)?;
            // Small scans begin with a coarser grid.
            let before = plans[0].levels.len().saturating_sub(1).max(1);
            let options = options.with(|o| o.domain.coarse_iterations = COARSE_ITERATIONS / before);
            let mut job = OnDevice::new(gpu, sides.seen.clone(), plans[0].clone(), *memory)?;
            make_ready(&mut job)?;
            *place = Some(Fit { options, grid, plans, job });
        }
        Ok(place.as_mut().expect("made above"))
    }

    /// Fits a volume; `None` if nothing is found.
    fn fit(&mut self, which: Which, sides: &Sides, watch: &mut Watch<'_>) -> Result<Option<Fitted>> {
        let gpu = self.gpu.clone();
        let Fit { options, grid, plans: [plan, plan_of_held], job } = self.made(which, sides)?;
        let (grid, level) = (*grid, *plan_of_held.finest());
        let driven = solve_volume(&gpu, job, options, watch, None, None)?;
        let active = driven.trace.last().map_or(0, |p| p.active).min(plan.capacity);
        if active == 0 || driven.level.grid != grid {
            return Ok(None);
        }
        let mut s = Schedule::default();
        s.copy(buffer::RAW, RAW_HOST, plan.capacity as u64 * 16);
        s.copy(buffer::MASK, MASK_HOST, grid.storage() as u64 / 8);
        render_volume(&mut s, plan_of_held, &level);
        let left = sides.judge(job, plan_of_held.clone(), &level, s, 1)?;
        let has_normals = plan.reflectance.has_normals();
        let samples = active_state(&job.executor, &grid).into_iter().map(|(c, [x, y, z, _])| {
            let vector = glam::dvec3(f64::from(x), f64::from(y), f64::from(z));
            let albedo = if has_normals { 1.0 } else { -vector.z };
            Sample { point: grid.position(c.map(|c| c as f64).into()), albedo, normal: vector, length: 1.0 }
        });
        let samples = samples.filter(|s| s.normal.length() > 0.0).collect();
        Ok(Some(Fitted { left, samples }))
    }

    /// How many times the light of `beyond` is to be taken off: as often as lets a volume of the box alone predict the
    /// pairs that judge best.
    fn strength(&mut self, beyond: &Beyond, sides: &Sides, watch: &mut Watch<'_>) -> Result<f64> {
        let light = [&sides.seen, &sides.held].map(|model| beyond.light(model));
        let mut left = [0.0; 3];
        for (left, times) in left.iter_mut().zip(STRENGTHS) {
            let mut less = sides.clone();
            take(&mut less.seen, &light[0], times);
            take(&mut less.held, &light[1], times);
            let Some(fitted) = self.fit(Which::Alone, &less, watch)? else { return Ok(1.0) };
            *left = fitted.left.pairs.iter().map(|p| p[0]).sum();
        }
        Ok(least_of(STRENGTHS, left))
    }
}

/// Pairs of a capture that the search takes.
fn pairs_of(capture: &Capture) -> usize {
    capture.pair_count().min(2 * PAIRS)
}

/// The options of a coarse volume.
fn coarse(options: &VectorOptions) -> VectorOptions {
    options.clone().with(|o| {
        o.iterations = ITERATIONS;
        o.growth_iterations = 1;
        o.bound_power = Some(BOUND_POWER);
        o.domain.coarse_iterations = COARSE_ITERATIONS;
        o.domain.keep_above = KEEP_ABOVE;
        o.domain.room = None;
        o.surface.iterations = 0;
        o.stop = false;
    })
}

/// The lateral extent of `inner` with this many metres beside it along x and y, and its depths.
fn box_of(inner: &Grid, [x, y]: [f64; 2]) -> Volume {
    let ([x0, x1, y0, y1], [z0, z1]) = (inner.extent(), inner.depth_range());
    Volume { min: glam::dvec3(x0 - x, y0 - y, z0), max: glam::dvec3(x1 + x, y1 + y, z1) }
}

/// A coarse square grid around `inner`, as wide as the longest path allows; `None` if that is not beyond it.
fn wider(capture: &Capture, inner: &Grid) -> Option<Grid> {
    let [x0, x1, y0, y1] = inner.extent();
    let width = (x1 - x0).max(y1 - y0);
    let pitch = width / INSIDE as f64;
    let [near, _] = inner.depth_range();
    let aside = (0.25 * capture.t_end().powi(2) - near.max(0.0).powi(2)).max(0.0).sqrt();
    // An even number on both sides together lets grids double.
    let beside = (((aside / pitch) as usize).min(BESIDE) / 4) * 4;
    (beside > 0).then_some(())?;
    let around = [x1 - x0, y1 - y0].map(|own| 0.5 * (width - own) + beside as f64 * pitch);
    Grid::new(box_of(inner, around), INSIDE + 2 * beside, 0.5 * pitch).ok()
}

/// A coarse volume, and what it leaves of pairs that it has not seen.
struct Fitted {
    left: Left,
    samples: Vec<Sample>,
}

/// Where the parabola through three equally spaced points is least, up to a step beyond them; the least point if it has
/// no minimum.
fn least_of(at: [f64; 3], [a, b, c]: [f64; 3]) -> f64 {
    let (step, bend) = (at[1] - at[0], a - 2.0 * b + c);
    if bend > 0.0 {
        return (at[1] + 0.5 * step * (a - c) / bend).clamp(at[0] - step, at[2] + step);
    }
    if a <= c { at[0] } else { at[2] }
}

/// Takes `times` this light, `[pair * bins + bin]`, off the measured values of `model`.
pub(super) fn take(model: &mut Model, light: &[f32], times: f64) {
    model.measured.iter_mut().zip(light).for_each(|(m, l)| *m -= times as f32 * l);
}

impl Beyond {
    /// Takes its light off the measured values of `model`, and returns it: it is the same for other counts with the same
    /// scale.
    pub fn take_off(&self, model: &mut Model) -> Vec<f32> {
        let light: Vec<f32> = self.light(model).into_iter().map(|l| self.told.strength as f32 * l).collect();
        take(model, &light, 1.0);
        light
    }

    /// The light that its samples send to the pairs of `model`, in units of the measured values, `[pair * bins + bin]`.
    fn light(&self, model: &Model) -> Vec<f32> {
        // The light as `model` counts it, with the falloff's reference and the area of the coarse voxels.
        let to = Model { reference: self.model.reference, measured: vec![], rendered: None, ..model.clone() };
        let unit = f64::from(self.model.scene(&self.grid).render_scale) * self.model.counts_per_unit
            / model.counts_per_unit;
        let pulse = model.pulse.clone().unwrap_or_else(PulseTaps::identity);
        let taps = pulse.blurred(SPREAD * self.grid.pitch.x / model.bin_width, REACH);
        let twin = Twin { model: &to, grid: &self.grid };
        let of_pair = |pair| {
            let light = taps.through(&twin::forward_pair(&twin, pair, &self.samples), Way::Spread);
            light.into_iter().map(|l| (unit * l) as f32)
        };
        (0..to.pairs()).into_par_iter().flat_map_iter(of_pair).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_of_a_parabola_is_found() {
        let parabola = |least: f64| STRENGTHS.map(|s| 3.0 + 7.0 * (s - least).powi(2));
        for least in [0.8, 1.0, 1.13, 1.5, 1.7] {
            assert!((least_of(STRENGTHS, parabola(least)) - least).abs() < 1e-12);
        }
        // Not far beyond what was tried, and the best that was tried where there is no minimum.
        assert_eq!(least_of(STRENGTHS, parabola(9.0)), 1.75);
        assert_eq!(least_of(STRENGTHS, parabola(-9.0)), 0.75);
        assert_eq!(least_of(STRENGTHS, [2.0, 3.0, 1.0]), 1.5);
        assert_eq!(least_of(STRENGTHS, [1.0, 1.0, 1.0]), 1.0);
    }

    #[test]
    fn taps_keep_the_light_and_spread_it() {
        let taps = PulseTaps::identity().blurred(2.5, REACH);
        let mut one = vec![0.0; 41];
        one[20] = 3.0;
        let wide = taps.through(&one, Way::Spread);
        let sum: f64 = wide.iter().sum();
        let second: f64 = wide.iter().enumerate().map(|(b, v)| v * (b as f64 - 20.0).powi(2)).sum();
        assert!((sum - 3.0).abs() < 1e-12);
        assert!((second / sum - 6.25).abs() < 0.1, "{}", second / sum);
        // Light at the end of a histogram leaves it.
        let mut last = vec![0.0; 41];
        last[40] = 1.0;
        assert!((taps.through(&last, Way::Spread).iter().sum::<f64>() - 0.58).abs() < 0.02);
    }
}
