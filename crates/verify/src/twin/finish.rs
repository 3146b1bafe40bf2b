use super::shared::close;
use super::{Call, Cells};

/// Closes an iteration: sums the losses and writes the row of the trace.
pub fn finish(call: &Call, b: &mut [Cells]) {
    bind!(b: counts u, loss_partials v2, l1_partials f, trace u);
    close(call, counts, loss_partials, l1_partials, trace);
}
