//! The normal distribution.

/// The share of a normal variable that is below this many standard deviations.
pub fn share_below(deviations: f64) -> f64 {
    0.5 * libm::erfc(-deviations * std::f64::consts::FRAC_1_SQRT_2)
}

/// Its density there.
pub fn density(deviations: f64) -> f64 {
    (-0.5 * deviations * deviations).exp() * 0.398_942_280_401_432_7
}
