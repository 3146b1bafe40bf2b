//! The solver, prepared for captures of one scan: the volume, the surface, and the search for light from beyond the box.

use std::sync::Arc;
use std::time::Instant;

use super::beyond::{Beyond, Search};
use super::{VectorOptions, albedo_of, make_ready, outline_of, solve_volume, steps, take};
use crate::capture::Capture;
use crate::gpu::{Gpu, Schedule};
use crate::solve::checkpoint::Keeper;
use crate::solve::drive::Watch;
use crate::solve::prepared::Planned;
use crate::solve::result::finish;
use crate::solve::{Beside, OnDevice, Plan, Prepared, Reconstruction, outline, surface};
use crate::transport::{Grid, Rows};
use crate::{Error, Kind, Result};

/// Prepares the solver for captures of one scan. Takes the arguments of [`super::reconstruct`]; the capture's counts may
/// be left out.
///
/// # Errors
/// Options, scan or device do not allow the solve.
pub fn prepare(
    gpu: &Gpu,
    capture: &Capture,
    grid: Grid,
    options: &VectorOptions,
    memory: Option<u64>,
    with_volume: bool,
) -> Result<impl Prepared + use<>> {
    options.check()?;
    let (outline, rows) = outline_of(capture, &grid, options);
    let plan = Plan::new(&outline, grid, capture.resolution(), options, &gpu.abilities(), with_volume)?;
    let search = match options.beyond {
        true => going_on(Search::of(gpu, capture, &grid, options, memory))?,
        false => None,
    };
    let planned = Planned::new(gpu, outline, plan, memory);
    Ok(PreparedVector { planned, rows, search, options: options.clone(), with_volume })
}

struct PreparedVector {
    planned: Planned,
    rows: Rows,
    search: Option<Search>,
    options: VectorOptions,
    with_volume: bool,
}

impl Prepared for PreparedVector {
    fn plan(&self) -> &Arc<Plan> {
        self.planned.plan()
    }

    fn allocate(&mut self) -> Result<()> {
        let PreparedVector { planned, options, .. } = self;
        let OnDevice { plan, executor, .. } = planned.made(make_ready)?;
        let mut reserve = |schedule: &Schedule| executor.reserve(schedule);
        outline::each(plan, &steps(plan, options), 0..options.iterations, &mut reserve)?;
        surface::each(plan, &options.surface, &mut reserve)?;
        if let Some(search) = &mut self.search {
            going_on(search.allocate().map(Some))?;
        }
        Ok(())
    }

    fn solve(&mut self, capture: &Capture, beside: Beside<'_, '_>) -> Result<Reconstruction> {
        let Beside { watch, keep } = beside;
        let begun = Instant::now();
        let beyond = self.light_beyond(capture, watch)?;
        let before = begun.elapsed().as_secs_f64();
        let PreparedVector { planned, rows, options, with_volume, .. } = self;
        let gpu = planned.gpu().clone();
        let job = planned.made(make_ready)?;
        take(capture, options, rows, &mut job.model);
        if let Some(beyond) = &beyond {
            beyond.take_off(&mut job.model);
        }
        job.upload_counts()?;
        let keeper = Keeper::new(keep, job, options)?;
        let mut driven = solve_volume(&gpu, job, options, watch, keeper)?;
        let volume_iterations = driven.trace.last().map_or(0, |p| p.iteration);
        let mut surface_left = false;
        if options.surface.iterations > 0 {
            let refined = surface::refine(&gpu, job, &options.surface, watch, driven)?;
            (driven, surface_left) = (refined.driven, refined.left);
        }
        driven.seconds += before;
        driven.trace.iter_mut().for_each(|p| p.seconds += before);
        Ok(Reconstruction {
            volume_iterations,
            surface_left,
            beyond: beyond.map(|b| b.told),
            ..finish(job, driven, with_volume.then_some(albedo_of))?
        })
    }
}

impl PreparedVector {
    /// The light from beyond the box. If everything was allocated before, the search keeps what it has.
    fn light_beyond(&mut self, capture: &Capture, watch: &mut Watch<'_>) -> Result<Option<Beyond>> {
        let Some(search) = &mut self.search else { return Ok(None) };
        let _span = self.planned.gpu().span("beyond");
        let found = search.find(capture, watch);
        if !self.planned.is_made() {
            search.release();
        }
        going_on(found)
    }
}

/// If the search fails for a reason of its own, the solve goes on without it.
fn going_on<T>(found: Result<Option<T>>) -> Result<Option<T>> {
    match found {
        Err(Error { kind, .. }) if !matches!(kind, Kind::Device | Kind::Cancelled) => Ok(None),
        found => found,
    }
}
