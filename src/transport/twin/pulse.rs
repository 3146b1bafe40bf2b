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
