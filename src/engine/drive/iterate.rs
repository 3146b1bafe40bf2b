//! A solver as its driver sees it.

use std::time::Instant;

use crate::engine::plan::{Level, Pass, Plan};
use crate::gpu::Schedule;

/// A solver as its driver sees it. What it adds goes into schedules that live as long as the device's buffers, so an iteration
/// allocates nothing.
pub(crate) trait Iterate {
    /// Its levels in order.
    fn levels(&self) -> &[Level];

    /// Adds what runs before the first iteration.
    fn start(&self, _s: &mut Schedule, _plan: &Plan) {}

    /// Adds iteration i (from 0) at a level.
    fn iteration(&self, s: &mut Schedule, plan: &Plan, level: &Level, i: usize);

    /// Adds what is due after N iterations, before the next one. It may move to the next level.
    fn due(&self, _s: &mut Schedule, _plan: &Plan, _level: &mut usize, _done: usize) {}

    /// Adds what follows the last iteration, after N of the whole solve.
    fn last(&self, _s: &mut Schedule, _plan: &Plan, _done: usize) {}

    /// Adds what leaves the maps of a level in `columns_host`.
    fn extract(&self, s: &mut Schedule, level: &Level);

    /// Whether the result has the maps; else those of the run before stay.
    fn has_maps(&self) -> bool;

    /// Its own passes whose faults may show in the trace.
    fn passes(&self) -> &'static [&'static Pass];

    /// Weight of the trace's L1 column in the loss at a level.
    fn l1_weight(&self, _level: &Level) -> f64 {
        1.0
    }

    /// Iterations of the whole solve, for progress.
    fn of(&self) -> usize;

    /// Whether active voxels become fewer from iteration to iteration.
    fn shrinks(&self) -> bool {
        false
    }

    /// It is to stop at the last level at this time. Blocks are short then.
    fn until(&self) -> Option<Instant> {
        None
    }
}
