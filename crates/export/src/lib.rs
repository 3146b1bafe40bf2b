//! Results as files: npz, EXR, PNG, SVG, PLY, reports and tables. Writes are atomic, and equal results give equal
//! bytes.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

mod axis;
pub mod benchmark;
pub mod calibration;
pub mod depth_difference;
pub mod depth_error;
pub mod exr;
pub mod figure;
pub mod foreign;
pub mod index;
pub mod inspection;
pub mod mat;
pub mod mesh;
pub mod npz;
pub mod page;
pub mod picture;
pub mod plot;
pub mod ply;
pub mod png;
pub mod print;
pub mod report;
mod text;
pub mod volume;

use std::path::{Path, PathBuf};

use thirdbounce_base::{advice, error, files};
use thirdbounce_capture as capture;
use thirdbounce_maps::{maps, measure, verdict};

use crate::error::{Error, Result};
use crate::maps::Maps;

type Writer = fn(&Path, &Maps) -> Result<()>;

/// Writes the maps in every format into `folder` (created if missing): `maps.npz`, `maps.mat`, `maps.exr`, `maps.svg`,
/// `albedo.png`, `depth.png`, `normal.png`, `points.ply`, `mesh.ply`, and `depth_error.png` if the expected depth error is
/// known. Returns the paths.
///
/// # Errors
/// `Kind::Input` if the maps' sizes do not agree, `Kind::Output` if a file cannot be written.
pub fn write_maps(folder: &Path, maps: &Maps) -> Result<Vec<PathBuf>> {
    let writers: [(&str, Writer); 10] = [
        ("maps.npz", npz::write_maps),
        ("maps.mat", mat::write),
        ("maps.exr", exr::write),
        ("maps.svg", print::write),
        ("albedo.png", png::write_albedo),
        ("depth.png", png::write_depth),
        ("normal.png", png::write_normal),
        ("depth_error.png", depth_error::write),
        ("points.ply", ply::write),
        ("mesh.ply", mesh::write),
    ];
    let mut written = Vec::new();
    let is_there = |name: &str| name != "depth_error.png" || maps.depth_error.is_some();
    for (name, write) in writers.into_iter().filter(|w| is_there(w.0)) {
        let path = folder.join(name);
        write(&path, maps)?;
        written.push(path);
    }
    Ok(written)
}

/// Formats that hold maps in one file.
const FILES: [(&str, Writer); 6] = [
    ("npz", npz::write_maps),
    ("mat", mat::write),
    ("exr", exr::write),
    ("ply", ply::write),
    ("png", print::write_plain),
    ("svg", print::write),
];

/// Writes maps to `path`: one file of the format of its ending, or into a folder ([`write_maps`]) if it has no ending or
/// is a folder. Returns the paths.
///
/// # Errors
/// `Kind::Options` for an unknown ending, and those of [`write_maps`].
pub fn save(path: &Path, maps: &Maps) -> Result<Vec<PathBuf>> {
    let Some(ending) = path.extension().filter(|_| !path.is_dir()) else { return write_maps(path, maps) };
    let Some((_, write)) = FILES.iter().find(|(known, _)| ending.eq_ignore_ascii_case(known)) else {
        let known = FILES.map(|(ending, _)| format!(".{ending}")).join(", ");
        return Err(Error::options(
            format!("maps are not saved as .{}", ending.display()),
            format!("give a file that ends in {known}, or a folder: a name without an ending"),
        ));
    };
    write(path, maps).map(|()| vec![path.into()])
}
