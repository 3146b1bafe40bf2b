//! Histograms and columns at other places than those they are given at.

/// Counts of a histogram up to any path.
pub struct Cumulative(Vec<f64>);

impl Cumulative {
    pub fn of(histogram: &[f32]) -> Cumulative {
        let mut sum = 0.0;
        let after = histogram.iter().map(|v| {
            sum += f64::from(*v);
            sum
        });
        Cumulative(std::iter::once(0.0).chain(after).collect())
    }

    /// Counts of paths shorter than the one at a place. The counts of a bin are spread evenly over it.
    pub fn until(&self, PathPlace { bin, share }: PathPlace) -> f64 {
        self.0[bin] * (1.0 - share) + self.0[bin + 1] * share
    }
}

/// Place of a path in histograms: its bin, and the share of that before it.
#[derive(Clone, Copy)]
pub struct PathPlace {
    bin: usize,
    share: f64,
}

impl PathPlace {
    /// In histograms of `bins` bins of this width, the first of which begins at path `start`; metres.
    pub fn of(path: f64, bins: usize, start: f64, width: f64) -> PathPlace {
        let at = ((path - start) / width).clamp(0.0, bins as f64);
        let bin = (at as usize).min(bins - 1);
        PathPlace { bin, share: at - bin as f64 }
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

/// Adds values times a weight.
pub fn add(to: &mut [f32], from: &[f32], weight: f32) {
    to.iter_mut().zip(from).for_each(|(t, f)| *t += weight * f);
}

/// The four places around `at` with their weights; places beyond the ends are those at the ends. `None` farther than
/// `beyond` from the first and the last of `n` places.
pub fn cubic(at: f64, n: usize, beyond: f64) -> Option<[(usize, f32); 4]> {
    if !(-beyond - 1e-9..=(n - 1) as f64 + beyond + 1e-9).contains(&at) {
        return None;
    }
    let low = at.floor();
    let t = at - low;
    let weights = [
        ((-0.5 * t + 1.0) * t - 0.5) * t,
        (1.5 * t - 2.5) * t * t + 1.0,
        ((-1.5 * t + 2.0) * t + 0.5) * t,
        (0.5 * t - 0.5) * t * t,
    ];
    let place = |k: usize| (low as isize + k as isize - 1).clamp(0, n as isize - 1) as usize;
    Some([0, 1, 2, 3].map(|k| (place(k), weights[k] as f32)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_up_to_a_path() {
        let c = Cumulative::of(&[2.0, 4.0, 0.0]);
        let all = [0.0, 1.0, 1.25, 1.5, 1.75, 2.0, 2.4, 9.0].map(|t| c.until(PathPlace::of(t, 3, 1.0, 0.5)));
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

    #[test]
    fn beyond_the_scan_nothing_is_known() {
        assert_eq!(cubic(-0.6, 4, 0.5), None);
        assert_eq!(cubic(3.6, 4, 0.5), None);
        let sum = |at: f64| cubic(at, 4, 0.5).unwrap().iter().map(|w| w.1).sum::<f32>();
        assert!([-0.5, 0.0, 1.25, 3.5].iter().all(|at| (sum(*at) - 1.0).abs() < 1e-6));
    }
}
