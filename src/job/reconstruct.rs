//! A solve with figures and snapshots on the way.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

use super::preview::Preview;
use super::sizes;
use super::{Loaded, Request, SolverOptions, advice};
use crate::estimation::{self, Estimates};
use crate::export::report::TraceEntry;
use crate::gpu::Gpu;
use crate::maps::{Maps, Truth};
use crate::measure::{Metrics, metrics};
use crate::solve::{Problem, Progress, Ready, Reconstruction, Watch, conclude};
use crate::transport::Grid;
use crate::{Kind, Result};

/// The result of a solve, and its figures.
pub struct Finished {
    /// The result, with the mask that the request asks for.
    pub result: Reconstruction,
    /// Figures against truth, if there is truth.
    pub metrics: Option<Metrics>,
    /// Brief figures after each measured iteration, including the last.
    pub along: BTreeMap<usize, Metrics>,
    /// The maps after the iterations that the request names.
    pub snapshots: Vec<(usize, Maps)>,
    /// What trials found before the solve. Their time counts as solve time.
    pub found: Estimates,
    /// The solver with its options, for the model that was found.
    pub solver: SolverOptions,
    /// The grid that was solved.
    pub grid: Grid,
    /// How many of the capture's bins were one.
    pub sum: usize,
}

/// Solves as `request` says. `hear` is called with the progress and may
/// cancel. `preview` shows the volume on its way.
///
/// # Errors
/// Those of [`super::SolverOptions::solve`] and of [`metrics`].
pub fn solve(
    request: &Request,
    loaded: &Loaded,
    gpu: &Gpu,
    truth: Option<&Truth>,
    preview: Option<&Preview>,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Finished> {
    let step = request.trace_step();
    let mut failed = None;
    let (mut along, mut snapshots) = (BTreeMap::new(), Vec::new());
    let found = estimation::estimate(&request.ask(), &loaded.capture, gpu, hear)?;
    let (settled, capture) = request.settled(&found, &loaded.capture)?;
    let request = &settled;
    let Ready { capture, grid, sum } = request.ready(capture)?;
    let capture = &*capture;
    let volume = request.solver.common().iterations[0];
    let previews = if preview.is_some() { vec![volume / 4, volume] } else { vec![] };
    let mut measure = |progress: &Progress| {
        let i = progress.point.iteration;
        if let Some(maps) = &progress.maps {
            if request.snapshots.contains(&i) {
                snapshots.push((i, masked(maps, request)));
            }
            if let Some(preview) = preview.filter(|_| previews.contains(&i)) {
                // The solve goes on without a picture.
                let _ = preview.show(maps);
            }
            let due = step > 0 && i.is_multiple_of(step);
            let truth = truth.filter(|_| due);
            let measured = truth.map(|t| metrics(&masked(maps, request), t, request.mask_fraction));
            match measured.transpose() {
                Ok(found) => along.extend(found.map(|m| (i, m.brief()))),
                Err(e) => {
                    failed = Some(e);
                    return ControlFlow::Break(());
                }
            }
        }
        hear(progress)
    };
    let maps_at = [&request.snapshots[..], &previews].concat();
    let mut watch = Watch { hear: &mut measure, maps_every: (step > 0).then_some(step), maps_at: &maps_at };
    let solver = sizes::with_kept(request, gpu, capture);
    let done = solver.solve(gpu, &request.problem(capture, grid), &mut watch);
    let mut result = match failed {
        Some(e) => return Err(e),
        None => done.map_err(|e| advice::advise(e, request, loaded, gpu))?,
    };
    let before = found.seconds;
    result.solve_seconds += before;
    result.trace.iter_mut().for_each(|p| p.seconds += before);
    conclude(capture, request.mask_fraction, &mut result, &mut snapshots);
    let metrics = truth.map(|t| metrics(&result.maps, t, request.mask_fraction)).transpose()?;
    if let (Some(last), Some(metrics)) = (result.trace.last(), &metrics) {
        along.insert(last.iteration, metrics.clone().brief());
    }
    Ok(Finished { result, metrics, along, snapshots, found, solver: settled.solver, grid, sum })
}

/// The maps with the mask that the request asks for, or that the method told.
fn masked(maps: &Maps, request: &Request) -> Maps {
    let mut maps = maps.clone();
    if request.mask_fraction.is_some() || !request.solver.is_closed_form() {
        maps.set_mask(request.mask_fraction);
    }
    maps
}

/// Begins a solve and cancels it. Drivers that compile at the first dispatch do so here, before any time is measured. A
/// job that does not fit fails here, before hours of work.
pub fn warm_up(request: &Request, loaded: &Loaded, gpu: &Gpu) -> Result<()> {
    let Ready { capture, grid, .. } = request.ready(Cow::Borrowed(&loaded.capture))?;
    let mut stop = |_: &Progress| ControlFlow::Break(());
    let mut watch = Watch { hear: &mut stop, maps_every: None, maps_at: &[1] };
    let solver = sizes::with_kept(request, gpu, &capture);
    let problem = Problem { with_volume: false, ..request.problem(&capture, grid) };
    match solver.solve(gpu, &problem, &mut watch) {
        Err(e) if e.kind != Kind::Cancelled => Err(advice::advise(e, request, loaded, gpu)),
        _ => Ok(()),
    }
}

impl Finished {
    /// Gives the result the mask with the best IoU over shares of the brightest albedo, and measures it anew: what a user
    /// without truth cannot do.
    ///
    /// # Errors
    /// Those of [`metrics`].
    pub fn mask_by(&mut self, truth: &Truth) -> Result<()> {
        let Some(best) = self.metrics.as_ref().and_then(|m| m.best_fraction) else { return Ok(()) };
        self.result.maps.set_mask(best);
        let found = metrics(&self.result.maps, truth, best)?;
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
        let residual = |data: f64| (result.empty_loss > 0.0).then(|| (data / result.empty_loss).sqrt());
        let entry = |p: &crate::solve::TracePoint| TraceEntry {
            iteration: p.iteration,
            seconds: p.seconds,
            gpu_seconds: timed.then_some(p.gpu_seconds),
            lateral: p.lateral,
            pairs: p.pairs,
            active: p.active,
            active_ratio: p.active_ratio,
            loss: p.loss,
            data_loss: Some(p.data_loss),
            residual: residual(p.data_loss),
            metrics: self.along.get(&p.iteration).cloned(),
        };
        result.trace.iter().map(entry).collect()
    }
}
