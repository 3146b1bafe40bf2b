//! Results as files: npz, EXR, PNG, SVG, PLY, reports and tables. Writes are atomic, and equal results give equal
//! bytes.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

#[doc(hidden)]
pub mod axis;
pub mod depth_difference;
pub mod depth_error;
pub mod exr;
#[doc(hidden)]
pub mod figure;
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
pub mod probability;
pub mod report;
#[doc(hidden)]
pub mod text;
pub mod track;
pub mod volume;

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use thirdbounce_base::{error, files};
use thirdbounce_capture as capture;
use thirdbounce_maps::{maps, measure, verdict};

use crate::error::{Error, Result};
use crate::files::atomic;
use crate::maps::Maps;

/// The bytes of a file of checked maps.
type Pack = fn(&Maps) -> Result<Vec<u8>>;

/// Writes the maps in every format into `folder` (created if missing): `maps.npz`, `maps.mat`, `maps.exr`, `maps.svg`,
/// `albedo.png`, `depth.png`, `normal.png`, `points.ply`, `mesh.ply`, and `depth_error.png` and `probability.png` if the
/// expected depth error and the probability of surface are known. Returns the paths.
///
/// # Errors
/// `Kind::Input` if the maps' sizes do not agree, `Kind::Output` if a file cannot be written.
pub fn write_maps(folder: &Path, maps: &Maps) -> Result<Vec<PathBuf>> {
    const FILES: [(&str, Pack); 10] = [
        ("maps.npz", npz::bytes),
        ("maps.mat", mat::bytes),
        ("maps.exr", exr::bytes),
        ("maps.svg", print::bytes),
        ("albedo.png", png::albedo_bytes),
        ("depth.png", png::depth_bytes),
        ("normal.png", png::normal_bytes),
        ("depth_error.png", depth_error::bytes),
        ("probability.png", probability::bytes),
        ("points.ply", ply::bytes),
    ];
    maps.check()?;
    let is_there = |name: &str| match name {
        "depth_error.png" => maps.depth_error.is_some(),
        "probability.png" => maps.probability.is_some(),
        _ => true,
    };
    let files: Vec<(&str, Pack)> = FILES.into_iter().filter(|(name, _)| is_there(name)).collect();
    // The mesh takes as long as all others. Only packing is parallel: files are written in their order.
    let (mesh, mut packed) = rayon::join(
        || mesh::bytes(maps),
        || files.par_iter().map(|(name, pack)| (*name, pack(maps))).collect::<Vec<_>>(),
    );
    packed.push(("mesh.ply", mesh));
    let write = |(name, packed)| {
        let path = folder.join(name);
        put_packed(&path, packed).map(|()| path)
    };
    packed.into_iter().map(write).collect()
}

/// Writes checked maps to a file.
fn put(path: &Path, maps: &Maps, pack: Pack) -> Result<()> {
    maps.check()?;
    put_packed(path, pack(maps))
}

fn put_packed(path: &Path, packed: Result<Vec<u8>>) -> Result<()> {
    atomic::write(path, &packed.map_err(|e| e.at(path.display()))?)
}

/// Formats that hold maps in one file.
const FILES: [(&str, Pack); 6] = [
    ("npz", npz::bytes),
    ("mat", mat::bytes),
    ("exr", exr::bytes),
    ("ply", ply::bytes),
    ("png", print::plain_bytes),
    ("svg", print::bytes),
];

/// Writes maps to `path`: one file of the format of its ending, or into a folder ([`write_maps`]) if it has no ending or
/// is a folder. Returns the paths.
///
/// # Errors
/// `Kind::Options` for an unknown ending, and those of [`write_maps`].
pub fn save(path: &Path, maps: &Maps) -> Result<Vec<PathBuf>> {
    let Some(ending) = path.extension().filter(|_| !path.is_dir()) else { return write_maps(path, maps) };
    let Some((_, pack)) = FILES.iter().find(|(known, _)| ending.eq_ignore_ascii_case(known)) else {
        let known = FILES.map(|(ending, _)| format!(".{ending}")).join(", ");
        return Err(Error::options(
            format!("maps are not saved as .{}", ending.display()),
            format!("give a file that ends in {known}, or a folder: a name without an ending"),
        ));
    };
    put(path, maps, *pack).map(|()| vec![path.into()])
}
