//! From an array [T, ...] of counts, which comes in parts, to histograms `[pair * bins + bin]` of the pairs that are
//! kept. An array's places are its positions behind the first axis, in C order.

use std::ops::Range;

use crate::data::histogram_figures::{self, HistogramFigures};
use crate::error::Result;
use crate::host;

/// Bytes that every place takes while its counts are read, beside them.
const OF_PLACE: usize =
    size_of::<FilledHistogram>() + 2 * size_of::<(HistogramFigures, f64)>() + 2 * size_of::<usize>();
/// Bins and places that are transposed together: a part of both arrays that stays in the nearest cache.
const TILE: [usize; 2] = [128, 16];

/// Whole-bin shifts of the histograms.
pub(super) struct Shifts {
    /// The stored bin that becomes bin 0, of every place; `None` makes all bins of the pair NaN.
    pub(super) of_place: Vec<Option<usize>>,
    /// Bins after the shift. Bins that are not in the array are zero.
    pub(super) bins: usize,
    /// The sentence about the shift, if there is one, given the sum of the counts behind the last bin.
    pub(super) note: fn(&Shifts, f64) -> Option<String>,
}

/// What is wanted of an array.
pub(super) struct ArraySelection<'w> {
    /// Bins and places of the array.
    pub(super) stored: [usize; 2],
    /// The place of every pair that is kept.
    pub(super) from: &'w [usize],
    /// The bins that are kept, after the shift.
    pub(super) bins: Range<usize>,
    pub(super) shifts: Option<&'w Shifts>,
}

/// The histograms that are kept, and what all pairs of the array hold.
pub(super) struct Scattered {
    pub(super) histograms: Vec<f32>,
    /// Figures of every place's histogram, with all of its bins after the shift.
    pub(super) seen: Vec<HistogramFigures>,
    /// Whether all values of the array are photon counts.
    pub(super) whole: bool,
    /// Sum of the counts behind the last bin after the shift.
    pub(super) late: f64,
}

/// A part of the array, with the histograms that it fills.
pub(super) struct ArrayPart<'h> {
    /// Index in the list of parts.
    pub(super) index: usize,
    pub(super) bins: Range<usize>,
    /// The place of each histogram, in the order of the values.
    places: Vec<usize>,
    columns: Vec<FilledHistogram<'h>>,
    /// Whether all values so far are photon counts.
    whole: bool,
}

/// A histogram as it is filled.
struct FilledHistogram<'h> {
    /// Bins of the array that are in the histogram after the shift.
    inside: Range<usize>,
    /// The bins that are kept, and the array's bin of the first.
    row: &'h mut [f32],
    begin: usize,
    seen: HistogramFigures,
    late: f64,
}

/// What a part saw.
pub(super) struct Filled {
    index: usize,
    places: Vec<usize>,
    seen: Vec<(HistogramFigures, f64)>,
    whole: bool,
}

impl ArraySelection<'_> {
    /// Bins after the shift.
    fn shifted_bins(&self) -> usize {
        self.shifts.map_or(self.stored[0], |s| s.bins)
    }

    /// The bins of the array that are in a place's histogram after the shift.
    fn inside(&self, place: usize) -> Range<usize> {
        let [bins, _] = self.stored;
        match self.shifts.map(|s| s.of_place[place]) {
            None => 0..bins,
            Some(Some(shift)) => shift..(shift + self.shifted_bins()).min(bins),
            Some(None) => bins..bins,
        }
    }

    /// Fills the histograms. `areas` are the parts of the array: bins, and places in the order of the values. Every
    /// place and bin is in one part; parts of the same places follow in the order of their bins. `fill` fills all parts
    /// in any order.
    ///
    /// # Errors
    /// Those of `fill`; `Kind::Memory` if the histograms do not fit.
    pub(super) fn scatter(
        &self,
        areas: Vec<(Range<usize>, Vec<usize>)>,
        fill: impl FnOnce(Vec<ArrayPart>) -> Result<Vec<Filled>>,
    ) -> Result<Scattered> {
        let kept = self.bins.len();
        host::ask("what is seen of the pairs", host::bytes(self.stored[1], OF_PLACE))?;
        let mut histograms = host::filled("the counts", self.from.len().saturating_mul(kept), 0.0f32)?;
        let mut rows: Vec<&mut [f32]> = (0..self.stored[1]).map(|_| Default::default()).collect();
        for (place, row) in self.from.iter().zip(histograms.chunks_exact_mut(kept.max(1))) {
            // A pair without a shift was not measured.
            match self.shifts.map(|s| s.of_place[*place]) {
                Some(None) => row.fill(f32::NAN),
                _ => rows[*place] = row,
            }
        }
        let parts = areas.into_iter().enumerate().map(|(index, area)| self.part(index, area, &mut rows));
        let parts = parts.collect();
        let mut results = fill(parts)?;
        results.sort_by_key(|r| r.index);
        let unmeasured = HistogramFigures {
            total: f64::NAN,
            wrong: Some((0, f32::NAN)),
            nothing: true,
            filled: self.shifted_bins() as u32,
            range: HistogramFigures::EMPTY.range,
        };
        let begin = |place| match self.shifts.map(|s| s.of_place[place]) {
            Some(None) => unmeasured,
            // Bins that the array does not have are zeros.
            _ if self.inside(place).len() < self.shifted_bins() => {
                HistogramFigures { nothing: false, range: [0.0; 2], ..HistogramFigures::EMPTY }
            }
            _ => HistogramFigures::EMPTY,
        };
        let mut all: Vec<(HistogramFigures, f64)> =
            (0..self.stored[1]).map(|place| (begin(place), 0.0)).collect();
        let mut whole = true;
        for result in results {
            whole &= result.whole;
            for (place, (seen, late)) in result.places.into_iter().zip(result.seen) {
                all[place].0.join(&seen);
                all[place].1 += late;
            }
        }
        let late = all.iter().map(|a| a.1).sum();
        let seen = all.into_iter().map(|a| a.0).collect();
        Ok(Scattered { histograms, seen, whole, late })
    }

    fn part<'h>(
        &self,
        index: usize,
        (bins, places): (Range<usize>, Vec<usize>),
        rows: &mut [&'h mut [f32]],
    ) -> ArrayPart<'h> {
        let column = |place: &usize| {
            let inside = self.inside(*place);
            // The array's bin of the first bin that is kept, and of the first that is left to fill.
            let first = inside.start + self.bins.start;
            let begin = first.max(bins.start);
            let filled = begin.min(first + self.bins.len()) - first;
            let row = std::mem::take(&mut rows[*place]);
            let left =
                if row.is_empty() { 0 } else { bins.end.saturating_sub(begin).min(self.bins.len() - filled) };
            let (row, rest) = row.split_at_mut(left);
            rows[*place] = rest;
            FilledHistogram { inside, row, begin, seen: HistogramFigures::EMPTY, late: 0.0 }
        };
        let columns = places.iter().map(column).collect();
        ArrayPart { bins, index, places, columns, whole: true }
    }
}

impl ArrayPart<'_> {
    /// Takes the values `[bin, place]` of the bins from `first` on.
    pub(super) fn take(&mut self, first: usize, values: &[f32]) {
        let places = self.columns.len();
        self.whole = self.whole && histogram_figures::whole(values);
        let mut turned = [[0.0f32; TILE[0]]; TILE[1]];
        let end = first + values.len() / places;
        for (tile, columns) in self.columns.chunks_mut(TILE[1]).enumerate() {
            for from in (first..end).step_by(TILE[0]) {
                let bins = from..(from + TILE[0]).min(end);
                for bin in bins.clone() {
                    let row = &values[(bin - first) * places + tile * TILE[1]..][..columns.len()];
                    for (turned, value) in turned.iter_mut().zip(row) {
                        turned[bin - from] = *value;
                    }
                }
                for (column, turned) in columns.iter_mut().zip(&turned) {
                    column.take(&bins, &turned[..bins.len()]);
                }
            }
        }
    }

    /// What the part saw, when all of it was taken.
    pub(super) fn finish(self) -> Filled {
        let seen = self.columns.into_iter().map(|c| (c.seen, c.late)).collect();
        Filled { index: self.index, places: self.places, seen, whole: self.whole }
    }
}

impl FilledHistogram<'_> {
    /// Takes the values of some bins of the array.
    fn take(&mut self, bins: &Range<usize>, values: &[f32]) {
        let common = |a: &Range<usize>| a.start.max(bins.start)..a.end.min(bins.end);
        let inside = common(&self.inside);
        if !inside.is_empty() {
            let values = &values[inside.start - bins.start..inside.end - bins.start];
            self.seen.add(inside.start - self.inside.start, values);
        }
        let kept = common(&(self.begin..self.begin + self.row.len()));
        if !kept.is_empty() {
            self.row[kept.start - self.begin..kept.end - self.begin]
                .copy_from_slice(&values[kept.start - bins.start..kept.end - bins.start]);
        }
        let late = bins.end.saturating_sub(self.inside.end.max(bins.start)).min(values.len());
        self.late += values[values.len() - late..].iter().map(|v| f64::from(*v)).sum::<f64>();
    }
}
