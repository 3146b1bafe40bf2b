//! Coverage of expected depth errors: the share of actual errors within them.

/// Share of errors within the expected error, of errors with a normal distribution.
pub const WITHIN: f64 = 0.68;

/// Pairs of (expected, actual) depth error in metres.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ErrorCoverage {
    pairs: Vec<[f64; 2]>,
}

impl ErrorCoverage {
    /// Adds a pixel, unless a value is NaN.
    pub fn add(&mut self, depth_error: f64, error: f64) {
        if depth_error.is_finite() && error.is_finite() {
            self.pairs.push([depth_error, error.abs()]);
        }
    }

    /// Share of the pixels whose error is within the expected error; `None` without pixels. [`WITHIN`] of errors with a normal distribution.
    pub fn within(&self) -> Option<f64> {
        within(&self.pairs)
    }

    /// Four groups of equal size, from most to least certain: median expected error in metres and share within. Empty
    /// with fewer than four pixels.
    pub fn quarters(&self) -> Vec<[f64; 2]> {
        let mut sorted = self.pairs.clone();
        sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let n = sorted.len();
        if n < 4 {
            return vec![];
        }
        let parts = (0..4).map(|k| &sorted[k * n / 4..(k + 1) * n / 4]);
        parts.filter_map(|part| Some([part[part.len() / 2][0], within(part)?])).collect()
    }
}

fn within(pairs: &[[f64; 2]]) -> Option<f64> {
    let inside = pairs.iter().filter(|[depth_error, error]| error <= depth_error).count();
    (!pairs.is_empty()).then(|| inside as f64 / pairs.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarters_go_from_certain_to_uncertain() {
        let mut all = ErrorCoverage::default();
        assert_eq!((all.within(), all.quarters()), (None, vec![]));
        // Every group has ten pixels; of the k-th, k + 1 errors exceed the expected error.
        for i in (0..40).rev() {
            let (quarter, depth_error) = (i / 10, 1.0 + f64::from(i));
            let is_more = i % 10 <= quarter;
            all.add(depth_error, if is_more { -2.0 * depth_error } else { depth_error });
        }
        all.add(f64::NAN, 1.0);
        all.add(1.0, f64::NAN);
        assert_eq!(all.within(), Some(0.75));
        assert_eq!(all.quarters(), [[6.0, 0.9], [16.0, 0.8], [26.0, 0.7], [36.0, 0.6]]);
    }
}
