//! Whether results can be written, found out before hours of work and without leaving anything behind.

use std::fs;
use std::path::Path;

use crate::files::atomic::cannot;
use crate::files::staging;
use crate::{Error, Result};

/// What a run writes into its folder.
const RESULTS: [&str; 8] = [
    "maps.npz",
    "maps.exr",
    "albedo.png",
    "depth.png",
    "normal.png",
    "points.ply",
    "mesh.ply",
    "report.json",
];

/// Whether `folder` can take the results of a run; it need not exist.
pub fn check_results(folder: &Path) -> Result<()> {
    check_folder(folder)?;
    match RESULTS.iter().map(|name| folder.join(name)).find(|path| path.is_dir()) {
        Some(path) => Err(Error::output(
            format!("{}: is a folder where a result file goes", path.display()),
            "choose another --out, or move that folder away",
        )),
        None => Ok(()),
    }
}

/// Whether `file` can take a volume.
pub fn check_volume(file: &Path) -> Result<()> {
    let ending = file.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase());
    if !matches!(ending.as_str(), "npz" | "hdf5" | "h5") {
        return Err(Error::options(
            format!("{}: the ending says no volume format", file.display()),
            "name the volume's file .npz or .hdf5",
        ));
    }
    check_file(file)
}

/// Whether `file` can be written; its folder need not exist.
pub fn check_file(file: &Path) -> Result<()> {
    if file.is_dir() {
        return Err(Error::output(
            format!("{}: is a folder", file.display()),
            "give the name of a file in it",
        ));
    }
    check_folder(file.parent().unwrap_or(Path::new(".")))
}

/// Writes and removes an empty file in `folder`, or in the nearest one above it that exists.
fn check_folder(folder: &Path) -> Result<()> {
    // A relative path ends in nothing, which is the folder one is in.
    let here = |at: &Path| at.as_os_str().is_empty();
    let exists = |at: &&Path| here(at) || fs::symlink_metadata(at).is_ok();
    let at = folder.ancestors().find(exists).filter(|at| !here(at)).unwrap_or(Path::new("."));
    if !at.is_dir() {
        return Err(Error::output(
            format!("{}: cannot hold results, {} is no folder", folder.display(), at.display()),
            "choose another folder for the results",
        ));
    }
    staging::probe(at).map_err(|e| cannot(folder, &e))
}
