//! Many captures: a reader ahead, solvers on one or several devices, and a writer behind, with short queues between them.
//! A result appears whole or not at all. What is done already is skipped.

mod figures;
mod names;
mod pipeline;
pub(super) mod record;

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use super::{Loaded, Request, places};
use crate::files::claim;
use crate::files::staging::Staging;
use crate::gpu::GpuOptions;
use crate::solve::Progress;
use crate::{Error, Result};

pub use figures::Figures;
pub use names::{Listed, Shard, named};
use pipeline::Lines;

/// What to reconstruct.
#[derive(Debug, Clone)]
pub struct Batch {
    /// The captures, with unlike names: see [`named`].
    pub captures: Vec<Listed>,
    /// The part of them that is reconstructed here.
    pub shard: Shard,
    /// The folder in which every capture gets a folder of its own.
    pub out: PathBuf,
    /// Every option that changes results, as it was given: a result that was made with others is made anew.
    pub options: Vec<String>,
    /// The devices.
    pub devices: Vec<GpuOptions>,
    /// Solves at once; they take turns with the devices.
    pub jobs: usize,
}

/// What happened to a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// It is reconstructed.
    Done,
    /// Its result was there, or another batch is at it: then a note says which, and there is no folder.
    Skipped,
    /// It has no result.
    Failed,
}

/// What is told of a capture.
#[derive(Debug, Clone)]
pub struct CaptureEnd {
    /// The capture.
    pub capture: Listed,
    /// What happened.
    pub status: Status,
    /// Seconds of reading, solving and writing.
    pub seconds: f64,
    /// What went wrong.
    pub error: Option<Error>,
    /// The folder with the result.
    pub folder: Option<PathBuf>,
    /// Figures of a result that was made now.
    pub figures: Option<Figures>,
    /// What was done to the capture, and warnings, as sentences.
    pub notes: Vec<String>,
}

/// How a batch ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Captures of this shard.
    pub captures: usize,
    /// Those that were reconstructed.
    pub done: usize,
    /// Those whose results were there, and those that another batch is at.
    pub skipped: usize,
    /// Those without a result.
    pub failed: usize,
    /// Whether the caller or a full disk stopped the batch. Captures that are not counted are left.
    pub stopped: bool,
    /// Seconds of the whole batch.
    pub seconds: f64,
}

/// What a batch asks of its caller, from several threads.
pub trait Caller: Sync {
    /// Reads a capture, and says how it is reconstructed. The folder of its result is set afterwards.
    ///
    /// # Errors
    /// The capture cannot be used: it fails, the batch goes on.
    fn load(&self, capture: &Listed) -> Result<(Loaded, Request)>;

    /// Hears of the progress of a solve, and is asked between captures. May stop the batch.
    fn may_continue(&self, progress: Option<(&Listed, &Progress)>) -> ControlFlow<()>;
}

/// Reconstructs many captures. `tell` is called once for each, in the order in which they end, by this thread.
///
/// # Errors
/// Before anything is computed: two captures of one name, no device, or a folder that cannot be written. What goes wrong
/// with a capture is told, and the batch goes on, unless the disk is full.
pub fn batch(what: &Batch, caller: &dyn Caller, tell: &mut dyn FnMut(&CaptureEnd)) -> Result<Tally> {
    let start = Instant::now();
    let mut names = BTreeSet::new();
    if let Some(twice) = what.captures.iter().find(|c| !names.insert(&c.name)) {
        return Err(Error::options(
            format!("two captures of the batch have the name {:?}", twice.name),
            "rename one of them",
        ));
    }
    if what.jobs == 0 || what.devices.is_empty() {
        return Err(Error::options(
            "the batch has no jobs or no devices",
            "give at least one job and one device",
        ));
    }
    places::check_folder(&what.out)?;
    let lines = Lines::new(what, caller)?;
    // It removes what a killed process left.
    drop(Staging::new(&what.out)?);
    claim::sweep(&what.out);
    let mut tally = Tally { captures: lines.captures.len(), ..Tally::default() };
    lines.run(&mut |told| {
        match told.status {
            Status::Done => tally.done += 1,
            Status::Skipped => tally.skipped += 1,
            Status::Failed => tally.failed += 1,
        }
        tell(told);
    });
    tally.stopped = tally.done + tally.skipped + tally.failed < tally.captures;
    tally.seconds = start.elapsed().as_secs_f64();
    Ok(tally)
}
