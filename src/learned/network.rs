//! The network: a U-Net over the volume (Ronneberger, Fischer, Brox 2015; Çiçek et al. 2016), which gives depths, and a few layers
//! over its features at these depths, which give the mask.

use half::f16;
use rayon::prelude::*;
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

    /// The convolution of some inputs, and sums of its values and their squares by channel.
    fn convolved(
        &self,
        name: &str,
        inputs: &[&Tensor],
        reach: [usize; 3],
        spare: &mut SpareTensors,
    ) -> (Tensor, Vec<[f64; 2]>) {
        let [weights, bias] = self.layer(name);
        let mut to = spare.take(bias.len(), inputs[0].n);
        let sums = to.convolve(inputs, &Weights { weights: &weights, bias: &bias, reach });
        (to, sums)
    }

    /// A convolution over 3 x 3 x 3 cells, normalised and activated; `with` is added in between.
    fn layered(
        &self,
        [name, norm]: [String; 2],
        inputs: &[&Tensor],
        with: Option<&Tensor>,
        spare: &mut SpareTensors,
    ) -> Tensor {
        let (mut to, sums) = self.convolved(&name, inputs, [1; 3], spare);
        let [weight, bias] = self.layer(&norm);
        to.activate(&sums, GROUPS, [&weight, &bias], with);
        to
    }

    /// Two convolutions, around which the input is added (He et al. 2016).
    fn block(&self, name: &str, inputs: &[&Tensor], spare: &mut SpareTensors) -> Tensor {
        let of = |part: &str| format!("{name}.{part}");
        let first = self.layered([of("a"), of("na")], inputs, None, spare);
        let names = [of("b"), of("nb")];
        let second = match inputs {
            [same] if same.channels == first.channels => self.layered(names, &[&first], Some(same), spare),
            _ => {
                let (skip, _) = self.convolved(&of("skip"), inputs, [0; 3], spare);
                let second = self.layered(names, &[&first], Some(&skip), spare);
                spare.give(skip);
                second
            }
        };
        spare.give(first);
        second
    }

    /// A block at half as many cells along each axis.
    fn down(&self, names: [&str; 2], fine: &Tensor, spare: &mut SpareTensors) -> Tensor {
        let [weights, bias] = self.layer(names[0]);
        let mut coarse = spare.take(bias.len(), fine.n.map(|n| n / 2));
        coarse.halve(fine, &weights, &bias);
        let made = self.block(names[1], &[&coarse], spare);
        spare.give(coarse);
        made
    }

    /// A block at twice as many cells along each axis, of these and those that were kept.
    fn up(&self, names: [&str; 2], coarse: Tensor, kept: Tensor, spare: &mut SpareTensors) -> Tensor {
        let [weights, bias] = self.layer(names[0]);
        let mut fine = spare.take(bias.len(), kept.n);
        fine.double(&coarse, &weights, &bias);
        let made = self.block(names[1], &[&fine, &kept], spare);
        [coarse, fine, kept].into_iter().for_each(|of| spare.give(of));
        made
    }

    /// The answer for bands, kind of scan and depth in the channels of `input`.
    pub fn answer(&self, input: &Tensor) -> Answer {
        let spare = &mut SpareTensors::default();
        let (first, _) = self.convolved("inp", &[input], [1; 3], spare);
        let x0 = self.block("e0", &[&first], spare);
        spare.give(first);
        let x1 = self.down(["d1", "e1"], &x0, spare);
        let x2 = self.down(["d2", "e2"], &x1, spare);
        let x3 = self.down(["d3", "e3"], &x2, spare);
        let y = self.up(["u2", "f2"], x3, x2, spare);
        let y = self.up(["u1", "f1"], y, x1, spare);
        let y = self.up(["u0", "f0"], y, x0, spare);
        let (logits, _) = self.convolved("depth", &[&y], [0; 3], spare);
        Answer { depth: rows(&logits, 0), mask: self.mask(&y, &logits) }
    }

    /// The mask's logits from features: their means over the depths' distribution and their maxima.
    fn mask(&self, features: &Tensor, logits: &Tensor) -> Vec<f32> {
        let count = features.channels;
        // [x][y][channel].
        let columns: Vec<Vec<f32>> = (0..SIDE)
            .into_par_iter()
            .map(|x| {
                let mut all = Vec::with_capacity(SIDE * (2 * count + 2));
                for y in 0..SIDE {
                    let logits = logits.along_z(0, x, y);
                    let most = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                    let shares: Vec<f32> = logits.iter().map(|l| (l - most).exp()).collect();
                    let sum = shares.iter().sum::<f32>();
                    let of = |channel: usize| features.along_z(channel, x, y);
                    let mean = |c: usize| shares.iter().zip(of(c)).map(|(p, v)| p * v).sum::<f32>() / sum;
                    all.extend((0..count).map(mean));
                    let largest = |c: usize| of(c).iter().copied().fold(f32::NEG_INFINITY, f32::max);
                    all.extend((0..count).map(largest));
                    all.extend([most, most + sum.ln()]);
                }
                all
            })
            .collect();
        // Along y lies y of the volume, in rows along z.
        let mut seen = Tensor::zeros(2 * count + 2, [SIDE, 1, SIDE]);
        seen.fill(|channel, x, _, row| {
            row.iter_mut().zip(columns[x].chunks(2 * count + 2)).for_each(|(to, of)| *to = of[channel]);
        });
        let spare = &mut SpareTensors::default();
        let mut layer = |name: &str, input: &Tensor| {
            let (mut made, _) = self.convolved(name, &[input], [1, 0, 1], spare);
            made.fill(|_, _, _, row| row.iter_mut().for_each(|v| *v = silu(*v)));
            made
        };
        let mut f = layer("m0", &seen);
        for name in ["m1", "m2"] {
            let more = layer(name, &f);
            f.fill(|c, x, y, row| row.iter_mut().zip(more.along_z(c, x, y)).for_each(|(v, m)| *v += m));
        }
        // Four channels are the four pixels of a column.
        let (four, _) = self.convolved("m3", &[&f], [1, 0, 1], spare);
        let pixel = |i: usize| {
            let [x, y] = [i / (2 * SIDE), i % (2 * SIDE)];
            four.along_z(x % 2 * 2 + y % 2, x / 2, 0)[y / 2]
        };
        (0..4 * SIDE * SIDE).map(pixel).collect()
    }
}

/// Tensors that are read no more, to be written anew: fresh memory takes as long as a pass over it.
#[derive(Default)]
struct SpareTensors(Vec<Tensor>);

impl SpareTensors {
    /// A tensor of any values with a rim of zeros.
    fn take(&mut self, channels: usize, n: [usize; 3]) -> Tensor {
        let at = self.0.iter().position(|of| (of.channels, of.n) == (channels, n));
        at.map_or_else(|| Tensor::zeros(channels, n), |i| self.0.swap_remove(i))
    }

    fn give(&mut self, tensor: Tensor) {
        self.0.push(tensor);
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
