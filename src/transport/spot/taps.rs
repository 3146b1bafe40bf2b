//! Weighted sums of histograms: how the light of rendered pairs makes up that of measured ones.

/// A sparse matrix that sums rows of histograms. It acts on one of three indices: row `(o * columns + c) * inner + i`
/// goes to row `(o * rows + r) * inner + i` for every `o` and `i`.
#[derive(Debug, Clone, PartialEq)]
pub struct SpotTaps {
    /// Number of the first index `o`.
    pub outer: usize,
    /// Number of the last index `i`.
    pub inner: usize,
    /// Columns that are summed.
    pub columns: usize,
    /// The columns of every sum with their weights; the weights of a sum add up to one.
    pub rows: Vec<Vec<(u32, f32)>>,
}

impl SpotTaps {
    /// A matrix that acts on all rows at once.
    pub fn of(columns: usize, rows: Vec<Vec<(u32, f32)>>) -> SpotTaps {
        SpotTaps { outer: 1, inner: 1, columns, rows }
    }

    /// The number of histograms that it makes.
    pub fn sums(&self) -> usize {
        self.outer * self.rows.len() * self.inner
    }

    /// The number of histograms that it reads.
    pub fn terms(&self) -> usize {
        self.outer * self.columns * self.inner
    }

    /// The most histograms that one sum has.
    pub fn longest(&self) -> usize {
        self.rows.iter().map(Vec::len).max().unwrap_or(0)
    }

    /// The adjoint.
    pub fn back(&self) -> SpotTaps {
        let mut rows = vec![vec![]; self.columns];
        for (r, row) in (0..).zip(&self.rows) {
            row.iter().for_each(|(c, weight)| rows[*c as usize].push((r, *weight)));
        }
        SpotTaps { columns: self.rows.len(), rows, ..*self }
    }

    /// Sums histograms of `bins` bins.
    pub fn through(&self, values: &[f64], bins: usize) -> Vec<f64> {
        let mut sums = vec![0.0; self.sums() * bins];
        for (row, sum) in sums.chunks_exact_mut(bins).enumerate() {
            let (i, r, o) =
                (row % self.inner, row / self.inner % self.rows.len(), row / self.inner / self.rows.len());
            for (c, weight) in &self.rows[r] {
                let from = ((o * self.columns + *c as usize) * self.inner + i) * bins;
                let weight = f64::from(*weight);
                sum.iter_mut().zip(&values[from..from + bins]).for_each(|(s, v)| *s += weight * v);
            }
        }
        sums
    }

    /// Number of [`SpotTaps::words`].
    pub fn len_of_words(&self) -> usize {
        HEAD + self.rows.len() + 1 + 2 * self.rows.iter().map(Vec::len).sum::<usize>()
    }

    /// The layout that kernels read: rows, columns, inner; for every row the number of entries before it; the number of
    /// all entries; for every entry its column and the bits of its weight.
    pub fn words(&self) -> Vec<u32> {
        let mut words = vec![self.rows.len() as u32, self.columns as u32, self.inner as u32];
        let mut before = 0;
        words.push(before);
        for row in &self.rows {
            before += row.len() as u32;
            words.push(before);
        }
        words.extend(self.rows.iter().flatten().flat_map(|(c, weight)| [*c, weight.to_bits()]));
        words
    }
}

/// Words before the rows' offsets.
const HEAD: usize = 3;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_adjoint_is_the_transposed_matrix() {
        let rows = vec![vec![(0, 0.5), (2, 0.5)], vec![(1, 1.0)], vec![(2, 0.25), (0, 0.75)], vec![]];
        let taps = SpotTaps { outer: 2, inner: 3, columns: 3, rows };
        let bins = 2;
        let numbers = |count: usize, by: f64| -> Vec<f64> {
            (0..count).map(|i| (i as f64 * by).fract() - 0.4).collect()
        };
        let (x, y) = (numbers(taps.terms() * bins, 0.754_877), numbers(taps.sums() * bins, 0.569_84));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let forth = dot(&taps.through(&x, bins), &y);
        let back = dot(&x, &taps.back().through(&y, bins));
        assert!((forth - back).abs() < 1e-12 && forth.abs() > 1e-3, "{forth} {back}");
        assert_eq!(taps.back().back().rows.iter().map(Vec::len).collect::<Vec<_>>(), [2, 1, 2, 0]);
        assert_eq!(taps.words().len(), taps.len_of_words());
        // Row (1, 2, 1) sums rows (1, 2, 1) and (1, 0, 1).
        let sums = taps.through(&x, bins);
        let want = 0.25 * x[2 * 16] + 0.75 * x[2 * 10];
        assert!((sums[2 * (12 + 2 * 3 + 1)] - want).abs() < 1e-12);
    }
}
