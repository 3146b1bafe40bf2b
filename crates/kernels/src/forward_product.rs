use super::{Call, Cells, Real, forward};

/// As [`forward`](forward::forward): the kernel differs in how it divides the work.
pub fn forward_product<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    forward::forward(call, b);
}
