//! Back-projection: its filter along time, and the gather into voxels.

use glam::DVec3;

use super::render::{Kernel, gather};
use super::{Sample, Twin};
use crate::transport::Model;

/// Weighted histograms, convolved along time with `hat`, the weights at 0, 1, 2, ... bins to either side. `odd`: those of
/// earlier bins are the negatives of those of later ones.
pub fn filter(twin: &Twin, hat: &[f64], odd: bool) -> Vec<f64> {
    let m = twin.model;
    let filtered = |histogram: &[f32], bin: usize| -> f64 {
        let near = |b: &usize| b.abs_diff(bin) < hat.len();
        let side = |b: usize| if odd && b < bin { -1.0 } else { 1.0 };
        let value = |b: usize| side(b) * hat[b.abs_diff(bin)] * m.bin_weight(b) * f64::from(histogram[b]);
        (0..m.bins).filter(near).map(value).sum()
    };
    m.measured.chunks(m.bins).flat_map(|h| (0..m.bins).map(move |b| filtered(h, b))).collect()
}

/// Back-projection of filtered histograms into every voxel that is not too near, by storage index. It uses the cosine
/// of a surface that faces the wall and no falloff.
pub fn backproject(twin: &Twin, filtered: &[f64]) -> Vec<f64> {
    let grid = twin.grid;
    // It takes spots for points.
    let sharp = Model { rendered: None, ..twin.model.clone() };
    let twin = &Twin { model: &sharp, grid };
    let near = twin.model.near_z(grid);
    let directed = twin.model.reflectance.has_normals();
    let cosine = |k: &Kernel| if directed { (-k.arms[0].toward.z).max(0.0) } else { 1.0 };
    let of_voxel = |index: usize| {
        let c = grid.voxel(index);
        let mut sum = 0.0;
        if grid.contains(c) && c[2] >= near {
            let point = grid.position(DVec3::from_array(c.map(|c| c as f64)));
            let sample = Sample { point, albedo: 1.0, normal: DVec3::ZERO, length: 0.0 };
            gather(twin, &sample, filtered, |k, r| sum += r * cosine(k));
        }
        sum
    };
    (0..grid.storage()).map(of_voxel).collect()
}
