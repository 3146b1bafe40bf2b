//! The plain form of a capture: an npz file.
//!
//! `H` [T, X, Y] counts (ix along +x, iy along +y); `sensor_xyz` and `laser_xyz` [X, Y, 3] pair by pair or
//! [1, 3] for a single point, metres; optional `sensor_normal` and `laser_normal` of the same shapes; scalars
//! `delta_t` (bin width, metres of path) and `t_start` (leading edge of bin 0, metres; 0 if missing).

use std::path::Path;

use glam::DVec3;

use super::archive::{Npz, npz_bytes};
use super::array::{Array, transpose};
use super::{compact, largest_count, per_pair, triples};
use crate::capture::Capture;
use crate::error::{Error, Result};
use crate::export::atomic;

const WANTED: &str = "H, sensor_xyz, laser_xyz, delta_t, and optionally t_start, sensor_normal, laser_normal; other arrays are ignored";

/// Reads a capture without checking its values; see [`super::read`].
///
/// # Errors
/// `Kind::Input` for a damaged archive, a missing array or shapes that do not agree.
pub fn read(path: &Path) -> Result<Capture> {
    let mut npz = Npz::open(path)?;
    let h = npz.require("H", WANTED)?;
    let [bins, nx, ny] = h.shape[..] else {
        return Err(Error::input(
            format!("H has shape {:?}, not three axes", h.shape),
            "store H as [T, X, Y]: bins, then the scan along x and y",
        ));
    };
    let pairs = nx * ny;
    let laser = points(&mut npz, "laser_xyz", pairs)?;
    let sensor = points(&mut npz, "sensor_xyz", pairs)?;
    let laser_normal = normals(&mut npz, "laser_normal", pairs)?;
    let sensor_normal = normals(&mut npz, "sensor_normal", pairs)?;
    let Some(bin_width) = npz.scalar("delta_t")? else {
        npz.require("delta_t", WANTED)?;
        return Err(Error::input("delta_t is missing", WANTED));
    };
    let t_start = npz.scalar("t_start")?.unwrap_or(0.0);
    Ok(Capture {
        name: String::new(),
        scan: [nx, ny],
        laser,
        sensor,
        laser_normal,
        sensor_normal,
        bins,
        bin_width,
        t_start,
        integer_counts: h.element.is_integer(),
        histograms: transpose(&h.to_f32(), bins, pairs),
    })
}

fn points(npz: &mut Npz, name: &str, pairs: usize) -> Result<Vec<DVec3>> {
    let array = npz.require(name, WANTED)?;
    per_pair(name, triples(name, &array.shape, &array.to_f64())?, pairs)
}

fn normals(npz: &mut Npz, name: &str, pairs: usize) -> Result<Option<Vec<DVec3>>> {
    let Some(array) = npz.get(name)? else { return Ok(None) };
    let given = triples(name, &array.shape, &array.to_f64())?;
    // Normals come as float32 at times: bring them back to unit length, but leave a wrong one for the check.
    let given = given.into_iter().map(|n| if (n.length() - 1.0).abs() < 1e-4 { n.normalize() } else { n });
    per_pair(name, given.collect(), pairs).map(Some)
}

/// Writes a capture; equal captures give equal bytes. Counts become uint16 or uint32 where they are whole and
/// fit, float32 otherwise. The file appears whole or not at all.
///
/// # Errors
/// `Kind::Input` if the capture fails its check, `Kind::Output` if the file cannot be written.
pub fn write(capture: &Capture, path: &Path) -> Result<()> {
    capture.check()?;
    let mut arrays = vec![("H", counts(capture))];
    let mut add = |name, vectors: &[DVec3]| {
        let (shape, values) = compact(vectors, capture.scan, &[1, 3]);
        arrays.push((name, Array::from_f64(&shape, &values)));
    };
    add("sensor_xyz", &capture.sensor);
    add("laser_xyz", &capture.laser);
    if let Some(normals) = &capture.sensor_normal {
        add("sensor_normal", normals);
    }
    if let Some(normals) = &capture.laser_normal {
        add("laser_normal", normals);
    }
    arrays.push(("delta_t", Array::from_f64(&[], &[capture.bin_width])));
    arrays.push(("t_start", Array::from_f64(&[], &[capture.t_start])));
    atomic::write(path, &npz_bytes(&arrays)?)
}

fn counts(capture: &Capture) -> Array {
    let [nx, ny] = capture.scan;
    let shape = [capture.bins, nx, ny];
    let h = transpose(&capture.histograms, capture.pair_count(), capture.bins);
    match largest_count(&h).filter(|_| capture.integer_counts) {
        Some(largest) if largest <= f32::from(u16::MAX) => {
            Array::from_u16(&shape, &h.iter().map(|&v| v as u16).collect::<Vec<_>>())
        }
        // 2^32 as float32 is one beyond the largest uint32.
        Some(largest) if largest < 4_294_967_296.0 => {
            Array::from_u32(&shape, &h.iter().map(|&v| v as u32).collect::<Vec<_>>())
        }
        _ => Array::from_f32(&shape, &h),
    }
}
