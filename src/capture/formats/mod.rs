//! Capture files, one module per format. Which one a file is in is decided by its contents, not its name.

pub mod archive;
pub mod array;
mod exhaustive;
pub mod legs;
pub mod npz;
pub mod ytal;

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use glam::DVec3;

use super::Capture;
use crate::error::{Error, Result};

const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";

/// What a file holds, by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Contents {
    Zip,
    Hdf5,
    Matlab5,
    Npy,
    Unknown,
}

/// A capture as it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Opened {
    pub capture: Capture,
    /// Pairs of the file that were left out because they were not measured.
    pub dropped: usize,
    /// What was left out and why, in sentences for people.
    pub notes: Vec<String>,
}

/// Reads a capture in any known format (npz, y-tal HDF5), leaves out pairs that were not measured (see
/// [`Capture::without_missing`]) and checks the rest. The name is the file's stem.
///
/// # Errors
/// `Kind::Input`, opening with the path: a missing, empty, cut or damaged file, a folder, an unknown format,
/// missing arrays, or whatever [`Capture::check`] finds. `Kind::Memory` if the counts do not fit.
pub fn read(path: &Path) -> Result<Capture> {
    read_with_notes(path).map(|read| read.capture)
}

/// Reads a capture as [`read`] does, and says what was left out.
///
/// # Errors
/// Those of [`read`].
pub fn read_with_notes(path: &Path) -> Result<Opened> {
    let place = path.display().to_string();
    let read = || {
        let mut capture = match contents(path)? {
            Contents::Zip => npz::read(path)?,
            Contents::Hdf5 => ytal::read(path)?,
            Contents::Matlab5 => {
                return Err(unknown("MATLAB v5 files are not read"));
            }
            Contents::Npy => return Err(unknown("a single npy array has no wall points or bin width")),
            Contents::Unknown => return Err(unknown("the format is not known")),
        };
        capture.name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        let (capture, dropped, notes) = capture.without_missing()?;
        capture.check()?;
        Ok(Opened { capture, dropped, notes })
    };
    read().map_err(|e: Error| e.at(place))
}

/// Writes a capture: y-tal HDF5 if the name ends in `.hdf5` or `.h5`, npz if it ends in `.npz`. The file
/// appears whole or not at all.
///
/// # Errors
/// `Kind::Input` for a capture that fails [`Capture::check`], `Kind::Options` for another ending,
/// `Kind::Output` if it cannot be written.
pub fn write(capture: &Capture, path: &Path) -> Result<()> {
    let ending = path.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase());
    match ending.as_str() {
        "npz" => npz::write(capture, path),
        "hdf5" | "h5" => ytal::write(capture, path),
        _ => Err(Error::options(
            format!("{}: the ending says no capture format", path.display()),
            "name the file .npz or .hdf5 (y-tal)",
        )),
    }
}

fn unknown(what: &str) -> Error {
    Error::input(what, "give a capture as npz (H, sensor_xyz, laser_xyz, delta_t) or as y-tal HDF5")
}

fn contents(path: &Path) -> Result<Contents> {
    let unreadable = |e: std::io::Error| {
        let mend = match e.kind() {
            std::io::ErrorKind::NotFound => "check the path: there is no such file",
            std::io::ErrorKind::PermissionDenied => "make the file readable for you",
            _ => "check the path and the disk",
        };
        Error::input(format!("cannot be read: {e}"), mend)
    };
    let meta = std::fs::metadata(path).map_err(unreadable)?;
    if meta.is_dir() {
        return Err(Error::input("is a folder, not a capture file", "give the capture file inside it"));
    }
    if !meta.is_file() {
        return Err(Error::input("is not a regular file", "copy the capture to a file first"));
    }
    if meta.len() == 0 {
        return Err(Error::input("is empty", "fetch or write the capture anew"));
    }
    let mut file = File::open(path).map_err(unreadable)?;
    let mut head = [0u8; 128];
    let mut length = 0;
    while length < head.len() {
        match file.read(&mut head[length..]).map_err(unreadable)? {
            0 => break,
            n => length += n,
        }
    }
    let head = &head[..length];
    if head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06") {
        return Ok(Contents::Zip);
    }
    if head.starts_with(b"\x93NUMPY") {
        return Ok(Contents::Npy);
    }
    // HDF5 may stand behind a user block of 512, 1024, 2048 ... bytes (MATLAB v7.3: 512).
    let mut at = 0u64;
    while at + 8 <= meta.len() && at <= 1 << 20 {
        let mut start = Vec::new();
        file.seek(SeekFrom::Start(at)).map_err(unreadable)?;
        (&mut file).take(64).read_to_end(&mut start).map_err(unreadable)?;
        if start.starts_with(HDF5) {
            return match hdf5_end(&start) {
                Some(end) if end > meta.len() => Err(Error::input(
                    format!("the HDF5 file is cut short: {} of {end} bytes", meta.len()),
                    "the file is damaged: fetch it anew",
                )),
                _ => Ok(Contents::Hdf5),
            };
        }
        at = if at == 0 { 512 } else { at * 2 };
    }
    Ok(if head.starts_with(b"MATLAB 5.0") { Contents::Matlab5 } else { Contents::Unknown })
}

/// The length of an HDF5 file as its superblock says (the reader does not look), if it can be told.
fn hdf5_end(superblock: &[u8]) -> Option<u64> {
    let at = match (superblock.get(8)?, superblock.get(13)?, superblock.get(9)?) {
        (0, 8, _) => 40,
        (1, 8, _) => 44,
        (2 | 3, _, 8) => 28,
        _ => return None,
    };
    Some(u64::from_le_bytes(superblock.get(at..at + 8)?.try_into().ok()?))
}

/// One vector per pair from `n` given ones: as they are, or a single one for all pairs.
fn per_pair(what: &str, given: Vec<DVec3>, pairs: usize) -> Result<Vec<DVec3>> {
    match given.len() {
        n if n == pairs => Ok(given),
        1 => Ok(vec![given[0]; pairs]),
        n => Err(Error::input(
            format!("{what} holds {n} points for {pairs} scan positions"),
            "give one point per scan position, in the order of H, or a single one",
        )),
    }
}

/// Vectors from consecutive triples; the last dimension must be 3.
fn triples(what: &str, shape: &[usize], values: &[f64]) -> Result<Vec<DVec3>> {
    if shape.last() != Some(&3) {
        return Err(Error::input(
            format!("{what} has shape {shape:?}, not x, y, z along its last axis"),
            format!("store {what} as [X, Y, 3], or as [1, 3] for a single point"),
        ));
    }
    Ok(values.chunks_exact(3).map(|v| DVec3::new(v[0], v[1], v[2])).collect())
}

/// Normals come as float32 at times: brings one back to unit length, but leaves a wrong one for the check, and a
/// unit one to the last bit.
fn unit(n: DVec3) -> DVec3 {
    let off = (n.length() - 1.0).abs();
    if (1e-12..1e-4).contains(&off) { n.normalize() } else { n }
}

/// Whether all values are whole and not negative, and the largest of them: what integer type holds them.
fn largest_count(values: &[f32]) -> Option<f32> {
    values.iter().try_fold(0.0f32, |largest, &v| (v >= 0.0 && v.fract() == 0.0).then(|| largest.max(v)))
}

/// A single point if all are the same, else all of them, as (leading shape, flat values).
fn compact(points: &[DVec3], scan: [usize; 2], single: &[usize]) -> (Vec<usize>, Vec<f64>) {
    let all_equal = points.windows(2).all(|w| w[0] == w[1]);
    let (shape, points) = if all_equal && points.len() > 1 {
        (single.to_vec(), &points[..1])
    } else {
        (vec![scan[0], scan[1], 3], points)
    };
    (shape, points.iter().flat_map(|p| p.to_array()).collect())
}
