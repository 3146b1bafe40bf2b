//! Files are written to a hidden folder, then moved to their places: results of several files replace older ones
//! together.

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

/// A hidden folder for files that are being written. It is removed, with what is in it, when this value is dropped. If
/// the process is killed, the next process that writes beside it removes it.
pub(super) struct Hidden {
    folder: PathBuf,
    // Held while this process lives, so that the folder is not taken for one that a killed process left.
    _lock: Option<File>,
}

impl Hidden {
    /// Creates the folder inside `beside`, which must exist, with a name that no other thread or process uses. Folders
    /// that killed processes left there are removed.
    ///
    /// # Errors
    /// The error of the system.
    pub(super) fn new(beside: &Path) -> std::io::Result<Hidden> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        sweep(beside);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder = beside.join(format!("{PREFIX}{}.{number}{SUFFIX}", std::process::id()));
        fs::create_dir(&folder)?;
        let lock = File::open(&folder).ok().filter(|f| f.try_lock().is_ok());
        Ok(Hidden { folder, _lock: lock })
    }

    pub(super) fn path(&self) -> &Path {
        &self.folder
    }
}

impl Drop for Hidden {
    fn drop(&mut self) {
        // A failure is ignored: the next process that writes here tries again.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Results of several files: they are written to a hidden folder inside the folder of the results, then moved to their
/// places together.
pub struct Staging {
    target: PathBuf,
    hidden: Hidden,
}

impl Staging {
    /// Creates `target` and its parents, if missing, and the hidden folder in it.
    ///
    /// # Errors
    /// `Kind::Output` if a folder cannot be created.
    pub fn new(target: &Path) -> Result<Staging> {
        create_dir(target)?;
        let hidden = Hidden::new(target).map_err(|e| cannot(target, &e))?;
        Ok(Staging { target: target.into(), hidden })
    }

    /// The hidden folder: write the files here.
    pub fn path(&self) -> &Path {
        self.hidden.path()
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
            let inside = file.strip_prefix(self.path()).unwrap_or(file);
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
        let (place, old) = (self.target.join(name), self.path().join(".old"));
        match fs::rename(&place, &old) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(cannot(&place, &e)),
            _ => {}
        }
        fs::rename(self.path().join(name), &place).map_err(|e| cannot(&place, &e))?;
        Ok(place)
    }
}

/// Checks that files can be created in `folder`, which must exist.
///
/// # Errors
/// The error of the system.
pub(crate) fn probe(folder: &Path) -> std::io::Result<()> {
    Hidden::new(folder).map(drop)
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

/// Removes hidden folders that killed processes left in `folder`. One whose lock is held, or cannot be asked for, may
/// belong to a process on another machine and stays.
fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let process = name.strip_prefix(PREFIX).and_then(|rest| rest.strip_suffix(SUFFIX));
        let process = process.and_then(|rest| rest.split('.').next()).and_then(|p| p.parse::<u32>().ok());
        if process.is_some_and(|p| !is_alive(p))
            && File::open(entry.path()).is_ok_and(|f| f.try_lock().is_ok())
        {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// Whether a process with this number may be running; true where this is unknown.
fn is_alive(process: u32) -> bool {
    !Path::new("/proc/self").exists() || Path::new(&format!("/proc/{process}")).exists()
}
