use rayon::prelude::*;

use super::shared::*;
use super::weight::bin_weights;
use super::{Call, Cells, Real};

/// Neighbouring cells, each of another sum.
const LANES: usize = WORKGROUP as usize;
/// Cells of a task.
const TILE: usize = LANES * RESIDUAL_BINS as usize;

/// Compares rendered histograms with the measurement: dLoss / d(accumulated value) of every bin, and the partial sums of
/// weighted and plain squared differences, one of each task.
pub fn residual<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: counts u, measured f, residual f, histograms f, loss_partials v2, noise_state v3, spread f);
    let comparison = CellComparison::of(call, measured, noise_state);
    let spread = call.is("SEEN").then_some(&*spread);
    let clears = !call.is("SPOT");
    let cells = call.cells();
    let tiles = residual[..cells].par_chunks_mut(TILE).zip(loss_partials.par_iter_mut()).enumerate();
    let run = |tile: usize, residual: &mut [F], partial: &mut [F; 2], histograms: &mut [F]| {
        let accumulated = spread.map_or(&*histograms, |spread| &spread[tile * TILE..][..residual.len()]);
        let mut sums = [[F::zero(); LANES]; 3];
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || comparison.tile(tile * TILE, accumulated, residual, &mut sums),
        );
        histograms.fill(F::zero());
        let [weighted, plain, magnitude] = sums;
        *partial = [weighted.into_iter().sum(), plain.into_iter().sum()];
        let fault = |lane: usize| match magnitude[lane].is_finite() {
            false => FAULT_FORWARD,
            true if !(weighted[lane] + plain[lane]).is_finite() => FAULT_RESIDUAL,
            true => 0,
        };
        (0..LANES).fold(0, |faults, lane| faults | fault(lane))
    };
    let all = |a: u32, b: u32| a | b;
    counts[COUNT_FAULTS as usize] |= if clears {
        let tiles = tiles.zip(histograms[..cells].par_chunks_mut(TILE));
        tiles.map(|((tile, (residual, partial)), histograms)| run(tile, residual, partial, histograms)).reduce(|| 0, all)
    } else {
        // Through spots other pairs are rendered than measured ones: their histograms may be fewer.
        tiles.map(|(tile, (residual, partial))| run(tile, residual, partial, &mut [])).reduce(|| 0, all)
    };
}

/// How cells are compared.
struct CellComparison<'m, F> {
    pairs: usize,
    stride: usize,
    bins: usize,
    measured: &'m [F],
    /// By bin.
    weights: Vec<F>,
    /// Rendered value per accumulated value, and dLoss / d(accumulated value) per weighted difference.
    render: F,
    slope: F,
    noise: Option<NoiseTerms<'m, F>>,
}

/// The noise term.
struct NoiseTerms<'m, F> {
    state: &'m [[F; 3]],
    by_bin: bool,
    base: F,
    span: F,
}

impl<'m, F: Real> CellComparison<'m, F> {
    fn of(call: &Call<'_>, measured: &'m [F], state: &'m [[F; 3]]) -> CellComparison<'m, F> {
        let render = F::from32(call.scene.render_scale);
        let [base, span] = [call.paper.noise_base, call.paper.noise_span].map(F::from32);
        let noise = call.constant("NOISE", 0);
        CellComparison {
            pairs: call.scene.pairs as usize,
            stride: call.stride(),
            bins: call.bins(),
            measured,
            weights: if call.is("WEIGHTED") { bin_weights(call) } else { vec![F::one(); call.bins()] },
            render,
            slope: F::of(2.0) * F::from32(call.scene.loss_scale) * render,
            noise: (noise != 0).then_some(NoiseTerms { state, by_bin: noise == 1, base, span }),
        }
    }

    /// Compares the cells of a tile from `first` on, and adds to the sums of its lanes: weighted and plain squared differences,
    /// and magnitudes.
    #[inline(always)]
    fn tile(&self, first: usize, accumulated: &[F], residual: &mut [F], sums: &mut [[F; LANES]; 3]) {
        let (mut pair, mut at) = (first / self.stride, first % self.stride);
        let mut begin = 0;
        while begin < residual.len() {
            // To the next bin of the row, end of the row or cell of the first lane, whichever is nearest.
            let lane = begin % LANES;
            let bin = at.checked_sub(PADDING as usize);
            let length = bin.map_or_else(|| PADDING as usize - at, |_| self.stride - at).min(LANES - lane);
            let length = length.min(residual.len() - begin);
            let out = &mut residual[begin..][..length];
            match bin.filter(|_| pair < self.pairs) {
                Some(bin) => {
                    let [a, b, c] = sums.each_mut().map(|sums| &mut sums[lane..][..length]);
                    self.run(pair, bin, &accumulated[begin..][..length], out, [a, b, c]);
                }
                None => out.fill(F::zero()),
            }
            (begin, at) = (begin + length, at + length);
            if at == self.stride {
                (pair, at) = (pair + 1, 0);
            }
        }
    }

    /// Compares neighbouring bins of a pair.
    #[inline(always)]
    fn run(&self, pair: usize, bin: usize, accumulated: &[F], out: &mut [F], sums: [&mut [F]; 3]) {
        let length = out.len();
        let mut values = [F::zero(); LANES];
        values.iter_mut().zip(accumulated).for_each(|(value, sum)| *value = *sum * self.render);
        let mut opens = [F::one(); LANES];
        if let Some(noise) = &self.noise {
            for i in 0..length {
                let [w, ..] = noise.state[if noise.by_bin { pair * self.bins + bin + i } else { pair }];
                let value = values[i] + noise.base + noise.span / (F::one() + (-w).exp());
                opens[i] = if value > F::zero() { F::one() } else { F::zero() };
                values[i] = value.at_least(F::zero());
            }
        }
        let measured = &self.measured[pair * self.bins + bin..][..length];
        let weights = &self.weights[bin..][..length];
        let [weighted, plain, magnitude] = sums.map(|sums| &mut sums[..length]);
        for i in 0..length {
            let difference = values[i] - measured[i];
            out[i] = self.slope * opens[i] * weights[i] * difference;
            weighted[i] = weighted[i] + weights[i] * difference * difference;
            plain[i] = plain[i] + difference * difference;
            magnitude[i] = magnitude[i] + values[i].abs();
        }
    }
}
