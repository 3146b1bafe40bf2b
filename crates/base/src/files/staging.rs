//! Files are written to a hidden folder, then moved to their places: results of several files replace older ones
//! together.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use super::atomic::{cannot, create_dir, sync_folder};
use crate::error::{Error, Result};

const PREFIX: &str = ".thirdbounce.";
const SUFFIX: &str = ".part";

/// How long to wait for another process to move its results, which takes milliseconds.
const PATIENCE: Duration = Duration::from_secs(20);
/// A hidden folder of another host or container is left over if nothing in it has changed for so long.
const OLD: Duration = Duration::from_secs(7 * 24 * 3600);
/// Names that are tried for a hidden folder.
const TRIES: u32 = 100;

/// A hidden folder for files that are being written. It is removed, with what is in it, when this value is dropped. If
/// the process is killed, the next process of its host that writes beside it removes it, or any one a week later.
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
    pub(super) fn new(beside: &Path) -> io::Result<Hidden> {
        sweep(beside, host());
        let name = || format!("{PREFIX}{}.{}.{:016x}{SUFFIX}", host(), std::process::id(), random());
        let mut tries = 0;
        let folder = loop {
            let folder = beside.join(name());
            match fs::create_dir(&folder) {
                Ok(()) => break folder,
                Err(e) if e.kind() == ErrorKind::AlreadyExists && tries < TRIES => tries += 1,
                Err(e) => return Err(e),
            }
        };
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

    /// The folder of the results.
    pub fn target(&self) -> &Path {
        &self.target
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
        let folders: BTreeSet<&Path> = places.iter().filter_map(|place| place.parent()).collect();
        folders.into_iter().chain([&*self.target]).try_for_each(sync_folder)?;
        Ok(places)
    }

    /// Moves the folder `name` (inside [`Staging::path`]) to its place in the target, whole. No folder of that name may be
    /// there, unless it is empty.
    ///
    /// # Errors
    /// `Kind::Output` if the folder cannot be moved, or if another process keeps the target locked for too long.
    pub fn commit_folder(self, name: &str) -> Result<PathBuf> {
        let _lock = alone_in(&self.target)?;
        let place = self.target.join(name);
        fs::rename(self.path().join(name), &place).map_err(|e| cannot(&place, &e))?;
        sync_folder(&self.target)?;
        Ok(place)
    }
}

/// Whether a folder is hidden or inside a hidden one.
pub(super) fn is_hidden(folder: &Path) -> bool {
    folder.components().any(|part| {
        let name = part.as_os_str().to_string_lossy();
        name.starts_with(PREFIX) && name.ends_with(SUFFIX)
    })
}

/// Checks that files can be created in `folder`, which must exist.
///
/// # Errors
/// The error of the system.
pub fn probe(folder: &Path) -> std::io::Result<()> {
    Hidden::new(folder).map(drop)
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

/// Where process numbers mean one process: the host's name, and its space of process numbers, of which containers have their own.
pub(super) fn host() -> &'static str {
    static HOST: OnceLock<String> = OnceLock::new();
    HOST.get_or_init(|| {
        let name = fs::read_to_string("/proc/sys/kernel/hostname").ok();
        let name = name.or_else(|| std::env::var("HOSTNAME").ok()).unwrap_or_default();
        let space = fs::read_link("/proc/self/ns/pid").map(|link| link.to_string_lossy().into_owned());
        let plain =
            |text: &str| text.chars().filter(char::is_ascii_alphanumeric).take(32).collect::<String>();
        format!("{}-{}", plain(&name), plain(&space.unwrap_or_default()))
    })
}

/// A number that no other process has, as good as certainly.
fn random() -> u64 {
    // The standard library's keys of hash tables are random, and other ones each time.
    RandomState::new().build_hasher().finish()
}

/// Removes hidden folders that killed processes left in `folder`: those of this host whose process is gone and whose lock is free;
/// those of others, of which neither can be told, when nothing in them has changed for long.
fn sweep(folder: &Path, host: &str) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let Some(about) = name.strip_prefix(PREFIX).and_then(|rest| rest.strip_suffix(SUFFIX)) else {
            continue;
        };
        let mut parts = about.split('.');
        let process = (parts.next() == Some(host)).then(|| parts.next()?.parse::<u32>().ok()).flatten();
        let is_left = process.map_or_else(|| is_old(&entry.path()), |process| !is_alive(process));
        if is_left && File::open(entry.path()).is_ok_and(|f| f.try_lock().is_ok()) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// Whether nothing in a folder has changed for long; false where this is unknown.
fn is_old(folder: &Path) -> bool {
    let inside = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    inside.chain([folder.to_path_buf()]).all(|path| {
        let changed = fs::symlink_metadata(path).and_then(|about| about.modified());
        changed.is_ok_and(|at| at.elapsed().is_ok_and(|age| age > OLD))
    })
}

/// Whether a process with this number may be running; true where this is unknown.
fn is_alive(process: u32) -> bool {
    !Path::new("/proc/self").exists() || Path::new(&format!("/proc/{process}")).exists()
}

#[cfg(test)]
mod tests {
    use std::time::SystemTime;

    use super::*;

    #[test]
    fn a_leftover_of_the_same_process_number_is_in_nobodys_way() {
        let folder = tempfile::tempdir().unwrap();
        for number in 0..200 {
            fs::create_dir(folder.path().join(format!("{PREFIX}{}.{number}{SUFFIX}", std::process::id())))
                .unwrap();
        }
        let [one, other] = [(); 2].map(|()| Hidden::new(folder.path()).unwrap());
        assert_ne!(one.path(), other.path());
    }

    /// What is renamed outlasts a loss of power when its folder is synced: once for a result, not for each file of it.
    #[test]
    fn folders_are_synced_once_for_a_result() {
        use super::super::atomic::{synced, write};
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        synced();
        write(&folder.path().join("alone"), b"1").unwrap();
        assert_eq!(synced(), [folder.path()]);
        let staging = Staging::new(&out).unwrap();
        let files = ["a", "b", "below/c"].map(|name| staging.path().join(name));
        files.iter().for_each(|file| write(file, b"1").unwrap());
        assert!(synced().is_empty(), "nobody misses a hidden folder");
        staging.commit(&files).unwrap();
        assert_eq!(synced(), [out.clone(), out.join("below"), out.clone()]);
        let staging = Staging::new(&out).unwrap();
        fs::create_dir(staging.path().join("whole")).unwrap();
        assert_eq!(staging.commit_folder("whole").unwrap(), out.join("whole"));
        assert_eq!(synced(), [out]);
    }

    #[test]
    fn only_what_nobody_uses_is_swept() {
        let folder = tempfile::tempdir().unwrap();
        // No process has a number beyond the system's largest, 2^22.
        let gone = u32::MAX;
        let made = |host: &str, process: u32, old: bool| {
            let path = folder.path().join(format!("{PREFIX}{host}.{process}.{:x}{SUFFIX}", random()));
            fs::create_dir(&path).unwrap();
            if old {
                File::open(&path).unwrap().set_modified(SystemTime::now() - 2 * OLD).unwrap();
            }
            path
        };
        let left = [made(host(), gone, false), made("elsewhere-1", 1, true), made("1234", 7, true)];
        let used = [made(host(), std::process::id(), true), made("elsewhere-1", gone, false)];
        // A process elsewhere writes a file now, in a folder that it made long ago.
        let slow = made("elsewhere-2", 1, false);
        fs::write(slow.join("maps.npz"), b"").unwrap();
        File::open(&slow).unwrap().set_modified(SystemTime::now() - 2 * OLD).unwrap();
        sweep(folder.path(), host());
        assert!(left.iter().all(|path| !path.exists()), "{left:?}");
        assert!(used.iter().chain([&slow]).all(|path| path.exists()), "{used:?}");
    }
}
