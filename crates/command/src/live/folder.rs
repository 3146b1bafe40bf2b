//! Frames as captures that appear in a folder.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use super::stream::{Arrived, FrameCounts, begin as begin_thread};
use thirdbounce::files::stamp::Stamp;
use thirdbounce::{Error, Result, capture};

/// Time between two looks at the folder.
const BETWEEN: Duration = Duration::from_millis(20);

/// A file that cannot be read may still be written: it is given up when it has not changed for so long.
const STILL: Duration = Duration::from_secs(2);
/// A file that changes for so long is given up, too: others wait behind it.
const LONGEST: Duration = Duration::from_secs(60);

/// A file that could not be read: since when, and since when it is as it is.
struct Unfinished {
    begun: Instant,
    stamp: Option<Stamp>,
    still: Instant,
}

impl Unfinished {
    /// Whether the file, tried again, is worth waiting for.
    fn goes_on(&mut self, stamp: Option<Stamp>) -> bool {
        if stamp != self.stamp {
            (self.stamp, self.still) = (stamp, Instant::now());
        }
        self.still.elapsed() < STILL && self.begun.elapsed() < LONGEST
    }
}

/// Begins to look at a folder. Files that are there already are frames, too.
pub(super) fn begin(folder: PathBuf, size: [usize; 2], give: SyncSender<Arrived>) -> Result<()> {
    if !folder.is_dir() {
        let hint = "give a folder in which captures appear, a pipe, or - for the standard input";
        return Err(Error::input(format!("{} is no folder", folder.display()), hint));
    }
    begin_thread(move || {
        let (mut seen, mut number, mut unfinished) = (BTreeSet::new(), 0, None);
        loop {
            let Some(next) = first_unseen(&folder, &seen) else {
                std::thread::sleep(BETWEEN);
                continue;
            };
            // Before it is read: what comes meanwhile is a change.
            let stamp = Stamp::of(&next);
            let name = next.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
            let arrived = match counts_of(&next, size, number) {
                Ok(counts) => Arrived::Counts(name, counts),
                Err(error) => {
                    let now = Instant::now();
                    let one = unfinished.get_or_insert(Unfinished { begun: now, stamp, still: now });
                    if one.goes_on(stamp) {
                        std::thread::sleep(BETWEEN);
                        continue;
                    }
                    let place = format!("{}: ", next.display());
                    let named = error.what.starts_with(&place);
                    Arrived::Failed(Some(name), if named { error } else { error.at(next.display()) })
                }
            };
            (number, unfinished) = (number + 1, None);
            seen.insert(next);
            if give.send(arrived).is_err() {
                return;
            }
        }
    })
}

/// The first .npz file by name that was not seen yet.
fn first_unseen(folder: &Path, seen: &BTreeSet<PathBuf>) -> Option<PathBuf> {
    let files = std::fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    files.filter(|file| file.extension().is_some_and(|e| e == "npz") && !seen.contains(file)).min()
}

fn counts_of(file: &Path, [pairs, bins]: [usize; 2], number: u64) -> Result<FrameCounts> {
    let capture = capture::read(file)?;
    if [capture.pair_count(), capture.bins] != [pairs, bins] {
        return Err(Error::input(
            format!(
                "{} pairs of {} bins, the scan has {pairs} of {bins}",
                capture.pair_count(),
                capture.bins
            ),
            "let only frames of the scan appear in the folder",
        ));
    }
    Ok(FrameCounts { frame: number, values: capture.histograms, measured: None })
}
