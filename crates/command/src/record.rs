//! What a result folder was made from: a result that was made from the same is not made again.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::json::write_json;
use thirdbounce::files::stamp::Stamp;
use thirdbounce::{Error, Result};

/// The record's file in a result folder.
const RECORD: &str = "made_from.json";

/// Version, options and files of a result. A file is identified by name, size and time of change: reading its contents may
/// take longer than solving.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResultRecord {
    version: String,
    options: Vec<String>,
    files: Vec<(String, Option<Stamp>)>,
}

impl ResultRecord {
    /// The record of these files, or of the files in these folders, as they are now.
    pub fn of<'p>(paths: impl IntoIterator<Item = &'p Path>, options: &[String]) -> ResultRecord {
        let mut files = vec![];
        for path in paths {
            let inside = fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.path());
            let mut all: Vec<_> = if path.is_dir() { inside.collect() } else { vec![path.into()] };
            all.sort();
            let name = |path: &Path| path.file_name().map(|n| n.to_string_lossy().into_owned());
            files.extend(all.iter().map(|path| (name(path).unwrap_or_default(), Stamp::of(path))));
        }
        ResultRecord { version: env!("CARGO_PKG_VERSION").into(), options: options.to_vec(), files }
    }

    /// Whether `folder` holds a complete result of the same record. The file `last` is written last.
    pub fn is_done(&self, folder: &Path, last: &str) -> bool {
        let text = fs::read_to_string(folder.join(RECORD)).unwrap_or_default();
        let found: Option<ResultRecord> = serde_json::from_str(&text).ok();
        found.as_ref() == Some(self) && folder.join(last).is_file()
    }

    /// Writes the record into `folder`.
    ///
    /// # Errors
    /// `Kind::Output`.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_json(&folder.join(RECORD), self, true)
    }
}

/// Refuses a folder with files and without a record: no result of ours belongs there.
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
