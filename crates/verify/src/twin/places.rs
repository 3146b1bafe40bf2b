use super::{Call, Cells};
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::{Binning, Geometry};

/// The cells of paths in a pair's row: bin 0 is cell [`PADDING`], and the ends of a row belong to no bin. What is not a
/// number is in the first cell.
pub fn places(call: &Call, b: &mut [Cells]) {
    bind!(b: source f, target u);
    let m = call.twin.model;
    let unit = match call.constant(constant::FINE, 0) {
        0 if m.wall.geometry == Geometry::Confocal => 2.0,
        0 => 1.0,
        _ => f64::from(call.scene.grain),
    };
    let first = f64::from(PADDING) - if m.binning == Binning::Linear { 0.5 } else { 0.0 };
    let last = m.stride() as f64 + 1.0;
    for (path, cell) in source.iter().zip(target).take(call.push.last as usize) {
        // `max` ignores NaN.
        *cell = ((unit * path - m.t_start) / m.bin_width + first).floor().max(0.0).min(last) as u32;
    }
}
