//! The trained weights, and the network on the host.

use half::f16;
use rayon::prelude::*;
use safetensors::SafeTensors;

use super::graph::{Footprint, Layers, Then, answer};
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

    /// Weights and biases of a layer.
    pub(super) fn layer(&self, name: &str) -> [Vec<f32>; 2] {
        self.halves(name).map(|all| all.into_iter().map(|bits| f16::from_bits(bits).to_f32()).collect())
    }

    /// The answer for bands, kind of scan and depth in the channels of `input`.
    pub fn answer(&self, input: Tensor) -> Answer {
        let mut host = HostLayers { network: self, spare: SpareTensors::default(), reach: [1; 3] };
        let [logits, four] = answer(&mut host, Channels::of(input)).map(|channels| channels.tensor);
        // Four channels are the four pixels of a column.
        let pixel = |i: usize| {
            let [x, y] = [i / (2 * SIDE), i % (2 * SIDE)];
            four.along_z(x % 2 * 2 + y % 2, x / 2, 0)[y / 2]
        };
        Answer { depth: rows(&logits, 0), mask: (0..4 * SIDE * SIDE).map(pixel).collect() }
    }
}

/// A network on the host.
pub(super) struct HostLayers<'n> {
    network: &'n Network<'n>,
    pub spare: SpareTensors,
    /// Neighbours along each axis that a wide convolution sees.
    reach: [usize; 3],
}

/// Channels of a volume, with sums of their values and of the squares where a convolution left them.
pub(super) struct Channels {
    pub tensor: Tensor,
    sums: Vec<[f64; 2]>,
}

impl Channels {
    pub fn of(tensor: Tensor) -> Channels {
        Channels { tensor, sums: vec![] }
    }
}

impl HostLayers<'_> {
    /// A network over planes: along y lies one cell.
    pub fn over_planes<'n>(network: &'n Network<'n>) -> HostLayers<'n> {
        HostLayers { network, spare: SpareTensors::default(), reach: [1, 0, 1] }
    }

    /// The convolution of the channels of some inputs.
    pub fn over(&mut self, name: &str, inputs: &[&Channels], reach: [usize; 3]) -> Channels {
        let [weights, bias] = self.network.layer(name);
        let inputs: Vec<&Tensor> = inputs.iter().map(|of| &of.tensor).collect();
        let mut tensor = self.spare.take(bias.len(), inputs[0].n);
        let sums = tensor.convolve(&inputs, &Weights { weights: &weights, bias: &bias, reach });
        Channels { tensor, sums }
    }
}

impl Layers for HostLayers<'_> {
    type Volume = Channels;

    fn channels(of: &Channels) -> usize {
        of.tensor.channels
    }

    fn outputs(&self, name: &str) -> usize {
        self.network.outputs(name)
    }

    fn convolved(&mut self, name: &str, inputs: &[&Channels], over: Footprint) -> Channels {
        self.over(name, inputs, if over == Footprint::Near { self.reach } else { [0; 3] })
    }

    fn activate(&mut self, name: &str, of: &mut Channels, with: Option<&Channels>) {
        let [weight, bias] = self.network.layer(name);
        of.tensor.activate(&of.sums, GROUPS, [&weight, &bias], with.map(|with| &with.tensor));
    }

    fn halved(&mut self, name: &str, fine: &Channels) -> Channels {
        let [weights, bias] = self.network.layer(name);
        let mut coarse = self.spare.take(bias.len(), fine.tensor.n.map(|n| n / 2));
        coarse.halve(&fine.tensor, &weights, &bias);
        Channels::of(coarse)
    }

    fn doubled(&mut self, name: &str, coarse: &Channels) -> Channels {
        let [weights, bias] = self.network.layer(name);
        let mut fine = self.spare.take(bias.len(), coarse.tensor.n.map(|n| 2 * n));
        fine.double(&coarse.tensor, &weights, &bias);
        Channels::of(fine)
    }

    fn columns(&mut self, features: &Channels, logits: &Channels) -> Channels {
        let (features, logits) = (&features.tensor, &logits.tensor);
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
        Channels::of(seen)
    }

    fn plane(&mut self, name: &str, input: &Channels, then: Then) -> Channels {
        let mut made = self.over(name, &[input], [1, 0, 1]);
        made.tensor.fill(|c, x, y, row| match then {
            Then::Activated => row.iter_mut().for_each(|v| *v = silu(*v)),
            Then::Added => {
                row.iter_mut()
                    .zip(input.tensor.along_z(c, x, y))
                    .for_each(|(v, before)| *v = before + silu(*v));
            }
            Then::Last => {}
        });
        made
    }

    fn free(&mut self, of: Channels) {
        self.spare.give(of.tensor);
    }
}

/// Tensors that are read no more, to be written anew: fresh memory takes as long as a pass over it.
#[derive(Default)]
pub(super) struct SpareTensors(Vec<Tensor>);

impl SpareTensors {
    /// A tensor of any values with a rim of zeros.
    pub fn take(&mut self, channels: usize, n: [usize; 3]) -> Tensor {
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
