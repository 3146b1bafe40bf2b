use super::{Call, Cells, residual_rows};

/// As [`residual_rows`](residual_rows::residual_rows): the kernel differs in how it divides the work.
pub fn residual_scan(call: &Call, b: &mut [Cells]) {
    residual_rows::residual_rows(call, b);
}
