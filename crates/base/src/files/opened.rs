//! What files a thread looked for, so that a result can be made anew when one of them changes.

use std::cell::RefCell;
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};

/// A file by its size and time of change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Stamp {
    bytes: u64,
    /// Nanoseconds since 1970.
    changed: u64,
}

impl Stamp {
    /// That of a file; `None` if there is none at this path.
    pub fn of(path: &Path) -> Option<Stamp> {
        let meta = fs::metadata(path).ok().filter(Metadata::is_file)?;
        let changed = meta.modified().ok().and_then(|t| t.duration_since(UNIX_EPOCH).ok());
        Some(Stamp { bytes: meta.len(), changed: changed.map_or(0, |t| t.as_nanos() as u64) })
    }
}

/// A path that was looked for, and the file that was there.
pub type Looked = (PathBuf, Option<Stamp>);

thread_local! {
    static LOOKED: RefCell<Option<Vec<Looked>>> = const { RefCell::new(None) };
}

/// Notes that a path was looked for, whether a file is there or not.
pub fn note(path: &Path) {
    LOOKED.with_borrow_mut(|looked| {
        if let Some(looked) = looked {
            looked.push((path.into(), Stamp::of(path)));
        }
    });
}

/// Does the work, and tells what paths this thread looked for meanwhile.
pub fn during<T>(work: impl FnOnce() -> T) -> (T, Vec<Looked>) {
    let before = LOOKED.replace(Some(vec![]));
    let done = work();
    (done, LOOKED.replace(before).unwrap_or_default())
}
