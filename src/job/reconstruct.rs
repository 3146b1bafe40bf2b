//! A solve with figures on the way.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use super::load::Loaded;
use super::preview::Preview;
use super::{Request, advice};
use crate::engine::{Doing, Progress, Reconstruction, TracePoint, Watch};
use crate::export::report::TraceEntry;
use crate::gpu::Gpu;
use crate::judge::Job;
use crate::maps::{Maps, Truth};
use crate::measure::{Metrics, metrics};
use crate::{Kind, Result, solve};

/// The result of a solve, and its figures.
pub struct Finished<'c> {
    /// The result, with the mask of the settings.
    pub result: Reconstruction,
    /// Figures against truth, if there is truth.
    pub metrics: Option<Metrics>,
    /// Brief figures after each measured iteration, including the last.
    pub along: BTreeMap<usize, Metrics>,
    /// What was solved.
    pub job: Job<'c>,
}

/// Measures maps at a mask fraction.
pub type Measure<'m> = &'m dyn Fn(&Maps, Option<f64>) -> Result<Metrics>;

/// Iterates that were measured. They are there after an error, too.
#[derive(Default)]
pub struct Iterates {
    /// The solve is cancelled at its first measured iterate after this many seconds, which is then the result.
    pub limit: Option<f64>,
    /// Whether it was.
    pub limited: bool,
    /// Seconds until the start of a surface, and its brief metrics; `None` for methods without one.
    pub first: Option<(f64, Metrics)>,
    /// Seconds and brief metrics by iteration.
    pub along: BTreeMap<usize, (f64, Metrics)>,
    /// The last maps, if there is a limit.
    pub last: Option<Maps>,
}

/// Solves as `request` says. `hear` is called with the progress and may
/// cancel. `preview` shows the volume on its way.
///
/// # Errors
/// Those of [`crate::engine::Solver::solve`] and of [`metrics()`].
pub fn solve<'c>(
    request: &Request,
    (job, loaded): (Job<'c>, &Loaded),
    gpu: &Gpu,
    truth: Option<&Truth>,
    preview: Option<&Preview>,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Finished<'c>> {
    let by_truth = truth.map(|truth| move |maps: &Maps, fraction| metrics(maps, truth, fraction));
    let measure = by_truth.as_ref().map(|measure| measure as Measure<'_>);
    solve_measured(request, (job, loaded), gpu, measure, preview, &mut Iterates::default(), hear)
}

/// [`solve()`] with what was measured on the way.
///
/// # Errors
/// Those of [`solve()`].
pub fn solve_measured<'c>(
    request: &Request,
    (job, loaded): (Job<'c>, &Loaded),
    gpu: &Gpu,
    metrics_of: Option<Measure<'_>>,
    preview: Option<&Preview>,
    iterates: &mut Iterates,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Finished<'c>> {
    let step = request.trace_step();
    let mut failed = None;
    let advised = |e| advice::advise(e, request, loaded, gpu);
    let fraction = job.mask_fraction();
    let volume = job.solver.common().iterations[0];
    let previews = if preview.is_some() { vec![volume / 4, volume] } else { vec![] };
    let mut measure = |progress: &Progress| {
        let TracePoint { iteration: i, seconds, .. } = progress.point;
        let Some(maps) = &progress.maps else { return hear(progress) };
        let is_first = progress.doing == Doing::Preview;
        if let Some(preview) = preview.filter(|_| is_first || previews.contains(&i)) {
            // Preview failures are non-fatal.
            let _ = preview.show(maps);
        }
        let due = step > 0 && i.is_multiple_of(step);
        if let Some(metrics_of) = metrics_of.filter(|_| is_first || due) {
            match metrics_of(maps, fraction) {
                Ok(found) if is_first => iterates.first = Some((seconds, found.brief())),
                Ok(found) => drop(iterates.along.insert(i, (seconds, found.brief()))),
                Err(e) => {
                    failed = Some(e);
                    return ControlFlow::Break(());
                }
            }
            if let Some(limit) = iterates.limit.filter(|_| !is_first) {
                iterates.last = Some(maps.clone());
                iterates.limited = seconds >= limit;
            }
        }
        match () {
            () if iterates.limited => ControlFlow::Break(()),
            // Without a preview, callers get no progress before the trials.
            () if is_first && preview.is_none() => ControlFlow::Continue(()),
            () => hear(progress),
        }
    };
    let mut watch = Watch { hear: &mut measure, maps_every: (step > 0).then_some(step), maps_at: &previews };
    let mut job = Job { warnings: loaded.warnings.clone(), faults: loaded.faults.clone(), ..job };
    if request.volume_file.is_some() {
        job.settings.keep_volume = Some(true);
    }
    let done = solve::solve(gpu, job, &mut watch);
    let (job, result) = match failed {
        Some(e) => return Err(e),
        None => done.map_err(advised)?,
    };
    let metrics = metrics_of.map(|of| of(&result.maps, fraction)).transpose()?;
    let mut along: BTreeMap<usize, Metrics> =
        iterates.along.iter().map(|(i, (_, metrics))| (*i, metrics.clone())).collect();
    if let (Some(last), Some(metrics)) = (result.trace.last(), &metrics) {
        along.insert(last.iteration, metrics.clone().brief());
    }
    Ok(Finished { result, metrics, along, job })
}

/// Begins a solve and cancels it. Drivers that compile at the first dispatch do so here, before any time is measured. A
/// job that does not fit fails here, before hours of work.
pub fn warm_up(request: &Request, loaded: &Loaded, gpu: &Gpu) -> Result<()> {
    let job = request.job(&loaded.capture).summed()?;
    let mut stop = |_: &Progress| ControlFlow::Break(());
    let mut watch = Watch { hear: &mut stop, maps_every: None, maps_at: &[1] };
    match job.solver.solve(gpu, &job.problem()?, &mut watch) {
        Err(e) if e.kind != Kind::Cancelled => Err(advice::advise(e, request, loaded, gpu)),
        _ => Ok(()),
    }
}

impl Finished<'_> {
    /// Gives the result the mask with the best IoU over shares of the brightest albedo, and measures it anew: what a user
    /// without truth cannot do.
    ///
    /// # Errors
    /// Those of `metrics_of`.
    pub fn mask_by(&mut self, metrics_of: Measure<'_>) -> Result<()> {
        let Some(best) = self.metrics.as_ref().and_then(|m| m.best_fraction) else { return Ok(()) };
        self.result.maps.set_mask(best);
        let found = metrics_of(&self.result.maps, Some(best))?;
        if let Some(last) = self.result.trace.last() {
            self.along.insert(last.iteration, found.clone().brief());
        }
        self.metrics = Some(found);
        Ok(())
    }

    /// The trace in the form of the report.
    pub fn trace(&self) -> Vec<TraceEntry> {
        let result = &self.result;
        let timed = result.trace.iter().any(|p| p.gpu_seconds > 0.0);
        let entry = |p: &crate::engine::TracePoint| TraceEntry {
            iteration: p.iteration,
            seconds: p.seconds,
            gpu_seconds: timed.then_some(p.gpu_seconds),
            lateral: p.lateral,
            pairs: p.pairs,
            active: p.active,
            active_ratio: p.active_ratio,
            loss: p.loss,
            data_loss: Some(p.data_loss),
            residual: result.residual(p.data_loss),
            metrics: self.along.get(&p.iteration).cloned(),
        };
        result.trace.iter().map(entry).collect()
    }
}
