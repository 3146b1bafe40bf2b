use super::{Call, Cells};

/// Eighths from zero on, rounded to whole numbers, plus 2^23.
pub fn rounding(_: &Call, b: &mut [Cells]) {
    bind!(b: result f);
    for (i, whole) in result.iter_mut().enumerate().take(64) {
        *whole = f64::from((i as f64 / 8.0 + 8_388_607.5) as f32);
    }
}
