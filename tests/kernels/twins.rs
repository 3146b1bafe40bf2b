//! Properties of the mathematics that twins share.

use fixtures::device::*;
use glam::{DVec3, dvec3};
use thirdbounce::solve::gaussian_weights;
use thirdbounce::transport::kernels::{PaperData, Push};
use thirdbounce_verify::twin::{Call, Twin, sample_point};

#[test]
fn continuous_samples_stay_within_half_a_voxel_and_cover_it() {
    let (model, grid) = (model(2, 16, 1), grid());
    let call = |iteration| Call {
        twin: Twin { model: &model, grid: &grid },
        scene: model.scene(&grid),
        paper: PaperData::default(),
        push: Push { iteration, ..Push::default() },
        constants: vec![],
    };
    let index = grid.index([5, 6, 7]) as u32;
    let (mut low, mut high, mut sum) = (DVec3::MAX, DVec3::MIN, DVec3::ZERO);
    for i in 0..4000 {
        let d = sample_point(&call(i), index) - dvec3(5.0, 6.0, 7.0);
        (low, high, sum) = (low.min(d), high.max(d), sum + d);
    }
    assert!(low.min_element() >= -0.5 && high.max_element() < 0.5);
    assert!(low.max_element() < -0.49 && high.min_element() > 0.49, "{low} {high}");
    // Four standard errors of the mean of 4000 uniform numbers.
    assert!((sum / 4000.0).abs().max_element() < 4.0 * (1.0f64 / 12.0 / 4000.0).sqrt());
    let corner = sample_point(&call(3), grid.index([0, 0, 0]) as u32);
    assert!(corner.min_element() >= 0.0, "clamped to the grid");
}

#[test]
fn taps_are_a_truncated_gaussian_that_sums_to_one() {
    let taps = gaussian_weights(3.0, 4.0);
    assert_eq!(taps.len(), 13, "cut off at 4 sigma");
    assert!((taps[0] + 2.0 * taps[1..].iter().sum::<f64>() - 1.0).abs() < 1e-12);
    assert!((taps[3] / taps[0] - (-0.5f64).exp()).abs() < 1e-12);
}
