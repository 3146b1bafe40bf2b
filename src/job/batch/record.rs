//! What a result folder was made from: it tells whether the result is done.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::super::words::write_json;
use crate::files::opened::{Looked, Stamp};
use crate::files::staging::{Staging, remove};
use crate::{Error, Result};

/// The record's file in a result folder.
pub const RECORD: &str = "made_from.json";

/// Refuses a folder that no batch made: the result would take its place.
///
/// # Errors
/// `Kind::Output`.
pub fn check_place(folder: &Path) -> Result<()> {
    let is_empty = || fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    if fs::symlink_metadata(folder).is_err() || folder.join(RECORD).is_file() || is_empty() {
        return Ok(());
    }
    Err(Error::output(
        format!("{}: is there, but no batch made it", folder.display()),
        "choose another folder for the results, or move this one away",
    ))
}

/// What a result was made from.
///
/// Files are told by size and time of change, not by their contents: reading a capture takes longer than many a solve. A
/// copy with a new time is solved again, which is the safe side.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Record {
    /// Version of thirdbounce.
    version: String,
    /// Every option that changes results, as it was given.
    options: Vec<String>,
    /// The capture's files.
    files: Vec<Made>,
    /// Other files that were looked for, in the order of their paths: whether they are there, and how, may change the result.
    beside: Vec<(String, Option<Stamp>)>,
    /// The result's files, by their paths in its folder. Others in there are somebody else's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    wrote: Option<BTreeSet<PathBuf>>,
}

/// A file, as it was when it was read.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
struct Made {
    name: String,
    stamp: Stamp,
}

impl Record {
    /// The record of a capture as it is now. A file that is not there has none: reading it will say so.
    pub fn of(capture: &Path, options: &[String]) -> Record {
        let mut files = vec![];
        if capture.is_dir() {
            let entries = fs::read_dir(capture).into_iter().flatten().flatten();
            files.extend(entries.filter_map(|e| Made::of(&e.path())));
        } else {
            files.extend(Made::of(capture));
        }
        files.sort();
        Record {
            version: env!("CARGO_PKG_VERSION").into(),
            options: options.to_vec(),
            files,
            beside: vec![],
            wrote: None,
        }
    }

    /// The record with other files that were looked for when the capture was read. Paths are kept from the folder in which the
    /// program runs, as they were given.
    pub fn beside(mut self, looked: &[Looked]) -> Record {
        let text = |(path, stamp): &Looked| (path.to_string_lossy().into_owned(), *stamp);
        self.beside = looked.iter().map(text).collect();
        self.beside.sort();
        self.beside.dedup();
        self
    }

    /// The record of a capture and another file that its result depends on.
    pub fn with(mut self, file: &Path) -> Record {
        self.files.extend(Made::of(file));
        self
    }

    /// Whether `folder` holds a whole result that was made from the same. Its file `whole` comes last.
    pub fn is_done(&self, folder: &Path, whole: &str) -> bool {
        let Some(mut found) = Record::read(folder) else { return false };
        found.wrote = None;
        let beside = std::mem::take(&mut found.beside);
        let same = beside.iter().all(|(path, stamp)| Stamp::of(Path::new(path)) == *stamp);
        same && found == *self && !self.files.is_empty() && folder.join(whole).is_file()
    }

    fn read(folder: &Path) -> Option<Record> {
        serde_json::from_str(&fs::read_to_string(folder.join(RECORD)).ok()?).ok()
    }

    /// Moves a result, which is written to a folder of this name inside `staging`, to its place, with this record. The files of
    /// an older result make room for it; all others in its folder stay. Returns the folder.
    ///
    /// # Errors
    /// A file that cannot be written, or that is somebody else's.
    pub fn commit(mut self, staging: Staging, name: &str, whole: &str) -> Result<PathBuf> {
        let (staged, place) = (staging.path().join(name), staging.target().join(name));
        let mut files = vec![];
        list(&staged, Path::new(""), &mut files);
        // First the record, which says whose the others are; last the file that says that all are there.
        files.retain(|file| file != Path::new(whole));
        files.insert(0, RECORD.into());
        files.push(whole.into());
        self.wrote = Some(files.iter().cloned().collect());
        self.write(&staged)?;
        if fs::symlink_metadata(&place).is_err() {
            return staging.commit_folder(name);
        }
        make_room(&place, &files, whole)?;
        staging.commit(&files.iter().map(|file| staged.join(file)).collect::<Vec<_>>())?;
        Ok(place)
    }

    /// Writes the record into `folder`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_json(&folder.join(RECORD), self, true)
    }
}

/// Removes what an older result has and the new one does not, its file `whole` first: it is not whole any more.
fn make_room(place: &Path, files: &[PathBuf], whole: &str) -> Result<()> {
    let Some(old) = Record::read(place).and_then(|record| record.wrote) else { return Ok(()) };
    if let Some(file) = files.iter().find(|file| !old.contains(*file) && place.join(file).exists()) {
        return Err(Error::output(
            format!("{}: is there, but no batch wrote it", place.join(file).display()),
            "move it away, or choose another folder for the results",
        ));
    }
    remove(&place.join(whole))?;
    // Whatever a record says, nothing outside of its folder goes.
    let inside = |file: &&PathBuf| file.components().all(|part| matches!(part, Component::Normal(_)));
    for file in old.iter().filter(inside).filter(|file| !files.contains(file)) {
        remove(&place.join(file))?;
        // Folders that are empty now go, too.
        file.ancestors().skip(1).try_for_each(|folder| fs::remove_dir(place.join(folder))).ok();
    }
    Ok(())
}

/// The files in a folder and those below it, as paths from there.
fn list(folder: &Path, below: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder.join(below)).into_iter().flatten().flatten() {
        let path = below.join(entry.file_name());
        match entry.path().is_dir() {
            true => list(folder, &path, files),
            false => files.push(path),
        }
    }
}

impl Made {
    fn of(path: &Path) -> Option<Made> {
        let stamp = Stamp::of(path)?;
        Some(Made { name: path.file_name()?.to_string_lossy().into_owned(), stamp })
    }
}
