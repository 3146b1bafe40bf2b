//! Which photons belong to which point of the scan.

use super::cuts::Span;
use super::{Image, Survey};
use crate::error::{Error, Result};

/// How the laser pulses of a measurement are divided among the points of a scan. Points come in the order in which they
/// were measured; when all are done, the next photons add to the first again.
#[derive(Debug, Clone, PartialEq)]
pub enum Division {
    /// A marker, from 1, begins each point.
    Pixels {
        /// The marker.
        marker: u32,
        /// The marker that begins each round of all points, if there is one.
        frame: Option<u32>,
    },
    /// Markers, from 1, begin and end each line. Its points take equal shares of its laser pulses.
    Lines {
        /// The marker of its begin.
        start: u32,
        /// The marker of its end; without one it ends where the next begins.
        stop: Option<u32>,
        /// The marker that begins each round of all lines, if there is one.
        frame: Option<u32>,
    },
    /// So many laser pulses for each point, one after the other.
    Pulses {
        /// Of each point.
        each: u64,
        /// Laser pulses before the first point.
        before: u64,
    },
}

/// Most times that a point is measured, of all points together: 2^23, which take 200 MiB.
const MOST_SPANS: i64 = 1 << 23;

/// A point is cut if it lasts longer than this, in usual durations of points: the scanner paused or went back.
const LONG: f64 = 1.1;

impl Division {
    /// The division that the header of an image asks for: its lines.
    pub fn of_image(image: &Image) -> Option<Division> {
        let [start, stop, frame] = image.markers;
        Some(Division::Lines { start: start?, stop, frame })
    }

    /// The laser pulses of `points` points, round by round. `per_line`: points of a line. Notes say what was left out.
    ///
    /// # Errors
    /// `Kind::Options` or `Kind::Input` if not every point has its laser pulses.
    pub(super) fn spans(
        &self,
        survey: &Survey,
        points: usize,
        per_line: Option<usize>,
        notes: &mut Vec<String>,
    ) -> Result<Vec<Span>> {
        let rounds = match self {
            Division::Pixels { marker, frame } => {
                let mut rounds = rounds(survey, *marker, None, *frame, points, notes)?;
                cut_pauses(&mut rounds, notes);
                rounds
            }
            Division::Lines { start, stop, frame } => {
                let per_line = per_line.filter(|n| points.is_multiple_of(*n)).ok_or_else(|| {
                    Error::options(
                        format!("it is not known how many of the {points} points are on a line"),
                        "give the scan as columns x rows, such as 64x64",
                    )
                })?;
                let mut lines = rounds(survey, *start, *stop, *frame, points / per_line, notes)?;
                if stop.is_none() {
                    cut_pauses(&mut lines, notes);
                }
                let parts = |line: &[i64; 2]| {
                    let [from, to] = line.map(i128::from);
                    let n = per_line as i128;
                    let edge = move |i: i128| (from + ((to - from) * i + n - 1) / n) as i64;
                    (0..n).map(move |i| [edge(i), edge(i + 1)])
                };
                lines.iter().map(|round| round.iter().flat_map(parts).collect()).collect()
            }
            Division::Pulses { each, before } => by_pulses(survey, points, *each, *before)?,
        };
        let whole = rounds.iter().filter(|round| round.len() == points).count();
        if whole < rounds.len() {
            notes.push(format!(
                "{} of {} rounds of the scan were not whole and are left out",
                rounds.len() - whole,
                rounds.len()
            ));
        }
        if whole > 1 {
            notes.push(format!("{whole} rounds of the scan are added up"));
        }
        let rounds = rounds.into_iter().filter(|round| round.len() == points);
        let span = |(point, [from, to]): (usize, [i64; 2])| Span { from, to, point: point as u32 };
        Ok(rounds.flat_map(|round| round.into_iter().enumerate().map(span)).collect())
    }
}

fn bit(marker: u32) -> Result<u16> {
    if (1..=16).contains(&marker) {
        return Ok(1 << (marker - 1));
    }
    Err(Error::options(
        format!("there is no marker {marker}"),
        "give a marker from 1 to 4, or to 16 in arrays and text",
    ))
}

/// Begin and end of what `start` begins, in rounds of `count`: `frame` begins a round, or a full one does. Rounds that are
/// not full are among them.
fn rounds(
    survey: &Survey,
    start: u32,
    stop: Option<u32>,
    frame: Option<u32>,
    count: usize,
    notes: &mut Vec<String>,
) -> Result<Vec<Vec<[i64; 2]>>> {
    let begins = bit(start)?;
    let ends = stop.filter(|stop| *stop != start).map(bit).transpose()?;
    let frames = frame.map(bit).transpose()?;
    if frames.is_none() {
        check_pauses(survey, start, begins, count)?;
    }
    let mut rounds: Vec<Vec<[i64; 2]>> = vec![];
    let mut open: Option<i64> = None;
    let mut waits = frames.is_some();
    for &(sync, bits) in &survey.markers {
        let new_frame = frames.is_some_and(|f| bits & f > 0);
        let begin = bits & begins > 0;
        // What is open ends at its own end, or where the next begins if none is marked.
        let end = match ends {
            Some(ends) => bits & ends > 0,
            None => begin || new_frame,
        };
        if let Some(from) = open.filter(|_| end || begin) {
            if let Some(round) = rounds.last_mut().filter(|_| end) {
                round.push([from, sync]);
            }
            open = None;
        }
        if new_frame {
            waits = false;
            rounds.push(vec![]);
        }
        if begin && !waits {
            let full = |round: &Vec<_>| frames.is_none() && round.len() == count;
            if rounds.last().is_none_or(full) {
                rounds.push(vec![]);
            }
            open = Some(sync);
        }
    }
    if let (Some(from), None, Some(round)) = (open, ends, rounds.last_mut()) {
        round.push([from, survey.pulses]);
    }
    // More than the scan has, before the next frame: the first count.
    let more = rounds.iter().filter(|round| round.len() > count).count();
    if more > 0 {
        notes.push(format!(
            "marker {start} begins more than the {count} that the scan has, in {more} rounds: the rest of each is left out"
        ));
    }
    rounds.iter_mut().for_each(|round| round.truncate(count));
    if rounds.iter().any(|round| round.len() == count) {
        return Ok(rounds);
    }
    let most = rounds.iter().map(Vec::len).max().unwrap_or(0);
    Err(Error::input(
        format!("marker {start} begins {most} of the {count} that the scan has"),
        format!(
            "check which marker begins what, and the size of the scan: the file has {}",
            survey.marker_counts()
        ),
    ))
}

/// A pause between rounds is this many times as long as usual.
const PAUSE: i64 = 3;

/// Refuses a scan that pauses elsewhere than after every `count`: its rounds are not those of the header, and each would be
/// shifted against the one before.
fn check_pauses(survey: &Survey, start: u32, begins: u16, count: usize) -> Result<()> {
    let starts: Vec<i64> = survey.markers.iter().filter(|m| m.1 & begins > 0).map(|m| m.0).collect();
    let steps: Vec<i64> = starts.windows(2).map(|w| w[1] - w[0]).collect();
    let mut sorted = steps.clone();
    sorted.sort_unstable();
    let Some(usual) = sorted.get(sorted.len() / 2) else { return Ok(()) };
    let pauses: Vec<usize> =
        (0..steps.len()).filter(|i| steps[*i] > PAUSE * (*usual).max(1)).map(|i| i + 1).collect();
    // Single pauses tell nothing of rounds: they are alike.
    let Some(first) =
        pauses.first().filter(|first| pauses.len() > 1 && pauses.iter().all(|p| p % **first == 0))
    else {
        return Ok(());
    };
    if first.is_multiple_of(count) || count.is_multiple_of(*first) {
        return Ok(());
    }
    Err(Error::input(
        format!(
            "marker {start} comes {first} times from one pause of the scanner to the next, but the scan has {count}"
        ),
        format!(
            "give the size of the scan as it was recorded, or the marker of frames: the file has {}",
            survey.marker_counts()
        ),
    ))
}

/// Ends what lasts much longer than usual after the usual duration.
fn cut_pauses(rounds: &mut [Vec<[i64; 2]>], notes: &mut Vec<String>) {
    let mut lengths: Vec<i64> = rounds.iter().flatten().map(|[from, to]| to - from).collect();
    if lengths.is_empty() {
        return;
    }
    let middle = lengths.len() / 2;
    let usual = *lengths.select_nth_unstable(middle).1;
    let mut cut = 0;
    for [from, to] in rounds.iter_mut().flatten() {
        if (*to - *from) as f64 > LONG * usual as f64 {
            *to = *from + usual;
            cut += 1;
        }
    }
    if cut > 0 {
        notes.push(format!(
            "{cut} markers were followed by a pause: photons count for the usual {usual} laser pulses"
        ));
    }
}

fn by_pulses(survey: &Survey, points: usize, each: u64, before: u64) -> Result<Vec<Vec<[i64; 2]>>> {
    let wrong =
        |what: String| Err(Error::options(what, "give the laser pulses that a point was measured for"));
    let (Ok(each), Ok(before)) = (i64::try_from(each), i64::try_from(before)) else {
        return wrong(format!("a point has {each} laser pulses, after {before}"));
    };
    let Some(round) = each.checked_mul(points as i64).filter(|_| each > 0) else {
        return wrong(format!("{points} points have {each} laser pulses each"));
    };
    let seen = survey.pulses - before;
    // The last photon may come long before the last laser pulse.
    if seen <= round - each {
        return wrong(format!(
            "{points} points of {each} laser pulses are {round}, but the file ends after {} of them",
            seen.max(0)
        ));
    }
    let rounds = 1 + (seen - round).max(0) / round;
    if rounds.saturating_mul(points as i64) > MOST_SPANS {
        return wrong(format!(
            "{points} points of {each} laser pulses would be measured {rounds} times over"
        ));
    }
    let spans = |r: i64| {
        (0..points as i64).map(move |p| before + r * round + p * each).map(|from| [from, from + each])
    };
    Ok((0..rounds).map(|r| spans(r).collect()).collect())
}
