//! Histograms and columns at other places than those they are given at.

/// Counts of a histogram up to any path.
pub struct Cumulative {
    sums: Vec<f64>,
    start: f64,
    width: f64,
}

impl Cumulative {
    /// Of a histogram whose first bin begins at path `start`, with bins of this width; metres.
    pub fn of(histogram: &[f32], start: f64, width: f64) -> Cumulative {
        let mut sum = 0.0;
        let after = histogram.iter().map(|v| {
            sum += f64::from(*v);
            sum
        });
        Cumulative { sums: std::iter::once(0.0).chain(after).collect(), start, width }
    }

    /// Counts of shorter paths than this one. The counts of a bin are spread evenly over it.
    pub fn until(&self, path: f64) -> f64 {
        let at = ((path - self.start) / self.width).clamp(0.0, (self.sums.len() - 1) as f64);
        let low = (at as usize).min(self.sums.len() - 2);
        let share = at - low as f64;
        self.sums[low] * (1.0 - share) + self.sums[low + 1] * share
    }
}

/// Linear interpolation between values at whole places; 0 beyond half a step from the first and the last.
pub fn linear(values: impl Fn(usize) -> f32, count: usize, at: f64) -> f32 {
    if !(-0.5..=count as f64 - 0.5).contains(&at) {
        return 0.0;
    }
    let at = at.clamp(0.0, (count - 1) as f64);
    let low = (at as usize).min(count.saturating_sub(2));
    let share = (at - low as f64) as f32;
    let high = (low + 1).min(count - 1);
    values(low) * (1.0 - share) + values(high) * share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_up_to_a_path() {
        let c = Cumulative::of(&[2.0, 4.0, 0.0], 1.0, 0.5);
        let all = [0.0, 1.0, 1.25, 1.5, 1.75, 2.0, 2.4, 9.0].map(|t| c.until(t));
        assert_eq!(all, [0.0, 0.0, 1.0, 2.0, 4.0, 6.0, 6.0, 6.0]);
    }

    #[test]
    fn columns_between_their_places() {
        let of = |at| linear(|i| [1.0, 3.0, 7.0][i], 3, at);
        assert_eq!(
            [-0.6, -0.4, 0.0, 0.5, 1.75, 2.0, 2.4, 2.6].map(of),
            [0.0, 1.0, 1.0, 2.0, 6.0, 7.0, 7.0, 0.0]
        );
        assert_eq!(linear(|_| 5.0, 1, 0.2), 5.0);
    }
}
