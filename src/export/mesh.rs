//! The reconstructed surface as a triangle mesh in a binary PLY file: the depth map's own grid, cut where the depth
//! jumps.

use std::path::Path;

use super::atomic;
use crate::error::Result;
use crate::maps::Maps;

/// An edge of a triangle is cut where the depth differs by more than so many times its length along the wall (a
/// slope of 72 degrees).
const STEEPEST: f32 = 3.0;

/// Writes a vertex for every masked pixel with a depth that has a triangle (`x y z nx ny nz albedo` as float32 and
/// the albedo as grey `red green blue`, as [`super::ply`] does), and two triangles for every four such neighbours,
/// one for three. Triangles turn counter-clockwise as seen from the wall. In the capture's frame, metres.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, maps: &Maps) -> Result<()> {
    maps.check()?;
    let triangles = triangles(maps);
    let mut number = vec![u32::MAX; maps.depth.len()];
    let mut vertices = Vec::new();
    for &pixel in triangles.iter().flatten() {
        if number[pixel] == u32::MAX {
            number[pixel] = vertices.len() as u32;
            vertices.push(pixel);
        }
    }
    let white = Maps::white(&maps.albedo).max(f32::MIN_POSITIVE);
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment thirdbounce, metres\nelement vertex {}\n{}{}\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        ["x", "y", "z", "nx", "ny", "nz", "albedo"].map(|n| format!("property float {n}\n")).concat(),
        ["red", "green", "blue"].map(|n| format!("property uchar {n}\n")).concat(),
        triangles.len()
    )
    .into_bytes();
    for pixel in vertices {
        let [x, y] = maps.centre(pixel / maps.ny, pixel % maps.ny);
        let normal = maps.normal[pixel];
        let [nx, ny, nz] = if normal.iter().all(|v| v.is_finite()) { normal } else { [0.0; 3] };
        for value in [x as f32, y as f32, maps.depth[pixel], nx, ny, nz, maps.albedo[pixel]] {
            bytes.extend_from_slice(&value.to_le_bytes());
        }
        bytes.extend_from_slice(&[(255.0 * (maps.albedo[pixel] / white).clamp(0.0, 1.0)).round() as u8; 3]);
    }
    for triangle in triangles {
        bytes.push(3);
        triangle.iter().for_each(|p| bytes.extend_from_slice(&number[*p].to_le_bytes()));
    }
    atomic::write(path, &bytes)
}

/// Triangles of pixels.
fn triangles(maps: &Maps) -> Vec<[usize; 3]> {
    let [x0, x1, y0, y1] = maps.extent;
    let pitch = [(x1 - x0) / maps.nx as f64, (y1 - y0) / maps.ny as f64].map(|p| p as f32);
    let there = |p: usize| maps.mask[p] && maps.depth[p].is_finite();
    let joined = |a: usize, b: usize| {
        let (dx, dy) = ((a / maps.ny).abs_diff(b / maps.ny), (a % maps.ny).abs_diff(b % maps.ny));
        let length = (dx as f32 * pitch[0]).hypot(dy as f32 * pitch[1]);
        (maps.depth[a] - maps.depth[b]).abs() <= STEEPEST * length
    };
    let whole = |t: &[usize; 3]| {
        t.iter().all(|&p| there(p)) && joined(t[0], t[1]) && joined(t[1], t[2]) && joined(t[2], t[0])
    };
    let mut all = Vec::new();
    for ix in 1..maps.nx {
        for iy in 1..maps.ny {
            let [a, b] = [(ix - 1) * maps.ny + iy - 1, ix * maps.ny + iy - 1];
            let [c, d] = [b + 1, a + 1];
            // Seen from the wall +x points left: this order turns counter-clockwise there, its normal is -z.
            let by_ac = [[a, c, b], [a, d, c]];
            let by_bd = [[a, d, b], [b, d, c]];
            let count = |split: &[[usize; 3]; 2]| split.iter().filter(|t| whole(t)).count();
            // The diagonal that keeps more, and of two the flatter one.
            let flatter = (maps.depth[a] - maps.depth[c]).abs() <= (maps.depth[b] - maps.depth[d]).abs();
            let (ac, bd) = (count(&by_ac), count(&by_bd));
            let split = if ac > bd || ac == bd && flatter { by_ac } else { by_bd };
            all.extend(split.into_iter().filter(whole));
        }
    }
    all
}
