//! Closed-form methods as solvers: prepared for a scan, a capture after the other.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use super::backproject::{Projecting, pixels_per_voxel, to_refine};
use super::method::{By, ClosedForm, HostMethod, Projection};
use super::on_host::OnHost;
use crate::capture::Capture;
use crate::closed_form::{image, upsample};
use crate::engine::{
    Accumulation, Common, Doing, Plan, Prepared, Problem, Progress, Reconstruction, RunsOn, Solver,
    TimedSchedule, TracePoint, VolumeMap, Watch,
};
use crate::gpu::{Abilities, Gpu};
use crate::maps::Maps;
use crate::transport::Grid;
use crate::{Error, Kind, Result};

impl<M: ClosedForm> Solver for M {
    fn common(&self) -> Common {
        let (lateral, image) = self.shared();
        let (pixels_per_voxel, runs_on) = match M::BY {
            By::Host(_) => (1, RunsOn::Host),
            By::Device(_) => (pixels_per_voxel(lateral), RunsOn::Device),
        };
        Common {
            lateral,
            iterations: [1, 0],
            reflectance: image.reflectance,
            accumulation: Accumulation::Auto,
            min_depth: image.min_depth,
            pixels_per_voxel,
            runs_on,
        }
    }

    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        match M::BY {
            By::Host(_) => Ok(()),
            By::Device(_) => upsample::check_sum(self.image(), M::NAME),
        }
    }

    fn takes(&self, capture: &Capture) -> Result<()> {
        match M::BY {
            By::Host(method) => (method.scan)(self, capture).map(|_| ()),
            By::Device(_) => upsample::check_sum(self.image(), M::NAME)
                .and_then(|()| to_refine(capture, self.image()).map(|_| ())),
        }
    }

    fn detail(&self) -> Option<f64> {
        self.finest_detail()
    }

    fn plan(&self, problem: &Problem<'_>, abilities: &Abilities) -> Result<Plan> {
        match M::BY {
            By::Host(method) => OnHost::plan_for(self, &method, problem, abilities),
            By::Device(_) => Projecting::plan_for(self.image(), problem, abilities),
        }
    }

    fn outline(&self, plan: &Plan) -> Vec<TimedSchedule> {
        match M::BY {
            By::Host(_) => vec![],
            By::Device(_) => Projecting::outline(plan),
        }
    }

    fn prepare(&self, gpu: &Gpu, problem: &Problem<'_>) -> Result<Box<dyn Prepared>> {
        self.check()?;
        let by = match M::BY {
            By::Host(method) => Imager::Host(Box::new(OnHost::new(self, &method, gpu, problem)?), method),
            By::Device(method) => Imager::Device(Box::new(Projecting::new(self, gpu, problem)?), method),
        };
        let Problem { grid, with_volume, .. } = *problem;
        Ok(Box::new(OneStep { options: self.clone(), by, grid, with_volume }))
    }
}

/// What makes the volumes of captures of one scan.
enum Imager<M> {
    Host(Box<OnHost>, HostMethod<M>),
    Device(Box<Projecting>, Projection<M>),
}

/// A method that is prepared for a scan.
struct OneStep<M: ClosedForm> {
    options: M,
    by: Imager<M>,
    grid: Grid,
    with_volume: bool,
}

impl<M: ClosedForm> Prepared for OneStep<M> {
    fn plan(&self) -> &Arc<Plan> {
        match &self.by {
            Imager::Host(host, _) => &host.plan,
            Imager::Device(projecting, _) => projecting.plan(),
        }
    }

    fn allocate(&mut self) -> Result<()> {
        match &mut self.by {
            Imager::Host(..) => Ok(()),
            Imager::Device(projecting, _) => projecting.allocate(),
        }
    }

    fn solve(&mut self, capture: &Capture, watch: &mut Watch<'_>) -> Result<Reconstruction> {
        let OneStep { options, by, grid, with_volume } = self;
        // Kernels and buffers are made before the time begins.
        let (plan, step) = match by {
            Imager::Host(host, _) => (host.plan.clone(), host.step()),
            Imager::Device(projecting, _) => {
                projecting.make(capture)?;
                (projecting.plan().clone(), projecting.step(capture))
            }
        };
        let mut point = TracePoint::before(grid, plan.scene.pairs);
        tell(watch, &point, None)?;
        let start = Instant::now();
        let (volume, sharpness) = match by {
            Imager::Host(host, method) => host.volume(options, method, capture)?,
            Imager::Device(projecting, method) => projecting.volume(options, method, capture)?,
        };
        // What noise alone would show is no surface.
        let floor = sharpness.and_then(|chosen| chosen.noise).map_or(0.0, |noise| noise.floor);
        let maps = image::maps(grid, &volume, step, |albedo| {
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
        match &mut self.by {
            Imager::Host(host, _) => done.filled = host.filled(),
            Imager::Device(projecting, _) => projecting.conclude(&mut done)?,
        }
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
        ControlFlow::Break(()) => {
            Err(Error::new(Kind::Cancelled, "cancelled before the volume was complete", "run it again"))
        }
    }
}
