//! Selects pairs of a capture: thinning, random subsets, removal of pairs without data.

use glam::DVec3;
use rand::SeedableRng;
use rand::seq::index;
use rand_pcg::Pcg64;

use super::hot;
use crate::data::histogram_figures::HistogramFigures;
use crate::data::lattice::Lattice;
use crate::data::median::median;
use crate::data::nearest::Tree;
use crate::data::{Capture, PairKind};
use crate::error::{Error, Result};

/// A pair without a count was not measured if half of the lit pairs around it have more photons than this. By chance a pair
/// would be empty once in e^20 pairs.
const DEAD_BELOW: f64 = 20.0;
/// The same for counts that are not photons, in bins with a count.
const DEAD_BELOW_BINS: f64 = 8.0;
/// Lit pairs around a pair that are compared with it.
const AROUND: usize = 8;

/// Pairs of a capture in a new order, and the shape of the scan that they make.
#[derive(Debug, PartialEq)]
pub(crate) struct PairOrder {
    pub pairs: Vec<usize>,
    pub scan: [usize; 2],
}

impl Capture {
    /// Keeps every `n`th scan point in x and in y (`ix % n == 0`, `iy % n == 0`), with their histograms. In an
    /// exhaustive capture the laser points and the sensor points are thinned separately, each on their lattice, or
    /// along their list if they form no lattice.
    ///
    /// # Errors
    /// `Kind::Options` if `n` is 0, or if the scan is a list of points that form no row.
    pub fn stride(&self, n: usize) -> Result<Capture> {
        Ok(self.stride_order(n)?.map_or_else(|| self.clone(), |order| self.keep(&order.pairs, order.scan)))
    }

    /// The pairs that [`Capture::stride`] keeps; `None` for all.
    pub(crate) fn stride_order(&self, n: usize) -> Result<Option<PairOrder>> {
        if n == 0 {
            return Err(Error::options("a stride of 0 keeps no scan point", "use 1 to keep every point"));
        }
        if n == 1 {
            return Ok(None);
        }
        let [nx, ny] = self.scan;
        if let PairKind::Exhaustive { .. } = self.pair_kind() {
            return Ok(self.stride_exhaustive(n));
        }
        if ny == 1 && nx > 1 && !self.resolution().contains(&1) {
            return Err(Error::options(
                format!(
                    "a stride of {n} was given, but the scan is a list of {nx} pairs, not rows and columns"
                ),
                format!("use a random subset of {} pairs instead", nx.div_ceil(n.saturating_mul(n))),
            ));
        }
        let pairs =
            (0..nx).step_by(n).flat_map(|ix| (0..ny).step_by(n).map(move |iy| ix * ny + iy)).collect();
        Ok(Some(PairOrder { pairs, scan: [nx.div_ceil(n), ny.div_ceil(n)] }))
    }

    fn stride_exhaustive(&self, n: usize) -> Option<PairOrder> {
        let product = self.product()?;
        let thin = |points: &[DVec3]| -> Vec<usize> {
            match Lattice::of(points).full() {
                Some(at) => (0..points.len()).filter(|&k| at[k].iter().all(|i| i % n == 0)).collect(),
                None => (0..points.len()).step_by(n).collect(),
            }
        };
        let (scanned, other) = (thin(&product.scanned), thin(&product.other));
        let pair = |o: &usize, a: &usize| product.pair_of[o * product.scanned.len() + a];
        // Laser point by laser point, each with all sensor points.
        let pairs = if product.laser_scanned {
            scanned.iter().flat_map(|a| other.iter().map(move |o| pair(o, a))).collect()
        } else {
            other.iter().flat_map(|o| scanned.iter().map(move |a| pair(o, a))).collect()
        };
        let (lasers, sensors) =
            if product.laser_scanned { (scanned.len(), other.len()) } else { (other.len(), scanned.len()) };
        Some(PairOrder { pairs, scan: [lasers, sensors] })
    }

    /// Keeps `count` pairs in their order, drawn at random by `seed`. The scan becomes a list.
    ///
    /// # Errors
    /// `Kind::Options` if `count` is 0 or larger than the number of pairs.
    pub fn subset(&self, count: usize, seed: u64) -> Result<Capture> {
        let order = self.subset_order(count, seed)?;
        Ok(order.map_or_else(|| self.clone(), |order| self.keep(&order.pairs, order.scan)))
    }

    /// The pairs that [`Capture::subset`] keeps; `None` for all.
    pub(crate) fn subset_order(&self, count: usize, seed: u64) -> Result<Option<PairOrder>> {
        let pairs = self.pair_count();
        if count == 0 || count > pairs {
            return Err(Error::options(
                format!("a subset of {count} pairs of {pairs} is not possible"),
                format!("give a number of pairs from 1 to {pairs}"),
            ));
        }
        if count == pairs {
            return Ok(None);
        }
        let mut kept = index::sample(&mut Pcg64::seed_from_u64(seed), pairs, count).into_vec();
        kept.sort_unstable();
        Ok(Some(PairOrder { pairs: kept, scan: [count, 1] }))
    }

    /// Leaves out the pairs that were not measured: pairs whose laser or sensor point is NaN, and pairs whose histogram
    /// is NaN in every bin. Pairs without any count beside lit pairs are left out too, unless `keep_empty`: points that were
    /// never measured are stored as zeros. So are a few pairs with more than eight times the counts of those around them,
    /// which hot pixels measured. If the rest is not a scan of whole rows and columns, it becomes a list. Returns the
    /// capture, the number of pairs left out, and sentences that say why.
    ///
    /// # Errors
    /// `Kind::Input` if no pair is left.
    #[doc(hidden)]
    pub fn without_missing(self, keep_empty: bool) -> Result<(Capture, usize, Vec<String>)> {
        self.without_missing_seen(keep_empty).map(|(capture, gone, [notes, _], _)| (capture, gone, notes))
    }

    /// As [`Capture::without_missing`], with notes and faults, and the figures of the histograms that are left; `None` if lengths do not
    /// agree.
    #[expect(clippy::type_complexity)]
    pub(super) fn without_missing_seen(
        self,
        keep_empty: bool,
    ) -> Result<(Capture, usize, [Vec<String>; 2], Option<Vec<HistogramFigures>>)> {
        // If the lengths do not agree, the check reports it.
        let pairs = self.laser.len();
        if self.bins == 0 || self.sensor.len() != pairs || self.histograms.len() / self.bins != pairs {
            return Ok((self, 0, [vec![], vec![]], None));
        }
        let seen = self.of_rows(HistogramFigures::of);
        let measured = Measured::of(&self, &seen, keep_empty)?;
        let gone = pairs - measured.pairs.len();
        let capture = if gone == 0 { self } else { self.retain(&measured.pairs) };
        let seen = measured.pairs.iter().map(|pair| seen[*pair]).collect();
        Ok((capture, gone, [measured.notes, measured.faults], Some(seen)))
    }

    /// The histogram of a pair; empty if the capture has no counts ([`Capture::outline`]).
    pub fn histogram(&self, pair: usize) -> &[f32] {
        self.histograms.get(pair * self.bins..(pair + 1) * self.bins).unwrap_or_default()
    }

    /// The given pairs, in ascending order, as a list. The histograms are moved in place, because they may be large.
    fn retain(mut self, kept: &[usize]) -> Capture {
        let histograms = retain_rows(std::mem::take(&mut self.histograms), self.bins, kept);
        Capture { histograms, ..self.keep(kept, scan_of(kept, &self)) }
    }

    /// The given pairs in the given order, as a scan of that shape.
    #[doc(hidden)]
    pub fn keep(&self, kept: &[usize], scan: [usize; 2]) -> Capture {
        let pick = |points: &[DVec3]| kept.iter().map(|&p| points[p]).collect::<Vec<_>>();
        Capture {
            name: self.name.clone(),
            scan,
            laser: pick(&self.laser),
            sensor: pick(&self.sensor),
            laser_normal: self.laser_normal.as_deref().map(pick),
            sensor_normal: self.sensor_normal.as_deref().map(pick),
            histograms: self.histograms_of(kept),
            empty: self.empty.as_ref().map(|counts| {
                kept.iter().flat_map(|&p| &counts[p * self.bins..(p + 1) * self.bins]).copied().collect()
            }),
            pulse: self.pulse.clone(),
            given: None,
            ..*self
        }
    }
}

/// The scan that these pairs of a capture make: some of its rows by some of its columns, else a list.
pub(crate) fn scan_of(kept: &[usize], capture: &Capture) -> [usize; 2] {
    let [nx, ny] = capture.scan;
    // If they do not agree, the check reports it.
    if nx.checked_mul(ny) != Some(capture.pair_count()) {
        return [kept.len(), 1];
    }
    let (mut columns, mut rows) = (vec![false; nx], vec![false; ny]); // bounded: the scan
    for pair in kept {
        (columns[pair / ny], rows[pair % ny]) = (true, true);
    }
    let [x, y] = [&columns, &rows].map(|of| of.iter().filter(|kept| **kept).count());
    if x.checked_mul(y) == Some(kept.len()) { [x, y] } else { [kept.len(), 1] }
}

/// Keeps the given rows of `length` values, in ascending order, in place.
pub(crate) fn retain_rows(mut values: Vec<f32>, length: usize, kept: &[usize]) -> Vec<f32> {
    for (to, from) in kept.iter().enumerate().filter(|(to, from)| to != *from) {
        values.copy_within(from * length..(from + 1) * length, to * length);
    }
    values.truncate(kept.len() * length);
    values.shrink_to_fit();
    values
}

/// Fewer bins hold one value by chance.
const CONSTANT_FROM: usize = 16;

/// Why a pair was not measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PairFault {
    Point,
    Histogram,
    Dead,
    Constant,
    Fill,
    Hot,
}

/// Values that programs store in place of missing ones.
const FILLS: [f32; 8] =
    [9999.0, 99999.0, 999_999.0, 9_999_999.0, -9999.0, -99999.0, -999_999.0, -9_999_999.0];
/// Least ratio of a fill value to the largest count.
const BEYOND: f32 = 8.0;
/// Pairs with a fill value at least.
const LEAST_FILLED: usize = 2;

/// The value in place of missing ones, if there is one: the largest of its sign in several pairs, and far beyond those of the others.
fn fill(seen: &[HistogramFigures]) -> Option<f32> {
    FILLS.into_iter().find(|fill| {
        let with = seen.iter().filter(|seen| seen.range.contains(fill)).count();
        let without = || seen.iter().filter(|seen| !seen.range.contains(fill));
        (LEAST_FILLED..seen.len()).contains(&with)
            && without().flat_map(|seen| seen.range).all(|v| fill.abs() > BEYOND * v.abs())
    })
}

/// The pairs that were measured, in their order, and sentences that say why the others were not.
pub(crate) struct Measured {
    pub pairs: Vec<usize>,
    pub notes: Vec<String>,
    /// What is wrong for certain.
    pub faults: Vec<String>,
}

/// Share of pairs without any count from which on the counts are no scan. Of fewer pairs than these, it proves nothing.
const EMPTY: f64 = 0.8;
const EMPTY_FROM: usize = 16;

/// The fault of counts of which hardly any histogram holds one, as the columns of a reconstructed volume.
fn mostly_empty(seen: &[HistogramFigures]) -> Option<String> {
    let measured = seen.iter().filter(|seen| !seen.nothing).count();
    let empty = seen.iter().filter(|seen| !seen.nothing && seen.filled == 0).count();
    let is_so = measured >= EMPTY_FROM && empty < measured && empty as f64 >= EMPTY * measured as f64;
    is_so.then(|| {
        format!(
            "{empty} of {measured} histograms hold no count: this looks like a volume, or a scan that hardly began; give the histograms \
             of a whole scan, or keep empty pairs if they were measured and are dark"
        )
    })
}

/// The value in place of missing ones that every histogram of a scan holds beside others.
fn fill_of_all(seen: &[HistogramFigures]) -> Option<f32> {
    let holds =
        |fill: f32, seen: &HistogramFigures| seen.range.contains(&fill) && seen.range[0] < seen.range[1];
    FILLS
        .into_iter()
        .filter(|_| seen.len() >= CONSTANT_FROM)
        .find(|fill| seen.iter().all(|seen| holds(*fill, seen)))
}

impl Measured {
    /// Tells by the points of `capture` and by what its histograms hold, `[pair]`; see [`Capture::without_missing`].
    ///
    /// # Errors
    /// `Kind::Input` if no pair was measured.
    pub fn of(capture: &Capture, seen: &[HistogramFigures], keep_empty: bool) -> Result<Measured> {
        if let Some(fill) = fill_of_all(seen) {
            return Err(Error::input(
                format!("all {} histograms hold {fill}, a value in place of missing counts", seen.len()),
                format!("store 0 in its place: H[H == {fill}] = 0"),
            ));
        }
        let faults = faults(capture, seen, keep_empty);
        let mut notes = Vec::new();
        let mut tell = |fault: PairFault, why: &str| {
            let count = faults.iter().filter(|m| **m == Some(fault)).count();
            if count > 0 {
                notes.push(format!("{count} of {} pairs are left out: {why}", faults.len()));
            }
        };
        tell(PairFault::Point, "their laser or sensor point is not a number");
        tell(PairFault::Histogram, "their histogram is not a number in any bin");
        tell(
            PairFault::Dead,
            "they have no count at all beside lit pairs, as points that were never measured (keep empty pairs to use them as \
             dark)",
        );
        tell(
            PairFault::Constant,
            "all their bins hold one value beside pairs that vary, as a fill value of points that were never measured",
        );
        if let Some(fill) = fill(seen) {
            tell(
                PairFault::Fill,
                &format!(
                    "bins of theirs hold {fill}, far beyond all counts: a value in place of missing ones"
                ),
            );
        }
        tell(
            PairFault::Hot,
            &format!("they have more than {} times the counts of the pairs around them", hot::TIMES),
        );
        let pairs: Vec<usize> = (0..faults.len()).filter(|&p| faults[p].is_none()).collect();
        if pairs.is_empty() && !faults.is_empty() {
            return Err(Error::input(
                format!("no pair has both points and counts: all {} pairs are left out", faults.len()),
                "check that the file holds the histograms and wall points of the same measurement",
            ));
        }
        let faults = if keep_empty { None } else { mostly_empty(seen) };
        Ok(Measured { pairs, notes, faults: faults.into_iter().collect() })
    }
}

/// Why each pair counts as not measured; `None` for measured pairs.
fn faults(capture: &Capture, seen: &[HistogramFigures], keep_empty: bool) -> Vec<Option<PairFault>> {
    let points = capture.laser.iter().zip(&capture.sensor);
    let mut faults: Vec<Option<PairFault>> = points
        .zip(seen)
        .map(|((laser, sensor), seen)| {
            if laser.is_nan() || sensor.is_nan() {
                Some(PairFault::Point)
            } else if seen.nothing {
                Some(PairFault::Histogram)
            } else {
                None
            }
        })
        .collect();
    if !keep_empty {
        for pair in unmeasured(capture, seen, &faults) {
            faults[pair] = Some(PairFault::Dead);
        }
    }
    let is_constant = |seen: &HistogramFigures| seen.filled > 0 && seen.range[0] == seen.range[1];
    if capture.bins >= CONSTANT_FROM && seen.iter().any(|seen| seen.range[0] < seen.range[1]) {
        for (fault, seen) in faults.iter_mut().zip(seen).filter(|(fault, _)| fault.is_none()) {
            *fault = is_constant(seen).then_some(PairFault::Constant);
        }
    }
    if let Some(fill) = fill(seen) {
        for (fault, seen) in faults.iter_mut().zip(seen).filter(|(fault, _)| fault.is_none()) {
            *fault = seen.range.contains(&fill).then_some(PairFault::Fill);
        }
    }
    let totals: Vec<Option<f64>> =
        faults.iter().zip(seen).map(|(fault, seen)| fault.is_none().then_some(seen.total)).collect();
    for pair in hot::pairs(capture, &totals) {
        faults[pair] = Some(PairFault::Hot);
    }
    faults
}

/// Pairs without any count whose nearest lit pairs have too many for a pair to be empty by chance. Pairs are near if
/// the middles of their laser and sensor points are.
fn unmeasured(capture: &Capture, seen: &[HistogramFigures], faults: &[Option<PairFault>]) -> Vec<usize> {
    let good = |pair: &usize| faults[*pair].is_none();
    let (dark, lit): (Vec<usize>, Vec<usize>) =
        (0..seen.len()).filter(good).partition(|pair| seen[*pair].filled == 0);
    if dark.is_empty() || lit.is_empty() {
        return vec![];
    }
    let middle = |pair: &usize| 0.5 * (capture.laser[*pair] + capture.sensor[*pair]);
    let middles: Vec<DVec3> = lit.iter().map(middle).collect();
    let tree = Tree::new(&middles);
    // Photons at the least: whole counts are photons, and a bin that is not empty holds one or more.
    let (photons, enough): (fn(&HistogramFigures) -> f64, f64) = match capture.integer_counts {
        true => (|seen| seen.total, DEAD_BELOW),
        false => (|seen| f64::from(seen.filled), DEAD_BELOW_BINS),
    };
    let is_unmeasured = |pair: &usize| {
        let near = tree.nearest(middle(pair), AROUND);
        let beside = median(near.into_iter().map(|(_, place)| photons(&seen[lit[place]])));
        beside.is_some_and(|beside| beside > enough)
    };
    dark.into_iter().filter(is_unmeasured).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hardly_any_histogram_with_a_count_is_a_fault() {
        let of = |lit: usize, all: usize| {
            let figures =
                |pair: usize| HistogramFigures::of(if pair < lit { &[0.0, 3.0] } else { &[0.0, 0.0] });
            mostly_empty(&(0..all).map(figures).collect::<Vec<_>>())
        };
        assert!(
            of(20, 100).unwrap().contains("80 of 100 histograms hold no count: this looks like a volume")
        );
        assert!(of(21, 100).is_none() && of(0, 100).is_none() && of(2, 15).is_none());
    }
}
