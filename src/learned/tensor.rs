//! Arrays of the network: channels of a volume with a rim of zeros, and the operations that it consists of.

use rayon::prelude::*;

use super::sizes::wide;

/// Vectors along z of a step of [`Tensor::convolve`], at most, and its output channels: sums, inputs and weights of 3 and 8 fill 32
/// registers of [`LANES`] values, of 2 and 4 sixteen narrower ones.
const VECTORS: usize = 3;
const OUTPUTS: usize = 8;
const FEWER: usize = 4;
/// Values of the widest vectors.
const LANES: usize = 16;

/// Channels of a volume of n cells, [x + 1][channel][y + 1][z + 1]: a slab along x lies together, and a rim of zeros is around
/// all cells.
pub struct Tensor {
    pub channels: usize,
    pub n: [usize; 3],
    /// Values from one row along z to the next.
    row: usize,
    values: Vec<f32>,
}

/// Weights of a convolution over 3 cells along some axes and one along the others, [output][input][taps].
pub struct Weights<'w> {
    pub weights: &'w [f32],
    pub bias: &'w [f32],
    /// Neighbours that count along x, y, z: 0 or 1 on each side.
    pub reach: [usize; 3],
}

impl Tensor {
    pub fn zeros(channels: usize, n: [usize; 3]) -> Tensor {
        let row = n[2].next_multiple_of(LANES) + 2;
        Tensor { channels, n, row, values: vec![0.0; (n[0] + 2) * channels * (n[1] + 2) * row] }
    }

    fn slab(&self) -> usize {
        self.channels * (self.n[1] + 2) * self.row
    }

    /// The values of the row at x and y of a channel.
    pub fn along_z(&self, channel: usize, x: usize, y: usize) -> &[f32] {
        let from = (x + 1) * self.slab() + (channel * (self.n[1] + 2) + y + 1) * self.row + 1;
        &self.values[from..from + self.n[2]]
    }

    /// Sets rows in parallel: `fill(channel, x, y, row)`.
    pub fn fill(&mut self, fill: impl Fn(usize, usize, usize, &mut [f32]) + Sync) {
        let (row, ny, nz, nx) = (self.row, self.n[1], self.n[2], self.n[0]);
        let slab = self.slab();
        self.values.par_chunks_mut(slab).enumerate().skip(1).take(nx).for_each(|(x, values)| {
            for (channel, values) in values.chunks_mut((ny + 2) * row).enumerate() {
                for y in 0..ny {
                    fill(channel, x - 1, y, &mut values[(y + 1) * row + 1..][..nz]);
                }
            }
        });
    }

    /// Becomes the convolution of the channels of all `inputs` one after another. Returns, by channel, sums of its values and of their
    /// squares.
    pub fn convolve(&mut self, inputs: &[&Tensor], weights: &Weights<'_>) -> Vec<[f64; 2]> {
        let packed = packed(inputs, weights);
        let (slab, nx) = (self.slab(), self.n[0]);
        let mut values = std::mem::take(&mut self.values);
        let like = &*self;
        let sums: Vec<Vec<[f64; 2]>> = values
            .par_chunks_mut(slab)
            .skip(1)
            .take(nx)
            .enumerate()
            .map(|(x, to)| {
                let slab = Slab { inputs, packed: &packed, weights, like, x: x + 1, to };
                pulp::Arch::new().dispatch(slab)
            })
            .collect();
        self.values = values;
        let of = |channel: usize| {
            sums.iter().fold([0.0; 2], |[a, b], of| [a + of[channel][0], b + of[channel][1]])
        };
        (0..self.channels).map(of).collect()
    }

    /// Becomes the convolution of 2 x 2 x 2 cells of `fine` to one; weights [output][input][2][2][2].
    pub fn halve(&mut self, fine: &Tensor, weights: &[f32], bias: &[f32]) {
        self.fill(|output, x, y, row| {
            row.fill(bias[output]);
            for input in 0..fine.channels {
                for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let from = fine.along_z(input, 2 * x + i, 2 * y + j);
                    let at = (output * fine.channels + input) * 8 + 4 * i + 2 * j;
                    let [a, b] = [weights[at], weights[at + 1]];
                    wide(
                        #[inline(always)]
                        || {
                            for (to, pair) in row.iter_mut().zip(from.as_chunks::<2>().0) {
                                *to += a * pair[0] + b * pair[1];
                            }
                        },
                    );
                }
            }
        });
    }

    /// Becomes the transposed convolution of a cell of `coarse` to 2 x 2 x 2; weights [input][output][2][2][2].
    pub fn double(&mut self, coarse: &Tensor, weights: &[f32], bias: &[f32]) {
        self.fill(|output, x, y, row| {
            row.fill(bias[output]);
            for input in 0..coarse.channels {
                let at = (input * bias.len() + output) * 8 + 4 * (x % 2) + 2 * (y % 2);
                let [a, b] = [weights[at], weights[at + 1]];
                let from = coarse.along_z(input, x / 2, y / 2);
                wide(
                    #[inline(always)]
                    || {
                        for (pair, value) in row.as_chunks_mut::<2>().0.iter_mut().zip(from) {
                            pair[0] += a * value;
                            pair[1] += b * value;
                        }
                    },
                );
            }
        });
    }

    /// x sigmoid(x) of these channels, normalised in groups (Wu & He 2018) by their `sums` and scaled by weights; `with` is added in
    /// between.
    pub fn activate(
        &mut self,
        sums: &[[f64; 2]],
        groups: usize,
        [weight, bias]: [&[f32]; 2],
        with: Option<&Tensor>,
    ) {
        let each = self.channels / groups;
        let cells = self.n.iter().product::<usize>() as f64;
        let scales: Vec<[f32; 2]> = (0..self.channels)
            .map(|channel| {
                let of = &sums[channel / each * each..][..each];
                let [sum, squares] = of.iter().fold([0.0; 2], |[a, b], m| [a + m[0], b + m[1]]);
                let mean = sum / (cells * each as f64);
                let variance = (squares / (cells * each as f64) - mean * mean).max(0.0);
                let scale = f64::from(weight[channel]) / (variance + 1e-5).sqrt();
                [scale as f32, (f64::from(bias[channel]) - mean * scale) as f32]
            })
            .collect();
        self.fill(|channel, x, y, row| {
            let [scale, offset] = scales[channel];
            match with {
                None => wide(
                    #[inline(always)]
                    || row.iter_mut().for_each(|v| *v = silu(*v * scale + offset)),
                ),
                Some(with) => {
                    let with = with.along_z(channel, x, y);
                    wide(
                        #[inline(always)]
                        || row.iter_mut().zip(with).for_each(|(v, w)| *v = silu(*v * scale + offset + w)),
                    );
                }
            }
        });
    }
}

#[inline(always)]
fn sums(row: &[f32]) -> [f32; 2] {
    let mut all = [[0.0f32; 8]; 2];
    for eight in row.chunks(8) {
        for (k, v) in eight.iter().enumerate() {
            all[0][k] += v;
            all[1][k] += v * v;
        }
    }
    all.map(|of| of.iter().sum())
}

/// x sigmoid(x). The exponential is a polynomial, to five digits, that a compiler makes wide.
#[inline(always)]
pub fn silu(x: f32) -> f32 {
    let y = (-x * std::f32::consts::LOG2_E).clamp(-60.0, 60.0);
    // Rounded in the sum, whose last bits are the whole number: a conversion with its checks is not made wide.
    let rounded = y + 12_582_912.0;
    let f = y - (rounded - 12_582_912.0);
    let power = 1.0
        + f * (std::f32::consts::LN_2
            + f * (0.240_226_5 + f * (0.055_504_1 + f * (0.009_618_1 + f * 0.001_333_4))));
    let scale = f32::from_bits(rounded.to_bits().wrapping_add(127) << 23);
    x / (1.0 + power * scale)
}

/// Offsets of the taps that count, by [x][y][z].
fn taps(reach: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    let along = |k: usize| 1 - reach[k]..=1 + reach[k];
    let [xs, ys, zs] = [along(0), along(1), along(2)];
    xs.flat_map(move |i| {
        let zs = zs.clone();
        ys.clone().flat_map(move |j| zs.clone().map(move |k| [i, j, k]))
    })
}

const fn vectors<S: pulp::Simd>() -> usize {
    if S::F32_LANES == LANES { VECTORS } else { 2 }
}

/// Weights in the order of [`Slab::step`]: by group of outputs, input, tap; those of a group together.
fn packed(inputs: &[&Tensor], weights: &Weights<'_>) -> Vec<[f32; OUTPUTS]> {
    let outputs = weights.bias.len();
    let channels: usize = inputs.iter().map(|t| t.channels).sum();
    let each = taps(weights.reach).count();
    let mut all = vec![];
    for group in (0..outputs).step_by(OUTPUTS) {
        for input in 0..channels {
            for tap in 0..each {
                let of = |o: usize| {
                    let at = ((group + o) * channels + input) * each + tap;
                    if group + o < outputs { weights.weights[at] } else { 0.0 }
                };
                all.push(std::array::from_fn(of));
            }
        }
    }
    all
}

/// All outputs of a slab at `x`, counted from the rim.
struct Slab<'s> {
    inputs: &'s [&'s Tensor],
    packed: &'s [[f32; OUTPUTS]],
    weights: &'s Weights<'s>,
    like: &'s Tensor,
    x: usize,
    to: &'s mut [f32],
}

impl pulp::WithSimd for Slab<'_> {
    type Output = Vec<[f64; 2]>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, simd: S) -> Vec<[f64; 2]> {
        let [_, ny, nz] = self.like.n;
        let outputs = self.weights.bias.len();
        let deep = 2 * self.weights.reach[2] + 1;
        let mut rows = vec![];
        for input in self.inputs {
            for channel in 0..input.channels {
                for [i, j, _] in taps(self.weights.reach).step_by(deep) {
                    let row = channel * (ny + 2) + j;
                    rows.push(
                        &input.values[(self.x + i - 1) * input.slab() + row * input.row + 1 - deep / 2..],
                    );
                }
            }
        }
        for y in 0..ny {
            for z in (0..nz).step_by(vectors::<S>() * S::F32_LANES) {
                if S::F32_LANES == LANES {
                    for group in (0..outputs).step_by(OUTPUTS) {
                        self.some::<S, OUTPUTS>(simd, &rows, [y, z, group]);
                    }
                } else {
                    for group in (0..outputs).step_by(FEWER) {
                        self.some::<S, FEWER>(simd, &rows, [y, z, group]);
                    }
                }
            }
        }
        let mut all = Vec::with_capacity(outputs);
        for channel in self.to.chunks(self.like.row * (ny + 2)) {
            let mut of = [0.0; 2];
            for row in channel.chunks(self.like.row).skip(1).take(ny) {
                let [a, b] = sums(&row[1..=nz]);
                of = [of[0] + f64::from(a), of[1] + f64::from(b)];
            }
            all.push(of);
        }
        all
    }
}

impl Slab<'_> {
    /// Some outputs of as many vectors of a row as there are.
    #[inline(always)]
    fn some<S: pulp::Simd, const O: usize>(&mut self, simd: S, rows: &[&[f32]], at: [usize; 3]) {
        match ((self.like.n[2] - at[1]).div_ceil(S::F32_LANES).min(vectors::<S>()), self.weights.reach[2]) {
            (1, 0) => self.step::<S, 1, O, 1>(simd, rows, at),
            (2, 0) => self.step::<S, 2, O, 1>(simd, rows, at),
            (_, 0) => self.step::<S, VECTORS, O, 1>(simd, rows, at),
            (1, _) => self.step::<S, 1, O, 3>(simd, rows, at),
            (2, _) => self.step::<S, 2, O, 3>(simd, rows, at),
            _ => self.step::<S, VECTORS, O, 3>(simd, rows, at),
        }
    }

    /// V vectors of O outputs, which read D cells along z.
    #[inline(always)]
    fn step<S: pulp::Simd, const V: usize, const O: usize, const D: usize>(
        &mut self,
        simd: S,
        rows: &[&[f32]],
        [y, z, group]: [usize; 3],
    ) {
        let Slab { packed, weights, like: &Tensor { n: [_, ny, nz], row, .. }, .. } = *self;
        let packed = &packed[group / OUTPUTS * rows.len() * D..];
        let mut sums = [[simd.splat_f32s(0.0); V]; O];
        for (o, sums) in sums.iter_mut().enumerate() {
            *sums = [simd.splat_f32s(weights.bias.get(group + o).copied().unwrap_or(0.0)); V];
        }
        for (from, weights) in rows.iter().zip(packed.as_chunks::<D>().0) {
            let from = &from[y * row + z..][..V * S::F32_LANES + D - 1];
            for d in 0..D {
                let (of, _) = S::as_simd_f32s(&from[d..d + V * S::F32_LANES]);
                let of: &[S::f32s; V] = of.first_chunk().expect("some vectors");
                let weights: &[f32; O] = weights[d][group % OUTPUTS..].first_chunk().expect("outputs");
                for o in 0..O {
                    let weight = simd.splat_f32s(weights[o]);
                    for v in 0..V {
                        sums[o][v] = simd.mul_add_e_f32s(of[v], weight, sums[o][v]);
                    }
                }
            }
        }
        // Copied by constant indices alone, so that the sums above stay in registers.
        let mut made = [[simd.splat_f32s(0.0); V]; O];
        for o in 0..O {
            for v in 0..V {
                made[o][v] = sums[o][v];
            }
        }
        let count = (nz - z).min(V * S::F32_LANES);
        for (o, made) in made.iter().enumerate().take(weights.bias.len() - group) {
            let at = ((group + o) * (ny + 2) + y + 1) * row + 1 + z;
            self.to[at..at + count].copy_from_slice(&bytemuck::cast_slice(made)[..count]);
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    fn random(count: usize, seed: u64) -> Vec<f32> {
        let mut random = Pcg64::seed_from_u64(seed);
        (0..count).map(|_| random.random::<f32>() - 0.5).collect()
    }

    fn filled(channels: usize, n: [usize; 3], seed: u64) -> Tensor {
        let values = random(channels * n[0] * n[1] * n[2], seed);
        let mut tensor = Tensor::zeros(channels, n);
        tensor.fill(|c, x, y, row| {
            row.copy_from_slice(&values[((c * n[0] + x) * n[1] + y) * n[2]..][..n[2]]);
        });
        tensor
    }

    /// The value at a cell, 0 beyond the border.
    fn value(tensor: &Tensor, channel: usize, at: [isize; 3]) -> f64 {
        let is_in = (0..3).all(|k| (0..tensor.n[k] as isize).contains(&at[k]));
        let [x, y, z] = at.map(|v| v as usize);
        if is_in { f64::from(tensor.along_z(channel, x, y)[z]) } else { 0.0 }
    }

    #[test]
    fn a_convolution_is_the_sum_over_neighbours_and_channels() {
        for (n, reach, outputs) in
            [([3, 4, 30], [1, 1, 1], 5), ([4, 1, 12], [1, 0, 1], 4), ([2, 3, 7], [0; 3], 1)]
        {
            let (a, b) = (filled(2, n, 1), filled(3, n, 2));
            let each: Vec<[usize; 3]> = taps(reach).collect();
            let (weights, bias) = (random(outputs * 5 * each.len(), 3), random(outputs, 4));
            let mut made = Tensor::zeros(outputs, n);
            made.convolve(&[&a, &b], &Weights { weights: &weights, bias: &bias, reach });
            for (o, bias) in bias.iter().enumerate() {
                for cell in 0..n.iter().product() {
                    let at = [cell / (n[1] * n[2]), cell / n[2] % n[1], cell % n[2]].map(|v| v as isize);
                    let mut sum = f64::from(*bias);
                    for input in 0..5 {
                        for (tap, by) in each.iter().enumerate() {
                            let from: [isize; 3] = std::array::from_fn(|k| at[k] + by[k] as isize - 1);
                            let (tensor, channel) = if input < 2 { (&a, input) } else { (&b, input - 2) };
                            let weight = weights[(o * 5 + input) * each.len() + tap];
                            sum += f64::from(weight) * value(tensor, channel, from);
                        }
                    }
                    assert!((value(&made, o, at) - sum).abs() < 1e-5, "{n:?} {o} {at:?}");
                }
            }
        }
    }

    #[test]
    fn doubling_is_the_transpose_of_halving() {
        let (fine, coarse) = (filled(2, [4, 6, 8], 1), filled(3, [2, 3, 4], 2));
        let weights = random(3 * 2 * 8, 3);
        let (mut halved, mut doubled) = (Tensor::zeros(3, [2, 3, 4]), Tensor::zeros(2, [4, 6, 8]));
        halved.halve(&fine, &weights, &[0.0; 3]);
        doubled.double(&coarse, &weights, &[0.0; 2]);
        let product = |a: &Tensor, b: &Tensor| -> f64 {
            let rows = (0..a.channels)
                .flat_map(|c| (0..a.n[0]).flat_map(move |x| (0..a.n[1]).map(move |y| (c, x, y))));
            let of = |(c, x, y)| {
                a.along_z(c, x, y).iter().zip(b.along_z(c, x, y)).map(|(a, b)| f64::from(a * b)).sum::<f64>()
            };
            rows.map(of).sum()
        };
        let (one, other) = (product(&halved, &coarse), product(&fine, &doubled));
        assert!((one - other).abs() < 1e-4 && one.abs() > 1e-3, "{one} {other}");
        // One weight goes to one place.
        let mut one = vec![0.0; 8];
        one[5] = 1.0;
        let point = filled(1, [1, 1, 1], 5);
        let mut made = Tensor::zeros(1, [2; 3]);
        made.double(&point, &one, &[0.0]);
        assert_eq!(value(&made, 0, [1, 0, 1]), value(&point, 0, [0; 3]));
    }

    #[test]
    fn groups_have_no_mean_and_unit_variance_before_their_weights() {
        let tensor = filled(4, [3, 4, 9], 1);
        let with = filled(4, [3, 4, 9], 2);
        let (weight, bias) = (random(4, 3), random(4, 4));
        let mut made = Tensor::zeros(4, [3, 4, 9]);
        let same: Vec<f32> = (0..16).map(|i| if i % 5 == 0 { 1.0 } else { 0.0 }).collect();
        let sums = made.convolve(&[&tensor], &Weights { weights: &same, bias: &[0.0; 4], reach: [0; 3] });
        made.activate(&sums, 2, [&weight, &bias], Some(&with));
        let cells: Vec<[isize; 3]> = (0..108).map(|i| [i / 36, i / 9 % 4, i % 9].map(|v: isize| v)).collect();
        for channel in 0..4 {
            let of: Vec<f64> = (channel / 2 * 2..channel / 2 * 2 + 2)
                .flat_map(|c| cells.iter().map(|at| value(&tensor, c, *at)).collect::<Vec<_>>())
                .collect();
            let mean = of.iter().sum::<f64>() / of.len() as f64;
            let variance = of.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / of.len() as f64;
            for at in &cells {
                let x = (value(&tensor, channel, *at) - mean) / (variance + 1e-5).sqrt();
                let x =
                    x * f64::from(weight[channel]) + f64::from(bias[channel]) + value(&with, channel, *at);
                let expected = x / (1.0 + (-x).exp());
                assert!((value(&made, channel, *at) - expected).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn the_activation_has_five_digits() {
        for i in -4000..4000 {
            let x = f64::from(i) * 0.01;
            let expected = x / (1.0 + (-x).exp());
            let found = f64::from(silu(x as f32));
            assert!((found - expected).abs() < 2e-5 * (1.0 + expected.abs()), "{x}: {found}, {expected}");
        }
        assert!(silu(-1e6).abs() < 1e-6 && silu(1e6) == 1e6);
    }
}
