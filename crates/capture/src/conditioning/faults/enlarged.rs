//! Scans that were enlarged: by repeating their lines, or by lines in the middle between two.

use crate::conditioning::choose::scan_of;
use crate::data::Capture;

/// Least share of lines that are copies of the line before, and of lines that were repeated.
const COPIES: f64 = 0.25;
const REPEATED: f64 = 0.25;
/// Fewer lines prove nothing.
const LEAST_LINES: usize = 4;
/// Fewer counts in a line may be alike by chance.
const LEAST_COUNTS: f64 = 16.0;
/// Largest error of a mean of two lines: that of rounding, whole counts to whole ones and others as a share of the largest.
const ROUNDING: [f32; 2] = [0.5, 1e-5];

/// Lines that belong together: the first is kept, at the middle of all that are the same.
type Blocks = Vec<Vec<usize>>;

impl Capture {
    /// Leaves out the lines of an enlarged scan that hold nothing of their own. Returns how many pairs were left out and what was done.
    pub(super) fn undo_enlargement(&mut self) -> Option<(usize, String)> {
        let before = self.pair_count();
        let mut done = vec![];
        for axis in [0, 1] {
            if let Some(blocks) = self.repeated_lines(axis) {
                self.take_lines(axis, &blocks);
                done.push("copies of the one beside");
            }
            if let Some(blocks) = self.middle_lines(axis) {
                self.take_lines(axis, &blocks);
                done.push("means of the two beside");
            }
        }
        done.dedup();
        let gone = before - self.pair_count();
        (gone > 0).then(|| {
            let scan = self.scan;
            let note = format!(
                "{gone} of {before} pairs are left out: their lines are {}, as of a scan of {} x {} points that was enlarged",
                done.join(" or "),
                scan[0],
                scan[1]
            );
            (gone, note)
        })
    }

    /// The pairs of a line across an axis of the scan.
    fn line(&self, axis: usize, at: usize) -> impl Iterator<Item = usize> + use<> {
        let [nx, ny] = self.scan;
        (0..if axis == 0 { ny } else { nx }).map(move |k| if axis == 0 { at * ny + k } else { k * ny + at })
    }

    fn is_lit(&self, axis: usize, at: usize) -> bool {
        let least = if self.integer_counts { LEAST_COUNTS } else { 0.0 };
        let total = |pair| self.histogram(pair).iter().map(|v| f64::from(v.abs())).sum::<f64>();
        let sum: f64 = self.line(axis, at).map(total).sum();
        sum > 0.0 && sum >= least
    }

    /// Lines that equal the one before, in blocks; `None` unless most lines were repeated.
    fn repeated_lines(&self, axis: usize) -> Option<Blocks> {
        let count = self.scan[axis];
        let is_copy = |at: usize| {
            let pairs = self.line(axis, at).zip(self.line(axis, at - 1));
            pairs.into_iter().all(|(a, b)| self.histogram(a) == self.histogram(b)) && self.is_lit(axis, at)
        };
        // Most scans end here: a quarter of the lines would be copies.
        if count < 2 * LEAST_LINES || !(1..count).take(count.div_ceil(2)).any(is_copy) {
            return None;
        }
        let mut blocks: Blocks = vec![vec![0]];
        for at in 1..count {
            match blocks.last_mut() {
                Some(block) if is_copy(at) => block.push(at),
                _ => blocks.push(vec![at]),
            }
        }
        let repeated = blocks.iter().filter(|block| block.len() > 1).count();
        let is_enlarged = blocks.len() >= LEAST_LINES
            && (count - blocks.len()) as f64 >= COPIES * count as f64
            && repeated as f64 >= REPEATED * blocks.len() as f64;
        is_enlarged.then_some(blocks)
    }

    /// Lines without those that are the means of their neighbours, where that is every second one.
    fn middle_lines(&self, axis: usize) -> Option<Blocks> {
        let count = self.scan[axis];
        if count < 2 * LEAST_LINES {
            return None;
        }
        let most = if self.integer_counts { ROUNDING[0] } else { ROUNDING[1] * self.range()[1] };
        let is_mean = |at: usize| {
            let mut all = self.line(axis, at).zip(self.line(axis, at - 1)).zip(self.line(axis, at + 1));
            all.all(|((of, before), after)| {
                let rows = self.histogram(of).iter().zip(self.histogram(before)).zip(self.histogram(after));
                rows.into_iter().all(|((v, a), b)| (v - 0.5 * (a + b)).abs() <= most)
            }) && self.is_lit(axis, at)
        };
        let first = [1, 2].into_iter().find(|first| (*first..count - 1).step_by(2).all(is_mean))?;
        // Lines that all are means are those of a scene without a change along this axis.
        if (3 - first..count - 1).step_by(2).any(is_mean) {
            return None;
        }
        let kept = (0..count).filter(|at| *at == 0 || *at == count - 1 || at % 2 != first % 2);
        Some(kept.map(|at| vec![at]).collect())
    }

    /// Keeps the first line of each block, at the middle of its lines.
    fn take_lines(&mut self, axis: usize, blocks: &Blocks) {
        let middle = |points: &[glam::DVec3], pair: usize, block: &[usize], step: usize| {
            let all = block.iter().map(|at| points[pair + (at - block[0]) * step]);
            all.sum::<glam::DVec3>() / block.len() as f64
        };
        let step = if axis == 0 { self.scan[1] } else { 1 };
        let (mut laser, mut sensor) = (self.laser.clone(), self.sensor.clone());
        let mut kept = vec![];
        for block in blocks {
            for pair in self.line(axis, block[0]) {
                laser[pair] = middle(&self.laser, pair, block, step);
                sensor[pair] = middle(&self.sensor, pair, block, step);
                kept.push(pair);
            }
        }
        kept.sort_unstable();
        let scan = scan_of(&kept, self);
        (self.laser, self.sensor) = (laser, sensor);
        *self = self.keep(&kept, scan);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{BINS, SIDE, noisy, scan};
    use super::*;

    /// A scan of `SIDE` points a side that shows column and row `of(i)` of a proper one.
    fn shown(of: impl Fn(usize) -> usize) -> Capture {
        let right = noisy();
        scan(|ix, iy, bin| right.histograms[(of(ix) * SIDE + of(iy)) * BINS + bin])
    }

    #[test]
    fn repeated_lines_are_left_out_at_the_middle_of_their_places() {
        // Twice, three times with a rest, and from 11 to 16 points by the nearest one.
        for (up, down) in [(1, 2), (1, 3), (11, 16)] {
            let sides = (SIDE * up).div_ceil(down);
            let mut enlarged = shown(|i| i * up / down);
            let (gone, note) = enlarged.undo_enlargement().unwrap();
            assert_eq!((enlarged.scan, gone), ([sides; 2], SIDE * SIDE - sides * sides));
            assert!(note.contains(&format!("{sides} x {sides} points that was enlarged")), "{note}");
            let right = noisy();
            for pair in 0..sides * sides {
                let from = pair / sides * SIDE + pair % sides;
                assert!(enlarged.histogram(pair) == right.histogram(from), "{pair}");
            }
        }
        let mut twice = shown(|i| i / 2);
        twice.undo_enlargement().unwrap();
        assert!((twice.laser[9] - glam::dvec3(0.05, 0.05, 0.0)).length() < 1e-12, "{}", twice.laser[9]);
    }

    #[test]
    fn lines_between_two_are_left_out() {
        for rounded in [false, true] {
            let right = noisy();
            let value = |ix: usize, iy: usize, bin: usize| right.histograms[(ix * SIDE + iy) * BINS + bin];
            let mut enlarged = scan(|ix, iy, bin| {
                let [a, b] =
                    [ix / 2, ix.div_ceil(2)].map(|x| [iy / 2, iy.div_ceil(2)].map(|y| value(x, y, bin)));
                let mean = 0.25 * (a[0] + a[1] + b[0] + b[1]);
                if rounded && ix % 2 + iy % 2 < 2 { mean.floor() } else { mean }
            });
            enlarged.integer_counts = false;
            if rounded {
                // Along one axis only: means of rounded means are not those of their neighbours.
                enlarged = scan(|ix, iy, bin| {
                    (0.5 * (value(ix / 2, iy, bin) + value(ix.div_ceil(2), iy, bin))).floor()
                });
            }
            let (gone, note) = enlarged.undo_enlargement().unwrap();
            // The last line of an even number is half a step beyond.
            let wanted = if rounded { [9, SIDE] } else { [9, 9] };
            assert_eq!((enlarged.scan, gone), (wanted, SIDE * SIDE - wanted[0] * wanted[1]), "{note}");
            assert!(note.contains("means of the two beside"), "{note}");
        }
    }

    #[test]
    fn proper_scans_stay() {
        assert_eq!(noisy().undo_enlargement(), None);
        // A scan that stopped was not enlarged, nor was one of a plane without end.
        let mut stopped = noisy();
        for ix in 11..SIDE {
            stopped.histograms.copy_within(10 * SIDE * BINS..11 * SIDE * BINS, ix * SIDE * BINS);
        }
        assert_eq!(stopped.undo_enlargement(), None);
        let mut flat = scan(|_, _, bin| (bin % 7) as f32);
        assert_eq!(flat.undo_enlargement(), None);
        let mut dark = scan(|ix, iy, bin| f32::from(u8::from(ix == 3 && iy == 5 && bin == 9)));
        assert_eq!(dark.undo_enlargement(), None);
    }
}
