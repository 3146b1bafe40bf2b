//! Claims: who works on what, so that two programs do not do the same. A claim is a hidden file that names its process, which
//! holds a lock on it. Hosts may not see each other's locks, so the file's time is kept fresh, too.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use super::atomic::cannot;
use super::hidden::host;
use crate::error::Result;

const PREFIX: &str = ".thirdbounce.";
const SUFFIX: &str = ".claim";

/// How often [`keep`] is called.
pub const EVERY: Duration = Duration::from_secs(30);
/// A claim of another host that was not kept for so long is nobody's.
const OLD: Duration = Duration::from_secs(3 * 60);

/// A claim of this process. It is given up when this value is dropped.
pub struct Claim {
    path: PathBuf,
    // Its lock ends with the process.
    _file: File,
}

impl Claim {
    /// Claims `name` in `folder`, which must exist. If another process has it, says which.
    ///
    /// # Errors
    /// `Kind::Output` if no file can be made there.
    pub fn take(folder: &Path, name: &str) -> Result<std::result::Result<Claim, String>> {
        let path = folder.join(format!("{PREFIX}{name}{SUFFIX}"));
        remove_if_left(&path);
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(mut file) => {
                // The lock comes first: who reads the text may ask for it. Some file systems have none.
                let _ = file.try_lock();
                if let Err(e) = file.write_all(own().as_bytes()) {
                    let _ = fs::remove_file(&path);
                    return Err(cannot(folder, &e));
                }
                Ok(Ok(Claim { path, _file: file }))
            }
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {
                let owner = fs::read_to_string(&path).unwrap_or_default();
                Ok(Err(owner.split_once(' ').map_or("another process", |(_, who)| who).into()))
            }
            Err(e) => Err(cannot(&path, &e)),
        }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // Another process took it over if this one was not heard of for too long.
        if fs::read_to_string(&self.path).is_ok_and(|owner| owner == own()) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// What stands in a claim of this process.
fn own() -> String {
    format!("{} process {} on {}", kernel(), std::process::id(), host())
}

/// The running system, which all of its containers share, and so its locks; empty if it has no name.
fn kernel() -> String {
    fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default().trim().into()
}

/// The claims in a folder.
fn all(folder: &Path) -> impl Iterator<Item = PathBuf> {
    let paths = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    paths.filter(|path| {
        let name = path.file_name().unwrap_or_default().as_encoded_bytes();
        name.starts_with(PREFIX.as_bytes()) && name.ends_with(SUFFIX.as_bytes())
    })
}

/// Says that this process still works on what it claimed in `folder`.
pub fn keep(folder: &Path) {
    for path in all(folder).filter(|path| fs::read_to_string(path).is_ok_and(|owner| owner == own())) {
        // A failure is ignored: the next time may do.
        let _ = OpenOptions::new().write(true).open(&path).and_then(|f| f.set_modified(SystemTime::now()));
    }
}

/// Removes claims that nobody has any more.
pub fn sweep(folder: &Path) {
    all(folder).for_each(|path| remove_if_left(&path));
}

/// Removes a claim whose process is gone, or was not heard of for long.
fn remove_if_left(path: &Path) {
    let (Ok(owner), Ok(file)) = (fs::read_to_string(path), File::open(path)) else { return };
    let is_near = owner.split(' ').next().is_some_and(|on| !on.is_empty() && on == kernel());
    let is_left = match file.try_lock() {
        Ok(()) if is_near => true,
        Err(TryLockError::WouldBlock) if is_near => false,
        _ => {
            let kept = file.metadata().and_then(|about| about.modified());
            kept.is_ok_and(|at| at.elapsed().is_ok_and(|age| age > OLD))
        }
    };
    if is_left {
        let _ = fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_claim_is_had_once_until_its_owner_is_gone_or_silent() {
        let folder = tempfile::tempdir().unwrap();
        let take = || Claim::take(folder.path(), "scene").unwrap();
        let path = folder.path().join(".thirdbounce.scene.claim");
        let first = take().ok().unwrap();
        let owner = take().err().unwrap();
        assert_eq!(owner, format!("process {} on {}", std::process::id(), host()));
        File::options().write(true).open(&path).unwrap().set_modified(SystemTime::now() - 2 * OLD).unwrap();
        assert!(take().is_err(), "its lock is held");
        keep(folder.path());
        assert!(fs::metadata(&path).unwrap().modified().unwrap().elapsed().unwrap() < OLD);
        drop(first);
        assert!(!path.exists());
        let left = |owner: &str, age: Duration| {
            fs::write(&path, owner).unwrap();
            File::options().write(true).open(&path).unwrap().set_modified(SystemTime::now() - age).unwrap();
        };
        left(&format!("{} process 1 on another-2", kernel()), Duration::ZERO);
        assert!(take().is_ok(), "nobody holds its lock");
        left("elsewhere process 1 on another-3", OLD / 2);
        assert_eq!(take().err().unwrap(), "process 1 on another-3");
        left("elsewhere process 1 on another-3", 2 * OLD);
        let taken = take().ok().unwrap();
        // Who slept and lost its claim does not take it from the next one.
        left("elsewhere process 2 on another-3", Duration::ZERO);
        drop(taken);
        assert!(path.exists());
        // A claim that is not written yet is old, or it is one.
        left("", Duration::ZERO);
        sweep(folder.path());
        assert!(path.exists());
        left("", 2 * OLD);
        sweep(folder.path());
        assert!(!path.exists());
    }
}
