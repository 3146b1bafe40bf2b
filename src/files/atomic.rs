//! Files that appear whole or not at all.

use std::cell::Cell;
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use super::staging::{aside, sweep};
use crate::error::{Error, Result};

/// Writes `bytes` to `path`: first under a temporary name in the same folder, then renamed over it. Missing
/// folders are made. On any error nothing is left behind and an older file of that name stays as it was.
///
/// # Errors
/// `Kind::Output` naming the path and what to do.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, |temporary| {
        let mut file = fs::File::create(temporary).map_err(|e| cannot(path, &e))?;
        file.write_all(bytes).map_err(|e| cannot(path, &e))
    })
}

/// As [`write()`], for writers that want a path: `fill` writes the file at the path it is given.
///
/// # Errors
/// `Kind::Output` naming the path, or the error of `fill`.
pub fn replace(path: &Path, fill: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let Some(name) = path.file_name() else {
        return Err(Error::output(format!("{}: not a file name", path.display()), "give the name of a file"));
    };
    if path.is_dir() {
        return Err(Error::output(format!("{}: is a folder", path.display()), "give the name of a file"));
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    create_dir(folder)?;
    let prefix = format!(".{}.", name.to_string_lossy());
    sweep(folder, &prefix);
    let temporary = Temporary(aside(folder, &prefix));
    let fault = next_fault();
    if let Some(fault) = fault {
        begin(fault, &temporary.0).map_err(|e| cannot(path, &e))?;
    }
    fill(&temporary.0).map_err(if_full)?;
    let file = fs::OpenOptions::new().write(true).open(&temporary.0).map_err(|e| cannot(path, &e))?;
    file.sync_all().map_err(|e| cannot(path, &e))?;
    drop(file);
    if fault == Some(DiskFault::Unmoved) {
        return Err(cannot(path, &ErrorKind::PermissionDenied.into()));
    }
    fs::rename(&temporary.0, path).map_err(|e| cannot(path, &e))
}

/// What may go wrong with a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DiskFault {
    /// It may not be made.
    Denied,
    /// The disk is full.
    Full,
    /// It may not be moved to its place.
    Unmoved,
}

thread_local! {
    /// Files written, and which of them is to go wrong.
    static FAULT: Cell<(u64, Option<(DiskFault, u64)>)> = const { Cell::new((0, None)) };
}

/// Makes the Nth file (from 0) that this thread writes from now on go wrong, or none. Returns how many were
/// written since the last call. For tests.
pub fn inject(fault: Option<(DiskFault, u64)>) -> u64 {
    FAULT.replace((0, fault)).0
}

fn next_fault() -> Option<DiskFault> {
    let (number, fault) = FAULT.get();
    FAULT.set((number + 1, fault));
    fault.filter(|f| f.1 == number).map(|f| f.0)
}

/// Lets `fault` happen to a file that is about to be written.
fn begin(fault: DiskFault, temporary: &Path) -> std::io::Result<()> {
    match fault {
        DiskFault::Denied => Err(ErrorKind::PermissionDenied.into()),
        // A device that is always full: writers meet the real error, in the middle of their work.
        #[cfg(unix)]
        DiskFault::Full => std::os::unix::fs::symlink("/dev/full", temporary),
        #[cfg(not(unix))]
        DiskFault::Full => Err(ErrorKind::StorageFull.into()),
        DiskFault::Unmoved => Ok(()),
    }
}

/// Libraries pass the system's error on as text: a full disk has its own advice all the same.
fn if_full(mut error: Error) -> Error {
    let full = std::io::Error::from_raw_os_error(28);
    if full.kind() == ErrorKind::StorageFull && error.what.contains(&full.to_string()) {
        error.mend = FULL.into();
    }
    error
}

/// Makes a folder and those above it, if missing.
///
/// # Errors
/// `Kind::Output` if something else stands there or it may not be made.
pub fn create_dir(folder: &Path) -> Result<()> {
    if folder.exists() && !folder.is_dir() {
        return Err(Error::output(
            format!("{}: is a file, not a folder", folder.display()),
            "choose another folder for the results, or move that file away",
        ));
    }
    fs::create_dir_all(folder).map_err(|e| cannot(folder, &e))
}

/// A file that goes away with this value; after a rename there is nothing left to remove.
struct Temporary(PathBuf);

impl Drop for Temporary {
    fn drop(&mut self) {
        // Nothing to do about a failure here: the error that led here is already on its way.
        let _ = fs::remove_file(&self.0);
    }
}

const FULL: &str = "the disk is full: free some space or write elsewhere";

/// The error for a failed write, with advice by its cause.
pub(crate) fn cannot(path: &Path, e: &std::io::Error) -> Error {
    let mend = match e.kind() {
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "choose a folder that you may write to"
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => FULL,
        ErrorKind::NotADirectory | ErrorKind::AlreadyExists => {
            "a part of the path is a file: choose another path"
        }
        ErrorKind::InvalidFilename => "choose a shorter or simpler name",
        _ => "check the path and the disk",
    };
    Error::output(format!("{}: cannot be written: {e}", path.display()), mend)
}
