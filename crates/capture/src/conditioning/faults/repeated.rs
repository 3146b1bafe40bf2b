//! A scan that stopped, whose file is filled with copies of the last counts.

use crate::conditioning::choose::{PairOrder, scan_of};
use crate::data::Capture;

/// Fewer photons in a histogram may be alike by chance.
const LEAST_COUNTS: f64 = 16.0;
/// Copies of one histogram or line, one behind the other, that no symmetric scene without noise makes.
const LEAST_COPIES: usize = 2;

impl Capture {
    /// The pairs without exact copies of the pair or line before; `None` if there are none. Whole counts of different pairs are the same
    /// only where they were copied.
    pub(super) fn without_repeats(&self) -> Option<PairOrder> {
        if !self.integer_counts {
            return None;
        }
        let (pairs, [_, ny]) = (self.pair_count(), self.scan);
        let mut copied = vec![false; pairs];
        for apart in if ny == 1 { vec![1] } else { vec![1, ny] } {
            let is_copy = |pair: usize| {
                let row = self.histogram(pair);
                pair >= apart
                    && row == self.histogram(pair - apart)
                    && row.iter().map(|v| f64::from(*v)).sum::<f64>() >= LEAST_COUNTS
            };
            let alike: Vec<bool> = (0..pairs).map(is_copy).collect();
            for begin in 0..apart {
                let chain: Vec<usize> = (begin..pairs).step_by(apart).collect();
                for run in chain.chunk_by(|a, b| alike[*a] == alike[*b]).filter(|run| alike[run[0]]) {
                    if run.len() < LEAST_COPIES {
                        continue;
                    }
                    // A scan that ran backwards stopped at the other end.
                    let backwards = run[0] == begin + apart && run[run.len() - 1] != chain[chain.len() - 1];
                    run.iter().for_each(|pair| copied[if backwards { pair - apart } else { *pair }] = true);
                }
            }
        }
        if !copied.contains(&true) {
            return None;
        }
        let kept: Vec<usize> = (0..pairs).filter(|pair| !copied[*pair]).collect();
        let scan = scan_of(&kept, self);
        Some(PairOrder { pairs: kept, scan })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{BINS, SIDE, noisy};

    #[test]
    fn copies_of_the_last_line_or_pair_are_left_out() {
        let line = SIDE * BINS;
        let mut stopped = noisy();
        for ix in 11..SIDE {
            stopped.histograms.copy_within(10 * line..11 * line, ix * line);
        }
        let kept = stopped.without_repeats().unwrap();
        assert_eq!((kept.pairs.len(), kept.scan), (11 * SIDE, [11, SIDE]));
        let mut backwards = noisy();
        for ix in 0..5 {
            backwards.histograms.copy_within(5 * line..6 * line, ix * line);
        }
        assert_eq!(backwards.without_repeats().unwrap().pairs, (5 * SIDE..SIDE * SIDE).collect::<Vec<_>>());
        let mut pair = noisy();
        for at in 200..SIDE * SIDE {
            pair.histograms.copy_within(199 * BINS..200 * BINS, at * BINS);
        }
        assert_eq!(pair.without_repeats().unwrap().pairs, (0..200).collect::<Vec<_>>());
        let mut alike = noisy();
        alike.histograms.copy_within(3 * line..4 * line, 4 * line);
        assert_eq!(alike.without_repeats(), None, "two lines, as of a symmetric scene");
        assert_eq!(noisy().without_repeats(), None);
    }
}
