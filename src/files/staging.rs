//! Results of several files that replace older ones together: all are written to a hidden folder, then moved to their
//! places.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use super::atomic::{cannot, create_dir};
use crate::error::{Error, Result};

const PREFIX: &str = ".thirdbounce.";
const SUFFIX: &str = ".part";

/// How long to wait for another process to move its results, which takes milliseconds.
const PATIENCE: Duration = Duration::from_secs(20);

/// A plain file that a killed process left is removed after this time without a change.
const STALE: Duration = Duration::from_secs(60);

/// A hidden folder inside the folder of the results. It is removed when this value is dropped. If the process is
/// killed, the next process that writes there removes it.
pub struct Staging {
    target: PathBuf,
    folder: PathBuf,
    // Held while this process lives, so that the folder is not taken for one that a killed process left.
    _lock: Option<File>,
}

impl Staging {
    /// Creates `target` and its parents, if missing, and the hidden folder in it.
    ///
    /// # Errors
    /// `Kind::Output` if a folder cannot be created.
    pub fn new(target: &Path) -> Result<Staging> {
        create_dir(target)?;
        sweep(target, PREFIX);
        let folder = aside(target, PREFIX);
        fs::create_dir(&folder).map_err(|e| cannot(target, &e))?;
        let lock = File::open(&folder).ok().filter(|f| f.try_lock().is_ok());
        Ok(Staging { target: target.into(), folder, _lock: lock })
    }

    /// The hidden folder: write the files here.
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// Moves `files` (inside [`Staging::path`]) to their places, in order, and returns their new paths. An older file
    /// at the last place is removed first: the last file exists only when all others are in place. Other processes that
    /// commit to the same folder wait.
    ///
    /// # Errors
    /// `Kind::Output` if a file cannot be moved, or if another process keeps the folder locked for too long.
    pub fn commit(self, files: &[PathBuf]) -> Result<Vec<PathBuf>> {
        let _lock = alone_in(&self.target)?;
        let place = |file: &PathBuf| {
            let inside = file.strip_prefix(&self.folder).unwrap_or(file);
            self.target.join(inside)
        };
        let places: Vec<PathBuf> = files.iter().map(place).collect();
        if let Some(last) = places.last() {
            remove(last)?;
        }
        for (from, to) in files.iter().zip(&places) {
            to.parent().map(create_dir).transpose()?;
            fs::rename(from, to).map_err(|e| cannot(to, &e))?;
        }
        Ok(places)
    }

    /// Moves the folder `name` (inside [`Staging::path`]) to its place in the target, whole. An older folder of that name
    /// goes. A process that is killed in between leaves the old folder, the new one, or none, never a part.
    ///
    /// # Errors
    /// `Kind::Output` if a folder cannot be moved, or if another process keeps the target locked for too long.
    pub fn commit_folder(self, name: &str) -> Result<PathBuf> {
        let _lock = alone_in(&self.target)?;
        let (place, old) = (self.target.join(name), self.folder.join(".old"));
        match fs::rename(&place, &old) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(cannot(&place, &e)),
            _ => {}
        }
        fs::rename(self.folder.join(name), &place).map_err(|e| cannot(&place, &e))?;
        Ok(place)
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // A failure is ignored: the next process that writes here tries again.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// A hidden path in `folder` that no other thread or process uses, and that [`sweep`] recognises.
pub(super) fn aside(folder: &Path, prefix: &str) -> PathBuf {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    folder.join(format!("{prefix}{}.{number}{SUFFIX}", std::process::id()))
}

/// Checks that a file can be created in `folder`, which must exist: creates one and removes it.
///
/// # Errors
/// The error of the system.
pub(crate) fn probe(folder: &Path) -> std::io::Result<()> {
    let file = aside(folder, PREFIX);
    File::create(&file)?;
    fs::remove_file(&file)
}

/// Removes a file if it exists.
///
/// # Errors
/// `Kind::Output` if it cannot be removed.
pub(crate) fn remove(file: &Path) -> Result<()> {
    match fs::remove_file(file) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(cannot(file, &e)),
        _ => Ok(()),
    }
}

/// A lock on `folder`; `None` where there are no such locks.
fn alone_in(folder: &Path) -> Result<Option<File>> {
    let Ok(file) = File::open(folder) else { return Ok(None) };
    let start = Instant::now();
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(Some(file)),
            Err(TryLockError::WouldBlock) if start.elapsed() < PATIENCE => {
                std::thread::sleep(Duration::from_millis(10));
            }
            Err(TryLockError::WouldBlock) => {
                return Err(Error::output(
                    format!("{}: another process is writing its results there", folder.display()),
                    "wait for it or end it, or choose another folder",
                ));
            }
            // Some file systems have no locks.
            Err(TryLockError::Error(_)) => return Ok(None),
        }
    }
}

/// Removes files and folders that killed processes left in `folder`, with names that begin with `prefix`.
pub(super) fn sweep(folder: &Path, prefix: &str) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let process = name.strip_prefix(prefix).and_then(|rest| rest.strip_suffix(SUFFIX));
        let process = process.and_then(|rest| rest.split('.').next()).and_then(|p| p.parse::<u32>().ok());
        if process.is_none_or(is_alive) {
            continue;
        }
        let (path, kind) = (entry.path(), entry.file_type());
        if kind.as_ref().is_ok_and(fs::FileType::is_dir) {
            if File::open(&path).is_ok_and(|f| f.try_lock().is_ok()) {
                let _ = fs::remove_dir_all(&path);
            }
        } else {
            let age = entry.metadata().and_then(|m| m.modified()).ok().and_then(|m| m.elapsed().ok());
            // The process may run on another machine that shares the folder, and may still be writing.
            if age.is_some_and(|age| age > STALE) {
                let _ = fs::remove_file(&path);
            }
        }
    }
}

/// Whether a process with this number may be running; true where this is unknown.
fn is_alive(process: u32) -> bool {
    !Path::new("/proc/self").exists() || Path::new(&format!("/proc/{process}")).exists()
}
