//! Numbers that their type could not hold: unsigned counts read as signed ones, and counters that begin again at zero.

use crate::data::Capture;

/// Minimum number of steps of half the range between neighbouring bins.
const LEAST_STEPS: usize = 16;
/// Share of these steps that may stay once the numbers are right.
const MOST_LEFT: f64 = 0.25;
/// Histograms that must be smoother with multiples of the range.
const LEAST_WRAPPED: usize = 16;
/// Multiples of the range that are tried, 0 included.
const TURNS: usize = 4;
/// A step that a change of the multiple must save, as a share of the range: the end of a full counter saves none.
const TURN: f64 = 0.25;
/// Counts up to this multiple of the range are undone: steps between larger ones are too large to tell.
const BARELY: f32 = 1.6;
/// Bits of counters.
const BITS: [u32; 4] = [8, 10, 12, 16];

impl Capture {
    /// Adds the range of the type to negative numbers of unsigned counts that were read as signed ones. A peak above the largest signed
    /// number falls by the whole range from one bin to the next, which no background and no noise does.
    pub(super) fn undo_sign(&mut self) -> Option<String> {
        let [low, high] = self.range();
        let bits = [8u32, 16].into_iter().find(|bits| {
            let half = (1u32 << (bits - 1)) as f32;
            (-half..=-0.5 * half).contains(&low) && (0.5 * half..half).contains(&high)
        })?;
        let range = (1u32 << bits) as f32;
        let right = |v: f32| if v < 0.0 { v + range } else { v };
        let steps = |of: &dyn Fn(f32) -> f32| {
            let rows = self.histograms.chunks_exact(self.bins);
            let large = |w: &&[f32]| (of(w[1]) - of(w[0])).abs() > 0.5 * range;
            rows.map(|row| row.windows(2).filter(large).count()).sum::<usize>()
        };
        let [before, after] = [steps(&|v| v), steps(&right)];
        if self.histograms.iter().any(|v| v.fract() != 0.0)
            || before < LEAST_STEPS
            || after as f64 > MOST_LEFT * before as f64
        {
            return None;
        }
        let count = self.histograms.iter().filter(|v| **v < 0.0).count();
        self.histograms.iter_mut().for_each(|v| *v = right(*v));
        self.integer_counts = true;
        Some(format!(
            "{count} negative counts get {range} added: unsigned counts of {bits} bits were stored or read as signed ones (write them \
             as unsigned numbers)"
        ))
    }

    /// Undoes counters that begin again at zero, where counts barely do; else says that they do. `None` without a sign of it.
    pub(super) fn undo_wraps(&mut self) -> Option<Result<String, String>> {
        if !self.integer_counts {
            return None;
        }
        let [_, high] = self.range();
        let bits = BITS.into_iter().find(|bits| high < (1u32 << bits) as f32)?;
        let range = (1u32 << bits) as f32;
        // Bins of a wrapped counter reach up to its last number.
        if high < range - 1.0 - range / 64.0 {
            return None;
        }
        let large = |row: &[f32]| row.windows(2).any(|w| (w[1] - w[0]).abs() > 0.5 * range);
        let rows = self.histograms.chunks_exact(self.bins).enumerate().filter(|(_, row)| large(row));
        let unwrapped: Vec<(usize, Vec<f32>)> =
            rows.filter_map(|(pair, row)| Some((pair, unwrapped(row, range)?))).collect();
        if unwrapped.len() < LEAST_WRAPPED {
            return None;
        }
        let most = unwrapped.iter().flat_map(|(_, row)| row).copied().fold(0.0f32, f32::max);
        let count = unwrapped.len();
        if most > BARELY * range {
            return Some(Err(format!(
                "counters of {bits} bits began again at 0, in {count} histograms or more: counts reach {high} and fall to the lowest ones \
                 in the next bin (store counts in a wider type, or measure for a shorter time)"
            )));
        }
        for (pair, row) in unwrapped {
            self.histograms[pair * self.bins..][..self.bins].copy_from_slice(&row);
        }
        Some(Ok(format!(
            "counters of {bits} bits began again at 0 in {count} histograms: {range} is added where that makes them smooth (use wider \
             counters)"
        )))
    }
}

/// The histogram with the multiples of `range` added that make the sum of its squared steps least: none at its ends, where there is
/// little light. `None` if none are added. Peaks that rise and fall by themselves need none, however steep they are.
fn unwrapped(row: &[f32], range: f32) -> Option<Vec<f32>> {
    let value = |bin: usize, turns: usize| f64::from(row[bin]) + turns as f64 * f64::from(range);
    let mut cost = [f64::INFINITY; TURNS];
    cost[0] = 0.0;
    let mut before = vec![[0usize; TURNS]; row.len()];
    for (bin, before) in before.iter_mut().enumerate().skip(1) {
        let mut next = [f64::INFINITY; TURNS];
        for (to, (next, before)) in next.iter_mut().zip(before).enumerate() {
            for (from, cost) in cost.iter().enumerate() {
                let turn = if to == from { 0.0 } else { (TURN * f64::from(range)).powi(2) };
                let total = cost + (value(bin, to) - value(bin - 1, from)).powi(2) + turn;
                if total < *next {
                    (*next, *before) = (total, from);
                }
            }
        }
        cost = next;
    }
    let (mut turns, mut made, mut any) = (0, row.to_vec(), false);
    for bin in (0..row.len()).rev() {
        made[bin] = value(bin, turns) as f32;
        any |= turns > 0;
        turns = before[bin][turns];
    }
    any.then_some(made)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    use super::super::tests::scan;
    use super::*;

    /// Photons of a smooth peak of this height.
    fn peak(most: f64, width: f64) -> Capture {
        let mut random = Pcg64::seed_from_u64(7);
        scan(|ix, iy, bin| {
            let middle = 40.0 + 0.5 * ix as f64 + 0.3 * iy as f64;
            let mean = most * (-((bin as f64 - middle) / width).powi(2)).exp() + 0.5;
            Poisson::new(mean).unwrap().sample(&mut random) as f32
        })
    }

    #[test]
    fn unsigned_counts_read_as_signed_are_right_again() {
        for (most, bits) in [(50_000.0, 16), (200.0, 8)] {
            let right = peak(most, 12.0);
            let range = (1u32 << bits) as f32;
            let mut read = right.clone();
            read.integer_counts = false;
            read.histograms.iter_mut().filter(|v| **v >= 0.5 * range).for_each(|v| *v -= range);
            assert!(read.undo_sign().is_some_and(|note| note.contains(&format!("{bits} bits"))));
            assert!(read.histograms == right.histograms);
        }
    }

    #[test]
    fn counters_that_began_again_are_undone_or_named() {
        let right = peak(340.0, 20.0);
        let mut wrapped = right.clone();
        wrapped.histograms.iter_mut().for_each(|v| *v %= 256.0);
        assert!(wrapped.undo_wraps().is_some_and(|found| found.is_ok_and(|n| n.contains("8 bits"))));
        assert!(wrapped.histograms == right.histograms);
        // Large steps: which turn they are is not known.
        let mut steep = peak(4000.0, 12.0);
        steep.histograms.iter_mut().for_each(|v| *v %= 256.0);
        let before = steep.clone();
        assert!(steep.undo_wraps().is_some_and(|found| found.is_err_and(|n| n.contains("8 bits"))));
        assert_eq!(steep, before);
    }

    #[test]
    fn proper_counts_stay() {
        for (most, width) in [(235.0, 12.0), (235.0, 0.6), (60_000.0, 12.0), (3.0, 12.0), (4.0e4, 0.4)] {
            let proper = peak(most, width);
            let mut capture = proper.clone();
            assert_eq!((capture.undo_sign(), capture.undo_wraps()), (None, None), "{most} {width}");
            // Others took the background off; a full counter cuts off.
            capture.integer_counts = false;
            capture.histograms.iter_mut().for_each(|v| *v -= 1.0);
            assert_eq!((capture.undo_sign(), capture.undo_wraps()), (None, None));
            let mut full = proper.clone();
            full.histograms.iter_mut().for_each(|v| *v = v.min(255.0));
            assert_eq!(full.undo_wraps(), None, "{most} {width}");
        }
    }
}
