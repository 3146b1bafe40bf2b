use super::shared::PADDING;
use super::{Call, Cells, Real};

/// The cells of paths in a pair's row: bin 0 is cell [`PADDING`], and the ends of a row belong to no bin. What is not a
/// number is in the first cell. Paths are metres, in a confocal scan half of the length; with `FINE` grains.
pub fn places<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: source f, target u);
    let s = &call.scene;
    let there_and_back = if call.constant("GEOMETRY", 0) == 0 { 2.0 } else { 1.0 };
    let unit = if call.is("FINE") { 1.0 } else { there_and_back / f64::from(s.grain) };
    let per_grain = f64::from(s.bins_per_grain) + f64::from(s.bins_per_grain_rest);
    let before = f64::from(s.start_bins) + f64::from(s.start_bins_rest);
    for (path, cell) in source.iter().zip(target).take(call.push.last as usize) {
        let bins = unit * path.wide() * per_grain - before + f64::from(PADDING);
        // `max` ignores NaN.
        *cell = bins.floor().max(0.0).min(f64::from(s.stride) + 1.0) as u32;
    }
}
