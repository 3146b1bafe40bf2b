//! Hidden folders for files during writing, beside their destinations.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;
use std::time::Duration;

use tempfile::TempDir;

const PREFIX: &str = ".thirdbounce.";
const SUFFIX: &str = ".part";

/// Age after which a hidden folder of another host, or on a file system without locks, is stale.
const OLD: Duration = Duration::from_secs(7 * 24 * 3600);
/// Folders that are tried: another process may sweep one before it is locked.
const TRIES: usize = 100;

/// A hidden folder for files that are being written, removed when dropped. After a kill, the next process of the same host that
/// writes beside it removes it.
pub(super) struct Hidden {
    folder: TempDir,
    // Lock held by this process; `None` on file systems without locks.
    _lock: Option<File>,
}

impl Hidden {
    /// Creates the folder inside `beside`, which must exist, and removes stale folders of killed processes.
    ///
    /// # Errors
    /// The error of the system.
    pub(super) fn new(beside: &Path) -> io::Result<Hidden> {
        let own = format!("{PREFIX}{}.", host());
        sweep(beside, &own);
        for _ in 0..TRIES {
            let folder = tempfile::Builder::new().prefix(&own).suffix(SUFFIX).tempdir_in(beside)?;
            let Ok(file) = File::open(folder.path()) else { continue };
            match file.try_lock() {
                Ok(()) if folder.path().exists() => return Ok(Hidden { folder, _lock: Some(file) }),
                Err(TryLockError::Error(_)) => return Ok(Hidden { folder, _lock: None }),
                _ => {}
            }
        }
        Err(io::Error::other("hidden folders are removed immediately after creation"))
    }

    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Whether a folder is hidden or inside a hidden one.
pub(super) fn is_hidden(folder: &Path) -> bool {
    folder.components().any(|part| is_ours(&part.as_os_str().to_string_lossy(), PREFIX))
}

fn is_ours(name: &str, prefix: &str) -> bool {
    name.starts_with(prefix) && name.ends_with(SUFFIX)
}

/// Checks that files can be created in `folder`, which must exist.
///
/// # Errors
/// The error of the system.
pub fn probe(folder: &Path) -> io::Result<()> {
    Hidden::new(folder).map(drop)
}

/// Host name in letters and digits: locks of another host may be invisible.
fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").or_else(|_| std::env::var("HOSTNAME"));
    name.unwrap_or_default().chars().filter(char::is_ascii_alphanumeric).take(32).collect()
}

/// Removes unlocked hidden folders in `folder`; those without the prefix `own` only if stale.
fn sweep(folder: &Path, own: &str) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let (name, path) = (entry.file_name().to_string_lossy().into_owned(), entry.path());
        let file = Some(&path).filter(|_| is_ours(&name, PREFIX)).and_then(|path| File::open(path).ok());
        let Some(file) = file else { continue };
        let is_left = match file.try_lock() {
            Ok(()) => is_ours(&name, own) || is_old(&path),
            Err(TryLockError::Error(_)) => is_old(&path),
            Err(TryLockError::WouldBlock) => false,
        };
        if is_left {
            let _ = fs::remove_dir_all(&path);
        }
    }
}

/// Whether a folder's content is stale; false if unknown.
fn is_old(folder: &Path) -> bool {
    let inside = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    inside.chain([folder.to_path_buf()]).all(|path| {
        let changed = fs::symlink_metadata(path).and_then(|about| about.modified());
        changed.is_ok_and(|at| at.elapsed().is_ok_and(|age| age > OLD))
    })
}

#[cfg(test)]
mod tests {
    use std::time::SystemTime;

    use super::*;

    #[test]
    fn only_unused_folders_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let made = |name: &str, old: bool| {
            let path = folder.path().join(format!("{PREFIX}{name}{SUFFIX}"));
            fs::create_dir(&path).unwrap();
            if old {
                File::open(&path).unwrap().set_modified(SystemTime::now() - 2 * OLD).unwrap();
            }
            path
        };
        let left = [made(&format!("{}.1", host()), false), made("elsewhere.1", true)];
        let used = Hidden::new(folder.path()).unwrap();
        assert!(left.iter().all(|path| !path.exists()), "{left:?}");
        let young = made("elsewhere.2", false);
        // Another host writes to a folder that it created long ago.
        let slow = made("elsewhere.3", false);
        fs::write(slow.join("maps.npz"), b"").unwrap();
        File::open(&slow).unwrap().set_modified(SystemTime::now() - 2 * OLD).unwrap();
        let others = folder.path().join(".thirdbounce.notes");
        fs::create_dir(&others).unwrap();
        let second = Hidden::new(folder.path()).unwrap();
        assert!([used.path(), second.path(), &young, &slow, &others].iter().all(|path| path.exists()));
        drop((used, second));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn threads_do_not_sweep_each_other() {
        let folder = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..100 {
                        let own = Hidden::new(folder.path()).unwrap();
                        fs::write(own.path().join("file"), b"1").expect("the folder is there");
                    }
                });
            }
        });
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
