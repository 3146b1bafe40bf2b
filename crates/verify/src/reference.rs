//! A kernel's reference on the scene of a model, without a plan.

use thirdbounce::transport::kernels::{PADDING, Push, SceneData};
use thirdbounce::transport::{Binning, Grid, Model};
use thirdbounce_kernels::{Call, Cells, kernel_of};

use crate::Sample;

/// Runs the reference of a kernel for a model's rendered pairs on the buffers at bindings 1, 2, ... `constants`: those
/// that are not of the scene.
pub fn run(
    kernel: &str,
    (model, grid): (&Model, &Grid),
    constants: &[(&'static str, u32)],
    push: Push,
    buffers: &mut [Cells<f64>],
) {
    let wall = model.rendered_wall();
    let own = [
        ("GEOMETRY", wall.geometry as u32),
        ("REFLECTANCE", model.reflectance.number()),
        ("CURVED", u32::from(wall.normals.is_some())),
        ("SPLIT", u32::from(model.binning == Binning::Linear)),
    ];
    let constants = [&own, constants].concat();
    let scene: SceneData = match &model.rendered {
        Some(rendered) => model.scene_of_rendered(grid, model.pairs(), rendered),
        None => model.scene(grid),
    };
    let words = bytemuck::cast_slice(std::slice::from_ref(&scene));
    let call = Call::new(&constants, bytemuck::cast(push), |block| (block == "scene").then_some(words));
    let row = kernel_of(kernel).unwrap_or_else(|| unreachable!("{kernel} is no kernel"));
    (row.reference)(&call, buffers);
}

/// The buffer of wall points.
pub fn wall_of(model: &Model) -> Cells<f64> {
    let words = model.rendered_wall().words(model.centre);
    Cells::Floats(words.as_flattened().iter().map(|v| f64::from(*v)).collect())
}

/// The buffers of samples: points, normals.
pub fn samples_of(samples: &[Sample]) -> [Cells<f64>; 2] {
    let points = samples.iter().flat_map(|s| [s.point.x, s.point.y, s.point.z, s.albedo]);
    let normals = samples.iter().flat_map(|s| [s.normal.x, s.normal.y, s.normal.z, s.length]);
    [Cells::Floats(points.collect()), Cells::Floats(normals.collect())]
}

/// Histograms `[pair * bins + bin]` as a buffer, with empty padding.
pub fn rows_of(bins: usize, values: &[f64]) -> Cells<f64> {
    let padding = [0.0; PADDING as usize];
    let rows = values.chunks(bins).flat_map(|row| padding.iter().chain(row));
    Cells::Floats(rows.chain(&padding).copied().collect())
}
