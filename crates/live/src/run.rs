//! Live frames: counts come from a folder or from the standard input, maps go to a callback and to a page.
//!
//! [`run`] reads frames in a thread of its own and gives them to a [`Session`]. What is wrong with a frame or a stream is one
//! message; the session lives on. Every frame has the points and bins of one capture, the scan.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

use thirdbounce::capture::Reflectance;
use thirdbounce::glam::DVec3;
use thirdbounce::session::{Frame, FrameId, Latency, Session};
use thirdbounce::transport::Grid;
use thirdbounce::{Error, Kind, Result};

use crate::folder::{self, FrameFolder};
use crate::motion::{MotionTrack, Moved};
use crate::page::{LivePage, LiveTotals};
use crate::stream::{self, Arrived, FrameCounts};

/// Where frames come from.
#[derive(Debug, Clone, PartialEq)]
pub enum FrameSource {
    /// Captures that appear in a folder, in the order of their names. It never ends.
    Folder(Box<FrameFolder>),
    /// A stream of frames ([`FrameHeader`]) on the standard input.
    Stdin,
}

/// Reports of [`run`]. A frame's name is that of its file without the ending, or `frame-` and its number in the stream.
pub enum News<'n> {
    /// A frame is solved, with what differs from the scan, and with what moves, where the room was subtracted.
    Solved(&'n str, &'n Frame, Latency, Option<&'n str>, Option<&'n Moved>),
    /// A newer frame replaced this one, or was added to it, before it was solved.
    Dropped(&'n str),
    /// A frame, if it has a name, or the stream failed; later frames may not.
    Failed(Option<&'n str>, &'n Error),
    /// Files of the folder that are no frames, by their names.
    Others(&'n [String]),
    /// Nothing happened for a moment.
    Idle,
}

/// How what moves is followed, in sessions that subtract the room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Following {
    /// The reflectance by which light falls with the distance.
    pub law: Reflectance,
    /// Time from frame to frame; `None`: by the clock, when frames arrive.
    pub interval: Option<Duration>,
}

impl Following {
    /// Seconds from the first frame of a session that began then.
    fn time(&self, id: FrameId, begun: Instant) -> f64 {
        match self.interval {
            Some(interval) => (id.0 - 1) as f64 * interval.as_secs_f64(),
            None => begun.elapsed().as_secs_f64(),
        }
    }
}

/// How long to wait for something new before looking at everything again.
const MOMENT: Duration = Duration::from_millis(5);

/// Solves frames in a session as they come, until the source ends or `hear` breaks; then the frames
/// that wait are solved. `page` shows the newest result, and what failed. What moves is followed as `following` says.
///
/// # Errors
/// A source that cannot be opened. After a lost device, its error.
pub fn run(
    mut session: Session,
    source: &FrameSource,
    page: Option<&LivePage>,
    following: Following,
    hear: &mut dyn FnMut(News<'_>) -> ControlFlow<()>,
) -> Result<LiveTotals> {
    // Frames wait in the session, by its rule, not here.
    let (give, take) = sync_channel(1);
    match source {
        FrameSource::Folder(frames) => folder::begin((**frames).clone(), give)?,
        FrameSource::Stdin => stream::begin_stdin(session.size(), give)?,
    }
    let grid = session.plan().finest().grid;
    let mut motion = MotionTrack::new(following.law, box_of(&grid));
    let (begun, subtracts) = (Instant::now(), session.subtracts());
    page.into_iter().for_each(|page| page.begin(grid.depth_range()));
    let mut totals = LiveTotals { latency: session.latency(), ..LiveTotals::default() };
    // Frames that were submitted and have no result.
    let mut waiting: VecDeque<(FrameId, FrameLabel)> = VecDeque::new();
    let (mut ended, mut broken, mut held) = (false, None, None);
    while broken.is_none() {
        let mut failed: Vec<(Option<String>, Error)> = vec![];
        let mut heard = ControlFlow::Continue(());
        match held.take().map_or_else(|| take.recv_timeout(MOMENT), Ok) {
            Ok(Arrived::Counts(name, counts, warning)) => match submit(&mut session, &counts) {
                // Where every frame counts, it waits here until there is room.
                Err(error) if error.kind == Kind::Options => {
                    held = Some(Arrived::Counts(name, counts, warning));
                }
                submitted => {
                    totals.arrived += 1;
                    match submitted {
                        Ok(id) => {
                            let time = following.time(id, begun);
                            waiting.push_back((id, FrameLabel { name, warning, time }));
                        }
                        Err(error) => failed.push((Some(name), error)),
                    }
                }
            },
            Ok(Arrived::Failed(name, error)) => {
                totals.arrived += 1;
                failed.push((name, error));
            }
            Ok(Arrived::Skipped(count)) => totals.skipped = count,
            Ok(Arrived::Others(mut names)) => {
                // One that changes is found again.
                names.retain(|name| !totals.others.contains(name));
                if !names.is_empty() {
                    heard = hear(News::Others(&names));
                    totals.others.append(&mut names);
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => ended = true,
        }
        let patience = if ended || held.is_some() { 10 * MOMENT } else { Duration::ZERO };
        let solved = session.wait_for(patience).map(|frame| frame.map(|frame| Arc::new(frame.clone())));
        totals.latency = session.latency();
        let mut done = if matches!(solved, Ok(None)) { vec![] } else { done(&mut waiting, session.taken()) };
        let label = done.pop();
        totals.replaced += done.len() as u64;
        done.iter().for_each(|before| heard = hear(News::Dropped(&before.name)));
        match solved {
            Ok(Some(frame)) => {
                let FrameLabel { name, warning, time } = label.unwrap_or_default();
                totals.solved += 1;
                let moved = motion.take(&name, time, &frame);
                if let Some(page) = page {
                    let shown = subtracts.then(|| motion.shown(&frame.result.maps, moved.as_ref()));
                    page.show(&name, frame.clone(), shown);
                }
                heard = hear(News::Solved(&name, &frame, totals.latency, warning.as_deref(), moved.as_ref()));
            }
            Ok(None) if ended && failed.is_empty() && session.is_idle() => break,
            Ok(None) => heard = if heard.is_break() { heard } else { hear(News::Idle) },
            // Nothing can be solved any more.
            Err(error) if error.kind == Kind::Device => broken = Some(error),
            Err(error) => failed.push((label.map(|label| label.name), error)),
        }
        totals.failed += failed.len() as u64;
        for (name, error) in &failed {
            let told = tell(name.as_deref(), error, page, hear);
            heard = if told.is_break() { told } else { heard };
        }
        page.into_iter().for_each(|page| page.count(&totals));
        if heard.is_break() {
            break;
        }
    }
    broken.map_or(Ok(totals), Err)
}

/// The box of the maps, metres.
fn box_of(grid: &Grid) -> [DVec3; 2] {
    let ([near, far], [x0, x1, y0, y1]) = (grid.depth_range(), grid.extent());
    [DVec3::new(x0, y0, near), DVec3::new(x1, y1, far)]
}

/// Takes the frames up to that of the last result: its label is the last one.
fn done(waiting: &mut VecDeque<(FrameId, FrameLabel)>, taken: Option<FrameId>) -> Vec<FrameLabel> {
    let count = waiting.iter().take_while(|(id, _)| Some(*id) <= taken).count();
    waiting.drain(..count).map(|(_, label)| label).collect()
}

/// Says that a frame, or the stream, failed.
fn tell(
    name: Option<&str>,
    error: &Error,
    page: Option<&LivePage>,
    hear: &mut dyn FnMut(News<'_>) -> ControlFlow<()>,
) -> ControlFlow<()> {
    page.into_iter().for_each(|page| page.fail(name, error));
    hear(News::Failed(name, error))
}

/// Name of a frame, and what differs from the scan.
#[derive(Default)]
struct FrameLabel {
    name: String,
    warning: Option<String>,
    /// Seconds from the first frame.
    time: f64,
}

fn submit(session: &mut Session, counts: &FrameCounts) -> Result<FrameId> {
    match &counts.measured {
        Some(measured) => session.submit_part(&counts.values, measured),
        None => session.submit(&counts.values),
    }
}
