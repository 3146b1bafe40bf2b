//! Results of several files: written to a hidden folder, then moved to their destinations together.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::atomic::{cannot, create_dir, sync_file, sync_folder};
use super::hidden::Hidden;
use crate::error::{Error, Result};

/// Maximum wait for another process to commit, which takes milliseconds.
const PATIENCE: Duration = Duration::from_secs(20);
/// Results of several files: written to a hidden folder inside the results' folder, then moved to their destinations
/// together.
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

    /// The hidden folder, to which files are written.
    pub fn path(&self) -> &Path {
        self.hidden.path()
    }

    /// Moves `files` (inside [`Staging::path`]) to their destinations, in order, and returns their new paths. A
    /// previous file at the last destination is removed first: the last file exists only when all others are in
    /// place. Commits of other processes to the same folder wait.
    ///
    /// # Errors
    /// `Kind::Output` if a file cannot be moved, or if another process keeps the folder locked for too long.
    pub fn commit(self, files: &[PathBuf]) -> Result<Vec<PathBuf>> {
        sync(files)?;
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
        let folders: BTreeSet<&Path> = places.iter().filter_map(|place| place.parent()).collect();
        folders.into_iter().chain([&*self.target]).try_for_each(sync_folder)?;
        Ok(places)
    }

    /// Moves the folder `name` (inside [`Staging::path`]) to its destination in the target. In an existing folder,
    /// files are replaced as by [`Staging::commit`] and others kept; `last` is the last file.
    ///
    /// # Errors
    /// Those of [`Staging::commit`].
    pub fn commit_folder(self, name: &str, last: &str) -> Result<PathBuf> {
        let (from, place) = (self.path().join(name), self.target.join(name));
        let mut files = vec![];
        list(&from, &mut files);
        sync(&files)?;
        let lock = alone_in(&self.target)?;
        if fs::rename(&from, &place).is_ok() {
            return sync_folder(&self.target).map(|()| place);
        }
        drop(lock);
        files.sort_by_key(|file| *file == from.join(last));
        self.commit(&files).map(|_| place)
    }
}

/// Threads that flush files: a disk takes several at the cost of one.
const FLUSHING: usize = 16;

/// Flushes the content of files to the disk.
fn sync(files: &[PathBuf]) -> Result<()> {
    #[cfg(test)]
    files.iter().for_each(|file| super::atomic::record(file));
    let each =
        |files: &[PathBuf]| files.iter().try_for_each(|file| sync_file(file).map_err(|e| cannot(file, &e)));
    std::thread::scope(|scope| {
        let parts = files.chunks(files.len().div_ceil(FLUSHING).max(1));
        let threads: Vec<_> = parts.map(|part| scope.spawn(move || each(part))).collect();
        threads.into_iter().try_for_each(|thread| match thread.join() {
            Ok(done) => done,
            Err(panic) => std::panic::resume_unwind(panic),
        })
    })
}

/// Files in a folder, recursively.
fn list(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        match entry.path() {
            path if path.is_dir() => list(&path, files),
            path => files.push(path),
        }
    }
}

/// Removes a file if it exists.
///
/// # Errors
/// `Kind::Output` if it cannot be removed.
pub fn remove(file: &Path) -> Result<()> {
    match fs::remove_file(file) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(cannot(file, &e)),
        _ => Ok(()),
    }
}

/// Lock on `folder`; `None` on file systems without locks.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A renamed file survives a power loss when it was synced before and its folder is synced after: once per result.
    #[test]
    fn files_and_folders_are_synced_once_for_a_result() {
        use super::super::atomic::{synced, write};
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        synced();
        write(&folder.path().join("alone"), b"1").unwrap();
        assert_eq!(synced(), [folder.path().join("alone"), folder.path().into()]);
        let staging = Staging::new(&out).unwrap();
        let files = ["a", "b", "below/c"].map(|name| staging.path().join(name));
        files.iter().for_each(|file| write(file, b"1").unwrap());
        assert!(synced().is_empty(), "a hidden folder needs no sync");
        staging.commit(&files).unwrap();
        assert_eq!(synced(), [&files[..], &[out.clone(), out.join("below"), out.clone()]].concat());
        let staging = Staging::new(&out).unwrap();
        fs::create_dir(staging.path().join("whole")).unwrap();
        write(&staging.path().join("whole/a"), b"1").unwrap();
        let inside = staging.path().join("whole/a");
        assert_eq!(staging.commit_folder("whole", "a").unwrap(), out.join("whole"));
        assert_eq!(synced(), [inside, out.clone()]);
        // Foreign files in a folder are kept.
        fs::write(out.join("whole/mine"), "mine").unwrap();
        let staging = Staging::new(&out).unwrap();
        for name in ["whole/a", "whole/b", "whole/below/c"] {
            write(&staging.path().join(name), b"2").unwrap();
        }
        staging.commit_folder("whole", "a").unwrap();
        for (name, text) in [("a", "2"), ("b", "2"), ("below/c", "2"), ("mine", "mine")] {
            assert_eq!(fs::read_to_string(out.join("whole").join(name)).unwrap(), text);
        }
    }
}
