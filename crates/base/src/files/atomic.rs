//! Atomic writes: a file appears completely or not at all.

use std::cell::Cell;
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use super::hidden::{Hidden, is_hidden};
use crate::error::{Error, Result};

/// Writes `bytes` to `path` through a file in a hidden folder beside it, which is then renamed. Missing folders are
/// created. On an error no file remains, and a previous file at `path` is unchanged. The target of a symbolic link is
/// replaced, the link kept. Devices and pipes (`/dev/null`, `/dev/stdout`) are written directly.
///
/// # Errors
/// `Kind::Output`, naming the path and the fix.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, |temporary| {
        let mut file = fs::File::create(temporary).map_err(|e| cannot(path, &e))?;
        file.write_all(bytes).map_err(|e| cannot(path, &e))
    })
}

/// As [`write()`], for writers that need a path: `fill` writes the file at its argument.
///
/// # Errors
/// `Kind::Output`, naming the path, or the error of `fill`.
pub fn replace(path: &Path, fill: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let Some(name) = path.file_name() else {
        return Err(Error::output(format!("{}: not a file name", path.display()), "give the name of a file"));
    };
    if path.is_dir() {
        return Err(Error::output(format!("{}: is a folder", path.display()), "give the name of a file"));
    }
    let stream = is_stream(path);
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.into());
    let folder = match target.parent() {
        _ if stream => std::env::temp_dir(),
        Some(folder) if !folder.as_os_str().is_empty() => folder.into(),
        _ => PathBuf::from("."),
    };
    create_dir(&folder)?;
    let hidden = Hidden::new(&folder).map_err(|e| cannot(path, &e))?;
    let temporary = hidden.path().join(target.file_name().unwrap_or(name));
    let fault = next_fault();
    if let Some(fault) = fault {
        begin(fault, &temporary).map_err(|e| cannot(path, &e))?;
    }
    fill(&temporary).map_err(if_full)?;
    // Files of a hidden folder are synced before they are moved, all at once.
    let is_staged = !stream && is_hidden(&folder);
    if !is_staged {
        #[cfg(test)]
        record(&target);
        sync_file(&temporary).map_err(|e| cannot(path, &e))?;
    }
    if fault == Some(DiskFault::Unmoved) {
        return Err(cannot(path, &ErrorKind::PermissionDenied.into()));
    }
    let moved = if stream { pour(&temporary, path) } else { fs::rename(&temporary, &target) };
    moved.map_err(|e| cannot(path, &e))?;
    if stream || is_staged { Ok(()) } else { sync_folder(&folder) }
}

/// Flushes a file's content to the disk.
pub(super) fn sync_file(file: &Path) -> std::io::Result<()> {
    fs::OpenOptions::new().write(true).open(file)?.sync_all()
}

/// Flushes a folder's entries to the disk. No-op on file systems without support.
pub(super) fn sync_folder(folder: &Path) -> Result<()> {
    #[cfg(test)]
    record(folder);
    match fs::File::open(folder).map(|f| f.sync_all()) {
        Ok(Err(e)) if !matches!(e.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => {
            Err(cannot(folder, &e))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
thread_local! {
    static SYNCED: std::cell::RefCell<Vec<PathBuf>> = const { std::cell::RefCell::new(vec![]) };
}

/// Records that a file or folder is synced.
#[cfg(test)]
pub(super) fn record(path: &Path) {
    SYNCED.with_borrow_mut(|all| all.push(path.into()));
}

/// Files and folders synced for this thread since the last call.
#[cfg(test)]
pub(super) fn synced() -> Vec<PathBuf> {
    SYNCED.take()
}

/// Whether `path` is writable but not replaceable: a device, a pipe, or an open file of a process.
pub fn is_stream(path: &Path) -> bool {
    let open = ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc"];
    let open = open.iter().any(|name| path.starts_with(name)) && path.exists();
    open || fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir())
}

fn pour(from: &Path, to: &Path) -> std::io::Result<()> {
    // Standard output may be a file that already has text.
    let mut to = fs::OpenOptions::new().append(true).open(to)?;
    std::io::copy(&mut fs::File::open(from)?, &mut to).map(|_| ())
}

/// A fault of the disk, for tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DiskFault {
    /// The file may not be created.
    Denied,
    /// The disk is full.
    Full,
    /// The temporary file may not be renamed.
    Unmoved,
}

thread_local! {
    /// Number of files written, and the fault with the number of the file that it hits.
    static FAULT: Cell<(u64, Option<(DiskFault, u64)>)> = const { Cell::new((0, None)) };
}

/// Injects a fault into the Nth file (from 0) that this thread writes after this call, or clears it. Returns the
/// number of files written since the last call. For tests.
pub fn inject(fault: Option<(DiskFault, u64)>) -> u64 {
    FAULT.replace((0, fault)).0
}

fn next_fault() -> Option<DiskFault> {
    let (number, fault) = FAULT.get();
    FAULT.set((number + 1, fault));
    fault.filter(|f| f.1 == number).map(|f| f.0)
}

/// Applies `fault` to a file before it is written.
fn begin(fault: DiskFault, temporary: &Path) -> std::io::Result<()> {
    match fault {
        DiskFault::Denied => Err(ErrorKind::PermissionDenied.into()),
        // A device that is always full: writers receive the real error during writing.
        #[cfg(unix)]
        DiskFault::Full => std::os::unix::fs::symlink("/dev/full", temporary),
        #[cfg(not(unix))]
        DiskFault::Full => Err(ErrorKind::StorageFull.into()),
        DiskFault::Unmoved => Ok(()),
    }
}

/// Libraries convert the system's error to text; a full disk is recognised by that text.
fn if_full(mut error: Error) -> Error {
    // ENOSPC, EDQUOT.
    let full = [28, 122].map(std::io::Error::from_raw_os_error);
    if full.iter().any(|e| is_of_full(e.kind()) && error.what.contains(&e.to_string())) {
        error.hint = FULL.into();
    }
    error
}

fn is_of_full(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
}

/// Whether an error reports a full disk or an exhausted quota.
pub fn is_full(error: &Error) -> bool {
    error.hint == FULL.into()
}

/// Creates a folder and its parents, if missing.
///
/// # Errors
/// `Kind::Output` if the path exists and is not a folder, or if the folder cannot be created.
pub fn create_dir(folder: &Path) -> Result<()> {
    if folder.exists() && !folder.is_dir() {
        return Err(Error::output(
            format!("{}: is a file, not a folder", folder.display()),
            "choose another folder for the results, or move that file away",
        ));
    }
    fs::create_dir_all(folder).map_err(|e| cannot(folder, &e))
}

const FULL: &str = "the disk is full: free some space or write elsewhere";

/// The error of a failed write, with advice for its cause.
pub fn cannot(path: &Path, e: &std::io::Error) -> Error {
    let hint = match e.kind() {
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "choose a folder that you may write to"
        }
        kind if is_of_full(kind) => FULL,
        ErrorKind::NotADirectory | ErrorKind::AlreadyExists => {
            "a part of the path is a file: choose another path"
        }
        ErrorKind::InvalidFilename => "choose a shorter or simpler name",
        _ => "check the path and the disk",
    };
    Error::output(format!("{}: cannot be written: {e}", path.display()), hint)
}
