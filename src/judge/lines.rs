//! Delays of the lines of a scan, by held-out pairs: a scanner that lags, a cable per detector, a trigger that drifts.

use rayon::prelude::*;

use super::found::Shown;
use super::laws::{LawScan, WallFrame};
use super::spread::add_products;
use crate::Result;
use crate::capture::{Capture, METRES_PER_PICOSECOND};
use crate::closed_form::image::peak_between;
use crate::settings::Correction;
use crate::surface::{HeldOut, Left};

/// Fewer lines have no pattern.
const LEAST_LINES: usize = 4;
/// Longest delay, as a share of the bins, and in bins of the fits.
const FARTHEST: [usize; 2] = [8, 24];
/// Shifted lines must explain this share of what is left, before a fit is spent on them.
const WORTH: f64 = 0.2;
/// Fits of shifted counts at most: a surface that was fitted to delayed counts hides a part of the delays. Each must leave less by this
/// factor.
const ROUNDS: usize = 4;
const LESS: f64 = 0.93;

/// A cause is proven if less than this share is left once it is undone, and less beyond chance.
const PROVEN: f64 = 0.6;

/// Whether undoing a cause explains more of the same pairs, beyond doubt.
fn is_proven(after: &Left, before: &Left) -> bool {
    after.excess() < PROVEN * before.excess() && after.is_less(before)
}

/// The lines of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lines {
    /// All points of one x.
    Columns,
    /// All points of one y.
    Rows,
}

impl Lines {
    pub fn of(self, pair: usize, [_, ny]: [usize; 2]) -> usize {
        match self {
            Lines::Columns => pair / ny,
            Lines::Rows => pair % ny,
        }
    }

    pub fn count(self, [nx, ny]: [usize; 2]) -> usize {
        match self {
            Lines::Columns => nx,
            Lines::Rows => ny,
        }
    }
}

impl std::fmt::Display for Lines {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Lines::Columns => "columns",
            Lines::Rows => "rows",
        })
    }
}

/// Delays of the lines of a scan.
#[derive(Debug, Clone, PartialEq)]
pub struct LineDelays {
    /// Which lines.
    pub lines: Lines,
    /// Metres of path by which the counts of each line are late; their median is 0.
    pub delays: Vec<f64>,
}

/// Delays of columns or rows that explain most of what is left, if that is worth a fit.
fn found(held: &HeldOut, scan: [usize; 2], lines: Lines) -> Option<(LineDelays, f64)> {
    let (bins, count) = (held.bins(), lines.count(scan));
    if count < LEAST_LINES || scan[0] * scan[1] <= count {
        return None;
    }
    let farthest = (bins / FARTHEST[0]).min(FARTHEST[1]);
    let [rendered, measured] = held.sides();
    let mut rows: Vec<Vec<usize>> = vec![vec![]; count];
    held.pairs.iter().enumerate().for_each(|(row, pair)| rows[lines.of(*pair, scan)].push(row));
    if rows.iter().any(Vec::is_empty) {
        return None;
    }
    // By line and lag in bins: sums of rendered values times measured ones.
    let of_line = |rows: &Vec<usize>| {
        let [mut early, mut late] = [vec![0.0; farthest + 1], vec![0.0; farthest + 1]];
        for row in rows {
            let [rendered, measured] = [&rendered, &measured].map(|all| &all[row * bins..(row + 1) * bins]);
            add_products(measured, rendered, 0, &mut early);
            add_products(rendered, measured, 0, &mut late);
        }
        early.into_iter().rev().chain(late.into_iter().skip(1)).collect()
    };
    let products: Vec<Vec<f64>> = rows.par_iter().map(of_line).collect();
    let best = |of: &Vec<f64>| {
        let at = (0..of.len()).max_by(|a, b| of[*a].total_cmp(&of[*b]).then(b.cmp(a))).unwrap_or(farthest);
        let beside = at.checked_sub(1).map(|i| of[i]).zip(of.get(at + 1));
        let part = beside.map_or(0.0, |(before, behind)| peak_between([before, of[at], *behind]));
        (at as f64 - farthest as f64 + part, of[at] - of[farthest])
    };
    let each: Vec<(f64, f64)> = products.iter().map(best).collect();
    let mut sorted: Vec<f64> = each.iter().map(|e| e.0).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let middle = sorted[count / 2];
    let delays = each.iter().map(|e| (e.0 - middle) * held.bin_width()).collect();
    let gain = 2.0 * each.iter().map(|e| e.1).sum::<f64>();
    Some((LineDelays { lines, delays }, gain))
}

/// Finds delays of lines, by all pairs, that explain far more of the held-out ones once they are undone. `trial` fits a capture.
///
/// # Errors
/// Those of `trial`.
pub(super) fn calibrate(
    shown: &Shown,
    capture: &Capture,
    trial: &mut dyn FnMut(&Capture) -> Result<Option<Shown>>,
) -> Result<Option<(LineDelays, Left)>> {
    let (before, Some(all)) = (shown.held.left(), &shown.all) else { return Ok(None) };
    let left = all.left();
    let excess: f64 = left.pairs.iter().map(|p| p[0]).sum::<f64>() - left.noise;
    let each = [Lines::Columns, Lines::Rows].into_iter().filter_map(|lines| found(all, capture.scan, lines));
    let Some((mut delays, gain)) = each.max_by(|a, b| a.1.total_cmp(&b.1)) else { return Ok(None) };
    if gain < WORTH * excess {
        return Ok(None);
    }
    let mut best: Option<(LineDelays, Left)> = None;
    for _ in 0..ROUNDS {
        let Some(shown) = trial(&delays.undone(capture))? else { break };
        let left = shown.held.left();
        let least = best.as_ref().map_or(before.excess(), |best| best.1.excess());
        if left.excess() > LESS * least {
            break;
        }
        best = Some((delays.clone(), left));
        let more = shown.all.as_ref().and_then(|all| found(all, capture.scan, delays.lines));
        let Some((more, _)) = more else { break };
        delays.delays.iter_mut().zip(more.delays).for_each(|(delay, more)| *delay += more);
    }
    Ok(best.filter(|(_, left)| is_proven(left, &before)))
}

impl LineDelays {
    /// The delays, about the wall of a capture.
    pub fn correction(&self, capture: &Capture) -> Correction {
        let WallFrame { middle, half } = LawScan::of(capture).frame;
        let law = format!("delays of {}", self.lines);
        Correction { law, numbers: self.delays.clone(), middle: middle.to_array(), half }
    }

    /// The capture without the delays, by whole bins; the end of a histogram that comes from outside holds its last count.
    pub fn undone(&self, capture: &Capture) -> Capture {
        let bins = capture.bins;
        let mut undone = capture.clone();
        for (pair, row) in undone.histograms.chunks_exact_mut(bins).enumerate() {
            let delay = self.delays[self.lines.of(pair, capture.scan)];
            let late = (delay / capture.bin_width).round().clamp(-(bins as f64), bins as f64) as isize;
            let from = capture.histogram(pair);
            let at = |bin: usize| bin.saturating_add_signed(late).min(bins - 1);
            row.iter_mut().enumerate().for_each(|(bin, v)| *v = from[at(bin)]);
        }
        undone
    }

    /// The pattern as a sentence.
    pub fn what(&self) -> String {
        let lines = self.lines;
        let axis = if lines == Lines::Columns { "x" } else { "y" };
        let picoseconds = |metres: f64| metres / METRES_PER_PICOSECOND;
        let (count, mean) = (self.delays.len(), self.mean(|_| true));
        let left = |model: &dyn Fn(usize) -> f64| -> f64 {
            self.delays.iter().enumerate().map(|(line, d)| (d - model(line)).powi(2)).sum()
        };
        let all = left(&|_| mean);
        let [even, odd] = [0, 1].map(|parity| self.mean(|line| line % 2 == parity));
        let alternating = left(&|line| if line % 2 == 0 { even } else { odd });
        let step = (2..count - 1)
            .map(|at| (at, [self.mean(|line| line < at), self.mean(|line| line >= at)]))
            .map(|(at, sides)| (at, sides[1] - sides[0], left(&|line| sides[usize::from(line >= at)])))
            .min_by(|a, b| a.2.total_cmp(&b.2));
        let middle = 0.5 * (count as f64 - 1.0);
        let centred = |line: usize| line as f64 - middle;
        let squares: f64 = (0..count).map(|line| centred(line).powi(2)).sum();
        let slope = self.delays.iter().enumerate().map(|(line, d)| centred(line) * d).sum::<f64>() / squares;
        let trend = left(&|line| mean + slope * centred(line));
        /// A pattern that leaves more than this share of the squares is another one.
        const MOST: f64 = 0.3;
        if alternating < MOST * all {
            return format!(
                "every second one of the {lines} is late by {:.0} ps, as of a scanner that lags behind on its way back",
                picoseconds(odd - even).abs()
            );
        }
        match step {
            Some((at, height, rest)) if rest < MOST * all && rest < trend => format!(
                "from line {at} of the {lines} on, counts are {:.0} ps {} than before, as of a time zero that jumped",
                picoseconds(height).abs(),
                if height > 0.0 { "later" } else { "earlier" }
            ),
            _ if trend < MOST * all => format!(
                "counts are later by {:.1} ps with each line along {axis}, as of a skew or drift of time zero",
                picoseconds(slope)
            ),
            _ => {
                let rms = (self.delays.iter().map(|d| d * d).sum::<f64>() / count as f64).sqrt();
                format!(
                    "the {lines} have delays of their own, of {:.0} ps (root mean square)",
                    picoseconds(rms)
                )
            }
        }
    }

    fn mean(&self, of: impl Fn(usize) -> bool) -> f64 {
        let chosen = || self.delays.iter().enumerate().filter(|(line, _)| of(*line));
        chosen().map(|(_, delay)| delay).sum::<f64>() / chosen().count().max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn of(delay: impl Fn(usize) -> f64) -> LineDelays {
        let picosecond = METRES_PER_PICOSECOND;
        LineDelays { lines: Lines::Columns, delays: (0..16).map(|line| picosecond * delay(line)).collect() }
    }

    #[test]
    fn delays_are_undone_and_patterns_have_names() {
        let mut capture = Capture::new(
            [16, 2],
            vec![DVec3::ZERO; 32],
            vec![DVec3::ZERO; 32],
            50,
            32.0 * METRES_PER_PICOSECOND,
            vec![0.0; 32 * 50],
        );
        let proper =
            capture.clone().with(|c| c.histograms.iter_mut().skip(20).step_by(50).for_each(|v| *v = 9.0));
        let late = |line: usize| [0, 3, 1, 0, 2][line % 5];
        for pair in 0..32 {
            capture.histograms[pair * 50 + 20 + late(pair / 2)] = 9.0;
        }
        assert_eq!(of(|line| 32.0 * late(line) as f64).undone(&capture), proper);
        assert!(
            of(|line| 100.0 * (line % 2) as f64)
                .what()
                .contains("every second one of the columns is late by 100 ps")
        );
        assert!(
            of(|line| if line < 9 { 0.0 } else { 60.0 })
                .what()
                .contains("from line 9 of the columns on, counts are 60 ps later")
        );
        assert!(of(|line| 7.0 * line as f64).what().contains("later by 7.0 ps with each line along x"));
        assert!(of(|line| 50.0 * late(line * 7) as f64).what().contains("delays of their own"));
    }
}
