//! The reconstructed surface as a point cloud in a binary PLY file.

use std::fmt::Write as _;
use std::path::Path;

use crate::error::Result;
use crate::maps::Maps;

/// Writes one point per masked pixel with a depth, of both layers, in the capture's frame in metres, little-endian:
/// `x y z nx ny nz albedo scalar_albedo` as float32 (the latter is the name that CloudCompare keeps), and the albedo again as grey `red green blue` for viewers (white at its 99.9th
/// percentile). An unknown normal is (0, 0, 0).
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, maps: &Maps) -> Result<()> {
    super::put(path, maps, bytes)
}

/// The file of [`write`].
pub(super) fn bytes(maps: &Maps) -> Result<Vec<u8>> {
    let white = Maps::white(&maps.albedo).max(f32::MIN_POSITIVE);
    let (mut points, mut count) = (Vec::new(), 0usize);
    let layers: Vec<Maps> = (0..2).filter_map(|layer| maps.layer(layer)).collect();
    let all = layers.iter().flat_map(|maps| (0..maps.depth.len()).map(move |p| (maps, p)));
    for (maps, pixel) in all.filter(|(maps, p)| maps.mask[*p] && maps.depth[*p].is_finite()) {
        let [x, y] = maps.centre(pixel / maps.ny, pixel % maps.ny);
        let normal = maps.normal[pixel];
        let [nx, ny, nz] = if normal.iter().all(|v| v.is_finite()) { normal } else { [0.0; 3] };
        let albedo = maps.albedo[pixel];
        for value in [x as f32, y as f32, maps.depth[pixel], nx, ny, nz, albedo, albedo] {
            points.extend_from_slice(&value.to_le_bytes());
        }
        points.extend_from_slice(&[(255.0 * (albedo / white).clamp(0.0, 1.0)).round() as u8; 3]);
        count += 1;
    }
    let mut header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment thirdbounce, metres\nelement vertex {count}\n"
    );
    // Sized names: meshio takes `uchar` for a signed type.
    for name in ["x", "y", "z", "nx", "ny", "nz", "albedo", "scalar_albedo"] {
        let _ = writeln!(header, "property float32 {name}");
    }
    for name in ["red", "green", "blue"] {
        let _ = writeln!(header, "property uint8 {name}");
    }
    header.push_str("end_header\n");
    let mut bytes = header.into_bytes();
    bytes.extend_from_slice(&points);
    Ok(bytes)
}
