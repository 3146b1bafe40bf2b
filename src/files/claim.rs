//! Claims: who works on what, so that two programs do not do the same. A claim is a hidden file with the host and the process; its
//! time says that the process still lives, where that cannot be seen.

use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use super::atomic::cannot;
use super::staging::{host, is_alive};
use crate::error::Result;

const PREFIX: &str = ".thirdbounce.";
const SUFFIX: &str = ".claim";

/// How often [`keep`] is called.
pub(crate) const EVERY: Duration = Duration::from_secs(30);
/// A claim that was not kept for so long is nobody's: clocks of hosts may differ by minutes.
const OLD: Duration = Duration::from_secs(15 * 60);

/// A claim of this process. It is given up when this value is dropped.
pub(crate) struct Claim(PathBuf);

impl Claim {
    /// Claims `name` in `folder`, which must exist. If another process has it, says which.
    ///
    /// # Errors
    /// `Kind::Output` if no file can be made there.
    pub(crate) fn take(folder: &Path, name: &str) -> Result<std::result::Result<Claim, String>> {
        let path = folder.join(format!("{PREFIX}{name}{SUFFIX}"));
        remove_if_left(&path);
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(mut file) => {
                let claim = Claim(path);
                file.write_all(own().as_bytes()).map_err(|e| cannot(&claim.0, &e))?;
                Ok(Ok(claim))
            }
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {
                let owner = fs::read_to_string(&path).unwrap_or_default();
                Ok(Err(match owner.split_once(' ') {
                    Some((host, process)) => format!("process {process} on {host}"),
                    None => "another process".into(),
                }))
            }
            Err(e) => Err(cannot(&path, &e)),
        }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // Another process took it over if this one slept too long.
        if fs::read_to_string(&self.0).is_ok_and(|owner| owner == own()) {
            let _ = fs::remove_file(&self.0);
        }
    }
}

/// What stands in a claim of this process.
fn own() -> String {
    format!("{} {}", host(), std::process::id())
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
pub(crate) fn keep(folder: &Path) {
    for path in all(folder).filter(|path| fs::read_to_string(path).is_ok_and(|owner| owner == own())) {
        // A failure is ignored: the next time may do.
        let _ = OpenOptions::new().write(true).open(&path).and_then(|f| f.set_modified(SystemTime::now()));
    }
}

/// Removes claims that nobody has any more.
pub(crate) fn sweep(folder: &Path) {
    all(folder).for_each(|path| remove_if_left(&path));
}

/// Removes a claim whose process is gone, or that was not kept for long.
fn remove_if_left(path: &Path) {
    let Ok(text) = fs::read_to_string(path) else { return };
    let owner = text.split_once(' ').and_then(|(on, process)| Some((on, process.parse().ok()?)));
    let is_gone = owner.is_some_and(|(on, process)| on == host() && !is_alive(process));
    let kept = File::open(path).and_then(|f| f.metadata()).and_then(|about| about.modified());
    if is_gone || kept.is_ok_and(|at| at.elapsed().is_ok_and(|age| age > OLD)) {
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
        drop(first);
        assert!(!path.exists());
        // No process has a number beyond the system's largest, 2^22.
        let left = |owner: &str, age: Duration| {
            fs::write(&path, owner).unwrap();
            File::options().write(true).open(&path).unwrap().set_modified(SystemTime::now() - age).unwrap();
        };
        left(&format!("{} {}", host(), u32::MAX), Duration::ZERO);
        assert!(take().is_ok(), "its process is gone");
        left("elsewhere 1", OLD / 2);
        assert_eq!(take().err().unwrap(), "process 1 on elsewhere");
        keep(folder.path());
        left("elsewhere 1", 2 * OLD);
        let taken = take().ok().unwrap();
        // Who slept and lost its claim does not take it from the next one.
        left("elsewhere 2", Duration::ZERO);
        drop(taken);
        assert!(path.exists());
        left(&own(), 2 * OLD);
        keep(folder.path());
        sweep(folder.path());
        assert!(path.exists(), "it was kept");
        left("", 2 * OLD);
        sweep(folder.path());
        assert!(!path.exists());
    }
}
