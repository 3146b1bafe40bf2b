//! Histograms that belong to other points of the scan: lost or additional triggers, exchanged lines, a turned quadrant.
//!
//! Neighbours alone decide: histograms of a right order change steadily over the wall, whatever the scene. Where an order leaves less of
//! the differences at the places that it changes, beyond chance, it is the right one.

use rayon::prelude::*;

use super::roots::{LEAST, RootRows};
use super::triggers::{self, InOrder};
use crate::data::Capture;

/// Minimum gain of an order over its standard error, and over the squared differences at the places that it changes. Largest of 25 proper
/// captures: lines 3.0 and .05, quadrants below 0. Faults with 200 photons (figure, letter) have at least 4.7 and .26, 6.7 and .83
/// (`benches/NOTES.md`).
const LINES: [f64; 2] = [3.5, 0.15];
const QUADRANT: [f64; 2] = [4.0, 0.05];
/// Pairs of lines that are exchanged at most.
const MOST_EXCHANGED: usize = 4;
/// Lines farther apart are not compared: the memory of the comparison.
const MAX_APART: usize = 32;

/// The gain of an order: its sum, squares and what there was before.
#[derive(Clone, Copy, Default)]
struct Gain([f64; 3]);

impl Gain {
    fn of(each: impl Iterator<Item = [f64; 2]>) -> Gain {
        let known = each.filter(|[before, after]| (before - after).is_finite());
        known.fold(Gain::default(), |Gain(sum), [before, after]| {
            let gain = before - after;
            Gain([sum[0] + gain, sum[1] + gain * gain, sum[2] + before])
        })
    }

    /// Gain in standard errors, if it reaches both thresholds.
    fn beyond(&self, [errors, share]: [f64; 2]) -> Option<f64> {
        let [gain, squares, before] = self.0;
        let in_errors = gain / squares.sqrt().max(f64::MIN_POSITIVE);
        (in_errors > errors && gain > share * before).then_some(in_errors)
    }
}

impl Capture {
    /// Gives histograms to the points at which their neighbours show that they were measured. Returns notes.
    pub(super) fn undo_order(&mut self) -> Vec<String> {
        let mut notes = vec![];
        // The noise of other values is not known.
        if !self.integer_counts {
            return notes;
        }
        let [nx, ny] = self.scan;
        let is_lattice = nx >= LEAST && ny >= LEAST;
        let mut rows = self.few_bins();
        if is_lattice {
            if let Some(note) = self.turn_quadrant(&rows) {
                notes.push(note);
                rows = self.few_bins();
            }
            for along_y in [true, false] {
                if let Some(note) = self.exchange_lines(&rows, along_y) {
                    notes.push(note);
                    rows = self.few_bins();
                }
            }
        }
        if notes.is_empty() {
            let pairs = self.pair_count();
            let line = if is_lattice { ny } else { self.line_length() };
            let stream: Vec<usize> = (0..pairs).collect();
            let note = self.move_triggers(&rows, &stream, line).or_else(|| {
                let across: Vec<usize> = (0..pairs).map(|p| p % nx * ny + p / nx).collect();
                is_lattice.then(|| self.move_triggers(&rows, &across, nx)).flatten()
            });
            notes.extend(note);
        }
        notes
    }

    /// Points of a line of a list of points, line behind line: those beside each other in one direction; 0 if lines differ, as where points
    /// are left out.
    fn line_length(&self) -> usize {
        let points = self.scanned_points();
        let step = (points[1] - points[0]).normalize_or_zero();
        let is_along =
            |pair: &usize| (points[*pair] - points[*pair - 1]).normalize_or_zero().dot(step) > 0.99;
        let line = 1 + (1..points.len()).take_while(is_along).count();
        if (1..points.len()).all(|pair| is_along(&pair) != pair.is_multiple_of(line)) { line } else { 0 }
    }

    fn reorder(&mut self, order: &[usize]) {
        self.histograms = self.histograms_of(order);
    }

    /// Turns or mirrors a quadrant back if only then its histograms continue those across its borders.
    fn turn_quadrant(&mut self, rows: &RootRows) -> Option<String> {
        let [nx, ny] = self.scan;
        let [hx, hy] = [nx / 2, ny / 2];
        if nx % 2 + ny % 2 > 0 {
            return None;
        }
        // Three points across a border between quadrants.
        let across = || {
            let x = (0..ny).flat_map(|iy| [hx - 1, hx].map(|ix| [ix - 1, ix, ix + 1].map(|ix| ix * ny + iy)));
            x.chain((0..nx).flat_map(|ix| [hy - 1, hy].map(|iy| [iy - 1, iy, iy + 1].map(|iy| ix * ny + iy))))
        };
        let words = [("turned by 180 degrees", [true, true]), ("mirrored along x", [true, false])];
        let words = words.into_iter().chain([("mirrored along y", [false, true])]);
        let all = words.flat_map(|(word, flips)| (0..4).map(move |q| (word, flips, [q / 2, q % 2])));
        let tried = all.filter_map(|(word, [fx, fy], [qx, qy])| {
            let from = |pair: usize| {
                let [ix, iy] = [pair / ny, pair % ny];
                if [ix / hx, iy / hy] != [qx, qy] {
                    return pair;
                }
                let flip =
                    |flips: bool, i: usize, h: usize| if flips { i / h * h + h - 1 - i % h } else { i };
                flip(fx, ix, hx) * ny + flip(fy, iy, hy)
            };
            let gain = Gain::of(across().map(|three| [rows.bend(three), rows.bend(three.map(from))]));
            let errors = gain.beyond(QUADRANT)?;
            Some((errors, word, [qx, qy], (0..nx * ny).map(from).collect::<Vec<usize>>()))
        });
        let (_, word, [qx, qy], order) = tried.max_by(|a, b| a.0.total_cmp(&b.0))?;
        self.reorder(&order);
        let [x, y] = [["lower", "upper"][qx], ["lower", "upper"][qy]];
        Some(format!(
            "the quarter of the scan with the {x} columns and the {y} rows is stored {word}, as the points beside it show: it is turned \
             back (export the tiles of the scan in one direction)"
        ))
    }

    /// Exchanges pairs of lines that lie at each other's place.
    fn exchange_lines(&mut self, rows: &RootRows, along_y: bool) -> Option<String> {
        let [nx, ny] = self.scan;
        let (lines, points) = if along_y { (nx, ny) } else { (ny, nx) };
        let pair = |line: usize, at: usize| if along_y { line * ny + at } else { at * ny + line };
        let apart = |a: usize, b: usize| -> Vec<f32> {
            (0..points).map(|at| rows.difference(pair(a, at), pair(b, at)) as f32).collect()
        };
        let apart: Vec<Vec<Vec<f32>>> = (0..lines)
            .into_par_iter()
            .map(|a| (a + 1..lines.min(a + 2 + MAX_APART)).map(|b| apart(a, b)).collect())
            .collect();
        let between = |a: usize, b: usize| apart[a.min(b)].get(a.abs_diff(b) - 1);
        let mut order: Vec<usize> = (0..lines).collect();
        let mut exchanged = vec![];
        while exchanged.len() < lines {
            let gain = |i: usize, j: usize| {
                let other = |at: usize| match at {
                    _ if at == i => order[j],
                    _ if at == j => order[i],
                    _ => order[at],
                };
                let steps = [i.checked_sub(1), Some(i), Some(j - 1), Some(j)].into_iter().flatten();
                let mut steps: Vec<usize> = steps.filter(|at| at + 1 < lines).collect();
                steps.dedup();
                let each: Option<Vec<_>> = (steps.iter())
                    .map(|at| between(order[*at], order[at + 1]).zip(between(other(*at), other(at + 1))))
                    .collect();
                let each = each?;
                let of = |at: usize| {
                    let both = each.iter().map(|(a, b)| [a[at], b[at]].map(f64::from));
                    both.fold([0.0; 2], |sum, both| [sum[0] + both[0], sum[1] + both[1]])
                };
                Some((Gain::of((0..points).map(of)).beyond(LINES)?, i, j))
            };
            let all = (0..lines).flat_map(|i| (i + 1..lines.min(i + MAX_APART)).map(move |j| (i, j)));
            let Some((_, i, j)) = all.filter_map(|(i, j)| gain(i, j)).max_by(|a, b| a.0.total_cmp(&b.0))
            else {
                break;
            };
            // Many lines at other places are noise, or wrong in another way.
            if exchanged.len() == MOST_EXCHANGED {
                return None;
            }
            order.swap(i, j);
            exchanged.push(format!("{i} and {j}"));
        }
        if exchanged.is_empty() {
            return None;
        }
        let mut from: Vec<usize> = (0..lines * points).collect();
        (0..lines).for_each(|line| (0..points).for_each(|at| from[pair(line, at)] = pair(order[line], at)));
        self.reorder(&from);
        Some(format!(
            "{} {} of the scan (from 0) are exchanged, as the lines beside them show: they are put in order",
            if along_y { "columns" } else { "rows" },
            exchanged.join(", ")
        ))
    }

    /// Moves histograms behind lost or additional triggers to their points. `stream`: the pairs in the order of the scanner, in lines of
    /// `line` points. Points without a histogram get the mean of their neighbours.
    fn move_triggers(&mut self, rows: &RootRows, stream: &[usize], line: usize) -> Option<String> {
        let InOrder { from, points: [lost, found] } = triggers::in_order(rows, stream, line)?;
        let mut moved: Vec<Option<Vec<f32>>> =
            from.iter().map(|pair| pair.map(|pair| self.histogram(pair).to_vec())).collect();
        while let Some(at) = moved.iter().position(Option::is_none) {
            let beside =
                [at.checked_sub(line), (at % line > 0).then(|| at - 1), Some(at + 1), Some(at + line)];
            let beside = beside.into_iter().flatten();
            let beside: Vec<&Vec<f32>> = beside.filter_map(|at| moved.get(at)?.as_ref()).collect();
            let mean =
                |bin: usize| beside.iter().map(|row| row[bin]).sum::<f32>() / beside.len().max(1) as f32;
            moved[at] = Some((0..self.bins).map(|bin| mean(bin).round()).collect());
        }
        for (pair, row) in stream.iter().zip(moved.into_iter().flatten()) {
            self.histograms[pair * self.bins..][..self.bins].copy_from_slice(&row);
        }
        let of = |word: &str, mut at: Vec<usize>| {
            at.sort_unstable();
            let at: Vec<String> = at.iter().map(usize::to_string).collect();
            (!at.is_empty()).then(|| format!("{} {word} (at the points {})", at.len(), at.join(", ")))
        };
        let all: Vec<String> = of("lost", lost).into_iter().chain(of("too many", found)).collect();
        Some(format!(
            "triggers of the scanner: {}, as the lines beside them show: the histograms behind them are moved to their points, and points \
             without one get the mean of their neighbours (about; check the trigger's level and the dead time of its input)",
            all.join(" and ")
        ))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use glam::dvec3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::super::tests::{SIDE, noisy};
    use super::*;

    fn stored(proper: &Capture, from: impl Fn(usize) -> usize) -> Capture {
        let order: Vec<usize> = (0..proper.pair_count()).map(from).collect();
        let mut stored = proper.clone();
        stored.reorder(&order);
        stored
    }

    #[test]
    fn a_proper_order_stays() {
        let mut capture = noisy();
        assert_eq!(capture.undo_order(), Vec::<String>::new());
        assert_eq!(capture, noisy());
    }

    #[test]
    fn exchanged_lines_and_a_turned_quadrant_are_put_in_order() {
        let proper = noisy();
        let exchange = |line: usize| if [3, 8].contains(&line) { 11 - line } else { line };
        let flip = |i: usize| SIDE / 2 - 1 - i;
        let is_first = |p: usize| p / SIDE < SIDE / 2 && p % SIDE < SIDE / 2;
        let cases: [(&str, Capture); 4] = [
            ("columns 3 and 8", stored(&proper, |p| exchange(p / SIDE) * SIDE + p % SIDE)),
            ("rows 3 and 8", stored(&proper, |p| p / SIDE * SIDE + exchange(p % SIDE))),
            (
                "180 degrees",
                stored(&proper, |p| if is_first(p) { flip(p / SIDE) * SIDE + flip(p % SIDE) } else { p }),
            ),
            ("along y", stored(&proper, |p| if is_first(p) { p / SIDE * SIDE + flip(p % SIDE) } else { p })),
        ];
        for (words, mut capture) in cases {
            let notes = capture.undo_order();
            assert!(notes.len() == 1 && notes[0].contains(words), "{words}: {notes:?}");
            assert!(capture == proper, "{words}");
        }
    }

    /// Photons of two things before a wall of 32 x 32 points.
    pub fn extended(seed: u64) -> Capture {
        let mut random = Pcg64::seed_from_u64(seed);
        let [side, bins] = [2 * SIDE, 64];
        let points: Vec<_> = (0..side * side)
            .map(|p| dvec3(0.02 * (p / side) as f64, 0.02 * (p % side) as f64, 0.0))
            .collect();
        let count = |pair: usize, bin: usize, random: &mut Pcg64| {
            let thing = |x: f64, y: f64| {
                let far = (x - (pair / side) as f64).powi(2) + (y - (pair % side) as f64).powi(2);
                (-(bin as f64 - 2.0 * (64.0 + far).sqrt() + 8.0).powi(2) / 8.0).exp()
            };
            let mean = 300.0 * (thing(7.0, 5.0) + thing(21.0, 6.0)) + 0.7;
            Poisson::new(mean).unwrap().sample(random) as f32
        };
        let all = (0..side * side).flat_map(|pair| (0..bins).map(move |bin| (pair, bin)));
        let counts = all.map(|(pair, bin)| count(pair, bin, &mut random)).collect();
        let capture = Capture::new([side, side], points.clone(), points, bins, 0.01, counts);
        Capture { integer_counts: true, ..capture }
    }

    /// Pairs that differ from those of the proper capture.
    fn unlike(capture: &Capture, proper: &Capture) -> Vec<usize> {
        (0..proper.pair_count()).filter(|p| capture.histogram(*p) != proper.histogram(*p)).collect()
    }

    #[test]
    fn lost_and_additional_triggers_are_found() {
        let proper = extended(11);
        assert_eq!(proper.clone().undo_order(), Vec::<String>::new());
        let last = proper.pair_count() - 1;
        // The point at which a trigger is found may be one or two off: histograms beside each other are alike.
        let lost = stored(&proper, |p| if p < 600 { p } else { (p + 1).min(last) });
        let many = stored(&proper, |p| if p <= 600 { p } else { p - 1 });
        for (words, mut capture) in [("1 too many", many), ("1 lost", lost)] {
            assert!(unlike(&capture, &proper).len() > 200);
            let notes = capture.undo_order();
            assert!(notes.len() == 1 && notes[0].contains(words), "{words}: {notes:?}");
            let unlike = unlike(&capture, &proper);
            assert!(unlike.len() < 30, "{words}: {unlike:?} {notes:?}");
        }
    }

    /// A trigger lost at 200 and one too many at 800: the histograms between them are at the points before.
    #[test]
    fn one_trigger_lost_and_one_too_many_are_found() {
        let proper = extended(11);
        let mut capture = stored(&proper, |p| if (200..=800).contains(&p) { p + 1 } else { p });
        assert!(unlike(&capture, &proper).len() > 500);
        let notes = capture.undo_order();
        assert!(
            notes.len() == 1 && notes[0].contains("1 lost") && notes[0].contains("1 too many"),
            "{notes:?}"
        );
        let unlike = unlike(&capture, &proper);
        assert!(unlike.len() < 60, "{unlike:?} {notes:?}");
    }

    /// Every 128th trigger is lost: one that is missed would leave all later lines a point off.
    #[test]
    fn triggers_lost_at_regular_intervals_are_found_together() {
        let proper = extended(11);
        let last = proper.pair_count() - 1;
        let mut capture = stored(&proper, |p| (p + p.saturating_sub(1) / 127).min(last));
        let notes = capture.undo_order();
        assert!(notes.len() == 1 && notes[0].contains("7 lost"), "{notes:?}");
        let unlike = unlike(&capture, &proper);
        assert!(unlike.len() < 60, "{unlike:?} {notes:?}");
    }

    /// Where a scanner turns, points are odd in every line: no trigger, as lines agree at the place of one.
    #[test]
    fn odd_points_at_the_ends_of_lines_are_no_triggers() {
        let proper = extended(11);
        let side = proper.scan[1];
        let mut capture = stored(&proper, |p| if p % side == 0 && p > side { p - side + 6 } else { p });
        let before = capture.clone();
        assert_eq!(capture.undo_order(), Vec::<String>::new());
        assert!(capture == before);
    }

    /// Lines of a list differ where points are left out.
    #[test]
    fn lists_without_some_points_are_not_put_in_order() {
        let proper = extended(11);
        let kept: Vec<usize> = (0..proper.pair_count()).filter(|p| p * p % 13 != 3).collect();
        let list = proper.keep(&kept, [kept.len(), 1]);
        assert_eq!(list.line_length(), 0);
        let all: Vec<usize> = (0..proper.pair_count()).collect();
        assert_eq!(proper.keep(&all, [all.len(), 1]).line_length(), proper.scan[1]);
    }

    /// Points without counts next to those with light are no trigger: they are not compared.
    #[test]
    fn masked_points_are_not_compared() {
        let mut masked = extended(11);
        let is_masked = |pair: usize| pair.wrapping_mul(2_654_435_761).is_multiple_of(7);
        let of = masked.bins;
        (0..masked.pair_count())
            .filter(|p| is_masked(*p))
            .for_each(|p| masked.histograms[p * of..][..of].fill(0.0));
        let rows = masked.few_bins();
        let is_nan = |pair: usize| rows.difference(pair, 40).is_nan() && rows.bend([1, pair, 40]).is_nan();
        assert!((0..masked.pair_count()).all(|pair| is_nan(pair) == is_masked(pair)));
        let before = masked.clone();
        assert_eq!(masked.undo_order(), Vec::<String>::new());
        assert!(masked == before);
    }

    /// No scanner loses count twice within a line.
    #[test]
    fn adjacent_triggers_are_not_believed() {
        let proper = extended(11);
        let last = proper.pair_count() - 1;
        let from = |p: usize| {
            if p < 600 {
                p
            } else if p < 615 {
                p + 3
            } else {
                (p + 6).min(last)
            }
        };
        let mut capture = stored(&proper, from);
        let before = capture.clone();
        assert_eq!(capture.undo_order(), Vec::<String>::new());
        assert!(capture == before);
    }
}
