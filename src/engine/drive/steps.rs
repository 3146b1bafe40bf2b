//! A solver as its driver sees it.

use std::time::Instant;

use crate::engine::plan::{Level, Pass, Plan};
use crate::gpu::Schedule;

/// Adds what runs before the first iteration.
type Start<'s> = Box<dyn Fn(&mut Schedule, &Plan) + 's>;

/// Adds iteration i (from 0) at a level.
type Iteration<'s> = Box<dyn Fn(&mut Schedule, &Plan, &Level, usize) + 's>;

/// Adds what is due after N iterations, before the next one. It may move to the next level.
type Due<'s> = Box<dyn Fn(&mut Schedule, &Plan, &mut usize, usize) + 's>;

/// Adds what leaves the maps of a level in `columns_host`.
type Extract<'s> = Box<dyn Fn(&mut Schedule, &Level) + 's>;

/// Adds what follows the last iteration, after N of the whole solve.
type Last<'s> = Box<dyn Fn(&mut Schedule, &Plan, usize) + 's>;

/// A solver as its driver sees it. What it adds goes into schedules that live as long as the device's buffers, so an
/// iteration allocates nothing.
pub(crate) struct Steps<'s> {
    /// Its levels in order.
    pub levels: Vec<Level>,
    /// Runs before the first iteration.
    pub start: Start<'s>,
    /// Iteration i (from 0) at a level.
    pub iteration: Iteration<'s>,
    /// What is due after N iterations, before the next one. It may move to the next level.
    pub due: Due<'s>,
    /// Follows the last iteration, after N of the whole solve.
    pub last: Last<'s>,
    /// Leaves the level's maps in `columns_host`.
    pub extract: Extract<'s>,
    /// The result has the maps; else those of the run before stay.
    pub has_maps: bool,
    /// Passes whose faults may show in the trace.
    pub passes: [&'static [&'static Pass]; 2],
    /// Weight of the trace's L1 column in the loss at a level.
    pub l1_weight: Box<dyn Fn(&Level) -> f64 + 's>,
    /// Iterations of the whole solve, for progress.
    pub of: usize,
    /// Whether active voxels become fewer from iteration to iteration.
    pub shrinks: bool,
    /// Stop at the last level at this time. Blocks are short then.
    pub until: Option<Instant>,
}
