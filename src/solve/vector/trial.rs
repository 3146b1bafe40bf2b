//! Quick solves that tell which of several descriptions of a scene is right: how surfaces reflect, how wide the
//! instrument's pulse is. A surface is fitted to a few pairs. It is judged by other pairs, which it has not seen: a wrong
//! description may fit the noise of the first, but does not predict the others.

use std::sync::Arc;

use super::left::{Left, Unseen};
use super::schedule::extrapolate;
use super::{VectorOptions, due, make_ready, model, solve_volume, steps, stop_below};
use crate::Result;
use crate::capture::{Capture, Pulse};
use crate::gpu::{BufferPlan, Gpu, Place, Schedule};
use crate::maps::Maps;
use crate::solve::drive::{Driven, Steps, Watch, drive};
use crate::solve::over_pairs::{compare, forward, over_parts};
use crate::solve::passes::{FORWARD, RESIDUAL};
use crate::solve::plan::{RESIDUAL_HOST, sum_of};
use crate::solve::surface::Beginning;
use crate::solve::{Level, OnDevice, Plan, surface};
use crate::transport::kernels::{Push, buffer};
use crate::transport::{Grid, Model};

/// Pairs that a trial fits; as many others judge it.
pub const PAIRS: usize = 256;

/// Trials of one capture on one grid.
pub struct Trial {
    gpu: Gpu,
    sides: Sides,
    grid: Grid,
    options: VectorOptions,
    memory: Option<u64>,
    /// A volume of its own, once there is one. It was fitted with the first pulse that was tried.
    own: Option<Own>,
    /// What the last surface rendered for the pairs that judge it.
    last: Option<Unseen>,
}

/// The volume that surfaces begin with.
#[derive(Debug, Clone)]
pub struct Own {
    /// Its maps.
    pub maps: Maps,
    /// The second surfaces in its columns.
    pub behind: Maps,
    /// What it leaves of the pairs that it has not seen.
    pub left: Left,
}

/// What the surface of a trial begins with.
#[derive(Debug, Clone)]
pub enum Start {
    /// A volume of its own. Surfaces of all pulses begin with it.
    Own,
    /// The volume of another trial, with one cosine, as the volume before a Lambertian surface has.
    Of(Box<Own>),
}

impl Trial {
    /// Prepares trials with the reflectance and the iterations of `options`. Half of the capture's pairs are fitted, and
    /// half of them judge, so there must be two at least; a few do not tell a difference from chance.
    pub fn new(
        gpu: &Gpu,
        capture: &Capture,
        grid: Grid,
        options: VectorOptions,
        memory: Option<u64>,
    ) -> Trial {
        let sides = Sides::of(capture, &grid, &options);
        Trial { gpu: gpu.clone(), sides, grid, options, memory, own: None, last: None }
    }

    /// Gives the fits, and what judges them, a high-pass of this length (metres of path) and floor.
    pub fn set_high_pass(&mut self, [length, floor]: [f64; 2]) {
        (self.options.high_pass, self.options.high_pass_floor) = (Some(length), floor);
        let filter = self.options.filter();
        [&mut self.sides.seen, &mut self.sides.held].into_iter().for_each(|side| side.high_pass = filter);
        self.own = None;
    }

    /// Fits its own volume, and tells the mean squares of what it leaves of pairs that it has not seen: of what changes over
    /// more than `length` along time, and of what changes faster ([`crate::transport::HighPass::bands`]).
    ///
    /// # Errors
    /// Those of [`super::reconstruct`], and a pulse without taps.
    pub fn bands(&mut self, length: f64, pulse: Option<&Pulse>, watch: &mut Watch<'_>) -> Result<[f64; 2]> {
        self.sides.spread_by(pulse)?;
        let options = self.options.clone().with(|o| {
            o.surface.blur = 0.0;
            o.cosine_volume = false;
        });
        let [plan, plan_of_held] = self.sides.plans(&self.gpu, self.grid, &options, true)?;
        let mut job = OnDevice::new(&self.gpu, self.sides.seen.clone(), plan, self.memory)?;
        make_ready(&mut job)?;
        let driven = solve_volume(&self.gpu, &mut job, &options, watch, None)?;
        let behind = surface::behind(&mut job, &driven.level)?;
        let unseen = self.sides.judge_volume(&mut job, &plan_of_held, &driven.level)?;
        self.own = Some(Own { maps: driven.maps, behind, left: unseen.left(1) });
        Ok(unseen.bands(length))
    }

    /// Its own volume, once there is one.
    pub fn own(&self) -> Option<&Own> {
        self.own.as_ref()
    }

    /// Fits a surface, with paths spread by `pulse`; `None` if no surface is found.
    ///
    /// # Errors
    /// Those of [`super::reconstruct`], and a pulse without taps.
    pub fn fit(
        &mut self,
        start: Start,
        pulse: Option<&Pulse>,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Left>> {
        self.sides.spread_by(pulse)?;
        let is_own = matches!(start, Start::Own);
        let options = self.options.clone().with(|o| {
            // A pulse shows at rims, which a short volume with one cosine loses, and in residuals that no blur averages.
            // Models are compared as their solves begin (benches/NOTES.md).
            o.cosine_volume = !is_own;
            if is_own {
                o.surface.blur = 0.0;
            }
        });
        let begun = match start {
            Start::Own => self.own.clone(),
            Start::Of(own) => Some(*own),
        };
        let judges_volume = begun.is_none();
        let [plan, plan_of_held] = self.sides.plans(&self.gpu, self.grid, &options, judges_volume)?;
        let last = plan_of_held.levels.pixels.expect("a trial has a surface");
        let mut job = OnDevice::new(&self.gpu, self.sides.seen.clone(), plan.clone(), self.memory)?;
        let (driven, behind) = match begun {
            Some(Own { maps, behind, .. }) => {
                job.executor.run_once(|s| surface::cleared(s, &job.plan))?;
                let level = job.plan.levels.volume.iter().rfind(|l| l.grid.n[0] == maps.nx);
                (Driven::begun(maps, *level.unwrap_or(job.plan.finest())), behind)
            }
            None => {
                make_ready(&mut job)?;
                let driven = solve_volume(&self.gpu, &mut job, &options, watch, None)?;
                let behind = surface::behind(&mut job, &driven.level)?;
                let left = self.sides.judge_volume(&mut job, &plan_of_held, &driven.level)?.left(1);
                job.put(self.sides.seen.clone(), plan)?;
                self.own = Some(Own { maps: driven.maps.clone(), behind: behind.clone(), left });
                (driven, behind)
            }
        };
        let kept = Beginning::Kept(&behind);
        let refined = surface::refine(&self.gpu, &mut job, &options.surface, watch, driven, kept)?;
        self.last = None;
        if refined.pixels == 0 {
            return Ok(None);
        }
        let s = Schedule::of(|s| surface::render(s, &plan_of_held, &last, refined.pixels, &RESIDUAL, None));
        // In the bins of a volume too ([`Trial::fit_volume`]).
        let sum = if self.options.general { 1 } else { sum_of(&self.sides.held, &self.grid) };
        let unseen = self.sides.judge(&mut job, plan_of_held, &last, s)?;
        let left = unseen.left(sum);
        self.last = Some(unseen);
        Ok(Some(left))
    }

    /// Of `pulses` for the light of the last surface, which had sharp paths, the one that leaves the least: its place, and what
    /// it leaves if light may also move along time and change its strength. `None` if no surface was found, or it is dark.
    ///
    /// # Errors
    /// A pulse without taps.
    pub fn spread(&self, pulses: &[Pulse]) -> Result<Option<(usize, Left)>> {
        let taps = pulses.iter().map(|p| p.taps(self.sides.held.bin_width));
        let taps = taps.collect::<Result<Vec<_>>>()?;
        Ok(self.last.as_ref().and_then(|unseen| unseen.spread(&taps)))
    }

    /// Fits a volume and no surface, with paths spread by `pulse`. After each number of `iterations`, which rise, `continues` hears
    /// what the volume leaves (`None` if it is empty, which ends the fit) and says whether to go on. The volume's voxels have
    /// vectors of their own, so its light depends on the angle as the data want it.
    ///
    /// # Errors
    /// Those of [`super::reconstruct`], and a pulse without taps.
    pub fn fit_volume(
        &mut self,
        pulse: Option<&Pulse>,
        iterations: &[usize],
        watch: &mut Watch<'_>,
        continues: &mut dyn FnMut(Option<Left>) -> bool,
    ) -> Result<()> {
        self.sides.spread_by(pulse)?;
        let options = self.options.clone().with(|o| {
            o.iterations = iterations.last().copied().unwrap_or(o.iterations);
            o.surface.iterations = 0;
        });
        let [plan, plan_of_held] = self.sides.plans(&self.gpu, self.grid, &options, true)?;
        let mut job = OnDevice::new(&self.gpu, self.sides.seen.clone(), plan.clone(), self.memory)?;
        make_ready(&mut job)?;
        let level = *plan_of_held.finest();
        let mut before: Option<Driven> = None;
        for until in iterations {
            let steps = match &before {
                None => steps(&plan, &options),
                Some(driven) => {
                    job.put(self.sides.seen.clone(), plan.clone())?;
                    steps_after(&plan, &options, driven)
                }
            };
            let steps = Steps { stop_below: stop_below(&options), ..steps };
            let driven = drive(&self.gpu, &mut job, *until, steps, watch, before.take())?;
            let is_empty = driven.trace.last().is_none_or(|p| p.active == 0);
            let left = if is_empty {
                None
            } else {
                Some(self.sides.judge_volume(&mut job, &plan_of_held, &level)?.left(1))
            };
            if !continues(left) || is_empty {
                break;
            }
            before = Some(driven);
        }
        Ok(())
    }
}

/// The steps that follow those of `driven`.
fn steps_after<'o>(plan: &Plan, options: &'o VectorOptions, driven: &Driven) -> Steps<'o> {
    let from = plan.levels.volume.iter().position(|level| *level == driven.level).unwrap_or(0);
    let done = driven.trace.last().map_or(0, |p| p.iteration);
    let mut reached = from;
    due(&mut Schedule::default(), plan, options, &mut reached, done);
    Steps {
        levels: plan.levels.volume[reached..].to_vec(),
        start: Box::new(move |s, plan| due(s, plan, options, &mut from.clone(), done)),
        due: Box::new(move |s, plan, level, done| {
            let mut at = reached + *level;
            due(s, plan, options, &mut at, done);
            *level = at - reached;
        }),
        ..steps(plan, options)
    }
}

/// Renders the volume of `level` for all pairs of `plan`, and compares.
fn render_volume(s: &mut Schedule, plan: &Plan, level: &Level) {
    extrapolate(s, plan, level, Push::default());
    over_parts(s, plan, level, |s, part| {
        forward(s, plan, level, part, &FORWARD);
        compare(s, plan, level, part, &RESIDUAL, Push::default(), None);
    });
}

/// The pairs of a capture in two halves.
#[derive(Clone)]
struct Sides {
    /// The pairs that are fitted.
    pub seen: Model,
    /// The pairs that judge.
    pub held: Model,
    /// Points to a side of a scan as dense as half of the pairs.
    scan: [usize; 2],
}

impl Sides {
    pub fn of(capture: &Capture, grid: &Grid, options: &VectorOptions) -> Sides {
        let whole = model(capture, grid, options);
        let [seen, held] = [0, 1].map(|side| whole.half(side));
        let scan = capture.resolution().map(|n| ((n as f64 / 2f64.sqrt()) as usize).max(1));
        Sides { seen, held, scan }
    }

    /// Paths spread by `pulse`, or sharp.
    fn spread_by(&mut self, pulse: Option<&Pulse>) -> Result<()> {
        for side in [&mut self.seen, &mut self.held] {
            side.pulse = pulse.map(|p| p.taps(side.bin_width)).transpose()?;
            side.pulse_shape = pulse.cloned();
        }
        Ok(())
    }

    /// The plan of a fit, with room for all that judges it, and that of the pairs that judge.
    ///
    /// # Errors
    /// Those of [`Plan::new`].
    pub fn plans(
        &self,
        gpu: &Gpu,
        grid: Grid,
        options: &VectorOptions,
        with_volume: bool,
    ) -> Result<[Arc<Plan>; 2]> {
        let mut plan = Plan::new(&self.seen, grid, self.scan, options, &gpu.abilities(), with_volume)?;
        let plan_of_held = plan.of_other_pairs(&self.held, options);
        plan.make_room(&plan_of_held);
        let residual = plan.bytes_of(buffer::RESIDUAL);
        plan.buffers.push(BufferPlan::new(RESIDUAL_HOST, residual, Place::Readback));
        Ok([plan, plan_of_held].map(Arc::new))
    }

    /// [`Self::judge`] of the volume at `level`, with all its bins.
    ///
    /// # Errors
    /// The device fails.
    fn judge_volume(&self, job: &mut OnDevice, plan_of_held: &Arc<Plan>, level: &Level) -> Result<Unseen> {
        let same = |of: &&Level| of.grid == level.grid;
        let level = *plan_of_held.levels.volume.iter().find(same).unwrap_or(plan_of_held.finest());
        let s = Schedule::of(|s| render_volume(s, plan_of_held, &level));
        self.judge(job, plan_of_held.clone(), &level, s)
    }

    /// Puts the pairs that judge in the place of those that were fitted, renders and compares by `compared` at `level` of the
    /// pairs' plan.
    ///
    /// # Errors
    /// The device fails.
    fn judge(
        &self,
        job: &mut OnDevice,
        plan_of_held: Arc<Plan>,
        level: &Level,
        mut compared: Schedule,
    ) -> Result<Unseen> {
        job.put(self.held.clone(), plan_of_held)?;
        let cells = job.plan.cells_at(level);
        compared.copy(buffer::RESIDUAL, RESIDUAL_HOST, cells as u64 * 4);
        job.executor.run(&compared)?;
        let residual: Vec<f32> = job.executor.read(RESIDUAL_HOST, ..cells);
        Ok(Unseen::of(job.model_of(level), &residual, &level.grid))
    }
}
