//! Metrics on cases computed by hand.

use thirdbounce::Kind;
use thirdbounce::maps::{Layer, Maps, Truth, percentile};
use thirdbounce::measure::{Metrics, metrics};

const TOWARDS_WALL: [f32; 3] = [0.0, 0.0, -1.0];
const MISS: [f32; 3] = [f32::NAN; 3];

/// Maps of n x n pixels on a wall of 1 m, lit where `inside` says, at the depth of `depth`.
fn maps(n: usize, inside: impl Fn(usize, usize) -> bool, depth: f32) -> Maps {
    let lit: Vec<bool> =
        (0..n).flat_map(|ix| (0..n).map(move |iy| (ix, iy))).map(|(x, y)| inside(x, y)).collect();
    let mut maps = Maps {
        albedo: lit.iter().map(|&l| if l { 1.0 } else { 0.0 }).collect(),
        depth: lit.iter().map(|&l| if l { depth } else { f32::NAN }).collect(),
        normal: lit.iter().map(|&l| if l { TOWARDS_WALL } else { MISS }).collect(),
        mask_fraction: Some(0.0),
        ..Maps::empty([n, n], [-0.5, 0.5, -0.5, 0.5])
    };
    maps.set_mask(Maps::MASK_FRACTION);
    maps
}

fn truth(n: usize, inside: impl Fn(usize, usize) -> bool, depth: f32) -> Truth {
    let m = maps(n, inside, depth);
    Truth {
        nx: n,
        ny: n,
        extent: m.extent,
        depth: m.depth,
        normal: m.normal,
        mask: m.mask,
        albedo: None,
        behind: None,
    }
}

fn close(value: Option<f64>, wanted: f64) {
    let value = value.expect("a figure");
    assert!((value - wanted).abs() < 1e-6, "{value} is not {wanted}");
}

#[test]
fn a_perfect_prediction() {
    let inside = |x, y| x >= 2 && y < 5;
    let m = metrics(&maps(8, inside, 0.75), &truth(8, inside, 0.75), 0.2).unwrap();
    assert_eq!((m.predicted_pixels, m.true_pixels, m.hit_pixels), (30, 30, 30));
    assert_eq!(
        (m.iou, m.completeness, m.depth_mae, m.depth_rmse),
        (Some(1.0), Some(1.0), Some(0.0), Some(0.0))
    );
    assert_eq!((m.depth_mae_whole, m.normal_error_deg, m.normal_mae), (Some(0.0), Some(0.0), Some(0.0)));
    assert_eq!((m.best_iou, m.fraction), (Some(1.0), Some(0.2)));
}

#[test]
fn layers_are_measured_each() {
    // A plate of 2 x 4 pixels at 0.5 m before a wall at 1 m; found 2 x 3 of the plate, and behind it 1 x 4 at 1.1 m.
    let mut real = truth(4, |_, _| true, 1.0);
    real.depth[..8].fill(0.5);
    let layer = |m: Maps| Layer {
        albedo: m.albedo,
        depth: m.depth,
        normal: m.normal,
        mask: m.mask,
        depth_error: None,
    };
    let mut found = maps(4, |_, _| true, 1.0);
    found.depth[..6].fill(0.5);
    assert!(metrics(&found, &real, 0.3).unwrap().layers.is_empty());
    real.behind = Some(layer(maps(4, |x, _| x < 2, 1.0)));
    let m = metrics(&found, &real, 0.3).unwrap();
    assert_eq!((m.layers[1].hit_pixels, m.layers[1].true_pixels, m.layers[1].depth_mae), (0, 8, None));
    found.behind = Some(layer(maps(4, |x, _| x == 0, 1.1)));
    let m = metrics(&found, &real, 0.3).unwrap();
    assert_eq!((m.layers[0].iou, m.layers[0].true_pixels), (m.iou, 16));
    close(m.layers[0].depth_mae, 2.0 * 0.5 / 16.0);
    assert_eq!((m.layers[1].iou, m.layers[1].completeness), (Some(0.5), Some(0.5)));
    close(m.layers[1].depth_mae, f64::from(1.1f32) - 1.0);
    assert_eq!(m.layers[1].normal_error_deg, Some(0.0));
}

#[test]
fn errors_within_the_expected_one_are_counted() {
    // Sixteen pixels, 10 mm off; the left half has an expected error of 20 mm, the right one 5 mm, one pixel none.
    let real = truth(4, |_, _| true, 0.5);
    let mut found = maps(4, |_, _| true, 0.51);
    assert_eq!(metrics(&found, &real, None).unwrap().within_depth_error, None);
    let mut reported: Vec<f32> = (0..16).map(|p| if p < 8 { 0.02 } else { 0.005 }).collect();
    found.depth_error = Some(reported.clone());
    let m = metrics(&found, &real, None).unwrap();
    assert_eq!(m.within_depth_error, Some(0.5));
    let shares: Vec<f64> = m.coverage.iter().map(|q| q[1]).collect();
    assert_eq!(shares, [0.0, 0.0, 1.0, 1.0]);
    assert!((m.coverage[0][0] - 0.005).abs() < 1e-6 && (m.coverage[3][0] - 0.02).abs() < 1e-6);
    reported[15] = f32::NAN;
    found.depth_error = Some(reported);
    assert_eq!(metrics(&found, &real, None).unwrap().within_depth_error, Some(8.0 / 15.0));
    assert!(m.clone().brief().coverage.is_empty() && m.brief().within_depth_error.is_some());
}

#[test]
fn figures_by_hand() {
    // Truth: the columns 0 and 1 of 4 (8 pixels) at 1 m. Found: column 1 and 2 at 1.1 m, one of them at 1.3 m.
    let real = truth(4, |x, _| x < 2, 1.0);
    let mut found = maps(4, |x, _| x == 1 || x == 2, 1.1);
    found.depth[4] = 1.3;
    found.normal[5] = [1.0, 0.0, 0.0];
    found.normal[6] = [0.0, 0.6, -0.8];
    found.normal[7] = MISS;
    let m = metrics(&found, &real, 0.2).unwrap();
    assert_eq!((m.predicted_pixels, m.true_pixels, m.hit_pixels), (8, 8, 4));
    close(m.iou, 4.0 / 12.0);
    close(m.completeness, 0.5);
    close(m.depth_mae, (0.3 + 3.0 * 0.1) / 4.0);
    close(m.depth_rmse.map(|v| v * v), (0.09 + 3.0 * 0.01) / 4.0);
    // Missing: 4 pixels of error 1.
    close(m.depth_mae_whole, (4.0 + 0.6) / 8.0);
    close(m.depth_rmse_whole.map(|v| v * v), (4.0 + 0.12) / 8.0);
    // Angles 0, 90 and acos 0.8; the pixel without a normal does not count.
    close(m.normal_error_deg, (90.0 + 0.8f64.acos().to_degrees()) / 3.0);
    close(m.normal_mae, (2.0 + 0.8) / 9.0);
    // The paper's measure, over all 16 pixels: 4 missing, 4 hit, 4 found where nothing is.
    close(m.paper.depth_mae, (4.0 + 0.6 + 4.4) / 16.0);
    close(m.paper.depth_rmse.map(|v| v * v), (4.0 + 0.12 + 4.0 * 1.21) / 16.0);
    // The normal that is missing counts as (0, 0, 0), like those of missing pixels.
    close(m.paper.normal_mae, (4.0 + 2.0 + 0.8 + 1.0 + 4.0) / 48.0);
    close(m.paper.normal_rmse.map(|v| v * v), (4.0 + 2.0 + 0.36 + 0.04 + 1.0 + 4.0) / 48.0);
}

#[test]
fn mirrored_and_shifted_maps_are_told_apart() {
    // An L: neither mirror image covers it.
    let shape = |x: usize, y: usize| {
        (2..5).contains(&x) && (2..14).contains(&y) || (2..12).contains(&x) && (2..5).contains(&y)
    };
    let real = truth(16, shape, 1.0);
    let iou = |inside: &dyn Fn(usize, usize) -> bool| {
        metrics(&maps(16, inside, 1.0), &real, 0.2).unwrap().iou.unwrap()
    };
    assert_eq!(iou(&shape), 1.0);
    assert!(iou(&|x, y| shape(15 - x, y)) < 0.5, "mirrored in x");
    assert!(iou(&|x, y| shape(x, 15 - y)) < 0.5, "mirrored in y");
    assert!(iou(&|x, y| shape(y, x)) < 0.9, "transposed");
    assert!(iou(&|x, y| x >= 4 && shape(x - 4, y)) < 0.5, "shifted");
}

#[test]
fn maps_of_another_size_and_extent() {
    // Found on a wall of 2 m in cells of 0.5 m; truth on the inner 1 m in cells of 0.125 m.
    let mut found = maps(4, |x, y| x == 2 && y == 1, 1.0);
    found.extent = [-1.0, 1.0, -1.0, 1.0];
    // Cell (2, 1) is x 0 to 0.5, y -0.5 to 0: of the truth's 8 x 8 the right lower quarter.
    let m = metrics(&found, &truth(8, |x, y| x >= 4 && y < 4, 1.0), 0.2).unwrap();
    assert_eq!((m.iou, m.predicted_pixels), (Some(1.0), 16));
    // Truth that reaches beyond the maps is missed there, not wrapped or clamped.
    let mut wide = truth(8, |_, _| true, 1.0);
    wide.extent = [-2.0, 2.0, -2.0, 2.0];
    let m = metrics(&maps(4, |_, _| true, 1.0), &wide, 0.2).unwrap();
    assert_eq!((m.predicted_pixels, m.true_pixels), (4, 64));
}

#[test]
fn nothing_to_measure_is_none() {
    let m = metrics(&maps(4, |x, _| x == 0, 1.0), &truth(4, |x, _| x == 3, 1.0), 0.2).unwrap();
    assert_eq!((m.iou, m.completeness), (Some(0.0), Some(0.0)));
    assert_eq!((m.depth_mae, m.depth_rmse, m.normal_error_deg, m.normal_mae), (None, None, None, None));
    assert_eq!(m.depth_mae_whole, Some(1.0));
    let m = metrics(&maps(4, |_, _| false, 1.0), &truth(4, |_, _| false, 1.0), 0.2).unwrap();
    assert_eq!((m.iou, m.completeness, m.depth_mae_whole, m.best_iou), (None, None, None, None));
    let json = serde_json::to_string(&m).unwrap();
    assert!(json.contains("\"iou\":null") && !json.contains("sweep"), "{json}");
    assert_eq!(serde_json::from_str::<Metrics>(&json).unwrap(), m);
}

#[test]
fn the_best_fraction_is_found() {
    // The figure at 1, clutter at 0.3 of it: fractions above 0.3 are perfect.
    let real = truth(8, |x, _| x < 4, 1.0);
    let mut found = maps(8, |x, _| x < 4, 1.0);
    found.albedo.iter_mut().filter(|a| **a == 0.0).for_each(|a| *a = 0.3);
    found.depth.fill(1.0);
    let m = metrics(&found, &real, 0.1).unwrap();
    assert_eq!((m.iou, m.best_iou), (Some(0.5), Some(1.0)));
    assert!(m.best_fraction.unwrap() >= 0.3);
    assert!(m.sweep.len() > 10 && m.clone().brief().sweep.is_empty());
}

#[test]
fn no_fraction_is_better_than_the_best() {
    // Figure and clutter overlap in brightness, and the best fraction lies between the steps of the sweep.
    let real = truth(16, |x, _| x < 8, 1.0);
    let mut found = maps(16, |_, _| true, 1.0);
    for (i, albedo) in found.albedo.iter_mut().enumerate() {
        let wave = 0.5 + 0.5 * (i as f32 * 0.7).sin();
        *albedo = if i < 128 { 0.52 + 0.4 * wave } else { 0.1 + 0.46 * wave };
    }
    let m = metrics(&found, &real, 0.2).unwrap();
    let each = (0..1000).map(|step| metrics(&found, &real, 1e-3 * f64::from(step)).unwrap().iou.unwrap());
    let most = each.fold(0.0, f64::max);
    let best = m.best_iou.unwrap();
    assert!(best >= most && best < most + 0.01, "{best}, {most}");
    assert!(m.sweep.iter().all(|[_, iou]| iou + 0.005 < best), "{:?}, {best}", m.sweep);
    // The reported fraction reproduces the mask.
    let there = metrics(&found, &real, m.best_fraction.unwrap()).unwrap();
    assert_eq!(there.iou, m.best_iou);
}

#[test]
fn wrong_input() {
    let (m, t) = (maps(4, |_, _| true, 1.0), truth(4, |_, _| true, 1.0));
    for fraction in [-0.1, 1.0, f64::NAN] {
        assert_eq!(metrics(&m, &t, fraction).unwrap_err().kind, Kind::Options);
    }
    let mut short = m.clone();
    short.depth.pop();
    let e = metrics(&short, &t, 0.2).unwrap_err().to_string();
    assert!(e.contains("maps: depth holds 15 values"), "{e}");
    let mut flat = t;
    flat.extent = [0.5, 0.5, 0.0, 1.0];
    assert!(metrics(&m, &flat, 0.2).unwrap_err().to_string().contains("extent"));
}

#[test]
fn masks_and_percentiles() {
    assert_eq!(percentile(&[3.0, 1.0, f32::NAN, 2.0], 50.0), Some(2.0));
    assert_eq!(percentile(&[1.0, 2.0], 25.0), Some(1.25));
    assert_eq!(percentile(&[f32::NAN], 50.0), None);
    assert_eq!(Maps::mask_of(&[0.0, 0.5, 1.0, f32::NAN], 0.6), [false, false, true, false]);
    assert_eq!(Maps::mask_of(&[0.0; 4], 0.0), [false; 4]);
    // A single lit pixel among many is white, although the percentile is zero.
    let mut one = vec![0.0f32; 10_000];
    one[7] = 4.0;
    assert_eq!(Maps::mask_of(&one, 0.2).iter().filter(|m| **m).count(), 1);
    let m = maps(4, |_, _| true, 1.0);
    assert_eq!(m.pixel_at(-0.49, 0.49), Some(3));
    assert_eq!((m.pixel_at(0.51, 0.0), m.pixel_at(f64::NAN, 0.0)), (None, None));
    assert_eq!(m.centre(0, 3), [-0.375, 0.375]);
}

#[test]
fn a_method_whose_far_half_is_dim_is_measured_on_both_halves() {
    // The near half is bright and right, the far half dim and 0.2 m off: at 0.3 it is not in the mask.
    let real = truth(8, |x, _| (2..6).contains(&x), 1.0);
    let mut found = maps(8, |x, _| (2..6).contains(&x), 1.0);
    for pixel in 4 * 8..6 * 8 {
        (found.albedo[pixel], found.depth[pixel]) = (0.12, 1.2);
    }
    let m = metrics(&found, &real, 0.3).unwrap();
    close(m.depth_mae, 0.0);
    close(m.completeness, 0.5);
    let best = m.at_best.expect("a best fraction");
    close(best.depth_mae, 0.1);
    close(best.depth_rmse.map(|v| v * v), 0.02);
    assert_eq!((best.hit_pixels, best.completeness, m.best_iou), (32, Some(1.0), Some(1.0)));
    let there = metrics(&found, &real, m.best_fraction.unwrap()).unwrap();
    assert_eq!((there.depth_mae, there.normal_error_deg), (best.depth_mae, best.normal_error_deg));
}
