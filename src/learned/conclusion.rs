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

/// Pixels are surface from this probability on. Evidence: benches/NOTES.md, "Conclusion".
const SURFACE: f32 = 0.5;

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

    /// The mask, and the IoU with the true one that its probabilities promise.
    pub fn mask(&self) -> (Vec<bool>, f64) {
        let probability = self.probability();
        let mask: Vec<bool> = probability.iter().map(|p| *p >= SURFACE).collect();
        let [mut inside, mut both, mut missed] = [0.0f64; 3];
        for (p, is_surface) in probability.iter().zip(&mask) {
            let p = f64::from(*p);
            match is_surface {
                true => (inside, both) = (inside + 1.0, both + p),
                false => missed += p,
            }
        }
        (mask, if inside > 0.0 { both / (inside + missed) } else { 0.0 })
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surface_is_where_it_is_more_probable_than_not() {
        let said = Conclusion { logit: vec![4.0, 0.2, -0.2, -4.0], scale: vec![] };
        let (mask, expected) = said.mask();
        assert_eq!(mask, [true, true, false, false]);
        let p = said.probability();
        let want = f64::from((p[0] + p[1]) / (2.0 + p[2] + p[3]));
        assert!((expected - want).abs() < 1e-6, "{expected} {want}");
        assert_eq!(Conclusion { logit: vec![-9.0; 2], scale: vec![] }.mask(), (vec![false; 2], 0.0));
    }
}
