use super::Twin;
pub use crate::capture::pulse::Way;

/// Histograms `[pair * bins + bin]` through the model's pulse, or unchanged without one. Light outside the bins is
/// lost.
pub fn pulse(twin: &Twin, values: &[f64], way: Way) -> Vec<f64> {
    match &twin.model.pulse {
        Some(taps) => values.chunks(twin.model.bins).flat_map(|h| taps.through(h, way)).collect(),
        None => values.to_vec(),
    }
}

/// Every `sum` neighbouring bins of histograms of `bins` bins as one. Bins at the end that do not fill one are left out.
pub fn sum_bins(values: &[f32], bins: usize, sum: usize) -> Vec<f64> {
    let wide = |h: &[f32]| -> Vec<f64> {
        h.chunks_exact(sum).map(|narrow| narrow.iter().map(|v| f64::from(*v)).sum()).collect()
    };
    values.chunks_exact(bins).flat_map(wide).collect()
}
