use super::{Call, Cells, Real, residual_rows};

/// As [`residual_rows`](residual_rows::residual_rows): the kernel differs in how it divides the work.
pub fn residual_scan<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    residual_rows::residual_rows(call, b);
}
