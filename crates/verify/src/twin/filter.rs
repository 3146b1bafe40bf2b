use super::{Call, Cells};

/// Weighted histograms, filtered along time. `hat_taps`: the radius, then the weights at 0, 1, 2, ... bins to either side;
/// a radius below zero: those of earlier bins are the negatives of those of later ones.
pub fn filter(call: &Call, b: &mut [Cells]) {
    bind!(b: measured f, hat_taps f, residual f);
    let m = call.twin.model;
    let (radius, hat) = (hat_taps[0].abs() as usize, &hat_taps[1..]);
    for (cell, out) in residual.iter_mut().enumerate().take(call.cells()) {
        *out = call.bin_of(cell).map_or(0.0, |(pair, bin)| {
            let side = |b: usize| if hat_taps[0] < 0.0 && b < bin { -1.0 } else { 1.0 };
            let value = |b: usize| side(b) * hat[b.abs_diff(bin)] * m.bin_weight(b) * measured[pair * m.bins + b];
            (bin.saturating_sub(radius)..(bin + radius + 1).min(m.bins)).map(value).sum()
        });
    }
}
