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

/// Course of a scanner along a line.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Course {
    /// Laser pulses of the points of a line; `None`: all of them.
    pub(super) duration: Option<i64>,
    /// Share of a sine's quarter periods that a line takes; `None` for a constant speed.
    pub(super) sine: Option<f64>,
    /// Whether the points of every second line come in the reverse order of the scan's.
    pub(super) reversed: bool,
    /// Points by which the photons of every second line come late.
    pub(super) late: f64,
}

impl Course {
    /// Edges of the points of a line as shares of its time, from 0 to 1.
    pub(super) fn edge(&self, share: f64) -> f64 {
        let Some(sine) = self.sine else { return share };
        let quarter = sine * std::f64::consts::FRAC_PI_2;
        0.5 + (quarter.sin() * (2.0 * share - 1.0)).asin() / (2.0 * quarter)
    }
}

/// Laser pulses of points or lines, round by round.
pub(super) type Rounds = Vec<Vec<[i64; 2]>>;

/// Finds the course of the scanner along these lines, if no marker ends them, and adds notes.
pub(super) type FindCourse<'c> = dyn Fn(&Rounds, bool, &mut Vec<String>) -> Result<Course> + 'c;

/// A point or line of fewer laser pulses than this share of the usual ones comes from a marker too many.
const SHORT: f64 = 0.25;

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

    /// The laser pulses of `points` points, round by round, without lines, or points, `before` those of the scan. `per_line`: points of
    /// a line. Notes say what was left out.
    ///
    /// # Errors
    /// `Kind::Options` or `Kind::Input` if not every point has its laser pulses.
    pub(super) fn spans(
        &self,
        survey: &Survey,
        [points, before]: [usize; 2],
        per_line: Option<usize>,
        course: &FindCourse,
        notes: &mut Vec<String>,
    ) -> Result<Vec<Span>> {
        let rounds = match self {
            Division::Pixels { marker, frame } => {
                let mut rounds = rounds(survey, *marker, None, *frame, [points, before], notes)?;
                cut_pauses(&mut rounds, survey.pulses, notes);
                check_short(&rounds, *marker, points, survey)?;
                rounds
            }
            Division::Lines { start, stop, frame } => {
                let per_line = per_line.filter(|n| points.is_multiple_of(*n)).ok_or_else(|| {
                    Error::options(
                        format!("it is not known how many of the {points} points are on a line"),
                        "give the scan as columns x rows, such as 64x64",
                    )
                })?;
                let stop = stop
                    .filter(|stop| bit(*stop).is_ok_and(|bit| survey.markers.iter().any(|m| m.1 & bit > 0)));
                if let (None, Division::Lines { stop: Some(stop), .. }) = (stop, self) {
                    notes.push(format!("there is no marker {stop}, which ends a line"));
                }
                let mut lines = rounds(survey, *start, stop, *frame, [points / per_line, before], notes)?;
                if stop.is_none() {
                    cut_pauses(&mut lines, survey.pulses, notes);
                }
                check_short(&lines, *start, points / per_line, survey)?;
                lines.retain(|round| round.len() == points / per_line);
                let course = course(&lines, stop.is_some(), notes)?;
                let parts = |(row, line): (usize, &[i64; 2])| {
                    let [from, to] = line.map(|at| at as f64);
                    let to = course.duration.map_or(to, |pulses| to.min(from + pulses as f64));
                    let is_second = row % 2 == 1;
                    let late = if is_second { course.late * (to - from) / per_line as f64 } else { 0.0 };
                    let edge = move |i: usize| {
                        (from + late + (to - from) * course.edge(i as f64 / per_line as f64) - 1e-6).ceil()
                            as i64
                    };
                    (0..per_line).map(move |i| {
                        let point = if is_second && course.reversed { per_line - 1 - i } else { i };
                        (point + row * per_line, [edge(i), edge(i + 1)])
                    })
                };
                let of_round =
                    |round: &Vec<[i64; 2]>| round.iter().enumerate().flat_map(parts).collect::<Vec<_>>();
                let spans = lines.iter().flat_map(of_round);
                if lines.len() > 1 {
                    notes.push(format!("{} rounds of the scan are added up", lines.len()));
                }
                return Ok(spans.map(|(point, [from, to])| Span { from, to, point: point as u32 }).collect());
            }
            Division::Pulses { each, before } => by_pulses(survey, points, *each, *before)?,
        };
        if rounds.len() > 1 {
            notes.push(format!("{} rounds of the scan are added up", rounds.len()));
        }
        let span = |(point, [from, to]): (usize, [i64; 2])| Span { from, to, point: point as u32 };
        Ok(rounds.into_iter().flat_map(|round| round.into_iter().enumerate().map(span)).collect())
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

const LEFT_OUT: &str = "left out (say how many lines come before those of the scan to leave the first out)";

/// Begin and end of what `start` begins, in rounds of `scanned`, after `before` others that are left out: `frame` begins a round, or a
/// full one does.
fn rounds(
    survey: &Survey,
    start: u32,
    stop: Option<u32>,
    frame: Option<u32>,
    [scanned, before]: [usize; 2],
    notes: &mut Vec<String>,
) -> Result<Rounds> {
    let count = scanned.saturating_add(before);
    let begins = bit(start)?;
    let ends = stop.filter(|stop| *stop != start).map(bit).transpose()?;
    let first_frame = |bit: u16| survey.markers.iter().position(|m| m.1 & bit > 0);
    let frames = frame.map(bit).transpose()?.filter(|bit| first_frame(*bit).is_some());
    if let (Some(frame), None) = (frame, frames) {
        notes.push(format!("there is no marker {frame}, which begins a round"));
    }
    if frames.is_none() {
        check_pauses(survey, start, begins, count)?;
    }
    let mut rounds: Rounds = vec![];
    let (mut open, mut framed): (Option<i64>, bool) = (None, false);
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
            // The marker of the first round may be missing. What comes earlier belongs to none.
            if let Some(before) = rounds.last_mut().filter(|_| !framed) {
                let early = before.len().saturating_sub(count);
                before.drain(..early);
            }
            framed = true;
            rounds.push(vec![]);
        }
        if begin {
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
            "marker {start} begins more than the {count} that the scan has, in {more} rounds: the last of each are {LEFT_OUT}"
        ));
    }
    rounds.iter_mut().for_each(|round| round.truncate(count));
    let (all, whole) = (rounds.len(), rounds.iter().filter(|round| round.len() == count).count());
    if whole > 0 {
        if whole < all {
            notes
                .push(format!("{} of {all} rounds of the scan were not whole and are left out", all - whole));
        }
        if frames.is_none() && all == 2 && whole == 1 {
            notes.push(format!(
                "marker {start} begins {} more than the {count} that the scan has: the last are {LEFT_OUT}",
                rounds.last().map_or(0, Vec::len)
            ));
        }
        if frames.is_none() && whole > 1 && whole < all {
            notes.push("rounds are reported by their number of markers alone: if each has more of them, name the marker of frames, or they shift".into());
        }
        rounds.retain(|round| round.len() == count);
        rounds.iter_mut().for_each(|round| drop(round.drain(..before)));
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

/// The laser pulses of most of them.
fn usual(rounds: &Rounds) -> Option<i64> {
    let mut lengths: Vec<i64> = rounds.iter().flatten().map(|[from, to]| to - from).collect();
    let middle = lengths.len() / 2;
    (!lengths.is_empty()).then(|| *lengths.select_nth_unstable(middle).1)
}

/// Ends what lasts much longer than usual after the usual duration. What the file's end cuts lasts as long.
fn cut_pauses(rounds: &mut Rounds, pulses: i64, notes: &mut Vec<String>) {
    let Some(usual) = usual(rounds) else { return };
    let mut cut = 0;
    for [from, to] in rounds.iter_mut().flatten() {
        let is_long = (*to - *from) as f64 > LONG * usual as f64;
        cut += usize::from(is_long);
        if is_long || *to == pulses {
            *to = *from + usual;
        }
    }
    if cut > 0 {
        notes.push(format!(
            "{cut} markers were followed by a pause: photons count for the usual {usual} laser pulses"
        ));
    }
}

/// Refuses what lasts much shorter than usual: a marker too many shifts all that follow.
fn check_short(rounds: &Rounds, start: u32, count: usize, survey: &Survey) -> Result<()> {
    let usual = usual(rounds).unwrap_or(0);
    let all = rounds.iter().flatten().enumerate();
    let short = all
        .map(|(at, [from, to])| (at, to - from))
        .find(|(_, pulses)| (*pulses as f64) < SHORT * usual as f64);
    let Some((at, pulses)) = short else { return Ok(()) };
    Err(Error::input(
        format!(
            "marker {start} begins something of {pulses} laser pulses, number {} of {count}, where {usual} are usual: there is a marker \
             too many",
            at % count + 1
        ),
        format!(
            "remove it, name the marker of rounds, or give the laser pulses of a point and those before the first: the file has {}",
            survey.marker_counts()
        ),
    ))
}

fn by_pulses(survey: &Survey, points: usize, each: u64, before: u64) -> Result<Rounds> {
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
