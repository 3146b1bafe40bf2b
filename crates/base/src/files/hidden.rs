//! Hidden folders for files that are being written, beside their places.

use std::fs::{self, File};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

const PREFIX: &str = ".thirdbounce.";
const SUFFIX: &str = ".part";

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
