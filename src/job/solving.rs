//! A solve that is measured on its way.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use super::{Loaded, Request};
use crate::export::report::TraceEntry;
use crate::gpu::Gpu;
use crate::maps::{Maps, Truth};
use crate::measure::{Metrics, metrics};
use crate::solve::{Progress, Reconstruction, Watch};
use crate::transport::Grid;
use crate::{Kind, Result};

/// What a solve yields, and its figures.
pub struct Solved {
    /// With the mask that the request asks for.
    pub solved: Reconstruction,
    /// Against truth, if there is one.
    pub metrics: Option<Metrics>,
    /// In brief after those iterations that were measured, the last one among them.
    pub along: BTreeMap<usize, Metrics>,
    /// The maps after the iterations that the request names.
    pub snapshots: Vec<(usize, Maps)>,
}

/// Solves as `request` says; `hear` is told of the progress and may break off.
///
/// # Errors
/// Those of [`super::SolverOptions::solve`] and of [`metrics`].
pub fn solve(
    request: &Request,
    loaded: &Loaded,
    gpu: &Gpu,
    grid: Grid,
    truth: Option<&Truth>,
    hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Solved> {
    let step = request.trace_step();
    let (mut along, mut snapshots, mut failed) = (BTreeMap::new(), Vec::new(), None);
    let mut measure = |progress: &Progress| {
        let i = progress.point.iteration;
        if let Some(maps) = &progress.maps {
            if request.snapshots.contains(&i) {
                let mut maps = maps.clone();
                maps.set_mask(request.mask_fraction);
                snapshots.push((i, maps));
            }
            let due = step > 0 && i.is_multiple_of(step);
            match truth.filter(|_| due).map(|t| metrics(maps, t, request.mask_fraction)).transpose() {
                Ok(found) => along.extend(found.map(|m| (i, m.brief()))),
                Err(e) => {
                    failed = Some(e);
                    return ControlFlow::Break(());
                }
            }
        }
        hear(progress)
    };
    let mut watch =
        Watch { hear: &mut measure, maps_every: (step > 0).then_some(step), maps_at: &request.snapshots };
    let with_volume = request.volume_file.is_some();
    let done = request.solver.solve(gpu, &loaded.capture, grid, request.memory, with_volume, &mut watch);
    let mut solved = match failed {
        Some(e) => return Err(e),
        None => done?,
    };
    solved.maps.set_mask(request.mask_fraction);
    let metrics = truth.map(|t| metrics(&solved.maps, t, request.mask_fraction)).transpose()?;
    if let (Some(last), Some(metrics)) = (solved.trace.last(), &metrics) {
        along.insert(last.iteration, metrics.clone().brief());
    }
    Ok(Solved { solved, metrics, along, snapshots })
}

/// Begins a solve and breaks off, so that drivers that compile at the first dispatch have done so before any
/// time is taken, and what does not fit is found out before hours of work.
pub fn warm_up(request: &Request, loaded: &Loaded, gpu: &Gpu, grid: Grid) -> Result<()> {
    let mut stop = |_: &Progress| ControlFlow::Break(());
    let mut watch = Watch { hear: &mut stop, maps_every: None, maps_at: &[1] };
    match request.solver.solve(gpu, &loaded.capture, grid, request.memory, false, &mut watch) {
        Err(e) if e.kind != Kind::Cancelled => Err(e),
        _ => Ok(()),
    }
}

impl Solved {
    /// The trace as the report has it.
    pub fn trace(&self) -> Vec<TraceEntry> {
        let solved = &self.solved;
        let timed = solved.trace.iter().any(|p| p.gpu_seconds > 0.0);
        let residual = |data: f64| (solved.empty_loss > 0.0).then(|| (data / solved.empty_loss).sqrt());
        let entry = |p: &crate::solve::TracePoint| TraceEntry {
            iteration: p.iteration,
            seconds: p.seconds,
            gpu_seconds: timed.then_some(p.gpu_seconds),
            lateral: p.lateral,
            active: p.active,
            active_ratio: p.active_ratio,
            loss: p.loss,
            data_loss: Some(p.data_loss),
            residual: residual(p.data_loss),
            metrics: self.along.get(&p.iteration).cloned(),
        };
        solved.trace.iter().map(entry).collect()
    }
}
