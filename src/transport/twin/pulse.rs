use super::Twin;

/// Which way through the instrument.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// From sharp paths to what histograms show.
    Spread,
    /// The adjoint: from a residual of the histograms to the paths.
    Back,
    /// The same for variances: with the taps' squares.
    Squared,
}

/// Histograms `[pair * bins + bin]` through the model's pulse; what leaves the bins is lost. The same without a pulse.
pub fn pulse(twin: &Twin, values: &[f64], way: Way) -> Vec<f64> {
    let Some(taps) = &twin.model.pulse else { return values.to_vec() };
    let bins = twin.model.bins;
    let at = |histogram: &[f64], bin: usize, tap: usize| {
        let from = match way {
            Way::Spread => (bin + taps.before).checked_sub(tap),
            Way::Back | Way::Squared => (bin + tap).checked_sub(taps.before),
        };
        from.and_then(|from| histogram.get(from)).copied().unwrap_or(0.0)
    };
    let weight = |w: f64| if way == Way::Squared { w * w } else { w };
    let of_bin = |histogram: &[f64], bin: usize| -> f64 {
        taps.weights.iter().enumerate().map(|(i, w)| weight(*w) * at(histogram, bin, i)).sum()
    };
    values.chunks(bins).flat_map(|h| (0..bins).map(move |bin| of_bin(h, bin))).collect()
}
