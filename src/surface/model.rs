//! The model of a capture as the surface solver sees it.

use super::options::SurfaceOptions;
use crate::capture::{Background, Capture};
use crate::engine::variances;
use crate::transport::{Binning, Geometry, Grid, Model, Rows};

/// The model of a capture for `grid` without measured values, and the rows that they are taken by: of the pairs that a fit
/// takes, spread over the wall, and of those that are held out, if there are any.
pub(crate) fn outline_of(
    capture: &Capture,
    grid: &Grid,
    options: &SurfaceOptions,
    holds_out: bool,
) -> (Model, Rows) {
    let (mut model, mut rows) = of_all_pairs(capture, options);
    let held = if holds_out { held_out(&model) } else { 0 };
    if !options.general && (model.pairs() > SPREAD_ABOVE || held > 0) {
        rows.reorder(&model.spread());
        let used = model.enough(options.pairs + held);
        model.use_first(used);
        rows.keep_first(used);
        rows.reorder(&model.hold_out(held));
    }
    trim(&mut model, &mut rows, grid, options);
    (model, rows)
}

/// Bounds of the size of the hold-out set, pairs, and its reciprocal share between them: fewer pairs cannot separate models,
/// more only cost light.
const HELD_OUT: [usize; 2] = [16, 256];
const ONE_OF: usize = 8;

/// Number of pairs to hold out. It depends on the scan alone: pairs that one fit of a capture holds out are in no other. None of
/// a few pairs, or where sums over spots mix pairs.
fn held_out(model: &Model) -> usize {
    let (pairs, others) = (model.pairs(), model.wall.others.len());
    let several = model.wall.geometry == Geometry::Product && others > 1;
    match several {
        _ if model.rendered.is_some() || pairs < 2 * HELD_OUT[0] => 0,
        true if others < 4 => 0,
        true => (others / ONE_OF).max(1) * model.wall.scanned.len(),
        false => (pairs / ONE_OF).clamp(HELD_OUT[0], HELD_OUT[1]),
    }
}

/// Leaves out the bins that no voxel of `grid` reaches.
fn trim(model: &mut Model, rows: &mut Rows, grid: &Grid, options: &SurfaceOptions) {
    if !options.general {
        rows.crop(model.trim(grid));
    }
}

fn of_all_pairs(capture: &Capture, options: &SurfaceOptions) -> (Model, Rows) {
    let (model, rows) = Model::outline(capture, options.reflectance, PEAK, options.general);
    let model = Model {
        min_depth: options.min_depth,
        binning: Binning::Linear,
        high_pass: options.filter(),
        ..model
    };
    (model, rows)
}

/// Fewer pairs are one batch, in their order.
const SPREAD_ABOVE: usize = 256;

/// Largest measured value after scaling.
const PEAK: f64 = 10.0;

/// The model of all pairs in their order, with the counts of the capture, less their background, and their noise.
#[cfg(test)]
pub(crate) fn model(capture: &Capture, grid: &Grid, options: &SurfaceOptions) -> Model {
    let (mut model, mut rows) = of_all_pairs(capture, options);
    trim(&mut model, &mut rows, grid, options);
    if !capture.histograms.is_empty() {
        take(capture, options, &rows, &mut model);
    }
    model
}

/// Takes the counts of a capture, less their background, and estimates their noise.
pub(super) fn take(capture: &Capture, options: &SurfaceOptions, rows: &Rows, model: &mut Model) {
    let background = Background::of(capture, options.background);
    let [per_count, empty] = variances(capture, background.level);
    model.take(rows, capture, &background);
    let scale = 1.0 / model.counts_per_unit;
    model.variance = [per_count * scale, empty * scale * scale];
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::default_volume;
    use crate::engine::noise::tests::counts;

    #[test]
    fn the_model_has_the_noise_in_its_own_units() {
        let capture = counts(500.0, 4.0, 90.0, 8);
        // General, so that all bins stay.
        let o = SurfaceOptions::default().with(|o| o.general = true);
        let grid = Grid::new(default_volume(&capture, 0.2).unwrap(), 16, capture.bin_width).unwrap();
        let of = |o: &SurfaceOptions| model(&capture, &grid, o);
        let noisy = of(&o);
        let scale = 1.0 / noisy.counts_per_unit;
        // A bin of n counts has the variance n, whatever was subtracted; so has a bin with background only.
        for (counts, value) in capture.histograms.iter().zip(&noisy.measured).step_by(37) {
            let variance = noisy.variance[0] * f64::from(*value) + noisy.variance[1];
            let want = f64::from(*counts) * scale * scale;
            assert!((variance - want).abs() < 1e-6 * scale, "{counts} counts: {variance}, not {want}");
        }
        let dark: f64 = noisy.measured.chunks(256).map(|h| f64::from(h[250])).sum::<f64>() / 256.0;
        assert!(dark.abs() < 0.15 * 4.0 * scale, "the background is subtracted: {dark}");
        let kept = of(&o.with(|o| o.background = false));
        assert!(kept.measured.iter().all(|m| *m >= 0.0) && kept.variance[1] == 0.0);
    }
}
