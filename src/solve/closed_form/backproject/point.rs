//! The light of one point: what a back-projection makes of it is the kernel of its Gram operator.

use glam::DVec3;

use crate::capture::Capture;
use crate::transport::{Grid, Reflectance};

/// The voxel in the middle of a grid.
pub(in crate::solve::closed_form) fn middle(grid: &Grid) -> [usize; 3] {
    grid.n.map(|n| n / 2)
}

/// The counts that a surface element at `at` gives the pairs of `scan`, as back-projections see it: it faces the wall, with one
/// cosine. Each path is shared by the two bins whose centres are around it.
pub(super) fn light_of(scan: &Capture, at: DVec3, reflectance: Reflectance) -> Capture {
    let mut counts = vec![0.0f32; scan.pair_count() * scan.bins];
    let pairs = scan.laser.iter().zip(&scan.sensor);
    for (row, (l, s)) in counts.chunks_mut(scan.bins).zip(pairs) {
        let arms = [l, s].map(|p| p.distance(at));
        let value = match reflectance {
            Reflectance::Retroreflective => 1.0 / (arms[0] * arms[1]),
            _ => 1.0 / (arms[0] * arms[1]).powi(2),
        };
        // A point on the wall gives nothing.
        if !value.is_finite() {
            continue;
        }
        let cosine = if reflectance.has_normals() { (at.z - l.z).max(0.0) / arms[0] } else { 1.0 };
        let place = (arms[0] + arms[1] - scan.t_start) / scan.bin_width - 0.5;
        let share = place - place.floor();
        for (bin, weight) in [(place.floor(), 1.0 - share), (place.floor() + 1.0, share)] {
            if (0.0..scan.bins as f64).contains(&bin) {
                row[bin as usize] += (value * cosine * weight) as f32;
            }
        }
    }
    let mut light = scan.outline();
    light.histograms = counts;
    light
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    #[test]
    fn a_point_lights_the_bins_around_its_paths() {
        let points = vec![dvec3(0.0, 0.0, 0.0), dvec3(0.3, 0.0, 0.0)];
        let mut scan = Capture::new([2, 1], points.clone(), points, 40, 0.05, vec![0.0; 80]);
        scan.t_start = 0.11;
        let light = light_of(&scan, dvec3(0.0, 0.0, 0.4), Reflectance::Cosine);
        for (row, (path, cosine)) in light.histograms.chunks(40).zip([(0.8, 1.0), (1.0, 0.8)]) {
            let all: f32 = row.iter().sum();
            let centre = |(bin, v): (usize, &f32)| (0.11 + (bin as f64 + 0.5) * 0.05) * f64::from(*v);
            let mean = row.iter().enumerate().map(centre).sum::<f64>() / f64::from(all);
            let value = cosine / (path * path / 4.0f64).powi(2);
            assert!(
                (mean - path).abs() < 1e-6 && (f64::from(all) / value - 1.0).abs() < 1e-6,
                "{mean} {all}"
            );
        }
        // Beyond the last bin there is none.
        let far = light_of(&scan, dvec3(0.0, 0.0, 1.5), Reflectance::Cosine);
        assert!(far.histograms.iter().all(|v| *v == 0.0));
    }
}
