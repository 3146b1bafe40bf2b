//! The reference of kernels against the model, and properties of their mathematics.

use fixtures::device::*;
use thirdbounce::engine::gaussian_weights;
use thirdbounce::transport::kernels::{COUNT_ACTIVE, COUNTS, Push, constant};
use thirdbounce::transport::{Binning, Model, Reflectance};
use thirdbounce_kernels::Cells;
use thirdbounce_verify::{Sample, reference, rendered};

/// Histograms of samples by the reference of `forward`, `[pair * bins + bin]`.
fn forward(model: &Model, samples: &[Sample]) -> Vec<f64> {
    let pairs = model.rendered_wall().pairs();
    let mut counts = vec![0; COUNTS as usize];
    counts[COUNT_ACTIVE as usize] = samples.len() as u32;
    let [points, normals] = reference::samples_of(samples);
    let empty = reference::rows_of(model.bins, &vec![0.0; pairs * model.bins]);
    let mut b = [Cells::Words(counts), points, normals, empty, reference::wall_of(model)];
    // One chunk for all samples.
    let constants = [(constant::CHUNK.name(), samples.len() as u32), (constant::SET_CELLS.name(), 1)];
    reference::run("forward", (model, &grid()), &constants, Push::default(), &mut b);
    model.bins_of(b[3].f())
}

/// Largest difference over the largest value. All numbers of the scene are exact in fp32 except for the normals of a curved wall.
#[test]
fn forward_renders_what_the_model_says() {
    let grid = grid();
    for (geometry, reflectance, curved) in variants() {
        let allowed = if curved && reflectance == Reflectance::Lambertian { 1e-7 } else { 1e-9 };
        for binning in [Binning::Linear, Binning::Nearest] {
            let exact = Model {
                binning,
                reference: 0.625,
                t_start: 0.3125,
                bin_width: 2.5 / 64.0,
                ..model(4, 64, 9)
            };
            let model = variant(&exact, geometry, reflectance, curved, 10);
            let samples = away_from_edges(&model, &samples(&model, &grid, 0.2, 11));
            let e = error(forward(&model, &samples), rendered(&model, &grid, &samples));
            assert!(e < allowed, "{geometry:?} {reflectance:?} {binning:?}, curved {curved}: {e:e}");
        }
    }
}

#[test]
fn taps_are_a_truncated_gaussian_that_sums_to_one() {
    let taps = gaussian_weights(3.0, 4.0);
    assert_eq!(taps.len(), 13, "cut off at 4 sigma");
    assert!((taps[0] + 2.0 * taps[1..].iter().sum::<f64>() - 1.0).abs() < 1e-12);
    assert!((taps[3] / taps[0] - (-0.5f64).exp()).abs() < 1e-12);
}
