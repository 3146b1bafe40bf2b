use super::{Call, Cells, Real};

/// Eighths from zero on, rounded to whole numbers, plus 2^23.
pub fn rounding<F: Real>(_: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: result f);
    for (i, whole) in result.iter_mut().enumerate().take(64) {
        *whole = F::from32((i as f64 / 8.0 + 8_388_607.5) as f32);
    }
}
