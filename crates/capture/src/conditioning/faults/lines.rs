//! Lines of a scan that a scanner measured in turn forwards and backwards, and that were stored as they came.

use rayon::prelude::*;

use crate::data::Capture;

/// Fewer lines, or points of a line, prove nothing.
const LEAST: usize = 8;
/// Every second line is backwards if turning it leaves at most this share of the differences between neighbouring lines, by more than
/// this number of standard errors, and lines two apart differ less as they are.
const TURNED: f64 = 0.8;
const BEYOND_CHANCE: f64 = 2.5;
/// Histograms are compared in this many bins at most.
const COMPARED_BINS: usize = 64;

impl Capture {
    /// Turns every second line round where the lines beside it show that it is stored backwards. Lines run along y, or along x.
    pub(super) fn turn_lines(&mut self) -> Option<String> {
        let [nx, ny] = self.scan;
        if nx < LEAST || ny < LEAST {
            return None;
        }
        let rows = self.coarse_rows();
        for (along, (lines, points)) in [("y", (nx, ny)), ("x", (ny, nx))] {
            let pair = |line: usize, at: usize| if along == "y" { line * ny + at } else { at * ny + line };
            if !are_backwards(&rows, lines, points, pair) {
                continue;
            }
            let mut order: Vec<usize> = (0..nx * ny).collect();
            for line in (1..lines).step_by(2) {
                (0..points).for_each(|at| order[pair(line, at)] = pair(line, points - 1 - at));
            }
            // Counts move, points stay.
            self.histograms = self.histograms_of(&order);
            return Some(format!(
                "every second line of the scan along {along} is stored backwards, as the lines beside it show: it is turned round (store \
                 points in one direction, or with their own coordinates)"
            ));
        }
        None
    }
}

/// Whether turning every second line makes neighbouring lines alike.
fn are_backwards(
    rows: &[Vec<f64>],
    lines: usize,
    points: usize,
    pair: impl Fn(usize, usize) -> usize + Sync,
) -> bool {
    let difference = |a: usize, b: usize, turned: bool| {
        let other = |at: usize| if turned { points - 1 - at } else { at };
        let squares = |at: usize| {
            let (a, b) = (&rows[pair(a, at)], &rows[pair(b, other(at))]);
            a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
        };
        (0..points).map(squares).sum::<f64>()
    };
    let of = |apart: usize| -> Vec<[f64; 2]> {
        let pairs = (apart..lines).into_par_iter().map(|line| (line - apart, line));
        pairs.map(|(a, b)| [false, true].map(|turned| difference(a, b, turned))).collect()
    };
    let sum = |each: &[[f64; 2]], at: usize| each.iter().map(|d| d[at]).sum::<f64>();
    let [beside, next] = [of(1), of(2)];
    let gain = sum(&beside, 0) - sum(&beside, 1);
    let spread = beside.iter().map(|d| (d[0] - d[1]).powi(2)).sum::<f64>().sqrt();
    gain > BEYOND_CHANCE * spread
        && sum(&beside, 1) < TURNED * sum(&beside, 0)
        && sum(&next, 0) < sum(&next, 1)
}

impl Capture {
    /// Histograms of a few bins each, `[pair][bin]`.
    fn coarse_rows(&self) -> Vec<Vec<f64>> {
        let width = self.bins.div_ceil(COMPARED_BINS);
        self.of_rows(|row| row.chunks(width).map(|run| run.iter().map(|v| f64::from(*v)).sum()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{BINS, SIDE, noisy, scan};
    use super::*;

    fn turned(capture: &Capture, along_y: bool) -> Capture {
        let mut stored = capture.clone();
        for pair in 0..SIDE * SIDE {
            let (ix, iy) = (pair / SIDE, pair % SIDE);
            let from = match along_y {
                true if ix % 2 == 1 => ix * SIDE + SIDE - 1 - iy,
                false if iy % 2 == 1 => (SIDE - 1 - ix) * SIDE + iy,
                _ => pair,
            };
            stored.histograms[pair * BINS..][..BINS].copy_from_slice(capture.histogram(from));
        }
        stored
    }

    #[test]
    fn lines_stored_backwards_are_turned_round() {
        let proper = noisy();
        for along_y in [true, false] {
            let mut stored = turned(&proper, along_y);
            let note = stored.turn_lines().expect("lines are backwards");
            assert!(note.contains(if along_y { "along y" } else { "along x" }));
            assert_eq!(stored, proper);
        }
        // A proper scan, a scene that is symmetric, and one that is the same everywhere.
        let light = |far: f64, bin: usize| (300.0 - (bin as f64 - 20.0 - far).powi(2)).max(0.0) as f32;
        let symmetric = scan(|_, iy, bin| light((2.0 * iy as f64 - SIDE as f64 + 1.0).abs(), bin));
        for proper in [proper, symmetric, scan(|_, _, bin| light(3.0, bin))] {
            let mut stored = proper.clone();
            assert_eq!(stored.turn_lines(), None);
            assert_eq!(stored, proper);
        }
    }
}
