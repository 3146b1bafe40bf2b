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

/// Histograms of rendered pairs as sums over the measured pairs' spots, or back; unchanged where spots are points.
pub fn spot(twin: &Twin, values: &[f64], way: Way) -> Vec<f64> {
    let Some(rendered) = &twin.model.rendered else { return values.to_vec() };
    let stages = if way == Way::Spread { rendered.stages.clone() } else { rendered.back() };
    stages.iter().fold(values.to_vec(), |v, stage| stage.through(&v, twin.model.bins))
}

/// From rendered paths to the histograms that are measured, through spot and pulse; or back, through both in reverse.
pub fn instrument(twin: &Twin, values: &[f64], way: Way) -> Vec<f64> {
    match way {
        Way::Spread => pulse(twin, &spot(twin, values, way), way),
        Way::Back => spot(twin, &pulse(twin, values, way), way),
    }
}
