//! Arrays of the network: channels of a volume with a rim of zeros, and the operations that it consists of.

use rayon::prelude::*;

use super::sizes::wide;

/// Vectors along z and output channels of a step of [`Tensor::convolved`]: with inputs and a weight they fill sixteen registers.
const VECTORS: usize = 3;
const OUTPUTS: usize = 4;
/// Cells along z of a step in the widest vectors, of sixteen.
const BLOCK: usize = 16 * VECTORS;

/// Channels of a volume of n cells, [x + 1][channel][y + 1][z + 1]: a slab along x lies together, and a rim of zeros is around
/// all cells.
#[derive(Clone)]
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
        let row = n[2].next_multiple_of(BLOCK) + 2;
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

    /// The convolution of the channels of all `inputs` one after another.
    pub fn convolved(inputs: &[&Tensor], weights: &Weights<'_>) -> Tensor {
        let outputs = weights.bias.len();
        let mut to = Tensor::zeros(outputs, inputs[0].n);
        let packed = packed(inputs, weights);
        let (slab, nx) = (to.slab(), to.n[0]);
        let like = Tensor { values: vec![], ..to };
        to.values.par_chunks_mut(slab).enumerate().skip(1).take(nx).for_each(|(x, values)| {
            let slab = Slab { inputs, packed: &packed, weights, like: &like, x, to: values };
            pulp::Arch::new().dispatch(slab);
        });
        Tensor { values: to.values, ..like }
    }

    /// Convolution of 2 x 2 x 2 cells to one; weights [output][input][2][2][2].
    pub fn halved(&self, weights: &[f32], bias: &[f32]) -> Tensor {
        let mut to = Tensor::zeros(bias.len(), self.n.map(|n| n / 2));
        to.fill(|output, x, y, row| {
            row.fill(bias[output]);
            for input in 0..self.channels {
                for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let from = self.along_z(input, 2 * x + i, 2 * y + j);
                    let at = (output * self.channels + input) * 8 + 4 * i + 2 * j;
                    for (to, pair) in row.iter_mut().zip(from.chunks_exact(2)) {
                        *to += weights[at] * pair[0] + weights[at + 1] * pair[1];
                    }
                }
            }
        });
        to
    }

    /// Transposed convolution of a cell to 2 x 2 x 2; weights [input][output][2][2][2].
    pub fn doubled(&self, weights: &[f32], bias: &[f32]) -> Tensor {
        let mut to = Tensor::zeros(bias.len(), self.n.map(|n| 2 * n));
        to.fill(|output, x, y, row| {
            row.fill(bias[output]);
            for input in 0..self.channels {
                let at = (input * bias.len() + output) * 8 + 4 * (x % 2) + 2 * (y % 2);
                let from = self.along_z(input, x / 2, y / 2);
                for (pair, value) in row.chunks_exact_mut(2).zip(from) {
                    pair[0] += weights[at] * value;
                    pair[1] += weights[at + 1] * value;
                }
            }
        });
        to
    }

    /// x sigmoid(x) of these channels, normalised in groups (Wu & He 2018) and scaled by weights; `with` is added in between.
    pub fn activated(mut self, groups: usize, weight: &[f32], bias: &[f32], with: Option<&Tensor>) -> Tensor {
        let each = self.channels / groups;
        let cells = self.n.iter().product::<usize>() as f64;
        let moments: Vec<[f64; 2]> = (0..self.channels)
            .into_par_iter()
            .map(|channel| {
                let rows = (0..self.n[0]).flat_map(|x| (0..self.n[1]).map(move |y| (x, y)));
                rows.fold([0.0; 2], |[sum, squares], (x, y)| {
                    let row = self.along_z(channel, x, y);
                    let [a, b] = wide(
                        #[inline(always)]
                        || sums(row),
                    );
                    [sum + f64::from(a), squares + f64::from(b)]
                })
            })
            .collect();
        let scales: Vec<[f32; 2]> = (0..self.channels)
            .map(|channel| {
                let of = &moments[channel / each * each..][..each];
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
        self
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

/// Weights in the order of [`slab_of`]: by group of outputs, input, tap; those of a group together.
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
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Slab { inputs, packed, weights, like: &Tensor { n: [_, ny, nz], row, .. }, x, to } = self;
        let [each, deep] = [taps(weights.reach).count(), 2 * weights.reach[2] + 1];
        let lines: Vec<[usize; 2]> =
            taps(weights.reach).step_by(deep).map(|[i, j, _]| [x + i - 1, j]).collect();
        let channels: usize = inputs.iter().map(|t| t.channels).sum();
        let block = VECTORS * S::F32_LANES;
        for y in 1..=ny {
            for z in (0..nz).step_by(block) {
                for group in (0..weights.bias.len()).step_by(OUTPUTS) {
                    let bias = |o: usize| weights.bias.get(group + o).copied().unwrap_or(0.0);
                    let mut sums: [[S::f32s; VECTORS]; OUTPUTS] =
                        std::array::from_fn(|o| [simd.splat_f32s(bias(o)); VECTORS]);
                    let mut next = group / OUTPUTS * channels * each;
                    for input in inputs {
                        for channel in 0..input.channels {
                            for [x, j] in &lines {
                                let at = x * input.slab() + (channel * (ny + 2) + y + j - 1) * row + z;
                                let from = &input.values[at + 1 - weights.reach[2]..][..block + deep - 1];
                                for (tap, weights) in packed[next..next + deep].iter().enumerate() {
                                    let (of, _) = S::as_simd_f32s(&from[tap..tap + block]);
                                    let of: [S::f32s; VECTORS] = std::array::from_fn(|v| of[v]);
                                    for (sums, weight) in sums.iter_mut().zip(weights) {
                                        let weight = simd.splat_f32s(*weight);
                                        for (sum, of) in sums.iter_mut().zip(of) {
                                            *sum = simd.mul_add_e_f32s(of, weight, *sum);
                                        }
                                    }
                                }
                                next += deep;
                            }
                        }
                    }
                    for (o, sums) in sums.iter().enumerate().take(weights.bias.len() - group) {
                        let at = ((group + o) * (ny + 2) + y) * row + 1 + z;
                        for (v, sum) in sums.iter().enumerate() {
                            let from = v * S::F32_LANES;
                            let to = &mut to[at + from..at + block.min(nz - z).max(from)];
                            simd.partial_store_f32s(to, *sum);
                        }
                    }
                }
            }
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
            let made = Tensor::convolved(&[&a, &b], &Weights { weights: &weights, bias: &bias, reach });
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
        let halved = fine.halved(&weights, &[0.0; 3]);
        let doubled = coarse.doubled(&weights, &[0.0; 2]);
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
        let made = point.doubled(&one, &[0.0]);
        assert_eq!(value(&made, 0, [1, 0, 1]), value(&point, 0, [0; 3]));
    }

    #[test]
    fn groups_have_no_mean_and_unit_variance_before_their_weights() {
        let tensor = filled(4, [3, 4, 9], 1);
        let with = filled(4, [3, 4, 9], 2);
        let (weight, bias) = (random(4, 3), random(4, 4));
        let made = tensor.clone().activated(2, &weight, &bias, Some(&with));
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
