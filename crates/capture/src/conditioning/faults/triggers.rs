//! Triggers of a scanner that were lost, or are too many: all later histograms belong to other points.
//!
//! Neighbours alone decide. Histograms of three points beside each other, along a line and across lines, bend least in the right order. Orders
//! share all triples but those across a trigger and at the ends of lines, so that sums over stretches of the stream compare all orders of one
//! trigger, of two that undo each other, and of one that returns at regular intervals.

use rayon::prelude::*;

use super::roots::{LEAST, RootRows};

/// Minimum gain of an order in standard errors of the noise. Of proper captures at most 3.7 (two triggers, 26 × 26 points of few photons), of
/// faults with 60 photons in the strongest bin 3.6, 4.7, 7.3, 11 and with 1,000 from 8.9 on (`benches/NOTES.md`).
const SHOWN: f64 = 4.2;
/// The same of the triples across the triggers alone: points where a scanner turns are odd in proper captures, too (two triggers of the statue:
/// 4.6 in all, -2.9 across them).
const ACROSS: f64 = 2.2;
/// Orders that are tried one behind the other: triggers without a rule.
const MOST_ORDERS: usize = 8;
/// Starts of regular triggers that are tried, over the length of a line.
const STARTS_OF_A_LINE: usize = 32;

/// A trigger in the order of the scanner: the first histogram behind it, and whether triggers were lost (the histogram is of a later point)
/// or one is too many (the histogram has no point).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Trigger {
    pub at: usize,
    pub is_lost: bool,
}

/// Sums of bends of a stream of histograms, in lines of `line` points.
struct Bends {
    line: usize,
    /// Sums before each histogram: along the stream, and across lines.
    along: Vec<f64>,
    across: Vec<f64>,
    /// Bends along the stream, summed over every `line`th histogram up to each.
    ends: Vec<f64>,
    /// Changes of the bends across a lost, and an additional trigger before each histogram.
    beyond: [Vec<f64>; 2],
    /// Standard deviation of a bend.
    deviation: f64,
}

impl Bends {
    /// `None` where nothing bends.
    fn of(rows: &RootRows, from: &[Option<usize>], line: usize) -> Option<Bends> {
        let count = from.len();
        let pair = |at: Option<usize>| *from.get(at?)?;
        let bend = |at: usize, before: Option<usize>, after: Option<usize>| match [
            pair(before),
            from[at],
            pair(after),
        ] {
            [Some(a), Some(b), Some(c)] => rows.bend([a, b, c]),
            _ => f64::NAN,
        };
        let all =
            |of: &(dyn Fn(usize) -> f64 + Sync)| -> Vec<f64> { (0..count).into_par_iter().map(of).collect() };
        let above = |at: usize, more: usize| (at + more).checked_sub(line);
        let along = all(&|at| bend(at, at.checked_sub(1), Some(at + 1)));
        let across = all(&|at| bend(at, above(at, 0), Some(at + line)));
        let upper = [
            all(&|at| bend(at, above(at, 1), Some(at + line))),
            all(&|at| bend(at, above(at, 0).and_then(|a| a.checked_sub(1)), Some(at + line))),
        ];
        let lower = [
            all(&|at| bend(at, above(at, 0), Some(at + line - 1))),
            all(&|at| bend(at, above(at, 0), Some(at + line + 1))),
        ];
        let inner = |at: &usize| !at.is_multiple_of(line) && at % line + 1 < line;
        let known = (0..count).filter(inner).map(|at| along[at]).chain(across.iter().copied());
        let [n, sum, squares] = known
            .filter(|bend| bend.is_finite())
            .fold([0.0; 3], |[n, sum, squares], bend| [n + 1.0, sum + bend, squares + bend * bend]);
        let mean = sum / n;
        let deviation = (squares / n - mean * mean).max(0.0).sqrt();
        if deviation.is_nan() || deviation <= 0.0 {
            return None;
        }
        // A bend that is not known is as large as the others.
        let over = |bends: &[f64]| -> Vec<f64> {
            bends.iter().map(|b| if b.is_finite() { b - mean } else { 0.0 }).collect()
        };
        let [along, across] = [over(&along), over(&across)];
        let sums = |bends: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
            let later = bends.scan(0.0, |sum, bend| {
                *sum += bend;
                Some(*sum)
            });
            std::iter::once(0.0).chain(later).collect()
        };
        let change = |of: &Vec<f64>| sums(&mut over(of).iter().zip(&across).map(|(a, b)| a - b));
        let beyond = [0, 1].map(|kind| {
            let [upper, lower] = [change(&upper[kind]), change(&lower[kind])];
            let at = |at: usize| {
                let [from, to] = [at.saturating_sub(line), (at + line).min(count)];
                upper[to] - upper[at] + lower[at] - lower[from]
            };
            (0..count).map(at).collect()
        });
        let mut ends = along.clone();
        (line..count).for_each(|at| ends[at] += ends[at - line]);
        Some(Bends {
            line,
            along: sums(&mut along.iter().copied()),
            across: sums(&mut across.iter().copied()),
            ends,
            beyond,
            deviation,
        })
    }

    fn count(&self) -> usize {
        self.ends.len()
    }

    /// Sum of the bends around the histograms before `at`, where each belongs to the point `shift` behind its place.
    fn before(&self, shift: i64, at: usize) -> f64 {
        // Those at the ends of a line have no neighbour on one side.
        let ends = [0, -1].map(|end| {
            let first = (end - shift).rem_euclid(self.line as i64) as usize;
            if at > first { self.ends[first + (at - 1 - first) / self.line * self.line] } else { 0.0 }
        });
        self.along[at] + self.across[at] - ends[0] - ends[1]
    }

    /// Changes of the bends across a trigger.
    fn at(&self, trigger: Trigger) -> f64 {
        self.beyond[usize::from(!trigger.is_lost)][trigger.at]
    }

    /// By how many standard errors less the histograms bend with these triggers; `None` if not so across them alone.
    fn gain(&self, triggers: impl Iterator<Item = Trigger> + Clone) -> Option<f64> {
        let [across, count] =
            triggers.clone().fold([0.0; 2], |[sum, count], t| [sum - self.at(t), count + 1.0]);
        if across < ACROSS * self.deviation * (4.0 * self.line as f64 * count).sqrt() {
            return None;
        }
        let line = self.line as i64;
        // Bends, and how many triples are others, of a stretch of the stream.
        let of = |shift: i64, from: usize, to: usize| {
            // Nothing is measured behind the last point.
            let to = to.min((self.count() as i64 - shift.max(0)) as usize);
            if from >= to {
                return [0.0; 2];
            }
            let ends = match shift.rem_euclid(line) {
                0 => 0.0,
                by if by == 1 || by + 1 == line => 2.0,
                _ => 4.0,
            };
            [self.before(shift, to) - self.before(shift, from), ends * (to - from) as f64 / line as f64]
        };
        let (mut shift, mut begin, mut sums) = (0, 0, [0.0; 2]);
        let mut add = |[bends, changed]: [f64; 2]| sums = [sums[0] + bends, sums[1] + changed];
        for trigger in triggers {
            add(of(shift, begin, trigger.at));
            add([self.at(trigger), 4.0 * line as f64]);
            (shift, begin) =
                if trigger.is_lost { (shift + 1, trigger.at) } else { (shift - 1, trigger.at + 1) };
        }
        add(of(shift, begin, self.count()));
        let [bends, changed] = sums;
        Some((self.before(0, self.count()) - bends) / (self.deviation * changed.sqrt()))
    }

    /// The triggers with which the histograms bend least.
    fn best(&self) -> Option<(f64, Vec<Trigger>)> {
        let (count, line) = (self.count(), self.line);
        let by_gain = |a: &(f64, Vec<Trigger>), b: &(f64, Vec<Trigger>)| a.0.total_cmp(&b.0);
        let of = |triggers: Vec<Trigger>| Some((self.gain(triggers.iter().copied())?, triggers));
        let places = || (line..count.saturating_sub(line)).into_par_iter();
        let of_kind = |is_lost: bool| {
            let single = places().filter_map(|at| of(vec![Trigger { at, is_lost }])).max_by(by_gain);
            // What is before the second trigger of two depends on the first one alone.
            let shift = if is_lost { 1 } else { -1 };
            let mut first: Option<(f64, usize)> = None;
            let mut pair: Option<(f64, [usize; 2])> = None;
            for at in 2 * line..count.saturating_sub(line) {
                let begin = at - line;
                let less = self.before(0, begin) + self.at(Trigger { at: begin, is_lost })
                    - self.before(shift, begin + usize::from(!is_lost));
                if first.is_none_or(|(least, _)| less < least) {
                    first = Some((less, begin));
                }
                let (less, begin) = first?;
                let bends = less + self.before(shift, at) - self.before(0, at + usize::from(is_lost))
                    + self.at(Trigger { at, is_lost: !is_lost });
                if pair.is_none_or(|(least, _)| bends < least) {
                    pair = Some((bends, [begin, at]));
                }
            }
            let pair = pair.and_then(|(_, [first, second])| {
                of(vec![Trigger { at: first, is_lost }, Trigger { at: second, is_lost: !is_lost }])
            });
            // Those in the last line show nothing.
            let regular = |every: usize, start: usize| {
                (start..count - line).step_by(every).map(move |at| Trigger { at, is_lost })
            };
            let step = (line / STARTS_OF_A_LINE).max(1);
            let starts = |every: usize| {
                let each = (1..=every + 1).step_by(step);
                each.filter_map(move |start| Some((self.gain(regular(every, start))?, every, start)))
            };
            let periods = (2 * line..count / 3 + 1).into_par_iter();
            let near = periods
                .filter_map(|every| starts(every).max_by(|a, b| a.0.total_cmp(&b.0)))
                .max_by(|a, b| a.0.total_cmp(&b.0));
            let regular = near.and_then(|(_, every, start)| {
                let fine = (start.saturating_sub(step).max(1)..=start + step)
                    .filter_map(|start| of(regular(every, start).collect()));
                fine.max_by(by_gain)
            });
            single.into_iter().chain(pair).chain(regular).max_by(by_gain)
        };
        [true, false].into_iter().filter_map(of_kind).max_by(by_gain)
    }
}

/// A stream put in order.
pub(super) struct InOrder {
    /// The pair whose histogram belongs to each point, `None` where a point has none.
    pub from: Vec<Option<usize>>,
    /// The points of lost and of additional triggers.
    pub points: [Vec<usize>; 2],
}

/// The order of the histograms of a stream; `None` if it is right, or wrong in another way. `stream`: pairs in the order of the scanner, in
/// lines of `line` points.
pub(super) fn in_order(rows: &RootRows, stream: &[usize], line: usize) -> Option<InOrder> {
    if line < LEAST || stream.len() < LEAST * line {
        return None;
    }
    let mut from: Vec<Option<usize>> = stream.iter().copied().map(Some).collect();
    let mut points = [vec![], vec![]];
    for _ in 0..MOST_ORDERS {
        let best = Bends::of(rows, &from, line).and_then(|bends| bends.best());
        let Some((_, triggers)) = best.filter(|(errors, _)| *errors > SHOWN) else { break };
        let mut shift = 0;
        for Trigger { at, is_lost } in triggers {
            let at = at.checked_add_signed(shift).filter(|at| *at < from.len())?;
            // No scanner loses count several times a line: something else is wrong.
            if points.iter().flatten().any(|other: &usize| at.abs_diff(*other) < line) {
                return None;
            }
            if is_lost {
                from.insert(at, None);
                from.pop();
            } else {
                from.remove(at);
                from.push(None);
            }
            shift += if is_lost { 1 } else { -1 };
            points[usize::from(!is_lost)].push(at);
        }
    }
    points.iter().any(|of| !of.is_empty()).then_some(InOrder { from, points })
}
