//! What a solve's driver works with between iterations.

use crate::Result;
use crate::gpu::{Executor, Schedule, Ticket};
use crate::transport::kernels::TRACE_ROW;

/// What runs work with. It stays from one run to the next, so that later ones allocate nothing for an iteration.
#[derive(Default)]
pub(super) struct Lists {
    /// The iterations that are submitted next.
    pub block: Schedule,
    /// What is due before the iteration after them.
    pub change: Schedule,
    /// Schedules that only show what is ahead.
    pub unused: Schedule,
    /// The rows of the trace that were read last.
    pub rows: Vec<[u32; TRACE_ROW as usize]>,
}

impl Lists {
    /// Submits the block, and empties it.
    pub fn submit(&mut self, executor: &mut Executor) -> Result<Ticket> {
        let submitted = executor.submit(&self.block);
        self.block.clear();
        submitted
    }
}
