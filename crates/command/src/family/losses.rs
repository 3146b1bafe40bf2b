//! What an instrument loses of the light of a scene.

use rand::SeedableRng;
use rand_distr::{Binomial, Distribution, StandardNormal};
use rand_pcg::Pcg64;
use thirdbounce::capture::Capture;

use super::dice::Dice;

/// What an instrument loses of the light.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Losses {
    /// Standard deviation of the logarithm of the gains of pairs.
    pub gains: f64,
    /// Share of the pairs that have no counts.
    pub masked: f64,
    /// Largest share of the photons that a bin misses, the same for all pairs.
    pub missing: f64,
}

/// The largest. Photons that bins miss: as LEAP trains with, there for each bin of each pair, here alike for all pairs, as bins of unequal
/// widths are. The others are chosen, not measured: no published network trains with gains of points.
const MOST: Losses = Losses { gains: 0.15, masked: 0.2, missing: 0.2 };

impl Losses {
    /// Those of a seed: each is absent in half of the scenes.
    pub(super) fn drawn(dice: &mut Dice) -> Losses {
        let [gains, masked, missing] = [MOST.gains, MOST.masked, MOST.missing]
            .map(|most| if dice.so_often(0.5) { dice.of(0.0, most) } else { 0.0 });
        Losses { gains, masked, missing }
    }

    fn random(seed: u64) -> Pcg64 {
        Pcg64::seed_from_u64(seed ^ 0x006c_6f73_7365_7300)
    }

    /// Applies the gains to expected light.
    pub(super) fn weaken(&self, light: &mut Capture, seed: u64) {
        if self.gains == 0.0 {
            return;
        }
        let mut random = Losses::random(seed);
        for histogram in light.histograms.chunks_exact_mut(light.bins) {
            let step: f64 = StandardNormal.sample(&mut random);
            let gain = (self.gains * step).exp() as f32;
            histogram.iter_mut().for_each(|value| *value *= gain);
        }
    }

    /// Takes counts away: those that bins miss, and those of masked pairs.
    pub(super) fn take(&self, counts: &mut Capture, seed: u64) {
        let mut dice = Dice(Losses::random(seed ^ 1));
        let kept: Vec<f64> = (0..counts.bins).map(|_| 1.0 - self.missing * dice.of(0.0, 1.0)).collect();
        for histogram in counts.histograms.chunks_exact_mut(counts.bins) {
            if dice.maybe(self.masked) {
                histogram.fill(0.0);
            } else if self.missing > 0.0 {
                for (value, kept) in histogram.iter_mut().zip(&kept) {
                    let left = Binomial::new(*value as u64, *kept).expect("a share of counts");
                    *value = left.sample(&mut dice.0) as f32;
                }
            }
        }
    }

    /// Names of those that are there.
    pub(super) fn words(&self) -> String {
        let named = [("gains", self.gains), ("masked", self.masked), ("missing", self.missing)];
        named
            .iter()
            .filter(|(_, share)| *share > 0.0)
            .map(|(name, share)| format!(", {name} {share:.3}"))
            .collect()
    }
}
