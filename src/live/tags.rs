//! Frames as passes of a scan in a file of time tags that an instrument is still writing.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::mpsc::SyncSender;

use super::Arrived;
use super::stream::{Counts, begin as begin_thread};
use crate::capture::{Capture, Gate};
use crate::tags::{Asked, Scan, passes};
use crate::{Error, Result};

/// A file of time tags that grows.
#[derive(Debug, Clone, PartialEq)]
pub struct Tags {
    /// The file.
    pub path: PathBuf,
    /// The points of the scan.
    pub scan: Scan,
    /// How tags become histograms.
    pub asked: Asked,
    /// Paths that are used.
    pub gate: Option<Gate>,
}

impl Tags {
    /// The capture of the first pass, which is also the first frame; `None` if `wait`, which is called while there is nothing to
    /// read, breaks before it is whole.
    ///
    /// # Errors
    /// Those of [`passes`]; a gate without bins.
    pub fn first(&self, wait: &dyn Fn() -> ControlFlow<()>) -> Result<Option<Capture>> {
        let mut first = None;
        passes(&self.path, &self.scan, &self.asked, wait, &mut |capture| {
            first = Some(capture);
            ControlFlow::Break(())
        })?;
        first.map(|capture| self.gated(capture)).transpose()
    }

    fn gated(&self, capture: Capture) -> Result<Capture> {
        match self.gate {
            Some(gate) => capture.gated(gate),
            None => Ok(capture),
        }
    }
}

/// Begins to follow the file.
pub(super) fn begin(tags: Tags, [pairs, bins]: [usize; 2], give: SyncSender<Arrived>) -> Result<()> {
    begin_thread(move || {
        let mut number = 0;
        let wait = || ControlFlow::Continue(());
        let done = passes(&tags.path, &tags.scan, &tags.asked, &wait, &mut |capture| {
            let arrived = match tags.gated(capture) {
                Ok(c) if [c.pair_count(), c.bins] == [pairs, bins] => {
                    Arrived::Counts(Counts { frame: number, values: c.histograms, measured: None })
                }
                Ok(c) => Arrived::Wrong(Error::input(
                    format!("{} pairs of {} bins, the scan has {pairs} of {bins}", c.pair_count(), c.bins),
                    "take the scan of this file's first pass",
                )),
                Err(error) => Arrived::Wrong(error),
            };
            number += 1;
            match give.send(arrived) {
                Ok(()) => ControlFlow::Continue(()),
                Err(_) => ControlFlow::Break(()),
            }
        });
        if let Err(error) = done {
            // Nobody may listen any more.
            let _ = give.send(Arrived::Wrong(error));
        }
    })
}
