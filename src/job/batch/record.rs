//! What a result folder was made from: it tells whether the result is done.

use std::fs::{self, Metadata};
use std::path::Path;
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};

use super::super::words::write_json;
use crate::{Error, Result};

/// The record's file in a result folder.
pub const RECORD: &str = "made_from.json";

/// A file with the times of flight that some captures have beside them.
const BESIDE: &str = "tof.mat";

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
}

/// A file, as it was when it was read.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
struct Made {
    name: String,
    bytes: u64,
    /// Nanoseconds since 1970.
    changed: u64,
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
            files.extend(Made::of(&capture.with_file_name(BESIDE)).filter(|_| !capture.ends_with(BESIDE)));
        }
        files.sort();
        Record { version: env!("CARGO_PKG_VERSION").into(), options: options.to_vec(), files }
    }

    /// The record of a capture and another file that its result depends on.
    pub fn with(mut self, file: &Path) -> Record {
        self.files.extend(Made::of(file));
        self
    }

    /// Whether `folder` holds a whole result that was made from the same. Its file `whole` comes last.
    pub fn is_done(&self, folder: &Path, whole: &str) -> bool {
        let text = fs::read_to_string(folder.join(RECORD)).ok();
        let found = text.and_then(|text| serde_json::from_str::<Record>(&text).ok());
        found.as_ref() == Some(self) && !self.files.is_empty() && folder.join(whole).is_file()
    }

    /// Writes the record into `folder`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_json(&folder.join(RECORD), self, true)
    }
}

impl Made {
    fn of(path: &Path) -> Option<Made> {
        let meta = fs::metadata(path).ok().filter(Metadata::is_file)?;
        let changed = meta.modified().ok().and_then(|t| t.duration_since(UNIX_EPOCH).ok());
        Some(Made {
            name: path.file_name()?.to_string_lossy().into_owned(),
            bytes: meta.len(),
            changed: changed.map_or(0, |t| t.as_nanos() as u64),
        })
    }
}
