//! Finds out what a run would do, without doing it.

use std::collections::BTreeMap;

use serde::Serialize;

use thirdbounce::advice::{Advice, advice};
use thirdbounce::capture::Summary;
use thirdbounce::engine::{Accumulation, TimedSchedule};
use thirdbounce::gpu::{DeviceInfo, check};
use thirdbounce::job::report::box_of;
use thirdbounce::job::{Loaded, Request, planned};
use thirdbounce::methods::SolverOptions;
use thirdbounce::options::Preset;
use thirdbounce::{Error, Kind, Result, job};

/// A capture, the grid of its reconstruction, and the work and memory it would take.
#[derive(Debug, Clone, Serialize)]
pub struct Inspection {
    /// What the capture holds.
    pub capture: Summary,
    /// What was done to the capture.
    pub notes: Vec<String>,
    /// What looks wrong in the capture.
    pub warnings: Vec<String>,
    /// The preset in force.
    pub preset: Preset,
    /// The solver's options as resolved.
    pub options: SolverOptions,
    /// Voxels along x, y, z.
    pub grid: [usize; 3],
    /// Voxel size in metres.
    pub voxel: [f64; 3],
    /// (xmin, xmax, ymin, ymax, zmin, zmax) in metres.
    #[serde(rename = "box")]
    pub volume: Vec<f64>,
    /// The device that would do the work.
    pub device: DeviceInfo,
    /// The plan; null if the solver cannot take this capture.
    pub plan: Option<PlanSummary>,
    /// Why there is no plan, or why it would not run.
    pub problems: Vec<Advice>,
}

/// What the solver would do on the device, and the memory it would need.
#[derive(Debug, Clone, Serialize)]
pub struct PlanSummary {
    /// Lateral resolutions, coarse to fine.
    pub levels: Vec<usize>,
    /// Pairs used at each level.
    pub level_pairs: Vec<usize>,
    /// Lateral pixels of the surface, if there is one after the volume.
    pub surface: Option<usize>,
    /// How rendered values would be added up.
    pub accumulation: Accumulation,
    /// What the scene does not need, and what leaving it out saves.
    pub left_out: Vec<String>,
    /// Passes with their modules and constants.
    pub variants: Vec<String>,
    /// Bytes of every buffer, by name.
    pub buffers: BTreeMap<String, u64>,
    /// Bytes of all buffers but those that are stored on the host.
    pub total_bytes: u64,
}

/// Finds out what [`job::run`] would do.
///
/// # Errors
/// Options out of range, or a device that is not there. A capture that the solver cannot take is not an
/// error: it is listed among the problems.
pub fn inspect(request: &Request, loaded: &Loaded) -> Result<Inspection> {
    request.settings.check()?;
    let capture = &loaded.capture;
    let job = request.job(capture);
    let planned = planned::to_plan(&job)?;
    let grid = planned.grid()?;
    let mut problems = Vec::new();
    let gpu = request.open()?;
    let mut notes = loaded.notes.clone();
    notes.extend(planned.preset_note());
    notes.extend(planned.summed_note());
    if job.models.len() > 1 {
        notes.push(
            "how surfaces reflect is not known: a run tries models first (name the model to skip this)"
                .into(),
        );
    }
    if planned::finds_pulse(&job) {
        notes.push(
            "the instrument's pulse is not known: a run finds its width first (give the pulse, or none, to skip this)"
                .into(),
        );
    }
    let plan = match planned.solver.plan(&planned.problem()?, &gpu.abilities()) {
        Ok(plan) => Some(plan),
        Err(Error { kind: Kind::Input, what, .. }) => {
            problems.push(what.into());
            None
        }
        Err(e) => return Err(e),
    };
    if let Some(plan) = &plan
        && let Err(e) = check(&plan.buffers, &gpu.memory(), job.settings.memory)
    {
        problems.push(problem(job::advise(e, request, loaded, &gpu)));
    }
    let total: u64 = plan.iter().flat_map(|plan| &plan.buffers).map(|b| b.bytes).sum();
    Ok(Inspection {
        capture: loaded.summary(),
        notes,
        warnings: loaded.warnings.clone(),
        preset: job.preset,
        options: planned.solver,
        grid: grid.n,
        voxel: grid.pitch.to_array(),
        volume: box_of(&grid),
        device: gpu.info.clone(),
        plan: plan.map(|plan| PlanSummary {
            levels: plan.levels.volume.iter().map(|l| l.grid.n[0]).collect(),
            level_pairs: plan.levels.volume.iter().map(|l| l.pairs).collect(),
            surface: plan.levels.pixels.map(|l| l.grid.n[0]),
            accumulation: plan.division.accumulation,
            left_out: plan.left_out.clone(),
            variants: plan.variants(),
            buffers: plan.bytes(),
            total_bytes: total,
        }),
        problems,
    })
}

/// The schedules that [`job::run`] would submit, in order.
///
/// # Errors
/// Options out of range, no device, or a capture that the solver cannot take.
pub fn schedule(request: &Request, loaded: &Loaded) -> Result<Vec<TimedSchedule>> {
    request.settings.check()?;
    let gpu = request.open()?;
    let planned = planned::to_plan(&request.job(&loaded.capture))?;
    let plan = planned.solver.plan_within(&gpu, &planned.problem()?);
    let plan = plan.map_err(|e| job::advise(e, request, loaded, &gpu))?;
    Ok(planned.solver.outline(&plan))
}

/// An error with its advice.
fn problem(error: Error) -> Advice {
    Advice::from(advice![(error.what) ": "]).and(error.hint)
}
