//! Captures in folders, by the names of their files.

use std::fs;
use std::path::{Path, PathBuf};

use thirdbounce::capture::formats::set::Set;
use thirdbounce::{Error, Result};

/// Endings of captures.
const CAPTURES: [&str; 4] = ["npz", "hdf5", "h5", "mat"];

/// The captures of a folder, sorted: files, without truths, and folders that are one capture each.
///
/// # Errors
/// A folder that cannot be read.
pub fn captures_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let is_one = |path: &PathBuf| if path.is_dir() { is_capture(path) } else { is_capture_file(path) };
    Ok(entries(folder)?.into_iter().filter(is_one).collect())
}

/// Whether a file is a capture by its name, and no truth.
pub fn is_capture_file(file: &Path) -> bool {
    let name = stem(file);
    CAPTURES.contains(&ending(file).as_str()) && !name.starts_with("truth_") && !name.ends_with("_truth")
}

/// Whether a folder is one capture: a few files of a format that has several.
pub fn is_capture(folder: &Path) -> bool {
    const MOST_FILES: usize = 8;
    let files = entries(folder).unwrap_or_default();
    let files: Vec<String> = files.iter().filter(|path| path.is_file()).map(|path| ending(path)).collect();
    let held = files.iter().filter(|ending| CAPTURES.contains(&ending.as_str())).count();
    if !(1..=MOST_FILES).contains(&held) || files.iter().any(|ending| ending == "npz") {
        return false;
    }
    Set::open(folder).is_ok_and(|set| {
        let alone = |name: &str| matches!(set.holding(name), Ok(Some(_)));
        ["laserpoints", "C_i"].into_iter().any(alone) || (alone("meas") && alone("tofgrid"))
    })
}

/// What a folder of the user holds, sorted.
///
/// # Errors
/// A folder that cannot be read, with what to give.
pub fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let cannot = |e: std::io::Error| {
        Error::input(
            format!("{}: cannot be read: {e}", folder.display()),
            "give a folder with captures or scenes",
        )
    };
    paths_in(folder).map_err(cannot)
}

/// What a folder holds, sorted.
///
/// # Errors
/// A folder that cannot be read.
pub fn paths_in(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut all = fs::read_dir(folder)?.map(|e| Ok(e?.path())).collect::<std::io::Result<Vec<_>>>()?;
    all.sort();
    Ok(all)
}

/// The ending of a file's name, in lower case.
pub fn ending(path: &Path) -> String {
    path.extension().map_or_else(String::new, |ending| ending.to_string_lossy().to_lowercase())
}

/// The name of a file without its ending.
pub fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}
