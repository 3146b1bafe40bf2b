//! Frames as captures that appear in a folder.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::SyncSender;
use std::time::Duration;

use super::Arrived;
use super::stream::{Counts, begin as begin_thread};
use crate::{Error, Result, capture};

/// Time between two looks at the folder.
const BETWEEN: Duration = Duration::from_millis(20);

/// A file that cannot be read may still be written: it is looked at so often.
const PATIENCE: usize = 25;

/// Begins to look at a folder. Files that are there already are frames, too.
pub(super) fn begin(folder: PathBuf, size: [usize; 2], give: SyncSender<Arrived>) -> Result<()> {
    if !folder.is_dir() {
        let mend = "give a folder in which captures appear, a pipe, or - for the standard input";
        return Err(Error::input(format!("{} is no folder", folder.display()), mend));
    }
    begin_thread(move || {
        let (mut seen, mut number, mut tried) = (BTreeSet::new(), 0, 0);
        loop {
            let Some(next) = first_unseen(&folder, &seen) else {
                std::thread::sleep(BETWEEN);
                continue;
            };
            let arrived = match counts_of(&next, size, number) {
                Err(_) if tried < PATIENCE => {
                    tried += 1;
                    std::thread::sleep(BETWEEN);
                    continue;
                }
                Err(error) => Arrived::Wrong(error.at(next.display())),
                Ok(counts) => Arrived::Counts(counts),
            };
            (number, tried) = (number + 1, 0);
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

fn counts_of(file: &Path, [pairs, bins]: [usize; 2], number: u64) -> Result<Counts> {
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
    Ok(Counts { frame: number, values: capture.histograms, measured: None })
}
