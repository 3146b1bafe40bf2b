//! Albedos against true ones, up to their common scale, which no method knows.

use std::collections::BTreeMap;

/// A tone with fewer of the pixels than this share does not count for the ratio: the rim of something else.
const TONE: f64 = 0.05;

/// Sums over the pixels of each true albedo.
#[derive(Debug, Clone, Default)]
pub struct Albedos(BTreeMap<u32, [f64; 3]>);

impl Albedos {
    /// Adds a pixel, unless a value is NaN.
    pub fn add(&mut self, found: f32, real: f32) {
        if found.is_finite() && real.is_finite() {
            let [count, sum, squares] = self.0.entry(real.to_bits()).or_default();
            let found = f64::from(found);
            (*count, *sum, *squares) = (*count + 1.0, *sum + found, *squares + found * found);
        }
    }

    /// Standard deviation over mean of the albedos found where the true ones are one, root mean square over pixels; `None` without
    /// pixels.
    pub fn spread(&self) -> Option<f64> {
        let all: f64 = self.0.values().map(|[count, ..]| count).sum();
        let of = |[count, sum, squares]: &[f64; 3]| count * (count * squares / (sum * sum) - 1.0).max(0.0);
        let lit = self.0.values().filter(|[_, sum, _]| *sum > 0.0);
        (all > 0.0).then(|| (lit.map(of).sum::<f64>() / all).sqrt())
    }

    /// By which share the ratio of the two tones that most pixels have is off; `None` with one tone.
    pub fn ratio_error(&self) -> Option<f64> {
        let all: f64 = self.0.values().map(|[count, ..]| count).sum();
        let mut tones: Vec<[f64; 3]> = self
            .0
            .iter()
            .map(|(real, [count, sum, _])| [*count, sum / count, f64::from(f32::from_bits(*real))])
            .filter(|[count, found, real]| *count >= TONE * all && *found > 0.0 && *real > 0.0)
            .collect();
        tones.sort_by(|a, b| b[0].total_cmp(&a[0]));
        let [[_, a, b], [_, c, d], ..] = tones[..] else { return None };
        Some((a * d / (b * c) - 1.0).abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(pixels: &[(f32, f32)]) -> Albedos {
        let mut all = Albedos::default();
        pixels.iter().for_each(|(found, real)| all.add(*found, *real));
        all
    }

    #[test]
    fn spread_is_within_tones_and_free_of_scale() {
        assert_eq!(of(&[]).spread(), None);
        assert_eq!(of(&[(f32::NAN, 1.0)]).spread(), None);
        // 1 and 3 have a mean of 2 and a deviation of 1; the other tone has none.
        let mixed = of(&[(1.0, 0.5), (3.0, 0.5), (7.0, 0.2), (7.0, 0.2)]);
        assert!((mixed.spread().unwrap() - 0.125f64.sqrt()).abs() < 1e-12);
        let scaled = of(&[(10.0, 0.5), (30.0, 0.5), (70.0, 0.2), (70.0, 0.2)]);
        assert!((mixed.spread().unwrap() - scaled.spread().unwrap()).abs() < 1e-12);
    }

    #[test]
    fn the_ratio_of_two_tones_is_off_by_a_share() {
        assert_eq!(of(&[(1.0, 0.5), (3.0, 0.5)]).ratio_error(), None);
        // Found 2 : 1, true 4 : 1.
        let error = of(&[(2.0, 0.8), (2.0, 0.8), (1.0, 0.2)]).ratio_error().unwrap();
        assert!((error - 0.5).abs() < 1e-6, "{error}");
        // A rim of a third tone does not count.
        let mut pixels = vec![(1.0, 1.0); 40];
        pixels.extend([(0.5, 0.5); 39]);
        pixels.push((9.0, 0.25));
        assert!(of(&pixels).ratio_error().unwrap() < 1e-12);
    }
}
