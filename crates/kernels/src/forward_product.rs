use super::{Call, Cells, Real, forward};

/// As [`forward`](forward::forward) for products of scanned and other points: the kernel differs in how it divides the work.
pub fn forward_product<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    // Not a constant of the module, which renders nothing else.
    let constants = [&[("GEOMETRY", super::light::PRODUCT)], call.constants].concat();
    forward::forward(&Call { constants: &constants, ..call.clone() }, b);
}
