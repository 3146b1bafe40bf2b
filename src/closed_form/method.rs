//! What a closed-form method is to the rest of the engine: a volume in one step, without iterations.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use super::image::AlbedoVolume;
use super::options::ImageOptions;
use super::sharpness::Ladder;
use crate::capture::Capture;
use crate::closed_form::image;
use crate::engine::{
    Accumulation, Common, Doing, Plan, Prepared, Problem, Progress, Reconstruction, RunsOn, Sharpness,
    Solver, TimedSchedule, TracePoint, VolumeMap, Watch,
};
use crate::gpu::{Abilities, Gpu};
use crate::maps::Maps;
use crate::options::Options;
use crate::transport::Grid;
use crate::{Error, Kind, Result};

/// A closed-form method, as its options.
pub trait ClosedForm: Options + Clone + Send + Sync + 'static {
    /// Its name on the command line.
    const NAME: &'static str;

    /// Its share of [`image::level_over_haze`], fitted on simulated scenes (benches/NOTES.md).
    const MASK_SHARE: f64;

    /// What makes its volumes.
    type By: Imager<Self>;

    /// Lateral pixels of the maps, and what the options of all closed-form methods have.
    fn shared(&self) -> (usize, &ImageOptions);

    /// The latter.
    fn image(&self) -> &ImageOptions {
        self.shared().1
    }

    /// As [`Solver::detail`].
    fn finest_detail(&self) -> Option<f64> {
        None
    }

    /// The candidates of the sharpness and its setting, if the method has one.
    fn sharpness(&mut self) -> Option<(Ladder, &mut Option<f64>)> {
        None
    }

    /// The candidates, if the options leave the sharpness open.
    fn ladder(&self) -> Option<Ladder> {
        self.clone().sharpness().filter(|(_, set)| set.is_none()).map(|(ladder, _)| ladder)
    }

    /// The options with a sharpness.
    fn with_sharpness(&self, value: f64) -> Self {
        let mut options = self.clone();
        options.sharpness().into_iter().for_each(|(_, setting)| *setting = Some(value));
        options
    }
}

/// Makes the volumes of captures of one scan.
pub trait Imager<M>: Send + Sized {
    /// Where it works.
    const RUNS_ON: RunsOn;

    /// Pixels of maps with `lateral` pixels that a voxel is wide.
    fn pixels_per_voxel(lateral: usize) -> usize;

    /// As [`Solver::takes`], and the options.
    fn check(options: &M, capture: Option<&Capture>) -> Result<()>;

    /// As [`Solver::plan`].
    fn plan_for(options: &M, problem: &Problem<'_>, abilities: &Abilities) -> Result<Plan>;

    /// As [`Solver::outline`].
    fn outline(_plan: &Plan) -> Vec<TimedSchedule> {
        vec![]
    }

    /// As [`Solver::prepare`].
    fn new(options: &M, gpu: &Gpu, problem: &Problem<'_>) -> Result<Self>;

    /// As [`Prepared::plan`].
    fn plan(&self) -> &Arc<Plan>;

    /// As [`Prepared::allocate`].
    fn allocate(&mut self) -> Result<()> {
        Ok(())
    }

    /// Makes what the capture needs, before the time begins.
    fn make(&mut self, _capture: &Capture) -> Result<()> {
        Ok(())
    }

    /// The distance of scan points, metres.
    fn step(&self, capture: &Capture) -> f64;

    /// The volume of a capture, and how sharp it is.
    fn volume(&mut self, options: &M, capture: &Capture) -> Result<(AlbedoVolume, Option<Sharpness>)>;

    /// Adds what it alone knows.
    fn conclude(&mut self, done: &mut Reconstruction) -> Result<()>;
}

impl<M: ClosedForm> Solver for M {
    fn common(&self) -> Common {
        let (lateral, image) = self.shared();
        Common {
            lateral,
            iterations: [1, 0],
            reflectance: image.reflectance,
            accumulation: Accumulation::Auto,
            min_depth: image.min_depth,
            pixels_per_voxel: M::By::pixels_per_voxel(lateral),
            runs_on: M::By::RUNS_ON,
        }
    }

    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        M::By::check(self, None)
    }

    fn takes(&self, capture: &Capture) -> Result<()> {
        M::By::check(self, Some(capture))
    }

    fn detail(&self) -> Option<f64> {
        self.finest_detail()
    }

    fn plan(&self, problem: &Problem<'_>, abilities: &Abilities) -> Result<Plan> {
        M::By::plan_for(self, problem, abilities)
    }

    fn outline(&self, plan: &Plan) -> Vec<TimedSchedule> {
        M::By::outline(plan)
    }

    fn prepare(&self, gpu: &Gpu, problem: &Problem<'_>) -> Result<Box<dyn Prepared>> {
        self.check()?;
        let by = M::By::new(self, gpu, problem)?;
        let Problem { grid, with_volume, .. } = *problem;
        Ok(Box::new(OneStep { options: self.clone(), by, grid, with_volume }))
    }
}

/// A method that is prepared for a scan.
struct OneStep<M: ClosedForm> {
    options: M,
    by: M::By,
    grid: Grid,
    with_volume: bool,
}

impl<M: ClosedForm> Prepared for OneStep<M> {
    fn plan(&self) -> &Arc<Plan> {
        self.by.plan()
    }

    fn allocate(&mut self) -> Result<()> {
        self.by.allocate()
    }

    fn solve(&mut self, capture: &Capture, watch: &mut Watch<'_>) -> Result<Reconstruction> {
        let OneStep { options, by, grid, with_volume } = self;
        by.make(capture)?;
        let plan = by.plan().clone();
        let mut point = TracePoint::before(grid, plan.scene.pairs);
        tell(watch, &point, None)?;
        let start = Instant::now();
        let (volume, sharpness) = by.volume(options, capture)?;
        // What noise alone would show is no surface.
        let floor = sharpness.and_then(|chosen| chosen.noise).map_or(0.0, |noise| noise.floor);
        let maps = image::maps(grid, &volume, by.step(capture), |albedo| {
            image::share_of_white(image::level_over_haze(albedo, M::MASK_SHARE)?.max(floor), albedo)
        });
        point.seconds = start.elapsed().as_secs_f64();
        point.iteration = 1;
        tell(watch, &point, Some(maps.clone()))?;
        let mut done = Reconstruction {
            maps,
            volume: with_volume.then_some(VolumeMap { grid: *grid, albedo: volume.albedo }),
            notes: vec![],
            warnings: vec![],
            verdict: None,
            empty_loss: 0.0,
            pairs: (plan.scene.pairs * grid.voxels()) as u64,
            solve_seconds: point.seconds,
            stages: None,
            evidence: None,
            trace: vec![point],
            device_bytes: plan.buffers.iter().map(|b| b.bytes).sum(),
            full: false,
            lateral: grid.n[0],
            volume_iterations: 1,
            has_mask: true,
            is_warm: false,
            filled: 0,
            sharpness,
            kernels: vec![],
            plan,
        };
        by.conclude(&mut done)?;
        Ok(done)
    }
}

/// Reports progress to the watch.
///
/// # Errors
/// It cancels ([`Kind::Cancelled`]).
fn tell(watch: &mut Watch<'_>, point: &TracePoint, maps: Option<Maps>) -> Result<()> {
    let progress = Progress { doing: Doing::Solve, point: *point, iterations: 1, remaining: None, maps };
    match (watch.hear)(&progress) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Error::new(
            Kind::Cancelled,
            "cancelled by the caller before the volume was there",
            "run it again",
        )),
    }
}
