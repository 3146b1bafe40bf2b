//! What becomes of counts between their submission and their solve: replaced, queued, or summed.

use crate::{Error, Result};

/// What becomes of a frame that is submitted while another one is being solved.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Feed {
    /// It is refused.
    #[default]
    One,
    /// It waits, in the place of the one that waited.
    Newest,
    /// It waits behind all others. Each is solved, once the result before it was taken. Of more than `most` that wait, the
    /// last is refused.
    Every {
        /// Most frames that wait.
        most: usize,
    },
    /// It is added to a running sum, which is solved as soon as that is possible.
    ///
    /// With counts c of the frames of a pair, the newest last, and weights decay^k of the frame k before it, a frame is
    /// Σ decay^k c / Σ decay^k, the mean, times what the mean is worth in frames of their own, (Σ decay^k)² / Σ decay^2k,
    /// in the mean over the pairs. So the variance of photon counts stays their mean. A pair that is not measured keeps its
    /// weights and its sum.
    Sum {
        /// From 0 (only the newest frame counts) to 1 (all count).
        decay: f64,
    },
}

/// Frames that may wait where every frame counts, by default.
const WAITING: usize = 64;

impl std::str::FromStr for Feed {
    type Err = Error;

    /// Reads `one`, `newest`, `every`, or `sum:0.9` with the decay.
    fn from_str(text: &str) -> Result<Feed> {
        match (text, text.strip_prefix("sum:").map(str::parse)) {
            ("one", _) => Ok(Feed::One),
            ("newest", _) => Ok(Feed::Newest),
            ("every", _) => Ok(Feed::Every { most: WAITING }),
            (_, Some(Ok(decay))) => Ok(Feed::Sum { decay }),
            _ => Err(Error::options(
                format!("the feed {text:?} is not known"),
                "give one, newest, every, or sum:0.9 with what the sum is multiplied by before each frame",
            )),
        }
    }
}

impl Feed {
    /// # Errors
    /// A queue without room for a frame, or a decay outside 0 to 1.
    pub(super) fn check(&self) -> Result<()> {
        match self {
            Feed::Every { most: 0 } => Err(Error::options(
                "the queue has room for no frame",
                "let at least one frame wait, or take Feed::One",
            )),
            Feed::Sum { decay } if !(0.0..=1.0).contains(decay) => {
                Err(Error::options(format!("the decay of the sum is {decay}"), "give a share from 0 to 1"))
            }
            _ => Ok(()),
        }
    }
}

/// The last counts of every pair, or their sums.
pub(super) struct KeptCounts {
    bins: usize,
    /// `[pair * bins + bin]`.
    values: Vec<f64>,
    /// Sums of the weights and of their squares, of every pair.
    weights: Vec<[f64; 2]>,
    /// The weight of all earlier frames where a new one comes.
    decay: f64,
}

impl KeptCounts {
    /// Of a scan that was not measured yet.
    pub fn new([pairs, bins]: [usize; 2], feed: Feed) -> KeptCounts {
        let decay = if let Feed::Sum { decay } = feed { decay } else { 0.0 };
        KeptCounts { bins, values: vec![0.0; pairs * bins], weights: vec![[0.0; 2]; pairs], decay }
    }

    /// Takes the counts of the pairs that are `measured`, or of all.
    pub fn take(&mut self, counts: &[f32], measured: Option<&[bool]>) {
        let rows = self.values.chunks_exact_mut(self.bins).zip(counts.chunks_exact(self.bins));
        for (pair, (sums, new)) in rows.enumerate().filter(|(p, _)| measured.is_none_or(|m| m[*p])) {
            sums.iter_mut().zip(new).for_each(|(sum, count)| *sum = self.decay * *sum + f64::from(*count));
            let [first, second] = &mut self.weights[pair];
            *first = self.decay * *first + 1.0;
            *second = self.decay * self.decay * *second + 1.0;
        }
    }

    /// Adds the frame that they make to `frame`. Pairs that were never measured are dark.
    pub fn give(&self, frame: &mut Vec<f32>) {
        let known = self.weights.iter().filter(|w| w[1] > 0.0);
        let worth = known.clone().map(|[m, v]| m * m / v).sum::<f64>() / known.count().max(1) as f64;
        for (sums, [weight, _]) in self.values.chunks_exact(self.bins).zip(&self.weights) {
            let times = if *weight > 0.0 { worth / weight } else { 0.0 };
            frame.extend(sums.iter().map(|sum| (times * sum) as f32));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(kept: &KeptCounts) -> Vec<f32> {
        let mut frame = vec![];
        kept.give(&mut frame);
        frame
    }

    #[test]
    fn a_sum_with_decay_is_that_of_its_definition() {
        let frames = [[4.0f32, 0.0, 1.0], [0.0, 2.0, 1.0], [8.0, 1.0, 0.0], [1.0, 1.0, 5.0]];
        for decay in [0.0, 0.5, 0.9, 1.0] {
            let mut kept = KeptCounts::new([1, 3], Feed::Sum { decay });
            frames.iter().for_each(|f| kept.take(f, None));
            let weight = |k: usize| f64::powi(decay, k as i32);
            let [first, second] = [1, 2].map(|p| (0..4).map(|k| weight(k).powi(p)).sum::<f64>());
            for (bin, value) in given(&kept).into_iter().enumerate() {
                let sum: f64 = (0..4).map(|k| weight(k) * f64::from(frames[3 - k][bin])).sum();
                let want = sum / first * (first * first / second);
                assert!((f64::from(value) - want).abs() < 1e-5, "{decay}: {value} {want}");
            }
        }
        // Without decay it is the plain sum, with nothing left the newest frame.
        let mut all = KeptCounts::new([1, 3], Feed::Sum { decay: 1.0 });
        frames.iter().for_each(|f| all.take(f, None));
        assert_eq!(given(&all), [13.0, 4.0, 7.0]);
    }

    #[test]
    fn feeds_have_words() {
        for (text, feed) in [
            ("one", Feed::One),
            ("newest", Feed::Newest),
            ("every", Feed::Every { most: WAITING }),
            ("sum:0.5", Feed::Sum { decay: 0.5 }),
        ] {
            assert_eq!(text.parse::<Feed>().unwrap(), feed);
        }
        for wrong in ["", "some", "sum", "sum:", "sum:x", "0.5"] {
            assert!(wrong.parse::<Feed>().unwrap_err().what.contains(&format!("{wrong:?}")));
        }
    }

    #[test]
    fn pairs_that_are_not_measured_keep_their_counts() {
        let mut kept = KeptCounts::new([2, 2], Feed::Newest);
        kept.take(&[1.0, 2.0, 3.0, 4.0], Some(&[true, false]));
        assert_eq!(given(&kept), [1.0, 2.0, 0.0, 0.0]);
        kept.take(&[9.0, 9.0, 5.0, 6.0], Some(&[false, true]));
        assert_eq!(given(&kept), [1.0, 2.0, 5.0, 6.0]);
        // A pair that was summed twice is as bright as one that was summed once.
        let mut kept = KeptCounts::new([2, 1], Feed::Sum { decay: 1.0 });
        kept.take(&[6.0, 6.0], None);
        kept.take(&[6.0, 0.0], Some(&[true, false]));
        assert_eq!(given(&kept), [9.0, 9.0]);
    }

    #[test]
    fn photons_stay_photons() {
        // Whole counts of 0 to 9 with a mean of 4.5 and a variance of 8.25: the ratio stays.
        let mut kept = KeptCounts::new([1, 4000], Feed::Sum { decay: 0.8 });
        let mut state = 7u64;
        for _ in 0..40 {
            let mut draw = || {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                ((state >> 33) % 10) as f32
            };
            kept.take(&(0..4000).map(|_| draw()).collect::<Vec<_>>(), None);
        }
        let frame = given(&kept);
        let mean = frame.iter().sum::<f32>() / 4000.0;
        let variance = frame.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / 4000.0;
        assert!((variance / mean / (8.25 / 4.5) - 1.0).abs() < 0.1, "{mean} {variance}");
        assert!((mean / (4.5 * 9.0) - 1.0).abs() < 0.02, "{mean}: 1.8 / 0.2 frames");
    }

    #[test]
    fn feeds_without_sense_are_refused() {
        for wrong in [Feed::Every { most: 0 }, Feed::Sum { decay: 1.1 }, Feed::Sum { decay: f64::NAN }] {
            assert!(wrong.check().is_err(), "{wrong:?}");
        }
        assert!(Feed::Sum { decay: 1.0 }.check().is_ok() && Feed::One.check().is_ok());
    }
}
