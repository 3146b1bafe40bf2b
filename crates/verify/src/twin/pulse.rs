use super::{Call, Cells};
use thirdbounce::transport::kernels::constant;

/// Histograms through the pulse, or back. Light outside the bins is lost.
pub fn pulse(call: &Call, b: &mut [Cells]) {
    bind!(b: _counts any, source f, pulse_taps f, spread f);
    let back = call.constant(constant::BACK, 0) != 0;
    let (before, taps) = (pulse_taps[0] as usize, &pulse_taps[2..][..pulse_taps[1] as usize]);
    for (cell, out) in spread.iter_mut().enumerate().take(call.cells()) {
        *out = call.bin_of(cell).map_or(0.0, |(pair, bin)| {
            let from = |i: usize| if back { (bin + i).checked_sub(before) } else { (bin + before).checked_sub(i) };
            let inside = |i: usize| from(i).filter(|from| *from < call.twin.model.bins);
            let value = |i: usize| inside(i).map_or(0.0, |from| source[call.row(pair) + from]);
            taps.iter().enumerate().map(|(i, tap)| tap * value(i)).sum()
        });
    }
}
