//! Metrics of maps against truth, at the truth's resolution.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::maps::{Layer, Maps, Truth};
use crate::measure::albedo::Albedos;
use crate::measure::paper::{Mean, Sums};
use crate::measure::{ErrorCoverage, PaperMeasure, missing};

/// Mask fractions of `sweep`.
pub const SWEEP: [f64; 14] = [0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8];

/// Metrics of a reconstruction against truth. Lengths in metres, angles in degrees.
///
/// *Predicted* pixels have an albedo above `fraction` of the map's 99.9th percentile and a known depth. *Hit* pixels
/// are predicted and in the true mask. A metric over no pixels is `None` (null in JSON), never 0 or NaN.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// Mask fraction: share of the albedo's 99.9th percentile. `None`: the maps' own mask.
    pub fraction: Option<f64>,
    /// Predicted pixels of the truth's grid.
    pub predicted_pixels: usize,
    /// Pixels of the true mask.
    pub true_pixels: usize,
    /// Hit pixels: predicted and true.
    pub hit_pixels: usize,
    /// |predicted ∩ mask| / |mask|; `None` if the mask is empty.
    pub completeness: Option<f64>,
    /// |predicted ∩ mask| / |predicted ∪ mask|; `None` if both are empty.
    pub iou: Option<f64>,
    /// Mean absolute error of depth over the hit pixels.
    pub depth_mae: Option<f64>,
    /// Root mean square error of depth over the hit pixels.
    pub depth_rmse: Option<f64>,
    /// Mean absolute error of depth over the whole mask; missing pixels have depth 0.
    pub depth_mae_whole: Option<f64>,
    /// Root mean square error of depth over the whole mask; missing pixels have depth 0.
    pub depth_rmse_whole: Option<f64>,
    /// Mean absolute error of depth over the whole mask; missing pixels have the largest true depth, the far limit.
    #[serde(default)]
    pub depth_mae_far: Option<f64>,
    /// Mean absolute error of depth over the whole mask; missing pixels have the depth of the nearest predicted pixel.
    #[serde(default)]
    pub depth_mae_nearest: Option<f64>,
    /// Mean angle between true and estimated normals over the hit pixels with a normal.
    pub normal_error_deg: Option<f64>,
    /// Mean absolute error of the normals' components, over the same pixels.
    pub normal_mae: Option<f64>,
    /// Standard deviation over mean of albedos where the true one is the same, over the hit pixels. `None`, and absent from the JSON,
    /// where true albedos are not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub albedo_spread: Option<f64>,
    /// By which share the ratio of the albedos of the two commonest tones is off; absent from the JSON with one tone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub albedo_ratio_error: Option<f64>,
    /// The measure that fits the paper's table best.
    #[serde(default)]
    pub paper: PaperMeasure,
    /// Best IoU over all mask fractions below 1, an upper bound that requires the truth.
    pub best_iou: Option<f64>,
    /// The fraction of `best_iou`.
    pub best_fraction: Option<f64>,
    /// Metrics at `best_fraction`, for comparing methods whose albedos fall off differently: at a fixed fraction the
    /// errors of one method cover the whole surface, those of another its bright part.
    #[serde(default)]
    pub at_best: Option<AtBest>,
    /// Share of the hit pixels whose depth error is within the expected error: 0.68 if errors are as expected. `None`, and absent
    /// from the JSON, without expected errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within_depth_error: Option<f64>,
    /// The same by quarters of the hit pixels, from most to least certain: (median expected error, share within);
    /// absent from the JSON if empty.
    #[serde(default, rename = "calibration", skip_serializing_if = "Vec::is_empty")]
    pub coverage: Vec<[f64; 2]>,
    /// Metrics of both layers, if the truth has two; else empty and absent from the JSON.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<LayerMetrics>,
    /// (fraction, IoU) over [`SWEEP`]; absent from the JSON if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sweep: Vec<[f64; 2]>,
}

/// Metrics over the hit pixels of the mask with the best IoU.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct AtBest {
    /// Hit pixels: predicted and true.
    pub hit_pixels: usize,
    /// |predicted ∩ mask| / |mask|.
    pub completeness: Option<f64>,
    /// Mean absolute error of depth.
    pub depth_mae: Option<f64>,
    /// Root mean square error of depth.
    pub depth_rmse: Option<f64>,
    /// Mean angle between true and estimated normals.
    pub normal_error_deg: Option<f64>,
}

/// Metrics of one layer against the same layer of the truth, at the common mask fraction.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct LayerMetrics {
    /// Pixels of the true mask.
    pub true_pixels: usize,
    /// Hit pixels: predicted and true.
    pub hit_pixels: usize,
    /// |predicted ∩ mask| / |mask|.
    pub completeness: Option<f64>,
    /// |predicted ∩ mask| / |predicted ∪ mask|.
    pub iou: Option<f64>,
    /// Mean absolute error of depth over the hit pixels.
    pub depth_mae: Option<f64>,
    /// Mean angle between true and estimated normals over the hit pixels with a normal.
    pub normal_error_deg: Option<f64>,
}

impl Metrics {
    /// The metrics without sweep and coverage, for one line of a trace.
    pub fn brief(mut self) -> Metrics {
        self.sweep.clear();
        self.coverage.clear();
        self
    }
}

/// Measures maps against truth. Each pixel of the truth reads the maps' cell that contains its centre. The extents
/// may differ: pixels outside the maps are not predicted, cells outside the truth ignored. Surface is where the
/// albedo exceeds `fraction` of its 99.9th percentile, or the maps' mask without a fraction.
///
/// # Errors
/// `Kind::Options` unless `fraction` is in [0, 1); `Kind::Input` if arrays and sizes do not agree.
pub fn metrics(maps: &Maps, truth: &Truth, fraction: impl Into<Option<f64>>) -> Result<Metrics> {
    let fraction = fraction.into();
    if let Some(fraction) = fraction.filter(|f| !(0.0..1.0).contains(f)) {
        return Err(Error::options(
            format!("a mask fraction of {fraction}"),
            format!("give a fraction of the brightest albedo from 0 to 1, usually {}", Maps::MASK_FRACTION),
        ));
    }
    maps.check().map_err(|e| e.at("maps"))?;
    truth.check().map_err(|e| e.at("truth"))?;
    let pixels = look_up(maps, truth);
    let white = f64::from(Maps::white(&maps.albedo));
    let overlap = |within: Within| {
        let mut overlap = Overlap::default();
        for (pixel, &real) in pixels.iter().zip(&truth.mask) {
            overlap.add(predicted(maps, *pixel, within).is_some(), real);
        }
        overlap
    };
    let above = |fraction: f64| Within::Above(fraction * white);
    let within = fraction.map_or(Within::Mask, above);
    let here = overlap(within);
    let sweep: Vec<[f64; 2]> = SWEEP
        .iter()
        .filter_map(|&fraction| overlap(above(fraction)).iou().map(|iou| [fraction, iou]))
        .collect();
    let best = best_fraction(maps, truth, &pixels, white);
    let best = best.and_then(|fraction| overlap(above(fraction)).iou().map(|iou| [fraction, iou]));

    let errors = errors(maps, truth, &pixels, within);
    let [far, nearest] = filled(maps, truth, &pixels, within);
    let at_best = best.map(|[fraction, _]| {
        let errors = self::errors(maps, truth, &pixels, above(fraction));
        let overlap = overlap(above(fraction));
        AtBest {
            hit_pixels: overlap.both,
            completeness: ratio(overlap.both, overlap.real),
            depth_mae: errors.hit.absolute.get(),
            depth_rmse: errors.hit.square.get().map(f64::sqrt),
            normal_error_deg: errors.angle.get(),
        }
    });
    Ok(Metrics {
        fraction,
        predicted_pixels: here.predicted,
        true_pixels: here.real,
        hit_pixels: here.both,
        completeness: ratio(here.both, here.real),
        iou: here.iou(),
        depth_mae: errors.hit.absolute.get(),
        depth_rmse: errors.hit.square.get().map(f64::sqrt),
        depth_mae_whole: errors.whole.absolute.get(),
        depth_rmse_whole: errors.whole.square.get().map(f64::sqrt),
        depth_mae_far: far,
        depth_mae_nearest: nearest,
        normal_error_deg: errors.angle.get(),
        normal_mae: errors.components.get(),
        albedo_spread: errors.albedos.spread(),
        albedo_ratio_error: errors.albedos.ratio_error(),
        paper: PaperMeasure::of(picture(maps, truth, &pixels, within)),
        best_iou: best.map(|b| b[1]),
        best_fraction: best.map(|b| b[0]),
        at_best,
        within_depth_error: errors.coverage.within(),
        coverage: errors.coverage.quarters(),
        layers: layers(maps, truth, &pixels, within),
        sweep,
    })
}

/// Mask fraction of the best IoU, over all fractions below 1 that separate pixels. The largest in a tie.
fn best_fraction(maps: &Maps, truth: &Truth, pixels: &[Option<usize>], white: f64) -> Option<f64> {
    let real = truth.mask.iter().filter(|real| **real).count();
    let lit = |(pixel, real): (&Option<usize>, &bool)| {
        predicted(maps, *pixel, Within::Above(0.0)).map(|p| (maps.albedo[p], *real))
    };
    let mut lit: Vec<(f32, bool)> = pixels.iter().zip(&truth.mask).filter_map(lit).collect();
    lit.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
    let (mut best, mut both) = (None, 0);
    for (i, (albedo, is_real)) in lit.iter().enumerate() {
        both += usize::from(*is_real);
        let below = lit.get(i + 1).map_or(0.0, |next| next.0);
        let fraction = 0.5 * (f64::from(*albedo) + f64::from(below)) / white;
        let iou = ratio(both, i + 1 + real - both).unwrap_or(0.0);
        if below < *albedo && fraction < 1.0 && best.is_none_or(|(_, most)| iou > most) {
            best = Some((fraction, iou));
        }
    }
    // Without light, all fractions are equal.
    best.map(|(fraction, _)| fraction).or((real > 0).then_some(0.0))
}

/// Metrics of each layer, if the truth has two. `pixels` maps the truth's pixels to the maps'.
fn layers(maps: &Maps, truth: &Truth, pixels: &[Option<usize>], within: Within) -> Vec<LayerMetrics> {
    let Some(Layer { depth, normal, mask, .. }) = truth.behind.clone() else { return vec![] };
    let second = Truth { depth, normal, mask, albedo: None, behind: None, ..truth.clone() };
    let of_layer = |(layer, truth): (usize, &Truth)| {
        let found = maps.layer(layer);
        let mut overlap = Overlap::default();
        for (pixel, &real) in pixels.iter().zip(&truth.mask) {
            overlap.add(found.as_ref().is_some_and(|m| predicted(m, *pixel, within).is_some()), real);
        }
        let errors = found.map(|m| errors(&m, truth, pixels, within)).unwrap_or_default();
        LayerMetrics {
            true_pixels: overlap.real,
            hit_pixels: overlap.both,
            completeness: ratio(overlap.both, overlap.real),
            iou: overlap.iou(),
            depth_mae: errors.hit.absolute.get(),
            normal_error_deg: errors.angle.get(),
        }
    };
    [truth, &second].into_iter().enumerate().map(of_layer).collect()
}

/// For each pixel of the truth, the maps' pixel at its centre.
fn look_up(maps: &Maps, truth: &Truth) -> Vec<Option<usize>> {
    let grid = (0..truth.nx).flat_map(|ix| (0..truth.ny).map(move |iy| (ix, iy)));
    grid.map(|(ix, iy)| {
        let [x, y] = truth.centre(ix, iy);
        maps.pixel_at(x, y)
    })
    .collect()
}

/// Selection of surface pixels.
#[derive(Clone, Copy)]
enum Within {
    /// The maps' mask.
    Mask,
    /// Albedo above a threshold.
    Above(f64),
}

/// The maps' pixel, if it is surface.
fn predicted(maps: &Maps, pixel: Option<usize>, within: Within) -> Option<usize> {
    pixel.filter(|&p| {
        let albedo = maps.albedo[p];
        let is_within = match within {
            Within::Mask => maps.mask[p],
            // In float32 as in `Maps::mask_of`, so that both agree on pixels at the threshold.
            Within::Above(threshold) => albedo > threshold as f32,
        };
        is_within && albedo > 0.0 && maps.depth[p].is_finite()
    })
}

/// Errors over true pixels.
#[derive(Default)]
struct Errors {
    hit: Sums,
    whole: Sums,
    angle: Mean,
    components: Mean,
    albedos: Albedos,
    coverage: ErrorCoverage,
}

/// Errors over these pixels.
fn errors(maps: &Maps, truth: &Truth, pixels: &[Option<usize>], within: Within) -> Errors {
    let mut all = Errors::default();
    for (at, pixel) in pixels.iter().enumerate().filter(|(at, _)| truth.mask[*at]) {
        let real = f64::from(truth.depth[at]);
        let found = predicted(maps, *pixel, within);
        all.whole.add(found.map_or(0.0, |p| f64::from(maps.depth[p])) - real);
        let Some(found) = found else { continue };
        let error = f64::from(maps.depth[found]) - real;
        all.hit.add(error);
        if let Some(albedo) = &truth.albedo {
            all.albedos.add(maps.albedo[found], albedo[at]);
        }
        if let Some(depth_error) = &maps.depth_error {
            all.coverage.add(f64::from(depth_error[found]), error);
        }
        let (n, m) = (maps.normal[found].map(f64::from), truth.normal[at].map(f64::from));
        if let Some(degrees) = angle_between(n, m) {
            all.angle.add(degrees);
            (0..3).for_each(|c| all.components.add((n[c] - m[c]).abs()));
        }
    }
    all
}

/// Mean absolute errors of depth over the true mask, with the largest true depth and that of the nearest predicted pixel where none is
/// predicted.
fn filled(maps: &Maps, truth: &Truth, pixels: &[Option<usize>], within: Within) -> [Option<f64>; 2] {
    let found: Vec<Option<f64>> =
        pixels.iter().map(|p| predicted(maps, *p, within).map(|p| f64::from(maps.depth[p]))).collect();
    let real = || (0..found.len()).filter(|at| truth.mask[*at]).map(|at| (at, f64::from(truth.depth[at])));
    let far = real().map(|(_, depth)| depth).fold(0.0, f64::max);
    let nearest = missing::nearest(&found, [truth.nx, truth.ny]);
    let mean = |missing: &dyn Fn(usize) -> f64| {
        let errors = real().map(|(at, depth)| (found[at].unwrap_or_else(|| missing(at)) - depth).abs());
        let count = real().count();
        (count > 0).then(|| errors.sum::<f64>() / count as f64)
    };
    [mean(&|_| far), nearest.and_then(|nearest| mean(&|at| nearest[at]))]
}

/// Depth and normal of every pixel of the picture, estimated and true; (0, [0, 0, 0]) without surface.
fn picture(
    maps: &Maps,
    truth: &Truth,
    pixels: &[Option<usize>],
    within: Within,
) -> impl Iterator<Item = [(f32, [f32; 3]); 2]> {
    pixels.iter().enumerate().map(move |(at, pixel)| {
        let found = predicted(maps, *pixel, within).map(|p| (maps.depth[p], maps.normal[p]));
        let real = truth.mask[at].then(|| (truth.depth[at], truth.normal[at]));
        [found, real].map(Option::unwrap_or_default)
    })
}

#[derive(Default)]
struct Overlap {
    predicted: usize,
    real: usize,
    both: usize,
}

impl Overlap {
    fn add(&mut self, predicted: bool, real: bool) {
        self.predicted += usize::from(predicted);
        self.real += usize::from(real);
        self.both += usize::from(predicted && real);
    }

    fn iou(&self) -> Option<f64> {
        ratio(self.both, self.predicted + self.real - self.both)
    }
}

fn ratio(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

/// Angle in degrees; `None` if a vector is zero or NaN.
fn angle_between(a: [f64; 3], b: [f64; 3]) -> Option<f64> {
    let (a, b) = (glam::DVec3::from(a), glam::DVec3::from(b));
    // atan2 keeps small angles exact; acos of a rounded cosine does not.
    let degrees = a.cross(b).length().atan2(a.dot(b)).to_degrees();
    (a.length() > 0.0 && b.length() > 0.0 && degrees.is_finite()).then_some(degrees)
}
