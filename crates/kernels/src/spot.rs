use rayon::prelude::*;

use super::shared::PADDING;
use super::{Call, Cells, Real};

/// Histograms as sums over the spots of the instrument, by the table from word `push.first` of `spot_taps`. A sum is one task.
pub fn spot<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: _counts any, source f, spot_taps u, target f);
    let table = &spot_taps[call.push.first as usize..];
    let [rows, columns, inner] = [0, 1, 2].map(|i| table[i] as usize);
    let (offsets, entries) = (&table[3..], table[3 + rows + 1..].as_chunks::<2>().0);
    let (before, sums) = target[..call.cells_of(call.push.last as usize)].split_at_mut(PADDING as usize);
    before.fill(F::zero());
    sums.par_chunks_mut(call.stride()).enumerate().for_each(|(sum, target)| {
        let (row, first) = (sum / inner % rows, sum / inner / rows * columns);
        let entries = &entries[offsets[row] as usize..offsets[row + 1] as usize];
        target.fill(F::zero());
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || {
                for [column, weight] in entries {
                    let from = call.row((first + *column as usize) * inner + sum % inner);
                    let weight = F::from32(f32::from_bits(*weight));
                    let bins = target.iter_mut().zip(&source[from..][..call.bins()]);
                    bins.for_each(|(sum, v)| *sum = *sum + weight * *v);
                }
            },
        );
    });
}
