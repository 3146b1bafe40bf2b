use rayon::prelude::*;

use super::shared::PADDING;
use super::{Call, Cells, Real};

/// Cells that are computed together.
const CELLS: usize = 64;

/// Histograms through the impulse response, or back. Light outside the bins is lost. A row is one task.
pub fn pulse<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: _counts any, source f, pulse_taps f, spread f);
    let (bins, stride, first) = (call.bins(), call.stride(), PADDING as usize);
    let [before, count] = [0, 1].map(|i| pulse_taps[i].wide() as usize);
    let taps: Vec<F> = match call.is("BACK") {
        true => pulse_taps[2..][..count].to_vec(),
        false => pulse_taps[2..][..count].iter().rev().copied().collect(),
    };
    // Bins before a cell from which the first tap reads.
    let early = if call.is("BACK") { before } else { count.saturating_sub(1 + before) };
    // The first tap may be after the cell itself.
    let shift = if call.is("BACK") { 0 } else { (before + 1).saturating_sub(count) };
    spread[..first].fill(F::zero());
    let rows = spread[first..call.cells()].par_chunks_mut(stride).zip(source[first..].par_chunks(stride));
    let scratch = || vec![F::zero(); early + shift + bins.next_multiple_of(CELLS) + count];
    rows.for_each_init(scratch, |padded, (to, from)| {
        padded[early..early + bins].copy_from_slice(&from[..bins]);
        let (own, padding) = to.split_at_mut(bins);
        padding.fill(F::zero());
        pulp::Arch::new().dispatch(Convolve { taps: &taps, padded: &padded[shift..], to: own });
    });
}

/// `to[i]`: the sum of taps times `padded[i..]`.
struct Convolve<'c, F> {
    taps: &'c [F],
    padded: &'c [F],
    to: &'c mut [F],
}

impl<F: Real> pulp::WithSimd for Convolve<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Convolve { taps, padded, to } = self;
        for (i, to) in to.chunks_mut(CELLS).enumerate() {
            let mut sums = [F::zero(); CELLS];
            for (k, tap) in taps.iter().enumerate() {
                let from = &padded[i * CELLS + k..][..CELLS];
                for (sum, value) in sums.iter_mut().zip(from) {
                    *sum = *sum + *tap * *value;
                }
            }
            to.copy_from_slice(&sums[..to.len()]);
        }
    }
}
