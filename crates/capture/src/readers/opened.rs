//! A capture as it was read, whatever its format.

use crate::error::Result;
use crate::{Capture, Keep, Turn};

/// A capture as it was read.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Opened {
    /// The capture.
    pub capture: Capture,
    /// Pairs of the file that were left out because they were not measured.
    pub dropped: usize,
    /// Sentences that say what was assumed and what was left out, and why.
    pub notes: Vec<String>,
}

/// Changes the points of all measured pairs, before some are chosen; notes say what was done. The capture may be
/// without its counts.
pub type Prepare<'p> = dyn FnMut(&mut Capture, &mut Vec<String>) -> Result<()> + 'p;

/// Leaves out pairs that were not measured, checks the rest, and rotates a wall that clearly does not face +z. Also returns
/// how many were left out.
pub fn measured(capture: Capture, notes: &mut Vec<String>) -> Result<(Capture, usize)> {
    let (capture, dropped, missing) = capture.without_missing()?;
    notes.extend(missing);
    capture.check()?;
    Ok((crate::conditioning::frame::roughly_facing_z(capture, notes), dropped))
}

/// Turns a whole capture, calls `prepare`, and keeps a part of it.
pub fn keep_prepared(
    (capture, dropped): (Capture, usize),
    turn: Turn,
    keep: &Keep,
    prepare: &mut Prepare,
    mut notes: Vec<String>,
) -> Result<Opened> {
    notes.extend(turn.note());
    let mut capture = capture.turned(turn);
    prepare(&mut capture, &mut notes)?;
    let capture = keep.apply(capture, &mut notes)?;
    notes.extend(capture.negative_note());
    Ok(Opened { capture, dropped, notes })
}
