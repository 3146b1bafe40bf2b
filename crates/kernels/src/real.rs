//! The two float types of kernels.

use std::fmt::Debug;
use std::iter::Sum;

/// A float type of kernels: f32 on the host as on a GPU, f64 as reference.
pub trait Real: num_traits::Float + Sum + Debug + Default + Send + Sync + 'static {
    /// Whether this is the type of references: intermediate results that a kernel leaves undefined are marked.
    const IS_REFERENCE: bool;

    /// The nearest number to a constant.
    fn of(value: f64) -> Self;

    /// This number in float64.
    fn wide(self) -> f64;

    /// The nearest number to one of a buffer or block.
    fn from32(value: f32) -> Self;

    /// The largest integer not above a number of [1, 2^22), and the rest; for an odd integer the one before it and 1. Without
    /// conversions, so that loops are vectorised. Any other number gives any integer below 2^22.
    fn split(self) -> (u32, Self);

    /// The larger number; `other` if this is NaN. A plain comparison, so that loops over it are vectorised.
    #[inline(always)]
    fn at_least(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// The smaller number.
    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    /// Words of a buffer as numbers; none for a type of another size.
    fn of_words(words: &mut [u32]) -> &mut [Self];
}

/// 2^23 and 2^52: floats from there upward are integers.
const WHOLE_32: f32 = 8_388_608.0;
const WHOLE_64: f64 = 4_503_599_627_370_496.0;

impl Real for f32 {
    const IS_REFERENCE: bool = false;

    #[inline(always)]
    fn of(value: f64) -> f32 {
        value as f32
    }

    #[inline(always)]
    fn wide(self) -> f64 {
        self.into()
    }

    #[inline(always)]
    fn from32(value: f32) -> f32 {
        value
    }

    #[inline(always)]
    fn split(self) -> (u32, f32) {
        let whole = (self - 0.5) + WHOLE_32;
        (whole.to_bits() & 0x3f_ffff, self - (whole - WHOLE_32))
    }

    fn of_words(words: &mut [u32]) -> &mut [f32] {
        bytemuck::cast_slice_mut(words)
    }
}

impl Real for f64 {
    const IS_REFERENCE: bool = true;

    #[inline(always)]
    fn of(value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }

    #[inline(always)]
    fn from32(value: f32) -> f64 {
        value.into()
    }

    #[inline(always)]
    fn split(self) -> (u32, f64) {
        let whole = (self - 0.5) + WHOLE_64;
        (whole.to_bits() as u32 & 0x3f_ffff, self - (whole - WHOLE_64))
    }

    fn of_words(_: &mut [u32]) -> &mut [f64] {
        &mut []
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_split_at_integers() {
        for i in 4..4000u32 {
            // No integers.
            let exact = f64::from(i) * std::f64::consts::FRAC_1_PI;
            let (low, rest) = (exact as f32).split();
            assert!(
                f64::from(low) + f64::from(rest) == f64::from(exact as f32) && (0.0..=1.0).contains(&rest)
            );
            let (low, rest) = exact.split();
            assert!((f64::from(low) + rest - exact).abs() < 1e-12 && (0.0..=1.0).contains(&rest), "{exact}");
        }
        assert!(f32::NAN.at_least(0.0) == 0.0 && f64::NAN.at_least(1.0) == 1.0);
    }
}
