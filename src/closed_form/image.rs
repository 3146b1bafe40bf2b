//! From a volume at the points of a scan to maps.

use rayon::prelude::*;

use super::resample::{add, cubic};
use super::scan::RegularScan;
use thirdbounce_base::quantile::peak_between;

use crate::maps::{Maps, percentile};
use crate::transport::Grid;

/// A value for each voxel of a grid, `[(x * n[1] + y) * n[2] + z]`.
#[derive(Debug, Clone, PartialEq)]
pub struct AlbedoVolume {
    /// What the method takes for the albedo; of any scale.
    pub albedo: Vec<f32>,
    /// The direction of the surface, not of unit length, from methods that find one. Others have it from the depths.
    pub normal: Option<Vec<[f32; 3]>>,
}

/// Sigma, scan steps, of the Gaussian that smooths depths before normals are computed.
const SMOOTH: f64 = 0.7;

/// Interpolates values at the points of a scan, `[(ix * n[1] + iy) * depth + k]`, at the voxel centres of `grid`: cubic
/// (Keys 1981) along x and y. Nothing is known beyond the cells of the scan: voxels there are zero.
/// What overshoots below zero is zero.
pub fn on_grid(scan: &RegularScan, values: &[f32], grid: &Grid) -> Vec<f32> {
    let mut all = on_grid_signed(scan, values, grid);
    all.par_iter_mut().for_each(|v| *v = v.max(0.0));
    all
}

/// The same of values that may be below zero.
pub fn on_grid_signed(scan: &RegularScan, values: &[f32], grid: &Grid) -> Vec<f32> {
    let depth = grid.n[2];
    let weights = |axis: usize| -> Vec<Option<[(usize, f32); 4]>> {
        let of = |i: usize| {
            let at = grid.origin[axis] + i as f64 * grid.pitch[axis] - scan.first[axis];
            cubic(at / scan.step[axis], scan.n[axis], 0.5 * scan.measured[axis] / scan.step[axis])
        };
        (0..grid.n[axis]).map(of).collect()
    };
    let [along_x, along_y] = [weights(0), weights(1)];
    let row = scan.n[1] * depth;
    let mut all = vec![0.0; grid.voxels()];
    all.par_chunks_mut(grid.n[1] * depth).zip(&along_x).for_each(|(slab, x)| {
        let Some(x) = x else { return };
        let mut between = vec![0.0f32; row];
        for (ix, weight) in x {
            add(&mut between, &values[ix * row..(ix + 1) * row], *weight);
        }
        for (column, y) in slab.chunks_mut(depth).zip(&along_y) {
            for (iy, weight) in y.iter().flatten() {
                add(column, &between[iy * depth..(iy + 1) * depth], *weight);
            }
        }
    });
    all
}

/// Parts of the albedo that Otsu's threshold tells apart.
const PARTS: usize = 256;

/// Otsu's threshold (1979), which parts values of two kinds. `None` if all are zero.
fn otsu(values: &[f64]) -> Option<f64> {
    let most = values.iter().copied().fold(0.0, f64::max);
    if !(most > 0.0 && most.is_finite()) {
        return None;
    }
    let mut counts = [0usize; PARTS];
    values.iter().for_each(|v| counts[((v / most * PARTS as f64) as usize).min(PARTS - 1)] += 1);
    let place = |part: usize| (part as f64 + 0.5) / PARTS as f64 * most;
    let all: f64 = counts.iter().enumerate().map(|(part, n)| *n as f64 * place(part)).sum();
    let (mut below, mut sum, mut best) = (0.0, 0.0, (0.0, place(0)));
    for (part, n) in counts.iter().enumerate() {
        below += *n as f64;
        sum += *n as f64 * place(part);
        let above = values.len() as f64 - below;
        if above > 0.0 && below > 0.0 {
            let between = below * above * (sum / below - (all - sum) / above).powi(2);
            if between > best.0 {
                best = (between, place(part));
            }
        }
    }
    // The upper end of the part.
    Some(best.1 + 0.5 * most / PARTS as f64)
}

/// The albedos to this power.
fn powers(albedo: &[f32], power: f64) -> Vec<f64> {
    albedo.iter().map(|a| f64::from(a.max(0.0)).powf(power)).collect()
}

/// A threshold of the albedo as a share of the brightest.
pub fn share_of_white(threshold: f64, albedo: &[f32]) -> Option<f64> {
    let white = f64::from(Maps::white(albedo));
    (white > 0.0).then(|| (threshold / white).clamp(0.0, 0.99))
}

/// The albedo above which a pixel is surface in maps with haze. Haze is dim but wide, and the
/// brightness of surfaces varies, so Otsu's threshold first parts the fourth roots of the albedo, in which both are
/// about as wide. A pixel is surface above `share` of the median of the bright part. `None` without light.
pub fn level_over_haze(albedo: &[f32], share: f64) -> Option<f64> {
    let roots = powers(albedo, 0.25);
    let threshold = otsu(&roots)?;
    let bright: Vec<f32> =
        albedo.iter().zip(&roots).filter(|(_, r)| **r > threshold).map(|(a, _)| *a).collect();
    Some(share * f64::from(percentile(&bright, 50.0)?))
}

/// The brightest value of each column of a volume with `depths` voxels a column; 0 if none is above.
pub fn brightest(volume: &[f32], depths: usize) -> Vec<f32> {
    volume.par_chunks(depths).map(|column| column.iter().copied().fold(0.0, f32::max)).collect()
}

/// The brightest voxel of every column: its value is the albedo, and a parabola through it and its neighbours tells the
/// depth. Normals that the volume does not have are those of the depths. `step` is the distance of scan points, metres.
/// `fraction` is the share of the brightest albedo above which a pixel is surface, of all albedos; `None` without light.
pub fn maps(
    grid: &Grid,
    volume: &AlbedoVolume,
    step: f64,
    fraction: impl FnOnce(&[f32]) -> Option<f64>,
) -> Maps {
    let [nx, ny, nz] = grid.n;
    let column = |values: &[f32]| -> (f32, f32, usize) {
        let (at, value) = values
            .iter()
            .enumerate()
            .fold((0, 0.0f32), |best, (i, v)| if *v > best.1 { (i, *v) } else { best });
        if value <= 0.0 {
            return (0.0, f32::NAN, 0);
        }
        let shift = match (at.checked_sub(1).map(|i| values[i]), values.get(at + 1)) {
            (Some(low), Some(high)) => peak_between([low, value, *high].map(f64::from)),
            _ => 0.0,
        };
        (value, (grid.origin.z + (at as f64 + shift) * grid.pitch.z) as f32, at)
    };
    let found: Vec<(f32, f32, usize)> = volume.albedo.par_chunks(nz).map(column).collect();
    let albedo: Vec<f32> = found.iter().map(|f| f.0).collect();
    let fraction = fraction(&albedo).unwrap_or(Maps::MASK_FRACTION);
    let mut maps = Maps {
        nx,
        ny,
        extent: grid.extent(),
        depth: found.iter().map(|f| f.1).collect(),
        normal: vec![],
        mask: Maps::mask_of(&albedo, fraction),
        mask_fraction: Some(fraction),
        depth_error: None,
        probability: None,
        behind: None,
        albedo,
    };
    maps.normal = match &volume.normal {
        Some(all) => found.iter().enumerate().map(|(i, f)| unit(all[i * nz + f.2])).collect(),
        None => normals_of(&maps, SMOOTH * step / grid.pitch.x.min(grid.pitch.y)),
    };
    maps
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = v.iter().map(|c| c * c).sum::<f32>().sqrt();
    if length > 0.0 { v.map(|c| c / length) } else { [f32::NAN; 3] }
}

/// Normals of the depths, smoothed by a Gaussian of `sigma` pixels whose weights are the albedo.
fn normals_of(maps: &Maps, sigma: f64) -> Vec<[f32; 3]> {
    let [nx, ny] = [maps.nx, maps.ny];
    let [x0, x1, y0, y1] = maps.extent;
    let pixel = [(x1 - x0) / nx as f64, (y1 - y0) / ny as f64];
    let reach = (3.0 * sigma).ceil() as isize;
    let taps: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    // A fit of a plane to the depths around: moments of the offset, weighted.
    let of = |i: usize| {
        if maps.depth[i].is_nan() {
            return [f32::NAN; 3];
        }
        let (x, y) = ((i / ny) as isize, (i % ny) as isize);
        let mut m = [0.0f64; 9];
        for dx in -reach..=reach {
            for dy in -reach..=reach {
                let (ox, oy) = (x + dx, y + dy);
                if !(0..nx as isize).contains(&ox) || !(0..ny as isize).contains(&oy) {
                    continue;
                }
                let other = ox as usize * ny + oy as usize;
                let z = f64::from(maps.depth[other]) - f64::from(maps.depth[i]);
                // Beyond an edge lies another surface.
                if z.is_nan()
                    || z.abs() > 3.0 * pixel[0].max(pixel[1]) * (dx.abs().max(dy.abs()) as f64).max(1.0)
                {
                    continue;
                }
                let w =
                    taps[(dx + reach) as usize] * taps[(dy + reach) as usize] * f64::from(maps.albedo[other]);
                let (a, b) = (dx as f64 * pixel[0], dy as f64 * pixel[1]);
                let terms = [1.0, a, b, a * a, a * b, b * b, z, a * z, b * z];
                m.iter_mut().zip(terms).for_each(|(m, t)| *m += w * t);
            }
        }
        let [s, a, b, aa, ab, bb, z, az, bz] = m;
        let (aa, ab, bb) = (aa - a * a / s, ab - a * b / s, bb - b * b / s);
        let (az, bz) = (az - a * z / s, bz - b * z / s);
        let det = aa * bb - ab * ab;
        if det.is_nan() || det <= 1e-6 * aa * bb {
            return [0.0, 0.0, -1.0];
        }
        let slope = [(bb * az - ab * bz) / det, (aa * bz - ab * az) / det];
        unit([slope[0] as f32, slope[1] as f32, -1.0])
    };
    (0..nx * ny).into_par_iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::Volume as Box;
    use glam::dvec3;

    fn scan() -> RegularScan {
        RegularScan {
            n: [6, 5],
            first: [-0.5, -0.4],
            step: [0.2, 0.2],
            measured: [0.2, 0.2],
            z: 0.0,
            pair_of: vec![],
            gaps: vec![],
            spot: None,
        }
    }

    #[test]
    fn what_is_linear_between_scan_points_is_interpolated_exactly() {
        let scan = scan();
        let plane = |x: f64, y: f64, z: f64| 2.0 + x + 2.0 * y + z;
        let grid =
            Grid::new(Box { min: dvec3(-0.25, -0.15, 0.3), max: dvec3(0.25, 0.15, 0.5) }, 7, 0.1).unwrap();
        let at = |i: usize, a: usize| scan.first[a] + i as f64 * scan.step[a];
        let values: Vec<f32> = (0..6 * 5 * grid.n[2])
            .map(|i| {
                let (column, z) = (i / grid.n[2], i % grid.n[2]);
                plane(at(column / 5, 0), at(column % 5, 1), z as f64) as f32
            })
            .collect();
        let all = on_grid(&scan, &values, &grid);
        for x in 0..7 {
            for y in 0..7 {
                let p = grid.position(dvec3(x as f64, y as f64, 0.0));
                let found = f64::from(all[(x * 7 + y) * grid.n[2] + 1]);
                assert!((found - plane(p.x, p.y, 1.0)).abs() < 1e-5, "{found}");
            }
        }
    }

    fn over_haze(albedo: &[f32]) -> Option<f64> {
        share_of_white(level_over_haze(albedo, 0.6)?, albedo)
    }

    #[test]
    fn haze_is_no_surface_and_dim_surface_is() {
        // A surface between half of its brightness and all of it, a third of the picture, in haze of up to a tenth.
        let albedo: Vec<f32> = (0..3000)
            .map(|i| {
                let wave = 0.5 + 0.5 * (i as f32 * 0.7).sin();
                if i % 3 == 0 { 0.5 + 0.5 * wave } else { 0.1 * wave }
            })
            .collect();
        let mask = |albedo: &[f32]| Maps::mask_of(albedo, over_haze(albedo).unwrap());
        let right = |mask: &[bool]| mask.iter().enumerate().filter(|(i, m)| **m == (i % 3 == 0)).count();
        assert!(right(&mask(&albedo)) == 3000);
        // A few pixels that are much brighter do not decide.
        let mut spotted = albedo.clone();
        (0..4).for_each(|i| spotted[300 * i] = 8.0);
        assert!(right(&mask(&spotted)) > 2980, "{}", right(&mask(&spotted)));
        assert_eq!(over_haze(&[0.0; 9]), None);
    }

    #[test]
    fn depths_lie_between_voxels_and_slopes_give_normals() {
        let grid = Grid::new(Box { min: dvec3(0.0, 0.0, 0.4), max: dvec3(0.8, 0.8, 1.4) }, 8, 0.05).unwrap();
        let [nx, ny, nz] = grid.n;
        let depth = |x: usize, y: usize| 0.8 + 0.02 * x as f64 - 0.03 * y as f64;
        let mut albedo = vec![0.0f32; grid.voxels()];
        for (i, v) in albedo.iter_mut().enumerate() {
            let (column, z) = (i / nz, i % nz);
            let off = (grid.origin.z + z as f64 * 0.05 - depth(column / ny, column % ny)) / 0.1;
            *v = (1.0 - off * off).max(0.0) as f32;
        }
        let maps = maps(&grid, &AlbedoVolume { albedo, normal: None }, 0.1, over_haze);
        maps.check().unwrap();
        for i in 0..nx * ny {
            assert!((f64::from(maps.depth[i]) - depth(i / ny, i % ny)).abs() < 1e-5);
            let wanted = dvec3(0.2, -0.3, -1.0).normalize();
            let found = maps.normal[i].map(f64::from);
            assert!((dvec3(found[0], found[1], found[2]) - wanted).length() < 1e-3, "{found:?}");
        }
        let empty = super::maps(
            &grid,
            &AlbedoVolume { albedo: vec![0.0; grid.voxels()], normal: None },
            0.1,
            over_haze,
        );
        assert!(empty.depth.iter().all(|z| z.is_nan()) && !empty.mask.contains(&true));
        empty.check().unwrap();
    }
}
