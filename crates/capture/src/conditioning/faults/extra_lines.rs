//! Lines at an end of a scan that are not of the picture: without light, or measured while the scanner ran back.

use super::roots::{COMPARED_BINS, LEAST, RootRows};
use crate::conditioning::choose::PairOrder;
use crate::data::Capture;
use crate::data::median::median;

/// Largest share of the lines at one end.
const MOST: usize = 4;
/// Structure of a histogram beyond noise, in standard deviations: of a dark line at most, of the line beside it at least. Light of a scene
/// falls by less than a half from line to line.
const DARK: f64 = 4.0;
const LIT: f64 = 100.0;
/// By how many standard errors of noise lines are more alike those further back than those beside them: of 60 proper captures at most 0.8,
/// where a scanner ran back 11 and 13 (`benches/NOTES.md`).
const BACK: f64 = 5.0;

/// Standard deviation over the median absolute deviation of noise.
const TO_DEVIATION: f64 = 1.4826;

/// Lines of a scan from one of its ends on.
struct Lines {
    along_y: bool,
    from_last: bool,
    count: usize,
    points: usize,
}

impl Lines {
    /// The lines at the four ends.
    fn of(capture: &Capture) -> impl Iterator<Item = Lines> {
        let [nx, ny] = capture.scan;
        let all = [[true, true], [true, false], [false, true], [false, false]];
        all.into_iter().map(move |[along_y, from_last]| {
            let (count, points) = if along_y { (nx, ny) } else { (ny, nx) };
            Lines { along_y, from_last, count, points }
        })
    }

    fn pair(&self, line: usize, point: usize) -> usize {
        let line = if self.from_last { self.count - 1 - line } else { line };
        if self.along_y { line * self.points + point } else { point * self.count + line }
    }

    /// The lines behind the first `left_out`.
    fn behind(&self, left_out: usize) -> PairOrder {
        let mut pairs: Vec<usize> = (left_out..self.count)
            .flat_map(|line| (0..self.points).map(move |at| self.pair(line, at)))
            .collect();
        pairs.sort_unstable();
        let lines = self.count - left_out;
        let scan = if self.along_y { [lines, self.points] } else { [self.points, lines] };
        PairOrder { pairs, scan }
    }

    fn words(&self, count: usize) -> String {
        let end = if self.from_last { "last" } else { "first" };
        let line = if self.along_y { "column" } else { "row" };
        if count == 1 { format!("the {end} {line}") } else { format!("the {end} {count} {line}s") }
    }
}

impl Capture {
    /// The pairs without lines at an end that are dark or run back, and what they are; `None` if there are none.
    pub(super) fn without_extra_lines(&self) -> Option<(PairOrder, String)> {
        if !self.integer_counts || self.scan.into_iter().any(|lines| lines < 2 * LEAST) {
            return None;
        }
        let rows = self.few_bins();
        let found = Lines::of(self).find_map(|lines| {
            let dark = dark(self, &lines)
                .map(|count| (count, "have no light of the scene, and the line beside them has"));
            let back = || Some((back(self, &rows, &lines)?, "repeat the lines beside them backwards"));
            let (count, what) = dark.or_else(back)?;
            Some((lines, count, what))
        });
        let (lines, count, what) = found?;
        Some((
            lines.behind(count),
            format!(
                "{} of the scan {what}: they are left out (lines that are not of the picture take the place of its own: leave them out \
                 where histograms are made, and check that the points are those of the lines that remain)",
                lines.words(count)
            ),
        ))
    }
}

/// Structure of the histogram of a line beyond noise, in its standard deviations; `None` without a photon for each of its bins: few do not
/// tell a dark line from a dim one.
fn structure(capture: &Capture, lines: &Lines, line: usize) -> Option<f64> {
    let width = capture.bins.div_ceil(COMPARED_BINS);
    let mut sums = vec![0.0; capture.bins / width];
    for point in 0..lines.points {
        let row = capture.histogram(lines.pair(line, point)).chunks_exact(width);
        sums.iter_mut()
            .zip(row)
            .for_each(|(sum, run)| *sum += run.iter().map(|v| f64::from(*v)).sum::<f64>());
    }
    let (count, mean) = (sums.len() as f64, sums.iter().sum::<f64>() / sums.len() as f64);
    let squares: f64 = sums.iter().map(|sum| (sum - mean).powi(2)).sum();
    (mean >= 1.0).then(|| (squares / mean - count) / (2.0 * count).sqrt())
}

/// How many lines at this end are dark.
fn dark(capture: &Capture, lines: &Lines) -> Option<usize> {
    let structure = |line: usize| structure(capture, lines, line);
    let count =
        (0..=lines.count / MOST).take_while(|line| structure(*line).is_some_and(|s| s < DARK)).count();
    (count > 0 && structure(count)? > LIT).then_some(count)
}

/// How many lines at this end repeat those beside them backwards.
fn back(capture: &Capture, rows: &RootRows, lines: &Lines) -> Option<usize> {
    let of_line = |line: usize| (0..lines.points).map(move |point| (line, point));
    let beside: Vec<f64> = (1..lines.count)
        .flat_map(of_line)
        .map(|(line, point)| rows.difference(lines.pair(line, point), lines.pair(line - 1, point)))
        .filter(|difference| difference.is_finite())
        .collect();
    let middle = median(beside.iter().copied())?;
    let deviation = TO_DEVIATION * median(beside.iter().map(|difference| (difference - middle).abs()))?;
    // Where most histograms are alike, as of few photons, nothing is known of noise.
    if deviation <= 0.0 {
        return None;
    }
    let gain = |count: usize, turned: usize, is_reversed: bool| {
        // From the line at which the scanner turned: those of the picture, and behind it.
        let behind = |line: usize, point: usize| lines.pair(count - 1 - line, point);
        let twin = |point: usize| if is_reversed { lines.points - 1 - point } else { point };
        let each = (0..count).flat_map(of_line).map(|(line, point)| {
            let own = behind(line, point);
            let beside = if line == 0 { lines.pair(count, point) } else { behind(line - 1, point) };
            rows.difference(own, beside)
                - rows.difference(own, lines.pair(count + line + turned, twin(point)))
        });
        let [gain, known] = each
            .filter(|gain| gain.is_finite())
            .fold([0.0; 2], |[sum, known], gain| [sum + gain, known + 1.0]);
        gain / (deviation * (2.0 * known).sqrt())
    };
    let most = lines.count / MOST;
    let kinds = [(0, false), (0, true), (1, false), (1, true)];
    let tried = (2..=most)
        .flat_map(|count| kinds.map(|(turned, is_reversed)| (gain(count, turned, is_reversed), count)));
    let (_, count) = tried.filter(|(gain, _)| *gain > BACK).max_by(|a, b| a.0.total_cmp(&b.0))?;
    // The light of a symmetric thing is the same on both sides of the line before it, which has most of it.
    let light = |line: &usize| structure(capture, lines, *line).unwrap_or(0.0);
    let brightest = (0..lines.count).max_by(|a, b| light(a).total_cmp(&light(b)))?;
    (brightest > count + most).then_some(count)
}

#[cfg(test)]
mod tests {
    use super::super::order::tests::extended;
    use super::*;

    fn found(capture: &Capture) -> Option<(Vec<usize>, [usize; 2], String)> {
        capture.without_extra_lines().map(|(kept, words)| (kept.pairs, kept.scan, words))
    }

    fn copied(proper: &Capture, from: impl Fn(usize, usize) -> [usize; 2]) -> Capture {
        let [nx, ny] = proper.scan;
        let mut copied = proper.clone();
        let bins = proper.bins;
        for pair in 0..nx * ny {
            let [ix, iy] = from(pair / ny, pair % ny);
            copied.histograms[pair * bins..][..bins].copy_from_slice(proper.histogram(ix * ny + iy));
        }
        copied
    }

    #[test]
    fn lines_without_light_at_an_end_are_left_out() {
        let proper = extended(11);
        assert_eq!(found(&proper), None);
        let mut dark = proper.clone();
        let [_, ny] = dark.scan;
        let bins = dark.bins;
        let is_dark = |pair: usize| pair % ny < 3;
        (0..dark.pair_count()).filter(|pair| is_dark(*pair)).for_each(|pair| {
            (0..bins).for_each(|bin| {
                dark.histograms[pair * bins + bin] = ((pair + 7 * bin) % 3 == 0) as u8 as f32
            });
        });
        let (kept, scan, words) = found(&dark).unwrap();
        assert_eq!((kept.len(), scan), (32 * 29, [32, 29]));
        assert!(kept.iter().all(|pair| !is_dark(*pair)) && words.contains("the first 3 rows"), "{words}");
    }

    #[test]
    fn lines_that_run_back_are_left_out() {
        // Light falls towards the last row.
        let dimmed = |seed: u64| {
            extended(seed).with(|c| {
                let [ny, bins] = [c.scan[1], c.bins];
                let row = |at: usize| (at / bins % ny) as f32;
                (0..c.histograms.len()).for_each(|at| {
                    c.histograms[at] = (c.histograms[at] * (1.0 - row(at) / 36.0)).round();
                });
            })
        };
        let [proper, later] = [11, 12].map(dimmed);
        assert_eq!(found(&proper), None);
        let turned = copied(&later, |ix, iy| [ix, if iy >= 28 { 55 - iy } else { iy }]);
        let turned = proper.clone().with(|c| {
            let [ny, bins] = [c.scan[1], c.bins];
            (0..c.pair_count()).filter(|pair| pair % ny >= 28).for_each(|pair| {
                c.histograms[pair * bins..][..bins].copy_from_slice(turned.histogram(pair));
            });
        });
        let (kept, scan, words) = found(&turned).unwrap();
        assert_eq!((kept.len(), scan), (32 * 28, [32, 28]));
        assert!(words.contains("the last 4 rows") && words.contains("backwards"), "{words}");
    }
}
