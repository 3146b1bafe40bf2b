//! The network that has the last word: a U-Net over the pixels of the maps. It sees the start and what a fit found
//! (`src/surface/evidence.rs`), and says where surface is, and how sure its depth is. It learns from what the fit leaves of the light, as
//! learned iterations do (Adler, Öktem: *Learned Primal-Dual Reconstruction*, IEEE Transactions on Medical Imaging 2018).

use super::graph::{Layers, block};
use super::network::{Channels, HostLayers, Network};
use super::tensor::Tensor;

/// Trained weights (`learn/README.md`).
static FILE: &[u8] = include_bytes!("conclusion.safetensors");

/// Lateral pixels of the maps that it was trained on.
pub const PIXELS: usize = 128;

/// Largest and smallest logarithm of the Laplace scale of a depth in voxels of the start.
const SCALES: [f32; 2] = [-5.0, 4.0];

/// Weight of the rules of the support beside the network: logarithm of the odds that their mask is right. Alone, the network fills concave
/// outlines of a few coarse scans that the rules have (benches/NOTES.md, "Conclusion").
const RULES: f32 = 0.5;

/// No pixel is surface below this probability by both: where nothing is likely, the best threshold would take all pixels. Of scenes with
/// surface it is never below .43.
const LEAST: f32 = 0.3;

/// What the network says of every pixel, `[x][y]`.
#[derive(Debug, Clone)]
pub struct Conclusion {
    /// Logit of surface.
    pub logit: Vec<f32>,
    /// Laplace scale of the error of a depth, voxels of the start.
    pub scale: Vec<f32>,
}

impl Conclusion {
    /// Of channels of [`PIXELS`] × [`PIXELS`] pixels, `[channel][x][y]`, by a file of weights or by those of the program.
    pub fn of(weights: Option<&[u8]>, channels: &[Vec<f32>]) -> Conclusion {
        let mut input = Tensor::zeros(channels.len(), [PIXELS, 1, PIXELS]);
        input.fill(|channel, x, _, row| row.copy_from_slice(&channels[channel][x * PIXELS..][..PIXELS]));
        let network = Network::of(weights.unwrap_or(FILE));
        let answer = answer(&mut HostLayers::over_planes(&network), Channels::of(input));
        let plane = |channel: usize| -> Vec<f32> {
            (0..PIXELS).flat_map(|x| answer.tensor.along_z(channel, x, 0)).copied().collect()
        };
        let [low, high] = SCALES;
        Conclusion {
            logit: plane(0),
            scale: plane(2).into_iter().map(|log| log.clamp(low, high).exp()).collect(),
        }
    }
}

impl Conclusion {
    /// Probability of surface.
    pub fn probability(&self) -> Vec<f32> {
        self.logit.iter().copied().map(sigmoid).collect()
    }

    /// The mask of the largest expected IoU by the network and the mask of the `rules`, and the IoU that the network alone expects of
    /// it.
    pub fn mask(&self, rules: &[bool]) -> (Vec<bool>, f64) {
        let both =
            self.logit.iter().zip(rules).map(|(l, rule)| sigmoid(l + if *rule { RULES } else { -RULES }));
        let both: Vec<f32> = both.collect();
        let least = best_threshold(&both).max(LEAST);
        let mask: Vec<bool> = both.iter().map(|p| *p >= least).collect();
        let promised = promised_iou(&mask, &self.probability());
        (mask, promised)
    }
}

/// The share of the union of a mask and the true one that both have, as probabilities of pixels promise it; 0 without a mask.
pub fn promised_iou(mask: &[bool], probability: &[f32]) -> f64 {
    let count = mask.iter().filter(|m| **m).count() as f64;
    let [inside, outside] =
        probability.iter().zip(mask).fold([0.0; 2], |[inside, outside], (p, m)| match m {
            true => [inside + f64::from(*p), outside],
            false => [inside, outside + f64::from(*p)],
        });
    if count > 0.0 { inside / (count + outside) } else { 0.0 }
}

fn sigmoid(logit: f32) -> f32 {
    1.0 / (1.0 + (-logit).exp())
}

/// Logit of surface, what a depth lacks (unused), and the logarithm of its Laplace scale.
fn answer(l: &mut HostLayers<'_>, input: Channels) -> Channels {
    let first = l.over("stem", &[&input], [0; 3]);
    let x0 = block(l, "e0", first, None);
    let x1 = down(l, "e1", &x0);
    let x2 = down(l, "e2", &x1);
    let x3 = down(l, "e3", &x2);
    let y = up(l, "f2", x3, x2);
    let y = up(l, "f1", y, x1);
    let y = up(l, "f0", y, x0);
    l.over("out", &[&y], [0; 3])
}

/// A block at half as many pixels along each axis, of means of four.
fn down(l: &mut HostLayers<'_>, name: &str, fine: &Channels) -> Channels {
    let fine = &fine.tensor;
    let mut coarse = l.spare.take(fine.channels, [fine.n[0] / 2, 1, fine.n[2] / 2]);
    coarse.fill(|channel, x, _, row| {
        let [a, b] = [0, 1].map(|i| fine.along_z(channel, 2 * x + i, 0).as_chunks::<2>().0);
        let means = a.iter().zip(b).map(|(a, b)| 0.25 * (a[0] + a[1] + b[0] + b[1]));
        row.iter_mut().zip(means).for_each(|(v, mean)| *v = mean);
    });
    block(l, name, Channels::of(coarse), None)
}

/// A block at twice as many pixels along each axis, of repeated ones and those that were kept.
fn up(l: &mut HostLayers<'_>, name: &str, coarse: Channels, kept: Channels) -> Channels {
    let mut fine = l.spare.take(coarse.tensor.channels, kept.tensor.n);
    fine.fill(|channel, x, _, row| {
        let from = coarse.tensor.along_z(channel, x / 2, 0);
        row.as_chunks_mut::<2>().0.iter_mut().zip(from).for_each(|(two, v)| *two = [*v; 2]);
    });
    l.free(coarse);
    let made = block(l, name, Channels::of(fine), Some(&kept));
    l.free(kept);
    made
}

/// The probability from which on pixels are surface where that gives the largest expected share of the union of mask and true surface
/// that both have.
fn best_threshold(probability: &[f32]) -> f32 {
    let mut sorted = probability.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let all: f64 = sorted.iter().map(|p| f64::from(*p)).sum();
    let mut both = 0.0;
    let (mut best, mut largest) = (1.0, 0.0);
    for (i, p) in sorted.iter().enumerate() {
        both += f64::from(*p);
        let share = both / ((i + 1) as f64 + all - both);
        if share > largest {
            (best, largest) = (*p, share);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_promises_less_with_unlikely_pixels_and_without_likely_ones() {
        let probability = [0.9, 0.9, 0.4, 0.1];
        let of = |count: usize| promised_iou(&[0, 1, 2, 3].map(|at| at < count), &probability);
        assert!((of(2) - 1.8 / 2.5).abs() < 1e-6, "{}", of(2));
        assert!(of(2) > of(1) && of(2) > of(3) && of(3) > of(4));
    }

    #[test]
    fn the_threshold_is_that_of_the_largest_expected_share() {
        // Certain pixels alone.
        assert_eq!(best_threshold(&[1.0, 0.0, 1.0, 0.01]), 1.0);
        // By trying all thresholds.
        let all = [0.9f32, 0.7, 0.4, 0.38, 0.1, 0.05];
        let of = |least: f32| {
            let inside = all.iter().filter(|p| **p >= least);
            let [both, count] = inside.fold([0.0f32; 2], |[sum, n], p| [sum + p, n + 1.0]);
            both / (count + all.iter().sum::<f32>() - both)
        };
        let best = best_threshold(&all);
        assert!(all.iter().all(|p| of(*p) <= of(best)), "{best}");
    }

    #[test]
    fn the_rules_decide_where_the_network_is_unsure_alone() {
        let said = Conclusion { logit: vec![4.0, 4.0, 0.1, -0.1, -4.0, -4.0], scale: vec![] };
        let (mask, expected) = said.mask(&[true, false, false, true, true, false]);
        assert_eq!(mask, [true, true, false, true, false, false]);
        let p = said.probability();
        let inside = p[0] + p[1] + p[3];
        let want = f64::from(inside / (3.0 + p[2] + p[4] + p[5]));
        assert!((expected - want).abs() < 1e-6, "{expected} {want}");
        assert_eq!(Conclusion { logit: vec![-9.0; 2], scale: vec![] }.mask(&[false; 2]).0, [false; 2]);
    }
}
