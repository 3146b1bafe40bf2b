//! The network: a U-Net over the volume (Ronneberger, Fischer, Brox 2015; Çiçek et al. 2016), which gives depths, and a few layers
//! over its features at these depths, which give the mask.

use half::f16;
use safetensors::SafeTensors;

use super::sizes::{DEEP, SIDE};
use super::tensor::{Tensor, Weights, silu};

/// Trained weights ([`super`]).
static FILE: &[u8] = include_bytes!("weights.safetensors");

/// Groups of channels that are normalised together.
pub const GROUPS: usize = 4;

/// What the network says of every column: logits of its voxels, and of surface on pixels half as wide.
pub struct Answer {
    /// [x][y][z].
    pub depth: Vec<f32>,
    /// [x][y] of 2 [`SIDE`] pixels.
    pub mask: Vec<f32>,
}

pub struct Network<'f>(SafeTensors<'f>);

impl Network<'_> {
    /// The network of a file of weights, which has all its layers in half precision.
    pub fn of(file: &[u8]) -> Network<'_> {
        Network(SafeTensors::deserialize(file).expect("a file of weights"))
    }

    /// That of the program.
    pub fn trained() -> Network<'static> {
        Network::of(FILE)
    }

    /// Weights and biases of a layer in half precision, as bits.
    pub fn halves(&self, name: &str) -> [Vec<u16>; 2] {
        ["weight", "bias"].map(|part| {
            let tensor =
                self.0.tensor(&format!("{name}.{part}")).expect("the file of weights has all layers");
            tensor.data().chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect()
        })
    }

    /// Output channels of a layer.
    pub fn outputs(&self, name: &str) -> usize {
        self.halves(name)[1].len()
    }

    fn layer(&self, name: &str) -> [Vec<f32>; 2] {
        self.halves(name).map(|all| all.into_iter().map(|bits| f16::from_bits(bits).to_f32()).collect())
    }

    fn convolved(&self, name: &str, inputs: &[&Tensor], reach: [usize; 3]) -> Tensor {
        let [weights, bias] = self.layer(name);
        Tensor::convolved(inputs, &Weights { weights: &weights, bias: &bias, reach })
    }

    fn activated(&self, name: &str, tensor: Tensor, with: Option<&Tensor>) -> Tensor {
        let [weight, bias] = self.layer(name);
        tensor.activated(GROUPS, &weight, &bias, with)
    }

    /// Two convolutions, around which the input is added (He et al. 2016).
    fn block(&self, name: &str, inputs: &[&Tensor]) -> Tensor {
        let of = |part: &str| format!("{name}.{part}");
        let first = self.activated(&of("na"), self.convolved(&of("a"), inputs, [1; 3]), None);
        let second = self.convolved(&of("b"), &[&first], [1; 3]);
        match inputs {
            [same] if same.channels == second.channels => self.activated(&of("nb"), second, Some(same)),
            _ => self.activated(&of("nb"), second, Some(&self.convolved(&of("skip"), inputs, [0; 3]))),
        }
    }

    fn down(&self, name: &str, tensor: &Tensor) -> Tensor {
        let [weights, bias] = self.layer(name);
        tensor.halved(&weights, &bias)
    }

    fn up(&self, name: &str, tensor: &Tensor) -> Tensor {
        let [weights, bias] = self.layer(name);
        tensor.doubled(&weights, &bias)
    }

    /// The answer for bands, kind of scan and depth in the channels of `input`.
    pub fn answer(&self, input: &Tensor) -> Answer {
        let x0 = self.block("e0", &[&self.convolved("inp", &[input], [1; 3])]);
        let x1 = self.block("e1", &[&self.down("d1", &x0)]);
        let x2 = self.block("e2", &[&self.down("d2", &x1)]);
        let x3 = self.block("e3", &[&self.down("d3", &x2)]);
        let y = self.block("f2", &[&self.up("u2", &x3), &x2]);
        let y = self.block("f1", &[&self.up("u1", &y), &x1]);
        let y = self.block("f0", &[&self.up("u0", &y), &x0]);
        let logits = self.convolved("depth", &[&y], [0; 3]);
        Answer { depth: rows(&logits, 0), mask: self.mask(&y, &logits) }
    }

    /// The mask's logits from features: their means over the depths' distribution and their maxima.
    fn mask(&self, features: &Tensor, logits: &Tensor) -> Vec<f32> {
        let count = features.channels;
        // Along y lies y of the volume, in rows along z.
        let mut seen = Tensor::zeros(2 * count + 2, [SIDE, 1, SIDE]);
        seen.fill(|channel, x, _, row| {
            for (y, to) in row.iter_mut().enumerate() {
                let logits = logits.along_z(0, x, y);
                let most = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                let sum = || logits.iter().map(|l| (l - most).exp()).sum::<f32>();
                *to = if channel < count {
                    let values = features.along_z(channel, x, y);
                    logits.iter().zip(values).map(|(l, v)| (l - most).exp() * v).sum::<f32>() / sum()
                } else if channel < 2 * count {
                    features.along_z(channel - count, x, y).iter().copied().fold(f32::NEG_INFINITY, f32::max)
                } else if channel == 2 * count {
                    most
                } else {
                    most + sum().ln()
                };
            }
        });
        let layer = |name: &str, input: &Tensor| {
            let mut made = self.convolved(name, &[input], [1, 0, 1]);
            made.fill(|_, _, _, row| row.iter_mut().for_each(|v| *v = silu(*v)));
            made
        };
        let mut f = layer("m0", &seen);
        for name in ["m1", "m2"] {
            let more = layer(name, &f);
            f.fill(|c, x, y, row| row.iter_mut().zip(more.along_z(c, x, y)).for_each(|(v, m)| *v += m));
        }
        // Four channels are the four pixels of a column.
        let four = self.convolved("m3", &[&f], [1, 0, 1]);
        let pixel = |i: usize| {
            let [x, y] = [i / (2 * SIDE), i % (2 * SIDE)];
            four.along_z(x % 2 * 2 + y % 2, x / 2, 0)[y / 2]
        };
        (0..4 * SIDE * SIDE).map(pixel).collect()
    }
}

/// A channel's values, [x][y][z].
fn rows(tensor: &Tensor, channel: usize) -> Vec<f32> {
    let mut all = Vec::with_capacity(SIDE * SIDE * DEEP);
    for column in 0..SIDE * SIDE {
        all.extend_from_slice(tensor.along_z(channel, column / SIDE, column % SIDE));
    }
    all
}
