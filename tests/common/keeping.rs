//! Solves that keep their state, for tests of what goes on from one.

use std::ops::ControlFlow;

use thirdbounce::Result;
use thirdbounce::capture::Capture;
use thirdbounce::gpu::Gpu;
use thirdbounce::job::{Request, SolverOptions};
use thirdbounce::solve::{Beside, Checkpoint, Keep, Progress, Reconstruction, Watch};

/// A solve that keeps its state after every so-manieth iteration, or goes on from one.
pub fn solve_keeping(
    gpu: &Gpu,
    solver: &SolverOptions,
    capture: &Capture,
    every: usize,
    from: Option<Checkpoint>,
) -> Result<(Reconstruction, Vec<Checkpoint>)> {
    let mut kept = vec![];
    let mut save = |state| {
        kept.push(state);
        Ok(())
    };
    let mut hear = |_: &Progress| ControlFlow::Continue(());
    let mut watch = Watch { hear: &mut hear, maps_every: None, maps_at: &[] };
    let beside = Beside { watch: &mut watch, keep: Some(Keep { every, save: &mut save, from }) };
    let grid = Request::new(solver.clone(), "").grid(capture)?;
    let done = solver.solve(gpu, capture, grid, None, true, beside)?;
    Ok((done, kept))
}
