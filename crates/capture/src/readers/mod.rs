//! Capture files, one module per format. The contents of a file decide its format, not its name. Some formats are
//! several files in a folder.

mod blocks;
pub mod ccsocr;
mod container;
mod contents;
mod convolutional;
pub mod counts;
mod dirac;
mod documented;
mod exhaustive;
mod frame;
pub mod general;
mod glance;
pub mod hdf5;
mod kilometre;
mod lct;
mod listed;
mod lit;
pub mod matlab5;
pub mod netf;
pub mod npz;
mod numbers;
mod opened;
pub mod phasor;
mod points;
mod pulse;
mod read_options;
pub mod recognised;
mod scatter;
pub mod set;
mod single;
mod socr_units;
pub mod stanford;
mod stated;
mod unread;
pub mod variables;
pub mod ytal;
pub mod znlos;
mod zones;

pub use crate::conditioning::legs;
pub use contents::HDF5;
pub use opened::Opened;
pub use read_options::ReadOptions;

use contents::Contents;
use unread::ReadCapture;
use variables::Variables;

use std::path::Path;

use crate::conditioning::{self, Conditioned, Conditioning, ConditioningStep};
use crate::error::{Error, Result};
use crate::{Capture, Keep};

/// Reads a capture in any known format, leaves out pairs that were not measured (see
/// [`Capture::without_missing`]) and checks the rest. The name is the file's stem.
///
/// # Errors
/// `Kind::Input`, beginning with the path: a missing, empty, cut or damaged file, a folder without a capture, an
/// unknown format, missing arrays, or anything that [`Capture::check`] finds. `Kind::Options` if the file lacks a value
/// that has no usual value either (see [`ReadOptions`]). `Kind::Memory` if the counts do not fit.
pub fn read(path: &Path) -> Result<Capture> {
    read_given(path, &ReadOptions::default()).map(|read| read.capture)
}

/// Reads a capture as [`read`] does, and returns notes and the number of dropped pairs with it.
///
/// # Errors
/// Those of [`read`].
pub fn read_with_notes(path: &Path) -> Result<Opened> {
    read_given(path, &ReadOptions::default())
}

/// Reads a capture as [`read`] does, with values that the file does not hold.
///
/// # Errors
/// Those of [`read`]. `Kind::Options` for a bin width, a bounce or a file of times of flight if the format takes none.
pub fn read_given(path: &Path, given: &ReadOptions) -> Result<Opened> {
    read_kept(path, given, &Keep::default())
}

/// Reads a part of a capture, with values that the file does not hold. The result is that of [`read_given`] followed by
/// [`Capture::stride`], [`Capture::subset`] and [`Capture::gated`]; large files take less memory. All counts of the
/// file are checked.
///
/// # Errors
/// Those of [`read_given`] and of the three.
pub fn read_kept(path: &Path, given: &ReadOptions, keep: &Keep) -> Result<Opened> {
    let how = Conditioning { keep: *keep, ..given.conditioning() };
    read_through(path, given, conditioning::AS_RECORDED, &how).map(Opened::from)
}

/// Reads a capture and makes it ready for a solve, as [`conditioning::prepare`] does with one in memory.
///
/// # Errors
/// Those of [`read_given`] and of [`conditioning::prepare`].
#[doc(hidden)]
pub fn read_prepared(path: &Path, given: &ReadOptions, how: &Conditioning) -> Result<Conditioned> {
    read_through(path, given, conditioning::FOR_A_SOLVE, how)
}

/// Reads what is kept of a capture after these steps.
fn read_through(
    path: &Path,
    given: &ReadOptions,
    steps: &[ConditioningStep],
    how: &Conditioning,
) -> Result<Conditioned> {
    let place = |e: Error| e.at(path.display());
    let mut notes = Vec::new();
    let name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let mut set;
    let found = match contents::of(path).map_err(place)? {
        Contents::Zip => given
            .no_axes("an npz file")
            .and_then(|()| npz::read(path, given, &mut notes))
            .map(ReadCapture::Whole),
        Contents::Hdf5 | Contents::Matlab5 | Contents::Folder => {
            set = set::Set::open(path).map_err(place)?;
            read_set(&mut set, given, &mut notes)
        }
        Contents::Matlab4 => Err(contents::version_4()),
        Contents::Npy => Err(counts::alone_in_npy(path)),
        Contents::Unknown => Err(match recognised::of(path).map_err(place)? {
            Some(known) => known.refusal(),
            None => unknown("the format is not known"),
        }),
    };
    let found = found.map_err(|e| recognised::tags_in_arrays(path).map_or(e, |tags| tags.refusal()));
    let capture = match found.map_err(place)? {
        ReadCapture::Unread(unread) => return unread.read(name, (steps, how), notes, &place),
        ReadCapture::Whole(capture) => Capture { name, ..capture },
    };
    let mut measured = conditioning::measured(capture, how.keep_empty).map_err(place)?;
    measured.notes.splice(0..0, notes);
    measured.through(steps, how)
}

/// Finds the format by the names of the arrays, and reads it.
fn read_set<'s>(
    set: &'s mut set::Set,
    given: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<ReadCapture<'s>> {
    let no_bounce = |what: &str| match given.bounce {
        None => given.no_axes(what),
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
    if ["meas", "tofgrid", "measlr"].iter().any(|name| set.any(name)) {
        return match stanford::times_of_flight(set, given)? {
            Some(tof) => {
                no_bounce("a Stanford f-k capture")?;
                stanford::read(set, given, tof, notes).map(ReadCapture::Unread)
            }
            None => {
                if given.bounce.is_some() {
                    no_bounce("meas")?;
                }
                stanford::read_rectified(set, given, notes)
            }
        };
    }
    if given.time_of_flight.is_some() {
        return Err(Error::options(
            "times of flight were given, but there is no meas, the counts of a Stanford f-k capture",
            "leave the file of times of flight out",
        ));
    }
    if socr {
        no_bounce("a CC-SOCR capture")?;
        return ccsocr::read(set, given, notes).map(ReadCapture::Whole);
    }
    let positions = set.any("cameraGridPositions");
    // The points of General-NLOS lie in a second file.
    if !positions && general::counts_name(set).is_some() {
        set.add_beside(&["setup.mat".into()])?;
    }
    if ["laserpoints", "detectpoints"].iter().any(|name| set.any(name)) {
        no_bounce("a General-NLOS capture")?;
        return general::read(set, given, notes).map(ReadCapture::Whole);
    }
    let file = match set.holding("cameraGridPositions")? {
        Some(file) => file,
        None => set.first().ok_or_else(|| unknown("the folder is empty"))?,
    };
    if positions {
        given.no_bin_width("a file with Z-NLOS names")?;
        given.no_axes("a file with Z-NLOS names")?;
        let axes = file.shape("data")?.ok_or_else(|| file.missing("data"))?.len();
        return if axes == 3 {
            no_bounce("a NeTF capture")?;
            netf::read(file, notes).map(ReadCapture::Whole)
        } else {
            znlos::read(file, given, notes).map(ReadCapture::Whole)
        };
    }
    if given.bounce.is_some() {
        no_bounce("the file")?;
    }
    read_single(file, given, notes)
}

/// A format of a single file: the criterion, its name, whether the file holds its bin width, and its reader.
struct FileFormat {
    is: fn(&Variables) -> bool,
    name: &'static str,
    has_bin_width: bool,
    read: for<'s> fn(&'s Variables, &ReadOptions, &mut Vec<String>) -> Result<ReadCapture<'s>>,
}

const FORMATS: [FileFormat; 10] = [
    FileFormat {
        is: |file| file.have(&["laser_grid_xyz"]) || file.have(&[ytal::SENSOR_POINTS]),
        name: "a y-tal capture",
        has_bin_width: true,
        read: |file, _, notes| ytal::read_variables(file, notes).map(ReadCapture::Whole),
    },
    FileFormat {
        // A file that holds `H` alone is a single array of anybody.
        is: |file| file.have(&["H"]) && file.names().len() > 1,
        name: "a file with the arrays of the npz form",
        has_bin_width: false,
        read: |file, given, notes| npz::read_variables(file, given, notes).map(ReadCapture::Whole),
    },
    FileFormat {
        is: |file| file.have(&["data_t"]),
        name: "an NLOS-Dirac capture",
        has_bin_width: true,
        read: |file, _, notes| dirac::read(file, notes).map(ReadCapture::Unread),
    },
    FileFormat {
        is: convolutional::is_one,
        name: "a file with NLOSDATA",
        has_bin_width: true,
        read: |file, _, notes| convolutional::read(file, notes).map(ReadCapture::Unread),
    },
    FileFormat {
        is: |file| file.have(&["sig_in"]),
        name: "a 1.43 km capture",
        has_bin_width: false,
        read: |file, given, notes| kilometre::read(file, given, notes).map(ReadCapture::Unread),
    },
    FileFormat {
        is: lit::is_one,
        name: "a surface-optimisation capture",
        has_bin_width: false,
        read: |file, given, notes| lit::read(file, given, notes).map(ReadCapture::Unread),
    },
    FileFormat {
        is: |file| file.have(&["dataset/data"]),
        name: "a phasor-field capture",
        has_bin_width: true,
        read: |file, _, notes| phasor::read_2019(file, notes).map(ReadCapture::Whole),
    },
    FileFormat {
        is: |file| file.have(&["rect_data", "width"]),
        name: "an LCT capture",
        has_bin_width: false,
        read: |file, given, notes| lct::read(file, given, notes).map(ReadCapture::Unread),
    },
    FileFormat {
        is: |file| file.have(&["rect_data", "ts"]),
        name: "a phasor-field capture",
        has_bin_width: true,
        read: |file, _, notes| phasor::read_2020(file, notes).map(ReadCapture::Unread),
    },
    FileFormat {
        is: listed::is_3d_rsd,
        name: "a 3D-RSD capture",
        has_bin_width: true,
        read: |file, _, notes| listed::read_3d_rsd(file, notes).map(ReadCapture::Whole),
    },
];

/// Finds the format of a capture that is one file, by the names of its arrays, and reads it.
fn read_single<'s>(
    file: &'s Variables,
    given: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<ReadCapture<'s>> {
    if let Some(format) = FORMATS.iter().find(|format| (format.is)(file)) {
        given.no_axes(format.name)?;
        if format.has_bin_width {
            given.no_bin_width(format.name)?;
        }
        return (format.read)(file, given, notes);
    }
    if let Some(error) = single::in_structs(&file.names()) {
        return Err(error);
    }
    if let Some(capture) = listed::read(file, given, notes)? {
        return Ok(ReadCapture::Whole(capture));
    }
    single::read(file, given, notes)
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
    if capture.devices != [None; 2] {
        notes.push("this format cannot hold the positions of the devices: write npz".into());
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
        "give a capture as npz (H, sensor_xyz, laser_xyz, delta_t), y-tal or Z-NLOS HDF5, or one of the known MATLAB files",
    )
}
