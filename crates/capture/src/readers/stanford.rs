//! Captures of the f-k migration data set (Lindell, Wetzstein, O'Toole 2019), MATLAB v7.3 or v5.
//!
//! `meas` (d1, d2, t) counts, bins of 32 ps; `tofgrid` (d1, d2), usually in a second file: the time in picoseconds from
//! the laser's pulse to the wall point and back to the sensor. Every histogram is shifted by floor(tofgrid / bin) whole
//! bins and, as in the published code, 512 bins are kept (all bins if no histogram is shifted). Their scans are 2 m
//! wide, which is not in the file. Bins that a gated detector did not record stay zero.
//!
//! Axes: d1 runs up and d2 to the left. The front view of their `cnlos_reconstruction.m` has d1 as rows from the bottom
//! and d2 as columns from the right.

use std::path::Path;

use rust_hdf5::{DatatypeMessage, H5File, Hdf5Error};

use super::frame::{self, Axes, WallDirection};
use super::read_options::ReadOptions;
use super::scatter::Shifts;
use super::set::Set;
use super::unread::{ReadCapture, Unread};
use super::{single, stated};
use crate::error::{Error, Result};
use crate::files::atomic;
use crate::{Capture, METRES_PER_PICOSECOND, PairKind, host};

const PICOSECONDS: f64 = 32.0;
const WALL: f64 = 2.0;
const AXES: Axes = Axes { d1: WallDirection::Up, d2: WallDirection::Left };
/// Bins that the published code keeps.
const KEPT: usize = 512;

/// Counts and times of flight, of the whole scan or of fewer points.
const NAMES: [[&str; 2]; 2] = [["meas", "tofgrid"], ["measlr", "tofgridlr"]];

/// Times of flight: the name of their counts, the shape, and picoseconds.
pub(super) type TimesOfFlight = (&'static str, Vec<usize>, Vec<f64>);

fn names(set: &Set) -> [&'static str; 2] {
    *NAMES.iter().find(|names| names.iter().any(|name| set.any(name))).unwrap_or(&NAMES[0])
}

/// The times of flight that belong to the counts of `set`; `None` where there are none, or none are to be used.
///
/// # Errors
/// `Kind::Input` if their file cannot be read or holds none, or they are empty.
pub(super) fn times_of_flight(set: &mut Set, given: &ReadOptions) -> Result<Option<TimesOfFlight>> {
    if given.time_of_flight.as_ref().is_some_and(|path| path.as_os_str() == "none") {
        return Ok(None);
    }
    let [counts, times] = names(set);
    if let Some(path) = &given.time_of_flight {
        set.add(path)?;
    } else if !(set.any(counts) && set.any(times)) {
        let name = set.name();
        set.add_beside(&["tof.mat".into(), name.replace("meas", "tof"), name.replace("tof", "meas")])?;
    }
    let Some(file) = set.holding(times)? else {
        return match &given.time_of_flight {
            None => Ok(None),
            Some(path) => Err(Error::input(
                format!("holds no {times} (times of flight to the wall)"),
                format!(
                    "give the file with {times}, or none if the histograms of {counts} begin at the wall"
                ),
            )
            .at(path.display())),
        };
    };
    let (shape, tof) = file.numbers(times)?.ok_or_else(|| {
        Error::input(
            format!("{times}, the times of flight to the wall for {counts}, is empty"),
            "store it in picoseconds; zeros if the histograms begin at the wall",
        )
    })?;
    Ok(Some((counts, shape, tof)))
}

/// Reads counts without times of flight as a single array of a rectified scan: t = 0 is at the wall.
///
/// # Errors
/// As [`single::read`].
pub(super) fn read_rectified<'s>(
    set: &'s Set,
    given: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<ReadCapture<'s>> {
    let [counts, times] = names(set);
    let file = set.holding(counts)?.ok_or_else(|| no_counts([counts, times]))?;
    let asked = given.clone().with_array(given.array.clone().or_else(|| Some(counts.into())));
    let without = format!(
        "{counts} has no {times} (times of flight to the wall) beside it: its histograms are taken to begin at the wall"
    );
    if given.time_of_flight.is_some() {
        return single::read(file, &asked, notes);
    }
    notes.push(format!("{without} (give the file of the times if they do not)"));
    single::read(file, &asked, notes).map_err(|e| Error { what: format!("{}; {without}", e.what), ..e })
}

fn no_counts([counts, times]: [&str; 2]) -> Error {
    Error::input(
        format!("holds {times} (times of flight), but no file beside it holds {counts} (counts)"),
        format!(
            "give the file with {counts}, and this one as its times of flight; or give the folder of both"
        ),
    )
}

/// Finds a capture without reading its counts; see [`super::read`].
///
/// # Errors
/// `Kind::Input` if there are no counts, or they do not fit the times of flight.
pub(super) fn read<'s>(
    set: &'s Set,
    given: &ReadOptions,
    (name, tof_shape, tof): TimesOfFlight,
    notes: &mut Vec<String>,
) -> Result<Unread<'s>> {
    let file = set.holding(name)?.ok_or_else(|| no_counts(names(set)))?;
    let given = &stated::with_bin_width(file, stated::with_wall(file, given.clone(), notes), notes);
    let counts = file.counts_shape(name)?;
    if counts.len() != 3 || counts[1..] != tof_shape[..] {
        return Err(Error::input(
            format!("{name} has shape {counts:?} and its times of flight {tof_shape:?}, which do not agree"),
            "meas is (d1, d2, t) in MATLAB and tofgrid (d1, d2), of the same scan",
        ));
    }
    let bin_width = given.bin_width("a Stanford f-k capture", Some(PICOSECONDS), notes)?;
    let wall = match given.wall {
        Some(_) => given.wall("a Stanford f-k capture")?,
        None => {
            notes.push(format!(
                "a Stanford f-k capture does not hold the wall size: {WALL} m is taken, as in its publication"
            ));
            WALL
        }
    };
    shifted(Unread::scanned(file, name, AXES, wall, bin_width)?, &tof)
}

/// Shifts every histogram to the left by its time of flight in picoseconds, in whole bins. `tof` is in the order of the
/// array.
fn shifted<'s>(unread: Unread<'s>, tof: &[f64]) -> Result<Unread<'s>> {
    let bins = unread.bins;
    let ps = unread.outline.bin_width / METRES_PER_PICOSECOND;
    let mut of_place = host::filled("tofgrid", tof.len(), None)?;
    for (pair, &place) in unread.from.iter().enumerate() {
        // A NaN time marks a pair that was not measured.
        let time = tof[place];
        if time.is_infinite() || time < 0.0 || time / ps >= bins as f64 {
            return Err(Error::input(
                format!(
                    "tofgrid is {time} ps at pair {pair}, but the {bins} bins reach from 0 to {:.0} ps",
                    ps * bins as f64
                ),
                "tofgrid is in picoseconds: check the bin width, and that both files belong together",
            ));
        }
        of_place[place] = time.is_finite().then(|| (time / ps).floor() as usize);
    }
    let kept = if longest(&of_place) == 0 { bins } else { bins.min(KEPT) };
    let shifts = Shifts { of_place, bins: kept, note };
    let outline = Capture { bins: kept, ..unread.outline };
    Ok(Unread { outline, shifts: Some(shifts), ..unread })
}

/// Says how far the histograms are shifted; `None` if they are not.
fn note(shifts: &Shifts, late: f64) -> Option<String> {
    let (most, kept) = (longest(&shifts.of_place), shifts.bins);
    let text = format!(
        "every histogram is shifted by its time of flight to the wall, up to {most} bins, and {kept} bins are kept, as \
         in its publication ({late} later counts are dropped)"
    );
    (most > 0).then_some(text)
}

/// The longest shift in bins.
fn longest(of_place: &[Option<usize>]) -> usize {
    of_place.iter().flatten().max().copied().unwrap_or(0)
}

/// Writes a confocal scan of a flat wall as `meas` and `tofgrid` (all zero, because nothing is left to shift) in one
/// MATLAB v7.3 file. The format does not hold the wall size and the bin width; notes say what to give when the file is
/// read.
///
/// # Errors
/// `Kind::Options` if the capture is not such a scan or does not begin at path 0, `Kind::Input` if it fails its check,
/// `Kind::Output` if the file cannot be written.
pub fn write(capture: &Capture, path: &Path) -> Result<Vec<String>> {
    capture.check()?;
    let [nx, ny] = capture.scan;
    let span = |points: &[glam::DVec3], c: usize| {
        let all = points.iter().map(|p| p[c]);
        all.clone().fold(f64::MIN, f64::max) - all.fold(f64::MAX, f64::min)
    };
    let wall = span(&capture.laser, 0).max(span(&capture.laser, 1));
    let regular = frame::lattice([nx, ny], wall);
    let off = capture.laser.iter().zip(&regular).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    let why_not = if capture.pair_kind() != PairKind::Confocal {
        "its laser and sensor points are apart".to_string()
    } else if off > 1e-3 * wall.max(1e-9) {
        "its points form no regular, centred lattice at z = 0".to_string()
    } else if capture.t_start != 0.0 {
        format!("its bins begin at {} m of path", capture.t_start)
    } else {
        String::new()
    };
    if !why_not.is_empty() {
        return Err(Error::options(
            format!("the capture cannot be written in the Stanford format: {why_not}"),
            "write it as .npz or .hdf5, which hold any capture",
        ));
    }
    let (mut meas, bins) = (vec![0.0f32; capture.histograms.len()], capture.bins); // bounded: as the counts that are written
    for (place, pair) in AXES.pairs([ny, nx]).into_iter().enumerate() {
        for (bin, value) in capture.histograms[pair * bins..(pair + 1) * bins].iter().enumerate() {
            meas[bin * nx * ny + place] = *value;
        }
    }
    atomic::replace(path, |temporary| {
        write_file(temporary, [bins, nx, ny], &meas).map_err(|e| {
            Error::output(format!("{}: cannot be written: {e}", path.display()), "check path and disk")
        })
    })?;
    Ok(vec![format!(
        "the Stanford format lacks the wall size, {wall} m, and the bin width, {} m: give both to read it",
        capture.bin_width
    )])
}

fn write_file(path: &Path, [bins, nx, ny]: [usize; 3], meas: &[f32]) -> std::result::Result<(), Hdf5Error> {
    const USER_BLOCK: u64 = 512;
    let file = H5File::options().userblock(USER_BLOCK).create(path)?;
    let chunk = [bins.min(64), nx.min(16), ny.min(16)];
    let counts =
        file.new_dataset::<f32>().shape([bins, nx, ny]).chunk(&chunk).shuffle_deflate(6).create("meas")?;
    counts.write_raw(meas)?;
    matlab_class(&counts, "single")?;
    let tof = file.new_dataset::<f64>().shape([nx, ny]).create("tofgrid")?;
    tof.write_raw(&vec![0.0f64; nx * ny])?; // bounded: as the points that are written
    matlab_class(&tof, "double")?;
    file.close()?;
    // MATLAB recognises the file by this text and the version after it.
    let mut header = format!(
        "{:<124}",
        "MATLAB 7.3 MAT-file, Platform: GLNXA64, written by thirdbounce HDF5 schema 1.00 ."
    )
    .into_bytes();
    header.truncate(124);
    header.extend([0x00, 0x02, b'I', b'M']);
    let mut raw = std::fs::OpenOptions::new().write(true).open(path)?;
    std::io::Write::write_all(&mut raw, &header)?;
    Ok(())
}

fn matlab_class(dataset: &rust_hdf5::H5Dataset, class: &str) -> std::result::Result<(), Hdf5Error> {
    dataset.set_attr_typed("MATLAB_class", DatatypeMessage::fixed_string(class.len() as u32), class.into())
}
