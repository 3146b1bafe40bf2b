//! Counts that are all multiples of one number: of a digitiser that stores 12 bits in 16, or of a program that scaled them.

use crate::data::Capture;

/// Different counts that prove a common factor.
const LEAST_VALUES: usize = 16;

impl Capture {
    /// Divides whole counts by their common factor, so that their noise is that of photons again.
    pub(super) fn undo_multiples(&mut self) -> Option<String> {
        if !self.integer_counts {
            return None;
        }
        let mut factor = 0u64;
        for count in self.histograms.iter().filter(|count| **count > 0.0) {
            factor = gcd(factor, *count as u64);
            if factor == 1 {
                return None;
            }
        }
        let lit = self.histograms.iter().copied().filter(|count| *count > 0.0);
        if factor < 2 || !are_many(lit) {
            return None;
        }
        self.histograms.iter_mut().for_each(|count| *count /= factor as f32);
        Some(format!(
            "all counts are multiples of {factor}, as of numbers of fewer bits in the upper bits of a word or of scaled counts: they are \
             divided by it, as photons have the noise of single counts"
        ))
    }
}

/// Largest multiple of the unit, and how far from a whole one a value may be: the rounding of f32 at that multiple.
const MOST: f32 = 4096.0;
const OFF: f32 = 1e-3;

impl Capture {
    /// Divides values that are all multiples of their smallest one by it: photons that a program scaled, as to a mean or a largest value
    /// of one. Values of a rendering are none.
    pub(super) fn undo_unit(&mut self) -> Option<String> {
        let lit = || self.histograms.iter().copied().filter(|v| *v != 0.0);
        if self.integer_counts || self.noise.is_some() {
            return None;
        }
        let unit = lit().fold(f32::INFINITY, f32::min);
        if !(unit > 0.0 && unit.is_finite()) {
            return None;
        }
        let is_multiple = |v: f32| v / unit <= MOST && (v / unit - (v / unit).round()).abs() <= OFF;
        if !lit().all(is_multiple) {
            return None;
        }
        if !are_many(lit().map(|v| (v / unit).round())) {
            return None;
        }
        self.histograms.iter_mut().for_each(|v| *v = (*v / unit).round());
        self.integer_counts = true;
        Some(format!(
            "all values are multiples of {unit:.4e}, as of scaled photon counts: they are divided by it, as photons have the noise of \
             single counts"
        ))
    }
}

/// Whether there are as many different values as prove a common factor.
fn are_many(values: impl Iterator<Item = f32>) -> bool {
    let mut found = vec![];
    for value in values {
        if !found.contains(&value) {
            found.push(value);
        }
        if found.len() == LEAST_VALUES {
            return true;
        }
    }
    false
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::super::tests::noisy;

    #[test]
    fn multiples_of_a_number_are_divided_by_it() {
        let right = noisy();
        for factor in [2.0, 16.0, 100.0] {
            let mut scaled = right.clone();
            scaled.histograms.iter_mut().for_each(|count| *count *= factor);
            assert!(
                scaled.undo_multiples().is_some_and(|note| note.contains(&format!("multiples of {factor},")))
            );
            assert!(scaled == right);
        }
        assert_eq!(right.clone().undo_multiples(), None);
        // Few photons of two at a time prove nothing.
        let mut few = right;
        few.histograms.iter_mut().for_each(|count| *count = if *count > 40.0 { 2.0 } else { 0.0 });
        assert_eq!(few.undo_multiples(), None);
    }

    #[test]
    fn scaled_photons_are_counts_again() {
        let right = noisy();
        assert_eq!(right.clone().undo_unit(), None, "whole already");
        for factor in [0.01f32, 1.0 / 87.0, 3.3e-7] {
            let mut scaled = right.clone();
            scaled.histograms.iter_mut().for_each(|count| *count *= factor);
            scaled.integer_counts = false;
            let mut exact = scaled.clone();
            assert!(scaled.undo_unit().is_some_and(|note| note.contains("scaled photon counts")));
            assert!(scaled == right);
            // A hundredth of a photon off.
            let most = exact.histograms.iter().fold(0.0f32, |a, b| a.max(*b));
            *exact.histograms.iter_mut().find(|v| **v == most).unwrap() += 0.01 * factor;
            assert_eq!(exact.undo_unit(), None);
        }
    }
}
