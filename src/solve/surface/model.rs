//! The model of a capture as the surface solver sees it.

use super::SurfaceOptions;
use crate::capture::{Background, Capture};
use crate::solve::estimate::variances;
use crate::transport::{Binning, Gradient, Grid, Model, Rows, Sampling};

/// The model of a capture for `grid` without measured values, and the rows that they are taken by: of the pairs that a fit
/// takes, spread over the wall.
pub(crate) fn outline_of(capture: &Capture, grid: &Grid, options: &SurfaceOptions) -> (Model, Rows) {
    let (mut model, mut rows) = of_all_pairs(capture, options);
    if !options.general && model.pairs() > SPREAD_ABOVE {
        rows.reorder(&model.spread());
        let used = model.enough(options.pairs);
        model.use_first(used);
        rows.keep_first(used);
    }
    trim(&mut model, &mut rows, grid, options);
    (model, rows)
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
        sampling: Sampling::Fixed,
        binning: Binning::Linear,
        gradient: Gradient::Exact,
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
