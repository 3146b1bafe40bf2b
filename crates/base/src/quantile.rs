//! Quantiles of values in any order, and maxima between values.

/// The value that this share of `values` is below, which it reorders; 0 without any.
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    let at = ((share * values.len() as f64) as usize).min(values.len().saturating_sub(1));
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(at, f64::total_cmp).1 }
}

/// The place of the maximum of the parabola through three values, the middle one the largest: in steps from the middle.
pub fn peak_between([low, middle, high]: [f64; 3]) -> f64 {
    let bend = low - 2.0 * middle + high;
    if bend < 0.0 { (0.5 * (low - high) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::quantile;

    #[test]
    fn a_share_of_the_values_is_below() {
        let of = |share| quantile(&mut [4.0, 1.0, 3.0, 2.0, 0.0], share);
        assert_eq!([0.0, 0.2, 0.5, 0.9, 1.0].map(of), [0.0, 1.0, 2.0, 4.0, 4.0]);
        assert_eq!(quantile(&mut [], 0.5), 0.0);
    }
}
