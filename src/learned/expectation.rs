//! The share of the union of a mask and the true one that both have, as it is to be expected: a logistic regression on what the last
//! network sees, which was trained on captures with faults of the instrument, too (`learn/README.md`). What the network's probabilities
//! alone promise is .14 too high there, as it has seen no such captures.

use super::network::Network;

/// Trained weights.
static FILE: &[u8] = include_bytes!("expectation.safetensors");

/// Channels of the network that are of a pixel; the others are the same everywhere.
const OF_PIXEL: usize = 33;
/// The first channel of the bands, which also count by their root mean square.
const OF_BANDS: usize = 18;
/// Standard deviations up to which a number counts.
const FAR: f32 = 4.0;

/// What is expected of a `mask`: `channels` of pixels, what the probabilities `alone` promise, and the Laplace `scale` of every depth in
/// voxels of the start. 0 without surface.
pub fn expected_iou(channels: &[Vec<f32>], mask: &[bool], alone: f64, scale: &[f32]) -> f64 {
    let count = mask.iter().filter(|m| **m).count();
    if count == 0 {
        return 0.0;
    }
    let mean = |of: &dyn Fn(usize) -> f32| {
        let sum: f64 = (0..mask.len()).filter(|p| mask[*p]).map(|p| f64::from(of(p))).sum();
        (sum / count as f64) as f32
    };
    let everywhere = channels[OF_PIXEL..].iter().map(|of| of[0]);
    let means = channels[..OF_PIXEL].iter().map(|of| mean(&|p| of[p]));
    let roots = channels[OF_BANDS..OF_PIXEL].iter().map(|of| mean(&|p| of[p] * of[p]).sqrt());
    let odds = (alone.max(0.01) / (1.01 - alone)).ln() as f32;
    let log = |p: usize| scale[p].ln();
    let share = count as f32 / mask.len() as f32;
    let rest = [odds, share, mean(&log), mean(&|p| log(p).abs())];
    let numbers: Vec<f32> = everywhere.chain(means).chain(roots).chain(rest).collect();
    let network = Network::of(FILE);
    let ([per_deviation, middle], [weight, bias]) = (network.layer("standard"), network.layer("expectation"));
    assert_eq!(numbers.len(), weight.len());
    let parts = numbers.iter().zip(&middle).zip(&per_deviation).zip(&weight);
    let logit = parts.map(|(((v, m), s), w)| w * ((v - m) * s).clamp(-FAR, FAR)).sum::<f32>() + bias[0];
    1.0 / (1.0 + f64::from(-logit).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Channels that are all this, of 4 pixels.
    fn expected(of_bands: f32, everywhere: f32, alone: f64, mask: [bool; 4]) -> f64 {
        let channel = |k: usize| match k {
            OF_PIXEL.. => everywhere,
            OF_BANDS.. => of_bands,
            _ => 0.5,
        };
        let channels: Vec<Vec<f32>> = (0..50).map(|k| vec![channel(k); 4]).collect();
        expected_iou(&channels, &mask, alone, &[0.5; 4])
    }

    #[test]
    fn more_is_expected_where_the_network_is_surer() {
        let of = |alone| expected(0.2, 0.3, alone, [true, true, false, false]);
        assert!(0.0 < of(0.3) && of(0.3) < of(0.6) && of(0.6) < of(0.9) && of(0.9) < 1.0);
        assert_eq!(expected(0.2, 0.3, 0.9, [false; 4]), 0.0);
    }

    #[test]
    fn numbers_beyond_all_that_was_seen_count_no_more_than_far_ones() {
        let of = |bands| expected(bands, 0.3, 0.8, [true; 4]);
        assert_eq!(of(1e6), of(1e9));
        assert!(of(1e9).is_finite());
    }
}
