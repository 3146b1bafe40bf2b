//! Capture files, one module per format. The contents of a file decide its format, not its name. Some formats are
//! several files in a folder.

mod blocks;
mod bonn;
pub mod ccsocr;
mod convolutional;
pub mod counts;
mod dirac;
mod exhaustive;
mod frame;
pub mod general;
mod given;
mod glance;
pub mod hdf5;
mod kilometre;
mod lct;
pub mod legs;
mod lit;
mod matlab;
pub mod matlab5;
pub mod netf;
pub mod npz;
mod numbers;
pub mod phasor;
mod pulse;
mod scatter;
pub mod set;
mod socr_units;
pub mod stanford;
mod unread;
pub mod variables;
pub mod ytal;
pub mod znlos;
mod zones;

pub use given::{Bounce, Given};

use unread::Unread;
use variables::Variables;

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use glam::DVec3;

use super::{Capture, Keep, Turn};
use crate::error::{Error, Result};
use crate::host;

/// The first bytes of an HDF5 file.
pub const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";

/// The kind of a file, by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Contents {
    Zip,
    Hdf5,
    Matlab5,
    Npy,
    Transient,
    Folder,
    Unknown,
}

/// A capture as it was read.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Opened {
    /// The capture.
    pub capture: Capture,
    /// Pairs of the file that were left out because they were not measured.
    pub dropped: usize,
    /// Sentences that say what was assumed and what was left out, and why.
    pub notes: Vec<String>,
}

/// Reads a capture in any known format, leaves out pairs that were not measured (see
/// [`Capture::without_missing`]) and checks the rest. The name is the file's stem.
///
/// # Errors
/// `Kind::Input`, beginning with the path: a missing, empty, cut or damaged file, a folder without a capture, an
/// unknown format, missing arrays, or anything that [`Capture::check`] finds. `Kind::Options` if the file lacks a value
/// that has no usual value either (see [`Given`]). `Kind::Memory` if the counts do not fit.
pub fn read(path: &Path) -> Result<Capture> {
    read_given(path, &Given::default()).map(|read| read.capture)
}

/// Reads a capture as [`read`] does, and returns notes and the number of dropped pairs with it.
///
/// # Errors
/// Those of [`read`].
pub fn read_with_notes(path: &Path) -> Result<Opened> {
    read_given(path, &Given::default())
}

/// Reads a capture as [`read`] does, with values that the file does not hold.
///
/// # Errors
/// Those of [`read`]. `Kind::Options` for a bin width, a bounce or a file of times of flight if the format takes none.
pub fn read_given(path: &Path, given: &Given) -> Result<Opened> {
    read_kept(path, given, &Keep::default())
}

/// Reads a part of a capture, with values that the file does not hold. The result is that of [`read_given`] followed by
/// [`Capture::stride`], [`Capture::subset`] and [`Capture::gated`]; large files take less memory. All counts of the
/// file are checked.
///
/// # Errors
/// Those of [`read_given`] and of the three.
pub fn read_kept(path: &Path, given: &Given, keep: &Keep) -> Result<Opened> {
    read_prepared(path, given, keep, &mut |_, _| Ok(()))
}

/// Changes the points of all measured pairs, before some are chosen; notes say what was done. The capture may be
/// without its counts.
pub type Prepare<'p> = dyn FnMut(&mut Capture, &mut Vec<String>) -> Result<()> + 'p;

/// Reads a part of a capture as [`read_kept`] does, and calls `prepare` before pairs are chosen.
///
/// # Errors
/// Those of [`read_kept`] and of `prepare`.
pub fn read_prepared(path: &Path, given: &Given, keep: &Keep, prepare: &mut Prepare) -> Result<Opened> {
    let place = |e: Error| e.at(path.display());
    let mut notes = Vec::new();
    let name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let mut set;
    let found = match contents(path).map_err(place)? {
        Contents::Zip => npz::read(path, given, &mut notes).map(Found::Whole),
        Contents::Hdf5 | Contents::Matlab5 | Contents::Folder => {
            set = set::Set::open(path).map_err(place)?;
            read_set(&mut set, given, &mut notes)
        }
        Contents::Transient => bonn::read(path, given, &mut notes).map(Found::Whole),
        Contents::Npy => Err(unknown("a single npy array has no wall points or bin width")),
        Contents::Unknown => Err(unknown("the format is not known")),
    };
    let found = found.map_err(place)?;
    let capture = match found {
        Found::Unread(unread) => {
            let mut opened = unread.read(name, keep, given.turn, prepare, notes, &place)?;
            opened.notes.extend(opened.capture.negative_note());
            return Ok(opened);
        }
        Found::Whole(capture) => Capture { name, ..capture },
    };
    let whole = measured(capture, &mut notes).map_err(place)?;
    keep_prepared(whole, given.turn, keep, prepare, notes)
}

/// Leaves out pairs that were not measured, checks the rest, and rotates a wall that clearly does not face +z. Also returns
/// how many were left out.
pub fn measured(capture: Capture, notes: &mut Vec<String>) -> Result<(Capture, usize)> {
    let (capture, dropped, missing) = capture.without_missing()?;
    notes.extend(missing);
    capture.check()?;
    Ok((frame::roughly_facing_z(capture, notes), dropped))
}

/// Turns a whole capture, calls `prepare`, and keeps a part of it.
pub fn keep_prepared(
    (capture, dropped): (Capture, usize),
    turn: Turn,
    keep: &Keep,
    prepare: &mut Prepare,
    mut notes: Vec<String>,
) -> Result<Opened> {
    notes.extend(turn.note());
    let mut capture = capture.turned(turn);
    prepare(&mut capture, &mut notes)?;
    let capture = keep.apply(capture, &mut notes)?;
    notes.extend(capture.negative_note());
    Ok(Opened { capture, dropped, notes })
}

/// A capture as a reader of its format finds it.
enum Found<'f> {
    Whole(Capture),
    /// All but the counts.
    Unread(Unread<'f>),
}

/// Finds the format by the names of the arrays, and reads it.
fn read_set<'s>(set: &'s mut set::Set, given: &Given, notes: &mut Vec<String>) -> Result<Found<'s>> {
    let no_bounce = |what: &str| match given.bounce {
        None => Ok(()),
        Some(_) => Err(Error::options(
            format!("a bounce was given, but {what} does not keep bounces apart"),
            "leave the bounce out",
        )),
    };
    let socr = ["C_i", "C_d", "sub_Sig"].iter().any(|name| set.any(name));
    if given.depth_unit.is_some() && !socr {
        return Err(Error::options(
            "a unit of the wall's depth was given, but only CC-SOCR captures need one",
            "leave it out",
        ));
    }
    if set.any("meas") || set.any("tofgrid") {
        no_bounce("a Stanford f-k capture")?;
        return stanford::read(set, given, notes).map(Found::Unread);
    }
    if given.time_of_flight.is_some() {
        return Err(Error::options(
            "times of flight were given, but there is no meas, the counts of a Stanford f-k capture",
            "leave the file of times of flight out",
        ));
    }
    if socr {
        no_bounce("a CC-SOCR capture")?;
        return ccsocr::read(set, given, notes).map(Found::Whole);
    }
    let positions = set.any("cameraGridPositions");
    // The points of General-NLOS lie in a second file.
    if !positions && general::counts_name(set).is_some() {
        set.add_beside(&["setup.mat".into()])?;
    }
    if ["laserpoints", "detectpoints"].iter().any(|name| set.any(name)) {
        no_bounce("a General-NLOS capture")?;
        return general::read(set, given, notes).map(Found::Whole);
    }
    let file = match set.holding("cameraGridPositions")? {
        Some(file) => file,
        None => set.first().ok_or_else(|| unknown("the folder is empty"))?,
    };
    if positions {
        no_width(given, "a file with Z-NLOS names")?;
        let axes = file.shape("data")?.ok_or_else(|| file.missing("data"))?.len();
        return if axes == 3 {
            no_bounce("a NeTF capture")?;
            netf::read(file, notes).map(Found::Whole)
        } else {
            znlos::read(file, given, notes).map(Found::Whole)
        };
    }
    no_bounce("the file")?;
    read_single(file, given, notes)
}

/// Refuses a bin width where the format holds its own.
fn no_width(given: &Given, what: &str) -> Result<()> {
    match given.bin_width {
        None => Ok(()),
        Some(_) => Err(Error::options(
            format!("a bin width was given, but {what} holds its own bin width"),
            "leave the bin width out",
        )),
    }
}

/// Finds the format of a capture that is one file, by the names of its arrays, and reads it.
fn read_single<'s>(file: &'s Variables, given: &Given, notes: &mut Vec<String>) -> Result<Found<'s>> {
    if file.have(&["H"]) || file.have(&["laser_grid_xyz"]) {
        no_width(given, "a y-tal capture")?;
        return ytal::read(file).map(Found::Whole);
    }
    if file.have(&["data_t"]) {
        no_width(given, "an NLOS-Dirac capture")?;
        return dirac::read(file, notes).map(Found::Unread);
    }
    if convolutional::is_one(file) {
        no_width(given, "a file with NLOSDATA")?;
        return convolutional::read(file, notes).map(Found::Unread);
    }
    if file.have(&["sig_in"]) {
        return kilometre::read(file, given, notes).map(Found::Unread);
    }
    if lit::is_one(file) {
        return lit::read(file, given, notes).map(Found::Unread);
    }
    if file.have(&["dataset/data"]) {
        no_width(given, "a phasor-field capture")?;
        return phasor::read_2019(file, notes).map(Found::Whole);
    }
    if file.have(&["rect_data", "width"]) {
        return lct::read(file, given, notes).map(Found::Unread);
    }
    if file.have(&["rect_data", "ts"]) {
        no_width(given, "a phasor-field capture")?;
        return phasor::read_2020(file, notes).map(Found::Unread);
    }
    matlab::read(file, given, notes).map(Found::Unread)
}

/// Writes a capture: y-tal HDF5 if the name ends in `.hdf5` or `.h5`, npz if it ends in `.npz`, Stanford v7.3 if it
/// ends in `.mat`. The file appears whole or not at all. Returns sentences that say what the format cannot hold.
///
/// # Errors
/// `Kind::Input` if the capture fails [`Capture::check`], `Kind::Options` for another ending or a capture that the
/// format cannot hold, `Kind::Output` if the file cannot be written.
pub fn write(capture: &Capture, path: &Path) -> Result<Vec<String>> {
    check_ending(path)?;
    let mut notes = match ending(path).as_str() {
        "npz" => return npz::write(capture, path).map(|()| vec![]),
        "mat" => stanford::write(capture, path),
        _ => ytal::write(capture, path).map(|()| vec![]),
    }?;
    if capture.pulse.is_some() {
        notes.push(
            "this format cannot hold the pulse: write npz, or give the pulse when the file is read".into(),
        );
    }
    if capture.laser_spot.or(capture.sensor_spot).is_some() {
        notes.push("this format cannot hold the spots: write npz, or give them when the file is read".into());
    }
    if capture.cycles.is_some() {
        notes.push("this format cannot hold the number of laser pulses (cycles): write npz".into());
    }
    if capture.direct.is_some() {
        notes.push("this format cannot hold the path of direct light (direct): write npz".into());
    }
    Ok(notes)
}

fn ending(path: &Path) -> String {
    path.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase())
}

/// Checks that a file's name has the ending of a format that [`write()`] knows.
///
/// # Errors
/// `Kind::Options` if it has none.
pub fn check_ending(path: &Path) -> Result<()> {
    if matches!(ending(path).as_str(), "npz" | "hdf5" | "h5" | "mat") {
        return Ok(());
    }
    Err(Error::options(
        format!("{}: the ending is not that of a capture format", path.display()),
        "name the file .npz, .hdf5 (y-tal) or .mat (Stanford)",
    ))
}

fn unknown(what: &str) -> Error {
    Error::input(
        what,
        "give a capture as npz (H, sensor_xyz, laser_xyz, delta_t), y-tal or Z-NLOS HDF5, a transient image TI04, or one of the \
         known MATLAB files",
    )
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
        return Ok(Contents::Folder);
    }
    if !meta.is_file() {
        return Err(Error::input("is not a regular file", "copy the capture to a file first"));
    }
    if meta.len() == 0 {
        return Err(Error::input("is empty", "copy or write the file again"));
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
    if bonn::is_one(head) {
        return Ok(Contents::Transient);
    }
    // HDF5 may begin after a user block of 512, 1024, 2048 ... bytes (MATLAB v7.3: 512).
    let mut at = 0u64;
    while at + 8 <= meta.len() && at <= 1 << 20 {
        let mut start = Vec::new();
        file.seek(SeekFrom::Start(at)).map_err(unreadable)?;
        (&mut file).take(64).read_to_end(&mut start).map_err(unreadable)?;
        if start.starts_with(HDF5) {
            return match hdf5_end(&start) {
                Some(end) if end > meta.len() => Err(Error::input(
                    format!("the HDF5 file is cut short: {} of {end} bytes", meta.len()),
                    "the file is damaged: copy or download it again",
                )),
                _ => Ok(Contents::Hdf5),
            };
        }
        at = if at == 0 { 512 } else { at * 2 };
    }
    let version_5 = matches!(head.get(124..128), Some(b"\x00\x01IM" | b"\x01\x00MI"));
    Ok(if version_5 || head.starts_with(b"MATLAB 5.0") { Contents::Matlab5 } else { Contents::Unknown })
}

/// The length of an HDF5 file according to its superblock, which the HDF5 reader does not check; `None` if unknown.
fn hdf5_end(superblock: &[u8]) -> Option<u64> {
    let at = match (superblock.get(8)?, superblock.get(13)?, superblock.get(9)?) {
        (0, 8, _) => 40,
        (1, 8, _) => 44,
        (2 | 3, _, 8) => 28,
        _ => return None,
    };
    Some(u64::from_le_bytes(superblock.get(at..at + 8)?.try_into().ok()?))
}

/// One vector per pair. `given` holds one for each, or a single one for all.
fn per_pair(what: &str, given: Vec<DVec3>, pairs: usize) -> Result<Vec<DVec3>> {
    match given.len() {
        n if n == pairs => Ok(given),
        1 => host::filled(what, pairs, given[0]),
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

/// Brings a normal that was rounded to float32 back to unit length. A wrong normal is left for the check; a unit normal
/// does not change by a bit.
fn unit(n: DVec3) -> DVec3 {
    let off = (n.length() - 1.0).abs();
    if (1e-12..1e-4).contains(&off) { n.normalize() } else { n }
}

/// The largest value, which decides the integer type to store; `None` unless all values are whole and not negative.
fn largest_count(values: &[f32]) -> Option<f32> {
    values.iter().try_fold(0.0f32, |largest, &v| (v >= 0.0 && v.fract() == 0.0).then(|| largest.max(v)))
}

/// Shape and flat values of the points: a single point, of shape `single`, if all are equal, else all of them.
fn compact(points: &[DVec3], scan: [usize; 2], single: &[usize]) -> (Vec<usize>, Vec<f64>) {
    let all_equal = points.windows(2).all(|w| w[0] == w[1]);
    let (shape, points) = if all_equal && points.len() > 1 {
        (single.to_vec(), &points[..1])
    } else {
        (vec![scan[0], scan[1], 3], points)
    };
    (shape, points.iter().flat_map(|p| p.to_array()).collect())
}
