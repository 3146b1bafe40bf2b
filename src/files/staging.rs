//! Results of several files that replace older ones together: all are written aside, then moved in.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use super::atomic::{cannot, create_dir};
use crate::error::{Error, Result};

const PREFIX: &str = ".thirdbounce.";
const SUFFIX: &str = ".part";

/// How long to wait for another process that moves its results in: it takes milliseconds.
const PATIENCE: Duration = Duration::from_secs(20);

/// What a killed process left behind as a plain file is taken for dead after so long without a change.
const STALE: Duration = Duration::from_secs(60);

/// A hidden folder inside the one that results go to. It goes away with this value; a killed process leaves it, and
/// the next one that writes there removes it.
pub struct Staging {
    target: PathBuf,
    folder: PathBuf,
    // Held while this process lives: tells the folder from one that was left behind.
    _lock: Option<File>,
}

impl Staging {
    /// Makes `target` and the folders above it, if missing, and the hidden folder in it.
    ///
    /// # Errors
    /// `Kind::Output` if a folder cannot be made.
    pub fn new(target: &Path) -> Result<Staging> {
        create_dir(target)?;
        sweep(target, PREFIX);
        let folder = aside(target, PREFIX);
        fs::create_dir(&folder).map_err(|e| cannot(target, &e))?;
        let lock = File::open(&folder).ok().filter(|f| f.try_lock().is_ok());
        Ok(Staging { target: target.into(), folder, _lock: lock })
    }

    /// Where the files are to be written.
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// Moves `files` (below [`Staging::path`]) to their places, the last one last; while they move there is none at
    /// the last one's place. Another process that does so waits. Returns their paths.
    ///
    /// # Errors
    /// `Kind::Output` if a file cannot be moved, or another process does not come to an end.
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
}

impl Drop for Staging {
    fn drop(&mut self) {
        // Nothing to do about a failure: the next process that writes here tries again.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// A hidden place in `folder` that nobody else of this or another process has, and that [`sweep`] knows.
pub(super) fn aside(folder: &Path, prefix: &str) -> PathBuf {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    folder.join(format!("{prefix}{}.{number}{SUFFIX}", std::process::id()))
}

/// Whether a file can be made in `folder`, which exists: makes one and removes it.
///
/// # Errors
/// The system's.
pub(crate) fn probe(folder: &Path) -> std::io::Result<()> {
    let file = aside(folder, PREFIX);
    File::create(&file)?;
    fs::remove_file(&file)
}

/// Removes a file if there is one.
///
/// # Errors
/// `Kind::Output` if it stays.
pub(crate) fn remove(file: &Path) -> Result<()> {
    match fs::remove_file(file) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(cannot(file, &e)),
        _ => Ok(()),
    }
}

/// A lock on `folder`, where the system has such.
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

/// Removes what killed processes left in `folder` under names that begin with `prefix`.
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
            // The process may run on another machine that shares the folder: it would write on.
            if age.is_some_and(|age| age > STALE) {
                let _ = fs::remove_file(&path);
            }
        }
    }
}

/// Whether a process of that number may be running; yes where that cannot be known.
fn is_alive(process: u32) -> bool {
    !Path::new("/proc/self").exists() || Path::new(&format!("/proc/{process}")).exists()
}
