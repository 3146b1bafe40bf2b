//! Live frames: counts come from a folder or from the standard input, maps go to a callback and to a page.
//!
//! [`run`] reads frames in a thread of its own and gives them to a [`Session`]. What is wrong with a frame or a stream is one
//! message; the session lives on. Every frame has the points and bins of one capture, the scan.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

use crate::session::{Frame, Latency, Session};
use crate::{Error, Kind, Result};

mod folder;
mod page;
mod stream;

pub use page::Page;
pub use stream::{Counts, Format, HEADER, Header, MAGIC, VERSION, read, write};

/// Where frames come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// Captures that appear in a folder as .npz files, in the order of their names. It never ends.
    Folder(PathBuf),
    /// A stream of frames ([`Header`]) on the standard input.
    Stdin,
}

/// What [`run`] tells.
pub enum News<'n> {
    /// A frame is solved.
    Solved(&'n Frame, Latency),
    /// A frame, a stream or a solve failed; the next one may not.
    Wrong(&'n Error),
    /// Nothing happened for a moment.
    Idle,
}

/// What was done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// Times of the last frames.
    pub latency: Latency,
    /// Frames that arrived.
    pub arrived: u64,
    /// Frames, streams and solves that failed.
    pub wrong: u64,
}

/// A frame on its way to the session.
pub(crate) enum Arrived {
    Counts(Counts),
    Wrong(Error),
}

/// How long to wait for something new before looking at everything again.
const MOMENT: Duration = Duration::from_millis(5);

/// Solves frames in a session as they come, until the source ends or `hear` breaks; then the frames
/// that wait are solved. The newest result is shown on `page`.
///
/// # Errors
/// A source that cannot be opened. After a lost device, its error.
pub fn run(
    mut session: Session,
    source: &Source,
    page: Option<&Page>,
    hear: &mut dyn FnMut(News<'_>) -> ControlFlow<()>,
) -> Result<Summary> {
    // Frames wait in the session, by its rule, not here.
    let (give, take) = sync_channel(1);
    let [pairs, bins] = session.size();
    match source {
        Source::Folder(folder) => folder::begin(folder.clone(), [pairs, bins], give)?,
        Source::Stdin => stream::begin_stdin([pairs, bins], give)?,
    }
    let mut summary = Summary { latency: session.latency(), arrived: 0, wrong: 0 };
    let (mut ended, mut broken, mut held) = (false, None, None);
    while broken.is_none() {
        let mut news = vec![];
        match held.take().map_or_else(|| take.recv_timeout(MOMENT), |counts| Ok(Arrived::Counts(counts))) {
            Ok(Arrived::Counts(counts)) => match submit(&mut session, &counts) {
                // Where every frame counts, it waits here until there is room.
                Err(error) if error.kind == Kind::Options => held = Some(counts),
                submitted => {
                    summary.arrived += 1;
                    news.extend(submitted.err());
                }
            },
            Ok(Arrived::Wrong(error)) => news.push(error),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => ended = true,
        }
        let patience = if ended || held.is_some() { 10 * MOMENT } else { Duration::ZERO };
        let solved = session.wait_for(patience);
        let solved = solved.map(|frame| frame.map(|frame| Arc::new(frame.clone())));
        let mut heard = ControlFlow::Continue(());
        match solved {
            Ok(Some(frame)) => {
                summary.latency = session.latency();
                if let Some(page) = page {
                    page.show(frame.clone(), summary.latency);
                }
                heard = hear(News::Solved(&frame, summary.latency));
            }
            Ok(None) if ended && session.is_idle() => break,
            Ok(None) => heard = hear(News::Idle),
            // Nothing can be solved any more.
            Err(error) if error.kind == Kind::Device => broken = Some(error),
            Err(error) => news.push(error),
        }
        for error in &news {
            summary.wrong += 1;
            if hear(News::Wrong(error)).is_break() {
                heard = ControlFlow::Break(());
            }
        }
        if heard.is_break() {
            break;
        }
    }
    summary.latency = session.latency();
    broken.map_or(Ok(summary), Err)
}

fn submit(session: &mut Session, counts: &Counts) -> Result<()> {
    let submitted = match &counts.measured {
        Some(measured) => session.submit_part(&counts.values, measured),
        None => session.submit(&counts.values),
    };
    submitted.map(drop)
}
