//! Checks that results can be written, before hours of work. The checks leave nothing behind.

use std::fs;
use std::path::Path;

use crate::files::atomic::{cannot, is_stream};
use crate::files::hidden;
use crate::{Error, Result};

/// The picture that a run shows, in the folder of its results.
pub const PREVIEW: &str = "preview.png";

/// The page of a result, in its folder.
pub const PAGE: &str = "report.html";

/// Files that a run writes into its folder, the preview among them.
const RESULTS: [&str; 14] = [
    "maps.npz",
    "maps.mat",
    "maps.svg",
    "maps.exr",
    "albedo.png",
    "depth.png",
    "normal.png",
    "depth_error.png",
    "probability.png",
    "points.ply",
    "mesh.ply",
    "report.json",
    PAGE,
    PREVIEW,
];

/// Checks that `folder` can take the results of a run. It need not exist.
pub fn check_results(folder: &Path) -> Result<()> {
    check_folder(folder)?;
    match RESULTS.iter().map(|name| folder.join(name)).find(|path| path.is_dir()) {
        Some(path) => Err(Error::output(
            format!("{}: is a folder, but a result file has this name", path.display()),
            "choose another folder for the results, or move this folder away",
        )),
        None => Ok(()),
    }
}

/// Checks that a run with results in `folder` does not write over one of the files that it reads.
///
/// # Errors
/// `Kind::Options`, naming the file.
pub fn check_inputs<'p>(inputs: impl IntoIterator<Item = &'p Path>, folder: &Path) -> Result<()> {
    inputs.into_iter().try_for_each(|input| {
        RESULTS.iter().try_for_each(|name| check_not_input(&folder.join(name), [input]))
    })
}

/// Checks that `file` is none of the inputs, whatever their paths look like.
///
/// # Errors
/// `Kind::Options`, naming the file.
pub fn check_not_input<'p>(file: &Path, inputs: impl IntoIterator<Item = &'p Path>) -> Result<()> {
    let whole = |path: &Path| fs::canonicalize(path).ok().filter(|path| path.is_file());
    let Some(place) = whole(file) else { return Ok(()) };
    match inputs.into_iter().any(|input| whole(input).as_ref() == Some(&place)) {
        true => Err(Error::options(
            format!("{}: is read, and would be written over", file.display()),
            "give another name or folder for what is written",
        )),
        false => Ok(()),
    }
}

/// Checks that `file` can take a volume.
pub fn check_volume(file: &Path) -> Result<()> {
    let ending = file.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase());
    if !matches!(ending.as_str(), "npz" | "hdf5" | "h5") {
        return Err(Error::options(
            format!("{}: no volume format has this ending", file.display()),
            "let the name of the volume's file end in .npz or .hdf5",
        ));
    }
    check_file(file)
}

/// Checks that `file` can be written. Its folder need not exist.
pub fn check_file(file: &Path) -> Result<()> {
    if file.is_dir() {
        return Err(Error::output(
            format!("{}: is a folder", file.display()),
            "give the name of a file in it",
        ));
    }
    if is_stream(file) {
        return Ok(());
    }
    check_folder(file.parent().unwrap_or(Path::new(".")))
}

/// Writes and removes an empty file in `folder`, or in the nearest folder above it that exists.
pub fn check_folder(folder: &Path) -> Result<()> {
    // The last ancestor of a relative path is empty: the current folder.
    let here = |at: &Path| at.as_os_str().is_empty();
    let exists = |at: &&Path| here(at) || fs::symlink_metadata(at).is_ok();
    let at = folder.ancestors().find(exists).filter(|at| !here(at)).unwrap_or(Path::new("."));
    if !at.is_dir() {
        return Err(Error::output(
            format!("{}: cannot hold results, {} is no folder", folder.display(), at.display()),
            "choose another folder for the results",
        ));
    }
    hidden::probe(at).map_err(|e| cannot(folder, &e))
}
