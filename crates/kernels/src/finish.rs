use super::trace::close;
use super::{Call, Cells, Real};

/// Closes an iteration: sums the losses and writes the row of the trace.
pub fn finish<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: counts u, loss_partials v2, l1_partials f, trace u);
    close(call, counts, loss_partials, l1_partials, trace);
}
